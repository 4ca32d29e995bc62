//! What the markers tell, gathered over the frames of a fit: for the tables, the page and the warning F005.

use crate::error::{Result, Warning};
use crate::fit::advise::MarkerHelp;
use crate::fit::identifiability::{ClipKnowledge, Evidence, Pair, Told};
use crate::fit::placement::Marker;
use crate::fit::{Estimate, Fit};
use crate::model::Control;
use crate::report::Frame;

/// A pair counts as worse than another where so much less of one minus its correlation is left.
const WORSE: f64 = 0.8;
/// A marker is proposed where it brings a deviation below this part of what it was.
const HELPS: f64 = 0.9;
/// Pairs that the warning names.
const NAMED: usize = 3;

/// The frames so far.
pub(super) struct Telling<'m> {
    pub clip: ClipKnowledge,
    controls: &'m [Control],
    /// Their names, with units.
    names: &'m [String],
    unknowns: Vec<usize>,
    markers: Vec<Marker>,
    /// The pair that is most alike, its frame, and the marker that would tell them apart best.
    worst: Option<(Frame, Pair, Option<MarkerHelp>)>,
}

impl<'m> Telling<'m> {
    pub fn new(fit: &Fit<'m>, names: &'m [String]) -> Telling<'m> {
        Telling {
            clip: ClipKnowledge::default(),
            controls: fit.controls(),
            names,
            unknowns: fit.unknowns().to_vec(),
            markers: fit.markers().to_vec(),
            worst: None,
        }
    }

    /// Adds a frame; gives back what its markers tell, if that is known. `help` is the marker that tells its pair apart best, if its pair
    /// may be the worst so far; `biases` are one per control that is sought, or none.
    pub fn frame(
        &mut self,
        frame: Frame,
        estimate: &Estimate,
        help: Option<MarkerHelp>,
        biases: &[Option<f64>],
    ) -> Result<Option<Told>> {
        let Some(evidence) = Evidence::of(estimate, self.controls, &self.unknowns) else { return Ok(None) };
        let measured: Vec<bool> = estimate.measured_mm.iter().map(Option::is_some).collect();
        let told = evidence.told(&self.markers, &measured)?;
        self.clip.add(frame.index, &evidence, &told, biases);
        if let Some(pair) = told.pairs.first()
            && self.worst.as_ref().is_none_or(|(_, worst, _)| pair.distinct() < WORSE * worst.distinct())
        {
            self.worst = Some((frame, pair.clone(), help));
        }
        Ok(Some(told))
    }

    /// F005, if some pair cannot be told apart.
    pub fn warning(&self) -> Option<(Frame, Warning)> {
        let (frame, pair, help) = self.worst.as_ref()?;
        let pairs = self.clip.pairs();
        let name = |k: usize| &self.names[k];
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
            pair.words(self.names),
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

/// Two digits that count.
fn short(value: f64) -> String {
    if value.abs() < 1e-3 {
        return format!("{value:.1e}");
    }
    let digits = (1 - value.abs().log10().floor() as i32).clamp(0, 6) as usize;
    format!("{value:.digits$}")
}
