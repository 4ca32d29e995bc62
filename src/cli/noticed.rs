//! What a frame's equilibrium shows that its reader must know.

use crate::error::Warning;
use crate::forward::{Equilibrium, Snap};
use crate::model::Model;
use crate::report::Frame;

/// In the order in which it came about: lost balance on the way, a saddle at the end, fibres on their descending limb.
pub(super) fn noticed(frame: Frame, model: &Model, found: &Equilibrium) -> Vec<Warning> {
    let mut warnings: Vec<Warning> = found.snaps.iter().map(|snap| snapped(frame, snap)).collect();
    warnings.extend(found.negative_modes.filter(|modes| *modes > 0).map(|modes| saddle(frame, modes)));
    warnings.extend(model.descending_fibres(&found.state).iter().map(|fibres| Warning {
        code: "S008",
        message: format!("{}: {}", named(frame), fibres.told(model)),
        place: None,
        help: Some(
            "where one part of a muscle stretches the other the answer depends on the mesh: lower the activation or stretch \
             the muscle less"
                .into(),
        ),
    }));
    warnings
}

fn named(frame: Frame) -> String {
    format!("frame {} at {:.3} s", frame.index, frame.time_s)
}

/// The answer is not the end of the path that was asked for.
fn snapped(frame: Frame, Snap { place, modes, distance }: &Snap) -> Warning {
    let cause = match modes {
        0 => "no equilibrium was near".into(),
        modes => format!("the equilibrium was not stable, with {modes} negative modes"),
    };
    Warning {
        code: "S007",
        message: format!(
            "{}: the body snapped {:.1} % along the way, where {cause}, by up to {distance:.3} mm: the answer is a stable \
             state beyond",
            named(frame),
            100.0 * place
        ),
        place: None,
        help: Some("which state a real body comes to may depend on small imperfections: look at the shapes".into()),
    }
}

/// An equilibrium that a small push would leave.
fn saddle(frame: Frame, modes: usize) -> Warning {
    Warning {
        code: "S005",
        message: format!(
            "{} is an equilibrium that is not stable: its tangent has {modes} negative modes",
            named(frame)
        ),
        place: None,
        help: Some("the body would buckle here: approach it in shorter steps (--set solver.step_max=0.05)".into()),
    }
}
