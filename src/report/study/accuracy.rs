//! `accuracy.toml`: the settings on the front, cheapest first, for `risorius run --accuracy`.

use crate::error::{Error, Result};
use crate::report::run_folder::failed;
use crate::scene::{Measure, Study};
use crate::study::Outcome;
use crate::study::front::front;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// All settings on a front.
#[derive(Debug, Serialize, Deserialize)]
struct Front {
    measure: String,
    setting: Vec<Choice>,
}

/// A setting on the front.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// The variant.
    pub name: String,
    /// Its error; mm for probes, markers and displacement.
    pub error: f64,
    /// Median time of a solve on the machine of the study, s.
    pub seconds: f64,
    /// What it sets, as after `--set`.
    pub set: Vec<String>,
}

/// The text of the file. A variant that takes tables away or changes threads is another problem and does not belong.
pub(super) fn write(study: &Study, outcome: &Outcome) -> String {
    let usable: Vec<_> = outcome
        .variants
        .iter()
        .filter(|v| v.variant.change.without.is_empty() && v.variant.change.threads.is_none())
        .collect();
    let pairs: Vec<(f64, f64)> = usable.iter().map(|v| v.pair(study.measure)).collect();
    let choice = |k: usize| Choice {
        name: usable[k].variant.name.clone(),
        error: pairs[k].0,
        seconds: pairs[k].1,
        set: usable[k].variant.change.set.clone(),
    };
    let front =
        Front { measure: study.measure.word().into(), setting: front(&pairs).into_iter().map(choice).collect() };
    let head = "# Written by a study: settings that no other beats in error and time, cheapest first.\n\
                # Put it beside the problem file; `risorius run --accuracy 0.1mm` then chooses from it.\n";
    head.to_owned() + &toml::to_string(&front).unwrap_or_default()
}

/// The settings in a file and their measure.
///
/// # Errors
/// A file that cannot be read, or that no study wrote.
pub fn read_choices(path: &Path) -> Result<(Measure, Vec<Choice>)> {
    let text = std::fs::read_to_string(path).map_err(failed("read", path))?;
    let bad = |message: String| Error::BadAccuracy { path: path.into(), message: message.into() };
    let front: Front = toml::from_str(&text).map_err(|error| bad(error.message().to_owned()))?;
    let measure = Measure::ALL.into_iter().find(|measure| measure.word() == front.measure);
    let measure = measure.ok_or_else(|| bad(format!("there is no measure `{}`", front.measure)))?;
    Ok((measure, front.setting))
}
