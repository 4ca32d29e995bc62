//! All variants of a study, solved and timed.

use super::estimate::{Estimated, estimate};
use super::norms::{self, Errors};
use super::solution::{Prepared, Solution};
use super::timing::Timing;
use super::variants::{Variant, variants};
use crate::error::{Error, Result};
use crate::forward::Work;
use crate::math::tensor::norm;
use crate::scene::{Change, Measure, ReferenceSpec, Study};

/// What a study found.
pub struct Outcome {
    /// Every variant in its order.
    pub variants: Vec<VariantResult>,
    /// What the reference was, in words.
    pub reference: String,
    /// Time of the one solve of the reference, s, if it was solved.
    pub reference_seconds: Option<f64>,
    /// Whether it was ended before all repetitions were done.
    pub interrupted: bool,
}

/// A variant and what became of it.
pub struct VariantResult {
    /// What was solved.
    pub variant: Variant,
    /// How it ended.
    pub ending: std::result::Result<Solved, Failed>,
}

/// A variant that failed.
#[derive(Debug, Clone, PartialEq)]
pub struct Failed {
    /// Its error's code.
    pub code: &'static str,
    /// The first line of its message.
    pub message: String,
}

/// A variant that was solved.
pub struct Solved {
    /// Errors against the reference.
    pub errors: Errors,
    /// Errors that it estimates of itself, if that is asked for, or why there are none.
    pub estimate: Option<std::result::Result<Estimated, Failed>>,
    /// Wall times of the repetitions, s.
    pub timing: Timing,
    /// Wall time of building the model once, s.
    pub build_seconds: f64,
    /// Work of one solve.
    pub work: Work,
    /// The names of the effects, as [`Work::points`] and [`Work::term_seconds`] count them.
    pub effects: Vec<String>,
    /// Elements of the host.
    pub elements: usize,
    /// Unknowns of the linear system.
    pub unknowns: usize,
    /// Memory of the tangent and its factor, MB.
    pub memory_mb: f64,
    /// Volume of the host over its elements, cube root: the size h, mm.
    pub element_size: f64,
    /// Displacement of each probe in the last frame, mm.
    pub probe_distances: Vec<f64>,
}

impl VariantResult {
    /// Error and median time, if it was solved and the measure applies; else NaN.
    pub fn pair(&self, measure: Measure) -> (f64, f64) {
        match &self.ending {
            Ok(solved) => (solved.errors.get(measure).unwrap_or(f64::NAN), solved.timing.median()),
            Err(_) => (f64::NAN, f64::NAN),
        }
    }
}

/// The reference as it is compared with.
enum Reference<'s> {
    Solved(Box<(Prepared, Solution)>),
    Values(&'s [(String, f64)]),
    Activations(&'s std::path::Path),
}

/// A study that is being done.
pub struct Sweep<'s> {
    study: &'s Study,
    /// Told what happens, a line each.
    tell: &'s mut dyn FnMut(&str),
    /// Asked between solves.
    is_interrupted: &'s dyn Fn() -> bool,
}

impl<'s> Sweep<'s> {
    /// Of a study; `tell` hears of every solve, `is_interrupted` is asked between them.
    pub fn new(study: &'s Study, tell: &'s mut dyn FnMut(&str), is_interrupted: &'s dyn Fn() -> bool) -> Sweep<'s> {
        Sweep { study, tell, is_interrupted }
    }

    /// Solves the reference and every variant once, then all again in turn for their times, so that a machine that is
    /// disturbed for a while disturbs all alike.
    ///
    /// # Errors
    /// A reference that cannot be solved. A variant that fails is a result.
    pub fn run(mut self) -> Result<Outcome> {
        let (reference, words, reference_seconds) = self.reference()?;
        let all = variants(self.study);
        let count = all.len();
        let mut kept = Vec::with_capacity(count);
        for (index, variant) in all.into_iter().enumerate() {
            let ending = if (self.is_interrupted)() {
                Err(Failed { code: "-", message: "interrupted".into() })
            } else {
                self.first(&variant, &reference)
            };
            let words = match &ending {
                Ok((_, solved)) => match solved.errors.get(self.study.measure) {
                    Some(error) => format!("error {error:.3e} {}", self.study.measure.unit()),
                    None => "no error of this measure".into(),
                },
                Err(failed) => format!("{} {}", failed.code, failed.message),
            };
            (self.tell)(&format!("{}/{count} {}: {words}", index + 1, variant.name));
            kept.push((variant, ending));
        }
        let mut seconds = vec![Vec::new(); count];
        let mut interrupted = (self.is_interrupted)();
        for round in 0..self.study.repetitions {
            for ((variant, ending), seconds) in kept.iter().zip(&mut seconds) {
                interrupted |= (self.is_interrupted)();
                let Ok((prepared, _)) = ending else { continue };
                if !interrupted {
                    seconds.push(with_threads(&variant.change, || prepared.solve())?.seconds);
                }
            }
            (self.tell)(&format!("timed {} of {}", round + 1, self.study.repetitions));
        }
        let finish = |((variant, ending), seconds): ((Variant, Ending), Vec<f64>)| VariantResult {
            variant,
            ending: ending.map(|(_, solved)| Solved { timing: Timing::new(seconds), ..solved }),
        };
        let variants = kept.into_iter().zip(seconds).map(finish).collect();
        Ok(Outcome { variants, reference: words, reference_seconds, interrupted })
    }

    fn reference(&mut self) -> Result<(Reference<'s>, String, Option<f64>)> {
        match &self.study.reference {
            ReferenceSpec::Variant(change) => {
                let words = [&change.set[..], &change.without[..]].concat().join(", ");
                (self.tell)(&format!("reference: {words}"));
                let prepared = Prepared::read(&self.study.problem, change)?;
                let solution = with_threads(change, || prepared.solve())?;
                let seconds = solution.seconds;
                Ok((Reference::Solved(Box::new((prepared, solution))), words, Some(seconds)))
            }
            ReferenceSpec::Values(values) => {
                let words = values.iter().map(|(key, value)| format!("{key} = {value}")).collect::<Vec<_>>();
                Ok((Reference::Values(values), words.join(", "), None))
            }
            ReferenceSpec::Csv(path) => Ok((Reference::Activations(path), path.display().to_string(), None)),
        }
    }

    /// The first solve of a variant, which is not timed.
    fn first(&self, variant: &Variant, reference: &Reference<'_>) -> Ending {
        let solve = || -> Result<(Prepared, Solved)> {
            let prepared = Prepared::read(&self.study.problem, &variant.change)?;
            let solution = with_threads(&variant.change, || prepared.solve())?;
            let errors = match reference {
                Reference::Solved(best) => norms::against_solution((&prepared, &solution), (&best.0, &best.1)),
                Reference::Values(values) => norms::against_values(&prepared, &solution, values),
                Reference::Activations(table) => norms::against_activations(&prepared, &solution, table)?,
            };
            let own =
                self.study.estimate.then(|| with_threads(&variant.change, || Ok(estimate(&prepared, &solution))));
            let own = own.transpose()?.map(|own| {
                own.map_err(|why| {
                    let message = why.message.lines().next().unwrap_or_default().to_owned();
                    Failed { code: why.code, message }
                })
            });
            let solved = Solved { estimate: own, ..describe(&prepared, &solution, errors) };
            Ok((prepared, solved))
        };
        // of several mistakes the first
        let first = |error: Error| error.into_mistakes().into_iter().next();
        let failed = |error: Error| Failed {
            code: error.code(),
            message: error.to_string().lines().next().unwrap_or_default().to_owned(),
        };
        let unknown = || Failed { code: "-", message: String::new() };
        solve().map_err(|error| first(error).map_or_else(unknown, failed))
    }
}

type Ending = std::result::Result<(Prepared, Solved), Failed>;

fn describe(prepared: &Prepared, solution: &Solution, errors: Errors) -> Solved {
    let model = &prepared.built.model;
    let entries = model.symbolic().pattern().nnz() + model.symbolic().factor_nnz();
    let distance = |state: &crate::model::State| -> Vec<f64> {
        prepared.built.probes.iter().map(|at| norm(model.mesh().interpolate(*at, &state.u))).collect()
    };
    Solved {
        errors,
        estimate: None,
        timing: Timing::new(Vec::new()),
        build_seconds: prepared.build_seconds,
        work: solution.work.clone(),
        effects: model.terms().iter().map(|term| term.name().to_owned()).collect(),
        elements: model.mesh().elements(),
        unknowns: model.numbering().unknowns(),
        memory_mb: 8e-6 * entries as f64,
        element_size: model.element_size(),
        probe_distances: solution.frames.last().map(|frame| distance(&frame.state)).unwrap_or_default(),
    }
}

/// In a pool of as many threads as the change asks for, or where it is.
fn with_threads<T: Send>(change: &Change, solve: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    let Some(threads) = change.threads else { return solve() };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|error| Error::Io {
        action: "start the threads of",
        path: "a variant".into(),
        source: std::io::Error::other(error),
    })?;
    pool.install(solve)
}
