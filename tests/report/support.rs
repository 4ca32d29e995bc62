//! What the questions share: a frame, a run folder, a solved state, markers.

use risorius::forward::{Drive, Equilibrium, Settings, Solver, Work};
use risorius::model::Model;
use risorius::report::{Frame, MarkerPair, RunFolder};

pub const FRAME: Frame = Frame { index: 3, time_s: 0.1 + 0.2 };

pub fn run_in(folder: &tempfile::TempDir) -> RunFolder {
    RunFolder::create(&folder.path().join("runs"), "smile").expect("a run folder")
}

pub fn temporary() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

pub fn solved(model: &Model) -> (Equilibrium, Work) {
    let mut solver = Solver::new(model, Settings::default()).expect("memory");
    let drive = Drive { controls: vec![0.02, 0.01], load: 1.0 };
    let found = solver.equilibrium(&model.rest(), &drive).unwrap_or_else(|failure| panic!("{}", failure.error));
    (found, solver.work())
}

pub fn some_markers() -> [MarkerPair<'static>; 3] {
    [
        MarkerPair { name: "brow, left", model: [1.0, 2.0, 3.0], measured: Some([1.5, 2.0, 3.0]) },
        MarkerPair { name: "lost", model: [4.0, 5.0, 6.0], measured: None },
        MarkerPair { name: "chin", model: [0.1, 0.0, 0.0], measured: Some([0.1, 0.3, -0.4]) },
    ]
}
