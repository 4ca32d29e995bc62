//! Estimated errors of the mesh, gathered over the frames for which they were estimated.

use super::count;
use crate::report::frame::{Frame, MeshError};
use std::fmt;

/// Points shown, those with the largest errors.
const SHOWN: usize = 5;

/// The largest value of something over the frames.
#[derive(Debug, Clone, PartialEq)]
struct Largest {
    name: String,
    value: f64,
    frame: usize,
}

/// `Display` is what the page says of it, some lines.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MeshErrors {
    frames: usize,
    body: Vec<Largest>,
    points: Vec<Largest>,
    biases: Vec<Largest>,
    steps: usize,
    seconds: f64,
}

impl MeshErrors {
    /// Sets the Newton steps of all estimates and their wall time, s.
    pub fn took(&mut self, steps: usize, seconds: f64) {
        (self.steps, self.seconds) = (steps, seconds);
    }

    /// Adds a frame.
    pub fn add(&mut self, frame: Frame, error: &MeshError) {
        self.frames += 1;
        keep(&mut self.body, "anywhere", error.largest_mm, frame);
        error.points.iter().for_each(|(name, mm)| keep(&mut self.points, name, *mm, frame));
        error.biases.iter().filter_map(|(name, bias)| Some((name, (*bias)?))).for_each(|(name, bias)| {
            keep(&mut self.biases, name, bias, frame);
        });
    }
}

/// Keeps the value if it is the largest of its name.
fn keep(all: &mut Vec<Largest>, name: &str, value: f64, frame: Frame) {
    match all.iter_mut().find(|known| known.name == name) {
        Some(known) if known.value.abs() >= value.abs() => {}
        Some(known) => (known.value, known.frame) = (value, frame.index),
        None => all.push(Largest { name: name.to_owned(), value, frame: frame.index }),
    }
}

impl fmt::Display for MeshErrors {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.frames == 0 {
            return Ok(());
        }
        let at = |l: &Largest| if self.frames > 1 { format!(" in frame {}", l.frame) } else { String::new() };
        let mut points: Vec<&Largest> = self.points.iter().collect();
        points.sort_by(|a, b| b.value.total_cmp(&a.value));
        let points = points.into_iter().take(SHOWN).chain(&self.body);
        let shown: Vec<String> = points.map(|l| format!("{} {} mm{}", l.name, short(l.value), at(l))).collect();
        writeln!(
            out,
            "  estimated error of the mesh: {}; {} on halved elements, {:.1} s",
            shown.join(", "),
            count(self.steps, "Newton step"),
            self.seconds
        )?;
        if self.biases.is_empty() {
            return Ok(());
        }
        let shown: Vec<String> =
            self.biases.iter().map(|l| format!("{} {}{}", l.name, signed(l.value), at(l))).collect();
        writeln!(out, "  estimated bias of what was fitted, the largest: {}", shown.join(", "))
    }
}

/// A value with two digits that count.
fn short(value: f64) -> String {
    if value.abs() < 1e-5 {
        return format!("{value:.1e}");
    }
    let digits = (1 - value.abs().log10().floor() as i32).clamp(0, 6) as usize;
    format!("{value:.digits$}")
}

fn signed(value: f64) -> String {
    let sign = if value < 0.0 { "-" } else { "+" };
    sign.to_owned() + &short(value.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_of_all_frames_are_told() {
        let mut errors = MeshErrors::default();
        assert_eq!(errors.to_string(), "");
        let error = |tip: f64, bias: f64| MeshError {
            kind: "marker",
            largest_mm: 2.0 * tip,
            points: vec![("B1".into(), tip), ("B2".into(), 0.01)],
            biases: vec![("top".into(), Some(bias)), ("low".into(), None)],
        };
        errors.add(Frame { index: 3, time_s: 0.1 }, &error(0.912, -0.02));
        errors.took(3, 1.0);
        let one = "  estimated error of the mesh: B1 0.91 mm, B2 0.010 mm, anywhere 1.8 mm; 3 Newton steps on halved \
                   elements, 1.0 s\n  estimated bias of what was fitted, the largest: top -0.020\n";
        assert_eq!(errors.to_string(), one);
        errors.add(Frame { index: 4, time_s: 0.2 }, &error(0.5, 0.03));
        errors.took(7, 1.5);
        let two = errors.to_string();
        assert!(two.contains("B1 0.91 mm in frame 3") && two.contains("7 Newton steps"), "{two}");
        assert!(two.contains("top +0.030 in frame 4"), "{two}");
        assert_eq!([short(12.3), short(0.0123), short(1e-9), short(0.0)], ["12", "0.012", "1.0e-9", "0.0e0"]);
    }
}
