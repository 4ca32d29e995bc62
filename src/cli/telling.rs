//! What the markers tell, gathered over the frames of a fit: for the tables, the page and the warning F005.

use crate::error::{Result, Warning};
use crate::fit::advise::{MarkerHelp, View, candidates};
use crate::fit::identifiability::{ClipKnowledge, Evidence, Pair, Told};
use crate::fit::{Estimate, Fit};
use crate::math::tensor::{Vector, norm, subtract};
use crate::mesh::{MaterialPoint, Mesh};
use crate::report::Frame;

/// A marker is not proposed nearer than this to another, mm.
pub(super) const APART_MM: f64 = 5.0;
/// A pair counts as worse than another where so much less of one minus its correlation is left.
const WORSE: f64 = 0.8;
/// A marker is proposed where it brings a deviation below this part of what it was.
const HELPS: f64 = 0.9;
/// Pairs that the warning names.
const NAMED: usize = 3;

/// The frames so far.
pub(super) struct Telling {
    pub clip: ClipKnowledge,
    /// Names of all controls, with units.
    controls: Vec<String>,
    points: Vec<MaterialPoint>,
    positions: Vec<Vector>,
    taken: Vec<Vector>,
    /// The pair that is most alike, its frame, and the marker that would tell them apart best.
    worst: Option<(Frame, Pair, Option<MarkerHelp>)>,
}

impl Telling {
    pub fn new(mesh: &Mesh, fit: &Fit<'_>, controls: Vec<String>) -> Telling {
        let points = candidates(mesh);
        Telling {
            clip: ClipKnowledge::default(),
            controls,
            positions: points.iter().map(|p| mesh.position(*p)).collect(),
            points,
            taken: fit.markers().iter().map(|m| mesh.position(m.point)).collect(),
            worst: None,
        }
    }

    /// Adds a frame; gives back what its markers tell, if that is known, and the marker that would help, if its pair is the worst so
    /// far. `biases` are one per control that is sought, or none. The marker is sought where the frame is the one that `fit`
    /// ended with (`live`), and otherwise known.
    pub fn frame(
        &mut self,
        frame: Frame,
        estimate: &Estimate,
        fit: &Fit<'_>,
        (live, known): (bool, Option<MarkerHelp>),
        biases: &[Option<f64>],
    ) -> Result<(Option<Told>, Option<MarkerHelp>)> {
        let Some(evidence) = Evidence::of(estimate, fit.controls(), fit.unknowns()) else { return Ok((None, None)) };
        let measured: Vec<bool> = estimate.measured_mm.iter().map(Option::is_some).collect();
        let told = evidence.told(fit.markers(), &measured)?;
        self.clip.add(frame.index, &evidence, &told, biases);
        if let Some(pair) = told.pairs.first() {
            let left = |pair: &Pair| 1.0 - pair.correlation.abs();
            if self.worst.as_ref().is_none_or(|(_, worst, _)| left(pair) < WORSE * left(worst)) {
                let help = if live { self.help(pair, &evidence, estimate, fit) } else { known };
                self.worst = Some((frame, pair.clone(), help));
                return Ok((Some(told), help));
            }
        }
        Ok((Some(told), None))
    }

    /// The marker that tells the less certain of a pair best.
    fn help(&self, pair: &Pair, evidence: &Evidence, estimate: &Estimate, fit: &Fit<'_>) -> Option<MarkerHelp> {
        let rates = fit.rates_at(&self.points, &estimate.equilibrium.state)?;
        let view = View::new(evidence, &rates, new_marker_sd(fit));
        let control = pair.controls[usize::from(pair.apart_sd[1] > pair.apart_sd[0])];
        let open = |c: usize| self.taken.iter().all(|t| norm(subtract(*t, self.positions[c])) >= APART_MM);
        let (candidate, before, after) = view.best_for(control, open)?;
        Some(MarkerHelp { place: self.positions[candidate], control, sd: [before, after] })
    }

    /// F005, if some pair cannot be told apart.
    pub fn warning(&self) -> Option<(Frame, Warning)> {
        let (frame, pair, help) = self.worst.as_ref()?;
        let pairs = self.clip.pairs();
        let name = |k: usize| &self.controls[k];
        let named = pairs.iter().take(NAMED).map(|(count, _, pair)| {
            let [a, b] = pair.controls;
            format!("{} / {} in {count} of {} frames", name(a), name(b), self.clip.frames())
        });
        let mut named: Vec<String> = named.collect();
        if pairs.len() > NAMED {
            named.push(format!("{} more in tables/pairs.csv", pairs.len() - NAMED));
        }
        let [a, b] = pair.controls;
        let message = format!(
            "{} of controls cannot be told apart by these markers (correlation > 0.9): {}\n  {} / {} in frame {}: {} is determined \
             ({} +/- {}), the split is {} (sd {} and {})",
            if pairs.len() == 1 { "1 pair".into() } else { format!("{} pairs", pairs.len()) },
            named.join("; "),
            name(a),
            name(b),
            frame.index,
            pair.words(&self.controls),
            short(pair.together),
            short(pair.together_95()),
            if pair.prior_dominated { "only the prior" } else { "much less certain" },
            short(pair.apart_sd[0]),
            short(pair.apart_sd[1]),
        );
        let help = match help {
            Some(MarkerHelp { place: [x, y, z], control, sd: [before, after] }) if *after < HELPS * before => {
                format!(
                    "a marker near ({x:.0}, {y:.0}, {z:.0}) mm would bring the sd of {} from {} to {}; more: risorius advise",
                    name(*control),
                    short(*before),
                    short(*after)
                )
            }
            Some(_) => "no further marker tells them apart: hold one of them, or add both up".into(),
            None => "risorius advise looks for markers that tell them apart".into(),
        };
        Some((*frame, Warning { code: "F005", message, place: None, help: Some(help) }))
    }
}

/// The deviation of a marker that is added: the median of those that there are, or as all of them where none is given.
pub(super) fn new_marker_sd(fit: &Fit<'_>) -> f64 {
    let mut all: Vec<f64> = fit.markers().iter().map(|m| m.sd.unwrap_or(1.0)).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(1.0)
}

/// Two digits that count.
fn short(value: f64) -> String {
    if value.abs() < 1e-3 {
        return format!("{value:.1e}");
    }
    let digits = (1 - value.abs().log10().floor() as i32).clamp(0, 6) as usize;
    format!("{value:.digits$}")
}
