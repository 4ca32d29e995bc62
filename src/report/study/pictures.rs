//! The pictures of a study, as SVG: error against time, error against element size, cost by effect and stage.

use super::tables::{refinements, stages};
use crate::scene::Study;
use crate::study::front::front;
use crate::study::{Outcome, Solved, VariantResult};
use plotters::prelude::*;

/// Size of a picture, pixels.
const SIZE: (u32, u32) = (900, 620);
/// Colours that people with colour blindness tell apart (Okabe and Ito 2008).
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(110, 110, 110),
];

/// More variants than this are not all numbered.
const MOST_NUMBERED: usize = 16;

/// Draws a picture into a text; leaves it empty where there is nothing to show.
type Draw = fn(&Study, &Outcome, &mut String) -> Drawn;
type Drawn = Result<(), Box<dyn std::error::Error>>;

/// Every picture with its file name; one that has nothing to show is left out.
pub(super) fn all(study: &Study, outcome: &Outcome) -> Vec<(&'static str, String)> {
    let pictures: [(&str, Draw); 3] = [("error_time.svg", error_time), ("order.svg", order), ("cost.svg", cost)];
    let drawn = |(name, draw): (&'static str, Draw)| {
        let mut text = String::new();
        // drawing into a string fails only where there is nothing to draw
        draw(study, outcome, &mut text).ok().filter(|()| !text.is_empty()).map(|()| (name, text))
    };
    pictures.into_iter().filter_map(drawn).collect()
}

/// The decades around some positive numbers.
fn decades(numbers: impl Iterator<Item = f64>) -> Option<std::ops::Range<f64>> {
    let (low, high) = numbers
        .filter(|x| x.is_finite() && *x > 0.0)
        .fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
    (low <= high).then(|| low / 1.8..high * 1.8)
}

fn axis_name(study: &Study) -> String {
    match study.measure.unit() {
        "" => format!("error of {}", study.measure.word()),
        unit => format!("error of {}, {unit}", study.measure.word()),
    }
}

/// Error against time, both logarithmic: every variant with its range of times, the front, and those that failed.
fn error_time(study: &Study, outcome: &Outcome, text: &mut String) -> Drawn {
    let pairs: Vec<(f64, f64)> = outcome.variants.iter().map(|v| v.pair(study.measure)).collect();
    let (Some(x), Some(y)) = (decades(pairs.iter().map(|p| p.1)), decades(pairs.iter().map(|p| p.0))) else {
        return Ok(());
    };
    let on_front = front(&pairs);
    let key = key(study, outcome, &on_front);
    let height = SIZE.1 + 18 * key.len() as u32 + 10;
    let area = SVGBackend::with_string(text, (SIZE.0, height)).into_drawing_area();
    area.fill(&WHITE)?;
    let (upper, lower) = area.split_vertically(SIZE.1);
    let mut chart = ChartBuilder::on(&upper)
        .caption(format!("{}: what accuracy costs", study.name), ("sans-serif", 22))
        .margin(14)
        .x_label_area_size(46)
        .y_label_area_size(74)
        .build_cartesian_2d(x.clone().log_scale(), y.clone().log_scale())?;
    let style = ("sans-serif", 15);
    chart
        .configure_mesh()
        .x_desc("seconds (median; the bar is the range)")
        .y_desc(axis_name(study))
        .x_label_formatter(&|x| short(*x))
        .y_label_formatter(&|y| short(*y))
        .label_style(style)
        .axis_desc_style(style)
        .light_line_style(RGBColor(235, 235, 235))
        .draw()?;
    let line: Vec<(f64, f64)> = on_front.iter().map(|k| (pairs[*k].1, pairs[*k].0)).filter(|p| p.1 > 0.0).collect();
    chart.draw_series(LineSeries::new(line, COLOURS[1].stroke_width(2)))?;
    for (index, VariantResult { ending, .. }) in outcome.variants.iter().enumerate() {
        let (Ok(solved), (error, seconds)) = (ending, pairs[index]) else { continue };
        if !(error > 0.0 && seconds > 0.0) {
            continue;
        }
        let chosen = on_front.contains(&index);
        let colour = COLOURS[if chosen { 1 } else { 0 }];
        let range = [(solved.timing.min(), error), (solved.timing.max(), error)];
        chart.draw_series(LineSeries::new(range, colour.mix(0.6)))?;
        chart.draw_series([Circle::new((seconds, error), 4, colour.filled())])?;
        // numbers of all only where there is room for them
        if chosen || pairs.len() <= MOST_NUMBERED {
            chart.draw_series([Text::new(
                format!("  {}", index + 1),
                (seconds, error),
                ("sans-serif", 12).into_font().color(&BLACK.mix(if chosen { 1.0 } else { 0.6 })),
            )])?;
        }
    }
    for (row, (words, colour, failed)) in key.into_iter().enumerate() {
        let y = 18 * row as i32;
        if failed {
            lower.draw(&Cross::new((76, y + 7), 4, RED.stroke_width(2)))?;
        } else {
            lower.draw(&Circle::new((76, y + 7), 4, colour.filled()))?;
        }
        lower.draw(&Text::new(clip(&words, 130), (90, y), ("sans-serif", 13).into_font().color(&colour)))?;
    }
    area.present()?;
    Ok(())
}

/// What stands below the picture: the variants on the front with their numbers, all others where they are few, and those
/// that failed; each with its colour and whether it failed.
fn key(study: &Study, outcome: &Outcome, on_front: &[usize]) -> Vec<(String, RGBColor, bool)> {
    let name = |k: usize| format!("{}   {}", k + 1, outcome.variants[k].variant.name);
    let mut lines: Vec<_> = on_front.iter().map(|k| (name(*k), COLOURS[1], false)).collect();
    let rest = (0..outcome.variants.len()).filter(|k| !on_front.contains(k));
    for k in rest {
        let result = &outcome.variants[k];
        match &result.ending {
            Err(failed) => lines.push((format!("{}: {}", name(k), failed.code), RED, true)),
            Ok(_) if !result.pair(study.measure).0.is_finite() => {
                lines.push((format!("{}: no error of this measure", name(k)), COLOURS[6], false));
            }
            Ok(_) if outcome.variants.len() <= MOST_NUMBERED => lines.push((name(k), COLOURS[0], false)),
            Ok(_) => {}
        }
    }
    lines
}

/// Error against element size, both logarithmic, a line for each series of refinements.
fn order(study: &Study, outcome: &Outcome, text: &mut String) -> Drawn {
    let point = |v: &VariantResult| Some((v.ending.as_ref().ok()?.element_size, v.pair(study.measure).0));
    let steps: Vec<[(f64, f64); 2]> = refinements(study, outcome)
        .into_iter()
        .filter_map(|(_, from, to)| Some([point(from)?, point(to)?]))
        .filter(|step| step.iter().all(|(h, e)| *h > 0.0 && *e > 0.0))
        .collect();
    let all = || steps.iter().flatten();
    let (Some(x), Some(y)) = (decades(all().map(|p| p.0)), decades(all().map(|p| p.1))) else { return Ok(()) };
    let area = SVGBackend::with_string(text, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption(format!("{}: error against element size", study.name), ("sans-serif", 22))
        .margin(14)
        .x_label_area_size(46)
        .y_label_area_size(74)
        .build_cartesian_2d(x.clone().log_scale(), y.clone().log_scale())?;
    let style = ("sans-serif", 15);
    chart
        .configure_mesh()
        .x_desc("element size h, mm (cube root of the mean volume)")
        .y_desc(axis_name(study))
        .x_label_formatter(&|x| short(*x))
        .y_label_formatter(&|y| short(*y))
        .label_style(style)
        .axis_desc_style(style)
        .light_line_style(RGBColor(235, 235, 235))
        .draw()?;
    for step in &steps {
        chart.draw_series(LineSeries::new(step.iter().copied(), COLOURS[0].stroke_width(2)))?;
        chart.draw_series(step.iter().map(|p| Circle::new(*p, 3, COLOURS[0].filled())))?;
    }
    // slopes to compare with, from the lower left corner up
    for (k, order) in [1.0, 2.0, 4.0].into_iter().enumerate() {
        let from = (x.start * 1.15, y.start * 1.3);
        let to = (x.end / 1.15, from.1 * (x.end / 1.15 / from.0).powf(order));
        let end = if to.1 > y.end {
            let reach = (y.end / from.1).powf(1.0 / order);
            (from.0 * reach, y.end)
        } else {
            to
        };
        let colour = COLOURS[6].mix(0.7);
        chart.draw_series(DashedLineSeries::new([from, end], 4 + 3 * k as u32, 4, colour.into()))?;
        chart.draw_series([Text::new(
            format!("order {order}"),
            (end.0 / 1.12, end.1 / 1.08),
            ("sans-serif", 12).into_font().color(&COLOURS[6]),
        )])?;
    }
    area.present()?;
    Ok(())
}

/// Stacked bars: the effects' seconds over threads, then the linear algebra's on the wall clock.
fn cost(study: &Study, outcome: &Outcome, text: &mut String) -> Drawn {
    let solved: Vec<(usize, &Solved)> =
        outcome.variants.iter().enumerate().filter_map(|(k, v)| Some((k, v.ending.as_ref().ok()?))).collect();
    let mut parts: Vec<String> = Vec::new();
    for (_, s) in &solved {
        let names = s.effects.iter().cloned().chain(["factorisation".to_owned(), "solve".to_owned()]);
        names.for_each(|name| {
            if !parts.contains(&name) {
                parts.push(name)
            }
        });
    }
    let share = |s: &Solved, part: &str| -> f64 {
        let effects: f64 =
            s.effects.iter().zip(&s.work.term_seconds).filter(|(name, _)| *name == part).map(|(_, t)| *t).sum();
        effects + stages(s).iter().filter(|(name, _)| *name == part).map(|(_, t)| *t).sum::<f64>()
    };
    let total = |s: &Solved| parts.iter().map(|part| share(s, part)).sum::<f64>();
    let most = solved.iter().map(|(_, s)| total(s)).fold(0.0, f64::max);
    if most <= 0.0 {
        return Ok(());
    }
    let height = 110 + 24 * solved.len() as u32 + 18 * parts.len() as u32;
    let area = SVGBackend::with_string(text, (SIZE.0, height)).into_drawing_area();
    area.fill(&WHITE)?;
    let words = |size: i32| ("sans-serif", size).into_font();
    area.draw(&Text::new(
        format!("{}: seconds of the first solve (effects summed over threads)", study.name),
        (14, 12),
        words(18).color(&BLACK),
    ))?;
    let (left, width) = (330.0, f64::from(SIZE.0) - 330.0 - 80.0);
    for (row, (index, s)) in solved.iter().enumerate() {
        let y = 44 + 24 * row as i32;
        let name = format!("{}  {}", index + 1, outcome.variants[*index].variant.name);
        area.draw(&Text::new(clip(&name, 52), (14, y + 3), words(12).color(&BLACK)))?;
        let mut x = left;
        for (k, part) in parts.iter().enumerate() {
            let next = x + width * share(s, part) / most;
            let colour = COLOURS[k % COLOURS.len()];
            area.draw(&Rectangle::new([(x as i32, y), (next as i32, y + 16)], colour.filled()))?;
            x = next;
        }
        area.draw(&Text::new(format!("{:.3}", total(s)), (x as i32 + 6, y + 2), words(12).color(&BLACK)))?;
    }
    for (k, part) in parts.iter().enumerate() {
        let y = 56 + 24 * solved.len() as i32 + 18 * k as i32;
        area.draw(&Rectangle::new(
            [(left as i32, y), (left as i32 + 14, y + 12)],
            COLOURS[k % COLOURS.len()].filled(),
        ))?;
        area.draw(&Text::new(part.clone(), (left as i32 + 22, y), words(12).color(&BLACK)))?;
    }
    area.present()?;
    Ok(())
}

/// A number with as many digits as a label needs.
fn short(x: f64) -> String {
    if (1e-2..1e4).contains(&x) { format!("{x}") } else { format!("{x:.0e}") }
}

/// The beginning of a text that is too long.
fn clip(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((at, _)) => format!("{}...", &text[..at]),
        None => text.to_owned(),
    }
}
