//! What the markers tell, on the page of a fit.

use super::{columns, count};
use crate::fit::identifiability::{ClipKnowledge, Combination, Weak};
use std::fmt;

/// Markers and combinations that are shown.
const SHOWN: usize = 4;
/// What is left of a marker is told where it is this many times what noise leaves.
const BEYOND_NOISE: f64 = 2.0;

/// `Display` is some lines; none where nothing was gathered.
#[derive(Debug, Clone, Copy)]
pub struct ToldSummary<'a> {
    /// What was gathered over the frames.
    pub clip: &'a ClipKnowledge,
    /// Names of all controls of the model, those of bones with their unit.
    pub controls: &'a [&'a str],
    /// Names of the markers.
    pub markers: &'a [String],
    /// `muscle` or `control`.
    pub kind: &'a str,
}

impl fmt::Display for ToldSummary<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.clip.frames() == 0 {
            return Ok(());
        }
        writeln!(out, "\nwhat the markers tell")?;
        let row = |weak: &Weak| {
            let known = &weak.peak.1;
            [
                self.controls[weak.control].to_owned(),
                format!("{} to {}", short(known.interval[0]), short(known.interval[1])),
                weak.bias_at_peak.map_or_else(|| "-".into(), |bias| format!("{bias:+.1e}")),
                weak.prior_dominated.to_string(),
                weak.wants.map_or_else(|| "-".into(), |(frame, at)| format!("{} in frame {frame}", short(at))),
            ]
        };
        let rows: Vec<_> = self.clip.controls().iter().map(row).collect();
        let header = [self.kind, "95 % at its peak", "bias there", "frames only prior", "without bounds at most"];
        out.write_str(&columns(header, &rows))?;
        self.combinations(out)?;
        self.left_over(out)
    }
}

impl ToldSummary<'_> {
    fn combinations(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = self.clip.combinations();
        let unseen: Vec<_> = all.iter().rev().filter(|c| !c.is_determined()).collect();
        if let (true, Some(weakest)) = (unseen.is_empty(), all.last()) {
            if all.len() > 1 {
                let words = self.words(weakest);
                writeln!(out, "  seen least over the clip: {words}, to {:.1e} of their ranges", weakest.sd())?;
            }
            return Ok(());
        }
        writeln!(out, "  {} that no marker determines, over the whole clip:", count(unseen.len(), "combination"))?;
        unseen.iter().take(SHOWN).try_for_each(|c| writeln!(out, "    {}", self.words(c)))
    }

    /// The greatest parts of a combination.
    fn words(&self, combination: &Combination) -> String {
        let parts: Vec<_> = combination.parts.iter().take(SHOWN).copied().collect();
        let more = if combination.parts.len() > SHOWN { " + ..." } else { "" };
        Combination { parts, ..*combination }.words(self.controls) + more
    }

    fn left_over(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = self.clip.left_over();
        let beyond: Vec<_> = all.iter().filter(|l| l.rms_mm > BEYOND_NOISE * l.expected_mm).collect();
        if beyond.is_empty() {
            return Ok(());
        }
        let told = beyond.iter().take(SHOWN).map(|left| {
            let (name, [x, y, z]) = (&self.markers[left.marker], left.mean_mm);
            format!("{name} {:.2} mm (noise {:.2}; mean {x:+.2}, {y:+.2}, {z:+.2})", left.rms_mm, left.expected_mm)
        });
        let told: Vec<String> = told.collect();
        writeln!(out, "  {} that no admissible control explains: {}", count(beyond.len(), "marker"), told.join(", "))
    }
}

/// Four digits behind the point, or an exponent where that would hide it.
fn short(value: f64) -> String {
    match value.abs() {
        size if size > 0.0 && size < 1e-3 => format!("{value:.1e}"),
        _ => format!("{value:.4}"),
    }
}
