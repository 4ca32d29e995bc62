//! Fitted fibres as streamlines with the measured axes, as SVG: seen along the shortest side of the body.

use super::grids::pieces;
use crate::fibres::FibreFit;
use crate::math::tensor::Vector;
use plotters::prelude::*;

/// The longer side of the picture, pixels.
const SIZE: f64 = 900.0;
/// Measured axes that are drawn.
const MOST_AXES: usize = 1500;
/// Colours that people with colour blindness tell apart (Okabe and Ito 2008).
const FITTED: RGBColor = RGBColor(0, 114, 178);
const MEASURED: RGBColor = RGBColor(213, 94, 0);

/// The picture; `None` where there is nothing to show.
pub(super) fn draw(name: &str, fit: &FibreFit, lines: &[Vec<Vector>]) -> Option<String> {
    let pieces = pieces(fit, MOST_AXES);
    let points = || lines.iter().flatten().chain(pieces.iter().flat_map(|(ends, _)| ends));
    let range = |d: usize| points().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x[d]), h.max(x[d])));
    let ranges = [0, 1, 2].map(range);
    let thin = (0..3).min_by(|a, b| (ranges[*a].1 - ranges[*a].0).total_cmp(&(ranges[*b].1 - ranges[*b].0)))?;
    let shown = [(1, 2), (0, 2), (0, 1)][thin];
    let mut text = String::new();
    picture(name, lines, &pieces, shown, [ranges[shown.0], ranges[shown.1]], &mut text).ok()?;
    Some(text)
}

fn picture(
    name: &str,
    lines: &[Vec<Vector>],
    pieces: &[([Vector; 2], f64)],
    (across, up): (usize, usize),
    [x, y]: [(f64, f64); 2],
    text: &mut String,
) -> Result<(), Box<dyn std::error::Error>> {
    let (width, height) = ((x.1 - x.0).max(1e-9), (y.1 - y.0).max(1e-9));
    // the same scale in both directions, within a picture that is not too thin
    let scale = SIZE / width.max(height);
    let pixels = ((width * scale).max(300.0) as u32 + 110, (height * scale).max(200.0) as u32 + 120);
    let root = SVGBackend::with_string(text, pixels).into_drawing_area();
    root.fill(&WHITE)?;
    let letters = ["x", "y", "z"];
    let margin = |range: (f64, f64)| {
        let more = 0.03 * (range.1 - range.0).max(1e-9);
        range.0 - more..range.1 + more
    };
    let mut chart = ChartBuilder::on(&root)
        .caption(format!("{name}: fitted fibres (blue) and measured axes (orange)"), ("sans-serif", 17))
        .margin(14)
        .x_label_area_size(44)
        .y_label_area_size(56)
        .build_cartesian_2d(margin(x), margin(y))?;
    chart
        .configure_mesh()
        .disable_mesh()
        .x_desc(format!("{}, mm", letters[across]))
        .y_desc(format!("{}, mm", letters[up]))
        .draw()?;
    let flat = |point: &Vector| ((point[across] * 1e3).round() / 1e3, (point[up] * 1e3).round() / 1e3);
    for (ends, _) in pieces {
        chart.draw_series(LineSeries::new(ends.iter().map(flat), MEASURED.mix(0.7).stroke_width(1)))?;
    }
    for line in lines {
        // every other point is enough for the eye
        let thinned = line.iter().step_by(2).chain(line.last()).map(flat);
        chart.draw_series(LineSeries::new(thinned, FITTED.stroke_width(1)))?;
    }
    root.present()?;
    Ok(())
}
