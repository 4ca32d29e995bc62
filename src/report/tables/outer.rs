//! `outer.csv`, `outer_controls.csv`, `outer_frames.csv`: what all frames share, what it has to do with the controls of the
//! frames, and how well the markers are met with it.

use super::{Cell, Rows, Table};
use crate::error::Result;
use crate::fit::outer::Outcome;
use crate::report::run_folder::RunFolder;

/// Writes all three. `controls` are the names of those that are sought.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io).
pub fn write_outer(run: &RunFolder, outcome: &Outcome, controls: &[&str]) -> Result<()> {
    let labels: Vec<String> = outcome.found.iter().map(|found| found.unknown.what.label()).collect();
    let correlations: Vec<String> = labels.iter().map(|label| format!("correlation_{label}")).collect();
    let columns = "name,unit,value,lower_95,upper_95,sd,sd_with_known_controls,prior_sd,prior_dominated,control,\
                   control_correlation,control_frame";
    let columns = columns.split(',').chain(correlations.iter().map(String::as_str));
    let mut table = Table::create(&run.tables(), "outer", columns)?;
    let mut rows = Rows::default();
    for (k, (found, label)) in outcome.found.iter().zip(&labels).enumerate() {
        let [lower, upper] = found.interval;
        let worst = match outcome.confounding.worst(k) {
            Some((frame, control, correlation)) => [controls[control].into(), correlation.into(), frame.into()],
            None => [Cell::Empty; 3],
        };
        let own = [
            label.as_str().into(),
            found.unknown.what.unit().into(),
            found.value.into(),
            lower.into(),
            upper.into(),
            found.sd.into(),
            found.sd_with_known_controls.into(),
            found.prior_sd.into(),
            usize::from(found.prior_dominated).into(),
        ];
        let others = outcome.correlation.row(k).iter().map(|value| Cell::Number(*value)).collect::<Vec<_>>();
        rows.add(own.into_iter().chain(worst).chain(others));
    }
    table.append(rows)?;

    let columns = ["frame", "control", "sd_known", "sd"].into_iter().chain(correlations.iter().map(String::as_str));
    let mut table = Table::create(&run.tables(), "outer_controls", columns)?;
    let mut rows = Rows::default();
    for frame in &outcome.confounding.frames {
        for (k, control) in controls.iter().enumerate() {
            let own = [frame.frame.into(), Cell::Text(control), frame.sd_known[k].into(), frame.sd[k].into()];
            rows.add(own.into_iter().chain(frame.correlation[k].iter().map(|value| Cell::from(*value))));
        }
    }
    table.append(rows)?;

    let mut table = Table::create(&run.tables(), "outer_frames", "frame,held_out,before_mm,after_mm".split(','))?;
    let mut rows = Rows::default();
    for frame in &outcome.frames {
        let held_out = Cell::Count(usize::from(frame.held_out));
        rows.add([frame.frame.into(), held_out, frame.before_mm.into(), frame.after_mm.into()]);
    }
    table.append(rows)
}
