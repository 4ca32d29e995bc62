//! Small charts as SVG: lines with bands over time, and a heat map.

use super::frame::escape;
use std::fmt::Write as _;

/// Colours that people with colour blindness tell apart (Okabe and Ito 2008).
pub(super) const COLOURS: [&str; 4] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7"];

/// A line over time.
#[derive(Debug, Clone, Default)]
pub(super) struct Line {
    /// Its name in the legend; none where there is one line only.
    pub name: String,
    /// A value per time; a gap where there is none.
    pub values: Vec<Option<f64>>,
    /// A band around it, where there is one.
    pub band: Vec<Option<[f64; 2]>>,
    /// Values that stand beside it as dots.
    pub dots: Vec<Option<f64>>,
}

/// A chart of lines that share an axis.
#[derive(Debug, Clone, Default)]
pub(super) struct Chart {
    /// What stands above it.
    pub title: String,
    /// Times, s.
    pub times: Vec<f64>,
    /// The lines.
    pub lines: Vec<Line>,
    /// Values at which a dashed line is drawn if they are in sight: bounds.
    pub bounds: Vec<f64>,
    /// Values that are always in sight.
    pub in_sight: Vec<f64>,
}

/// Size of a chart, and the room for the numbers at its axes.
const WIDTH: f64 = 320.0;
const HEIGHT: f64 = 130.0;
const LEFT: f64 = 44.0;
const BELOW: f64 = 18.0;
const ABOVE: f64 = 8.0;

impl Chart {
    /// A figure with a caption.
    pub fn figure(&self) -> String {
        let numbers = self.lines.iter().flat_map(|line| {
            let band = line.band.iter().flatten().flatten();
            line.values.iter().flatten().chain(line.dots.iter().flatten()).chain(band)
        });
        let (low, high) = span(numbers.chain(&self.in_sight).copied());
        let (first, last) = span(self.times.iter().copied());
        let x = |time: f64| LEFT + (WIDTH - LEFT - 6.0) * (time - first) / (last - first);
        let y = |value: f64| ABOVE + (HEIGHT - ABOVE - BELOW) * (high - value) / (high - low);
        let mut svg =
            format!("<svg width=\"{WIDTH}\" height=\"{HEIGHT}\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\">");
        for tick in ticks(low, high) {
            let _ = write!(
                svg,
                "<path d=\"M{LEFT} {0:.1}H{1}\" stroke=\"#e4e4e4\"/><text x=\"{2}\" y=\"{3:.1}\" text-anchor=\"end\">{4}</text>",
                y(tick),
                WIDTH - 6.0,
                LEFT - 4.0,
                y(tick) + 3.5,
                shown(tick)
            );
        }
        for bound in self.bounds.iter().filter(|bound| (low..=high).contains(*bound)) {
            let _ = write!(
                svg,
                "<path d=\"M{LEFT} {0:.1}H{1}\" stroke=\"#888\" stroke-dasharray=\"4 3\"/>",
                y(*bound),
                WIDTH - 6.0
            );
        }
        for (time, anchor) in [(first, "start"), (last, "end")] {
            let _ = write!(
                svg,
                "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"{anchor}\">{} s</text>",
                x(time),
                HEIGHT - 5.0,
                shown(time)
            );
        }
        for (line, colour) in self.lines.iter().zip(COLOURS.iter().cycle()) {
            for run in runs(&line.band) {
                let there = run.iter().map(|(k, ends)| format!("{:.1} {:.1}", x(self.times[*k]), y(ends[1])));
                let back = run.iter().rev().map(|(k, ends)| format!("{:.1} {:.1}", x(self.times[*k]), y(ends[0])));
                let path: Vec<String> = there.chain(back).collect();
                let _ = write!(svg, "<path d=\"M{}Z\" fill=\"{colour}\" fill-opacity=\"0.22\"/>", path.join("L"));
            }
            for run in runs(&line.values) {
                let path: Vec<String> =
                    run.iter().map(|(k, value)| format!("{:.1} {:.1}", x(self.times[*k]), y(*value))).collect();
                svg += &match path.len() {
                    1 => format!(
                        "<path d=\"M{}h0\" stroke=\"{colour}\" stroke-width=\"5\" stroke-linecap=\"round\"/>",
                        path[0]
                    ),
                    _ => format!(
                        "<path d=\"M{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\"/>",
                        path.join("L")
                    ),
                };
            }
            for (k, dot) in line.dots.iter().enumerate().filter_map(|(k, dot)| Some((k, (*dot)?))) {
                let _ = write!(
                    svg,
                    "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"1.7\" fill=\"#222\"/>",
                    x(self.times[k]),
                    y(dot)
                );
            }
        }
        svg += "</svg>";
        let named = self.lines.iter().zip(COLOURS.iter().cycle()).filter(|(line, _)| !line.name.is_empty());
        let legend: String = named
            .map(|(line, colour)| format!(" <b style=\"color:{colour}\">&#9632;</b>&nbsp;{}", escape(&line.name)))
            .collect();
        format!("<figure><figcaption>{}{legend}</figcaption>{svg}</figure>\n", escape(&self.title))
    }
}

/// Rows of numbers as colours from white to dark; an empty cell is grey. `unit` stands behind the numbers of the scale.
pub(super) fn heat_map(rows: &[(String, Vec<Option<f64>>)], times: &[f64], unit: &str) -> String {
    const NAMES: f64 = 120.0;
    const ROW: f64 = 13.0;
    const ALONG: f64 = 800.0;
    let most = rows.iter().flat_map(|(_, row)| row.iter().flatten().copied()).fold(0.0, f64::max);
    let height = ROW * rows.len() as f64 + 44.0;
    let width = NAMES + ALONG + 8.0;
    let mut svg = format!(
        "<svg width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" role=\"img\" shape-rendering=\"crispEdges\">"
    );
    let cell = ALONG / times.len().max(1) as f64;
    for (number, (name, row)) in rows.iter().enumerate() {
        let y = ROW * number as f64;
        let _ =
            write!(svg, "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>", NAMES - 5.0, y + 10.0, escape(name));
        for (k, value) in row.iter().enumerate() {
            let fill = value.map_or("#cfcfcf".into(), |value| heat(if most > 0.0 { value / most } else { 0.0 }));
            let x = NAMES + cell * k as f64;
            let _ = write!(
                svg,
                "<rect x=\"{x:.2}\" y=\"{y}\" width=\"{cell:.2}\" height=\"{}\" fill=\"{fill}\"/>",
                ROW - 1.0
            );
        }
    }
    let y = ROW * rows.len() as f64;
    if let (Some(first), Some(last)) = (times.first(), times.last()) {
        let _ = write!(svg, "<text x=\"{NAMES}\" y=\"{}\">{} s</text>", y + 11.0, shown(*first));
        let _ = write!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{} s</text>",
            NAMES + ALONG,
            y + 11.0,
            shown(*last)
        );
    }
    for k in 0..20 {
        let x = NAMES + 10.0 * k as f64;
        let _ = write!(
            svg,
            "<rect x=\"{x}\" y=\"{}\" width=\"10\" height=\"10\" fill=\"{}\"/>",
            y + 20.0,
            heat(k as f64 / 19.0)
        );
    }
    let _ = write!(
        svg,
        "<text x=\"{NAMES}\" y=\"{0}\">0</text><text x=\"{1}\" y=\"{0}\" text-anchor=\"end\">{2} {unit}</text>\
         <text x=\"{3}\" y=\"{0}\">grey: lost</text></svg>",
        y + 41.0,
        NAMES + 200.0,
        shown(most),
        NAMES + 230.0
    );
    svg
}

/// White over orange to dark red.
fn heat(part: f64) -> String {
    let stops = [[255.0, 255.0, 245.0], [254.0, 200.0, 100.0], [215.0, 80.0, 30.0], [90.0, 0.0, 20.0]];
    let at = 3.0 * part.clamp(0.0, 1.0);
    let k = (at as usize).min(2);
    let [r, g, b]: [u8; 3] =
        std::array::from_fn(|c| (stops[k][c] + (at - k as f64) * (stops[k + 1][c] - stops[k][c])) as u8);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// The stretches without a gap, with their places.
fn runs<T: Copy>(values: &[Option<T>]) -> Vec<Vec<(usize, T)>> {
    let mut runs: Vec<Vec<(usize, T)>> = vec![Vec::new()];
    for (k, value) in values.iter().enumerate() {
        match value {
            Some(value) => runs.last_mut().into_iter().for_each(|run| run.push((k, *value))),
            None => runs.push(Vec::new()),
        }
    }
    runs.retain(|run| !run.is_empty());
    runs
}

/// Least and greatest, apart from each other.
fn span(numbers: impl Iterator<Item = f64>) -> (f64, f64) {
    let ends =
        numbers.filter(|x| x.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    match ends {
        (low, high) if low < high => ends,
        (low, _) if low.is_finite() => (low, low + if low == 0.0 { 1.0 } else { 0.1 * low.abs() }),
        _ => (0.0, 1.0),
    }
}

/// Three to six round numbers.
fn ticks(low: f64, high: f64) -> Vec<f64> {
    let rough = (high - low) / 4.0;
    let decade = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|step| *step >= rough).unwrap_or(rough);
    let first = (low / step).ceil() as i64;
    (first..).map(|k| k as f64 * step).take_while(|tick| *tick <= high + 1e-9 * step).collect()
}

/// A number with as few digits as it needs.
pub(super) fn shown(number: f64) -> String {
    if number == 0.0 || !(1e-4..1e5).contains(&number.abs()) {
        return if number == 0.0 { "0".into() } else { format!("{number:.1e}") };
    }
    let digits = (3 - number.abs().log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{number:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}
