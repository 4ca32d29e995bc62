//! `cost.csv`: what each effect cost, then the solver and the output.

use super::{Cell, Rows};
use crate::error::Result;
use crate::forward::Work;
use crate::model::Model;
use crate::report::run_folder::RunFolder;

/// What tables, shapes and checkpoints of frames took, s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OutputSeconds {
    /// For so long solving waited for them.
    pub waited: f64,
    /// So long it took to write them, most of it while the next frame was solved.
    pub written: f64,
}

/// What it took to solve a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameCost {
    /// Wall time, s.
    pub seconds: f64,
    /// Factorisations of the tangent.
    pub factorisations: usize,
    /// Whether it started from the frame before, not from rest.
    pub warm: bool,
}

/// Writes the table `part,seconds,clock,points,count,flops`: a row per effect that the scene named (seconds summed over
/// `threads`, quadrature points evaluated), then rows on the `wall` clock for `assembly` (evaluations, which hold the
/// effects, and assemblies), `factorisation`, `solve` and `output` (solving waited for files), one on the clock of the `writer`, a
/// thread beside the solver, for `writing`, one for a `warm frame`, the medians of all frames that started from the one
/// before, if there are any (`count`: factorisations), and one for `estimate`, the whole of what estimates of the error took, if there
/// were any: its work and seconds.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io).
pub fn write_cost(
    run: &RunFolder,
    model: &Model,
    work: &Work,
    (output, frames): (OutputSeconds, &[FrameCost]),
    estimate: Option<(&Work, f64)>,
) -> Result<()> {
    let mut rows = Rows::default();
    rows.add("part,seconds,clock,points,count,flops".split(',').map(Cell::Text));
    for ((term, seconds), points) in model.terms().iter().zip(&work.term_seconds).zip(&work.points) {
        let cost = [(*seconds).into(), "threads".into(), (*points).into(), Cell::Empty, Cell::Empty];
        rows.add([term.name().into()].into_iter().chain(cost));
    }
    let mut wall = |part, seconds: f64, count, flops| {
        rows.add([Cell::Text(part), seconds.into(), "wall".into(), Cell::Empty, count, flops]);
    };
    let linear = &work.linear;
    let evaluations = work.force_evaluations + work.assemblies;
    wall("assembly", work.assembly_seconds, evaluations.into(), Cell::Empty);
    let (count, flops) = (linear.factorisations.into(), linear.factor_flops.into());
    wall("factorisation", linear.factor_time.as_secs_f64(), count, flops);
    wall("solve", linear.solve_time.as_secs_f64(), linear.solves.into(), Cell::Empty);
    wall("output", output.waited, Cell::Empty, Cell::Empty);
    let warm: Vec<&FrameCost> = frames.iter().filter(|frame| frame.warm).collect();
    if !warm.is_empty() {
        let seconds = median(warm.iter().map(|frame| frame.seconds));
        let factorisations = median(warm.iter().map(|frame| frame.factorisations as f64));
        wall("warm frame", seconds, factorisations.into(), Cell::Empty);
    }
    let writing = [output.written.into(), "writer".into()].into_iter().chain([const { Cell::Empty }; 3]);
    rows.add(["writing".into()].into_iter().chain(writing));
    if let Some((work, seconds)) = estimate {
        let (points, count) = (work.points.iter().sum::<usize>(), work.linear.factorisations);
        let cost = [seconds.into(), "wall".into(), points.into(), count.into(), work.linear.factor_flops.into()];
        rows.add(["estimate".into()].into_iter().chain(cost));
    }
    run.write("tables/cost.csv", rows.text)
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    if sorted.len() % 2 == 1 { sorted[middle] } else { 0.5 * (sorted[middle - 1] + sorted[middle]) }
}
