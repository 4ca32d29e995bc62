//! The page of a forward run or a fit.

use super::charts::{Chart, Line, heat_map, shown};
use super::frame::{Page, escape, table};
use super::{methods, sides, told, viewer};
use crate::error::Result;
use crate::math::tensor::{dot, norm, subtract};
use crate::report::Manifest;
use crate::report::playback::{Control, Marker, Playback, Sheet};
use crate::report::status::{Outcome, Status};

/// The whole page.
///
/// # Errors
/// Where a table cannot be read.
pub(super) fn page(run: &Playback) -> Result<String> {
    let scene = &run.scene;
    let fitted = !run.markers.is_empty();
    let what = if fitted { "Muscle activations found from surface markers" } else { "Shapes for given activations" };
    let mut page = Page::new(&scene.name, &format!("{what}; {}.", extent(run)));
    standing(&mut page, &run.status);
    page.section("At a glance", &glance(run));
    if let Some(section) = viewer::section(run) {
        page.section("Shape through time", &section);
        page.script(viewer::SCRIPT);
    }
    if let Some(section) = sides::section(run) {
        page.section("Left against right", &section);
    }
    page.section("Activations", &activations(run));
    if fitted {
        page.section("Markers", &markers(run));
        page.section("Distance of model and marker", &distances(run));
    }
    if let Some(section) = told::section(run)? {
        page.section("What the markers can and cannot tell", &section);
    }
    page.section("Convergence and cost", &effort(run)?);
    let manifest = Manifest::read(&run.folder)?;
    page.section("Methods", &methods::paragraph(run, &manifest));
    page.section("Provenance", &methods::provenance(run, &manifest));
    Ok(page.html())
}

/// How the run ended, where that is not simply well.
pub(super) fn standing(page: &mut Page, status: &Status) {
    let mut said = Vec::new();
    match status.status {
        Outcome::Converged => {}
        Outcome::Running => {
            said.push("The run goes on, or was killed: this page shows the frames so far.".to_owned())
        }
        Outcome::Interrupted => said.push("The run was interrupted: this page shows the frames so far.".into()),
        Outcome::Partial | Outcome::Failed => {
            said.push(format!(
                "NOT CONVERGED: {} of {} frames.",
                status.frames_failed.len(),
                status.frames_ok + status.frames_failed.len()
            ));
        }
    }
    said.extend(status.error.iter().map(|error| format!("{}: {}", error.code, error.message)));
    said.extend(
        status
            .frames_failed
            .iter()
            .map(|failed| format!("frame {}, {}: {}", failed.frame, failed.code, failed.message)),
    );
    said.extend(
        status
            .warnings
            .iter()
            .map(|warning| format!("frame {}, {}: {}", warning.frame, warning.code, warning.message)),
    );
    if !said.is_empty() {
        page.section("To be known first", &format!("<p class=\"bad\">{}</p>", escape(&said.join("\n"))));
    }
}

/// How many frames over which time.
fn extent(run: &Playback) -> String {
    match &run.frames[..] {
        [] => "no frame converged".into(),
        [frame] => format!("one frame, at {:.2} s", frame.time_s),
        [first, .., last] => format!("{} frames, {:.2} s", run.frames.len(), last.time_s - first.time_s),
    }
}

/// The strongest of each control, and how well the markers are met.
fn glance(run: &Playback) -> String {
    let mut rows = Vec::new();
    for control in &run.controls {
        // of equals the first
        let values = control.values.iter().copied().enumerate().rev();
        let Some((at, value)) = values.max_by(|a, b| a.1.total_cmp(&b.1)) else {
            continue;
        };
        let interval = control.intervals[at].map_or("-".into(), |[low, high]| format!("{low:.4} to {high:.4}"));
        rows.push([control.label(), format!("{value:.4}"), interval, format!("{:.2} s", run.frames[at].time_s)]);
    }
    let mut html = table(["strongest", "value", "95 % interval", "at"], &rows);
    let distances: Vec<f64> =
        run.markers.iter().flat_map(|m| m.samples.iter().filter_map(|s| s.distance())).collect();
    if !distances.is_empty() {
        let rms = (distances.iter().map(|d| d * d).sum::<f64>() / distances.len() as f64).sqrt();
        let most = distances.iter().copied().fold(0.0, f64::max);
        let all = run.markers.len() * run.frames.len();
        html += &format!(
            "<p>The model is {rms:.2} mm (root mean square) from {} measured markers, at most {most:.2} mm; {} of {all} samples were lost.</p>",
            run.markers.len(),
            all - distances.len()
        );
    }
    html
}

/// A chart per control; both sides of a pair share one.
fn activations(run: &Playback) -> String {
    let times: Vec<f64> = run.frames.iter().map(|frame| frame.time_s).collect();
    let line = |name: &str, control: &Control| Line {
        name: name.into(),
        values: control.values.iter().map(|value| Some(*value)).collect(),
        band: control.intervals.clone(),
        dots: Vec::new(),
    };
    let chart = |title: String, lines: Vec<Line>, control: &Control| {
        let bounds = control.range.to_vec();
        Chart { title, times: times.clone(), lines, bounds, in_sight: vec![control.range[0].max(0.0)] }.figure()
    };
    let mut html = String::from("<div class=\"charts\">\n");
    let mut done: Vec<&str> = Vec::new();
    for (name, left, right) in sides::pairs(&run.controls, |control| &control.name) {
        html += &chart(name.into(), vec![line("left", left), line("right", right)], left);
        done.extend([left.name.as_str(), right.name.as_str()]);
    }
    for control in run.controls.iter().filter(|control| !done.contains(&control.name.as_str())) {
        html += &chart(control.label(), vec![line("", control)], control);
    }
    let band = if run.markers.is_empty() {
        ""
    } else {
        " Band: the interval that holds the truth with 95 %, as far as noise tells."
    };
    html + &format!("</div>\n<p class=\"note\">Dashed: a bound of the control.{band}</p>")
}

/// A chart per marker: along the direction in which the model moves most.
fn markers(run: &Playback) -> String {
    let times: Vec<f64> = run.frames.iter().map(|frame| frame.time_s).collect();
    let figures: String = run.markers.iter().filter_map(|marker| trace(marker, &times)).collect();
    format!(
        "<div class=\"charts\">\n{figures}</div>\n<p class=\"note\">Way along the direction in which the marker moves most, mm. Line: model; band: \
         the root mean square residual of the marker along it; dots: measurement.</p>"
    )
}

fn trace(marker: &Marker, times: &[f64]) -> Option<String> {
    let first = marker.samples.first()?.model;
    let farthest =
        marker.samples.iter().map(|s| subtract(s.model, first)).max_by(|a, b| norm(*a).total_cmp(&norm(*b)))?;
    let along = if norm(farthest) > 1e-9 { farthest.map(|c| c / norm(farthest)) } else { [0.0, 0.0, 1.0] };
    let way = |x| dot(subtract(x, first), along);
    let model: Vec<f64> = marker.samples.iter().map(|s| way(s.model)).collect();
    let dots: Vec<Option<f64>> = marker.samples.iter().map(|s| s.measured.map(way)).collect();
    let off: Vec<f64> = model.iter().zip(&dots).filter_map(|(m, d)| Some(d.as_ref()? - m)).collect();
    let rms = (off.iter().map(|o| o * o).sum::<f64>() / off.len().max(1) as f64).sqrt();
    let band = model.iter().map(|m| Some([m - rms, m + rms])).collect();
    let line = Line { name: String::new(), values: model.into_iter().map(Some).collect(), band, dots };
    let title = format!("{} (rms {rms:.2} mm)", marker.name);
    Some(Chart { title, times: times.to_vec(), lines: vec![line], ..Chart::default() }.figure())
}

fn distances(run: &Playback) -> String {
    let times: Vec<f64> = run.frames.iter().map(|frame| frame.time_s).collect();
    let rows: Vec<(String, Vec<Option<f64>>)> = run
        .markers
        .iter()
        .map(|marker| (marker.name.clone(), marker.samples.iter().map(|sample| sample.distance()).collect()))
        .collect();
    heat_map(&rows, &times, "mm")
}

/// Iterations per frame, and seconds per part.
fn effort(run: &Playback) -> Result<String> {
    let mut html = String::new();
    if !run.effort.is_empty() {
        let times: Vec<f64> = run.frames.iter().map(|frame| frame.time_s).collect();
        let line = |values: Vec<Option<f64>>| Line { values, ..Line::default() };
        let (title, iterations) = match Sheet::find(&run.folder.join("tables"), "fit")? {
            Some(sheet) => ("Gauss-Newton steps of the fit", steps(run, &sheet)?),
            None => (
                "Newton iterations of the steps that succeeded",
                run.effort.iter().map(|effort| Some(effort.iterations as f64)).collect(),
            ),
        };
        let ratio =
            run.effort.iter().map(|e| Some((e.residual_mn / e.required_mn).log10()).filter(|r| r.is_finite()));
        let chart = |title: &str, values, in_sight: Vec<f64>, bounds| {
            Chart { title: title.into(), times: times.clone(), lines: vec![line(values)], in_sight, bounds }.figure()
        };
        html += "<div class=\"charts\">\n";
        html += &chart(title, iterations, vec![0.0], Vec::new());
        html += &chart("residual at the end: log10 of residual over required", ratio.collect(), vec![0.0], vec![0.0]);
        html += "</div>\n";
    }
    if let Some(sheet) = Sheet::find(&run.folder.join("tables"), "cost")? {
        let [part, seconds, clock, count] =
            [sheet.column("part")?, sheet.column("seconds")?, sheet.column("clock")?, sheet.column("count")?];
        let mut rows = Vec::new();
        for row in 0..sheet.len() {
            let time = sheet.number(row, seconds)?.map_or("-".into(), shown);
            rows.push(
                [sheet.text(row, part), &time, sheet.text(row, clock), sheet.text(row, count)].map(str::to_owned),
            );
        }
        html += &table(["part", "seconds", "clock", "count"], &rows);
        html += "<p class=\"note\">Seconds of effects are summed over threads and are part of the assembly; those of stages are wall time. Output: \
                 solving waited for files; most of writing goes on beside it.</p>";
    }
    Ok(html)
}

/// Rows of `fit.csv` per frame.
fn steps(run: &Playback, sheet: &Sheet) -> Result<Vec<Option<f64>>> {
    let column = sheet.column("frame")?;
    let mut steps = vec![Some(0.0); run.frames.len()];
    for row in 0..sheet.len() {
        let index = sheet.count(row, column)?;
        if let Some(at) = run.frames.iter().position(|frame| frame.index == index) {
            steps[at] = steps[at].map(|count| count + 1.0);
        }
    }
    Ok(steps)
}
