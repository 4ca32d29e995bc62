//! Tables: the documented columns, and every bit of every number.

use super::model::{MUSCLES, model};
use super::support::{FRAME, run_in, solved, some_markers, temporary};
use risorius::mesh::MaterialPoint;
use risorius::report::tables::{
    ActivationTable, ConvergenceTable, EnergyTable, FrameCost, MarkerTable, MuscleTable, OutputSeconds, ProbeTable,
    write_cost,
};
use risorius::report::{Frame, Probe, muscle_states, probe_states};
use risorius::term::pressure::Trilinear;
use std::fs;
use std::path::Path;

/// The rows of a table by RFC 4180.
fn read_csv(path: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let (mut rows, mut row, mut cell, mut quoted) = (Vec::new(), Vec::new(), String::new(), false);
    let mut characters = text.chars().peekable();
    while let Some(c) = characters.next() {
        match c {
            '"' if quoted && characters.peek() == Some(&'"') => cell.extend(characters.next()),
            '"' => quoted = !quoted,
            ',' if !quoted => row.push(std::mem::take(&mut cell)),
            '\n' if !quoted => {
                row.push(std::mem::take(&mut cell));
                rows.push(std::mem::take(&mut row));
            }
            other => cell.push(other),
        }
    }
    assert!(cell.is_empty() && row.is_empty(), "the last line has no end");
    assert!(rows.iter().all(|row: &Vec<String>| row.len() == rows[0].len()), "ragged: {}", path.display());
    rows
}

fn numbers(cells: &[String]) -> Vec<f64> {
    cells.iter().map(|cell| cell.parse().unwrap_or_else(|_| panic!("{cell:?} is no number"))).collect()
}

#[test]
fn tables_have_their_columns_and_every_bit() {
    let model = model(&Trilinear);
    let (found, work) = solved(&model);
    let folder = temporary();
    let run = run_in(&folder);
    let table = |name: &str| read_csv(&run.tables().join(format!("{name}.csv")));
    let columns = |text: &str| text.split(',').map(String::from).collect::<Vec<_>>();
    let frame = ["3".to_owned(), "0.30000000000000004".to_owned()];

    let probe = Probe { name: "tip".into(), at: MaterialPoint { element: 5, xi: [0.3, 0.9, 0.2] } };
    let probes = [probe.clone(), Probe { name: "a, b".into(), ..probe }];
    let states = probe_states(&probes, &model, &found.state);
    ProbeTable::create(&run).and_then(|mut t| t.add(FRAME, &found.state, &states)).expect("written");
    let rows = table("probes");
    assert_eq!(rows[0], columns("frame,time_s,load,name,x_mm,y_mm,z_mm,ux_mm,uy_mm,uz_mm"));
    assert_eq!(rows[1][..4], [&frame[0], &frame[1], "1.0", "tip"]);
    assert_eq!(rows[2][3], "a, b");
    let at = probes[0].at;
    let x = model.current(&found.state);
    let expected = [model.mesh().interpolate(at, &x), model.mesh().interpolate(at, &found.state.u)].concat();
    assert_eq!(numbers(&rows[1][4..]), expected);
    assert!((0..3).all(|i| (expected[i] - expected[3 + i] - model.mesh().position(at)[i]).abs() < 1e-12));

    let mut activations = ActivationTable::create(&run, MUSCLES, true).expect("created");
    activations.add(FRAME, &[1.0 / 3.0, 1e-20], &[Some(0.1), None]).expect("written");
    let rows = table("activations");
    let sd = MUSCLES.map(|name| format!("{name}_sd"));
    assert_eq!(rows[0], ["frame", "time_s", MUSCLES[0], MUSCLES[1], &sd[0], &sd[1]]);
    assert_eq!(numbers(&rows[1][2..5]), [1.0 / 3.0, 1e-20, 0.1]);
    assert_eq!(rows[1][5], "");
    let mut activations = ActivationTable::create(&run, MUSCLES, false).expect("created");
    activations.add(FRAME, &[1.0, f64::NAN], &[]).expect("written");
    assert_eq!(table("activations")[0], ["frame", "time_s", MUSCLES[0], MUSCLES[1]]);
    assert_eq!(table("activations")[1][2..], ["1.0", ""]);

    EnergyTable::create(&run, &model).and_then(|mut t| t.add(FRAME, &model, &found)).expect("written");
    let rows = table("energies");
    let muscles = MUSCLES.map(|name| format!("{name}_uj"));
    let tail =
        columns("external_work_uj,det_f_min,det_f_max,volume_change,negative_modes,torque_0_mn_mm,axial_force_0_mn");
    let head = columns("frame,time_s,tissue_uj");
    assert_eq!(rows[0], [&head[..], &muscles[..], &tail[..]].concat());
    let e = &found.evaluation;
    let reactions = model.supports().rotation_reactions(model.mesh(), &e.force, &x);
    let work_of_loads = model.external_work(&found.state);
    assert!(e.energies[0] > 0.0 && work_of_loads > 0.0 && reactions[0].0 != 0.0);
    assert_eq!(found.negative_modes, Some(0));
    let expected = [e.energies[0], e.energies[1], e.energies[2], work_of_loads, e.det_f.min, e.det_f.max];
    let change = model.mesh().volume(&x) / model.mesh().volume(&model.mesh().parameters) - 1.0;
    assert!(change != 0.0);
    assert_eq!(numbers(&rows[1][2..]), [&expected[..], &[change, 0.0, reactions[0].0, reactions[0].1]].concat());

    MarkerTable::create(&run).and_then(|mut t| t.add(FRAME, &some_markers())).expect("written");
    let rows = table("markers");
    let expected =
        "frame,time_s,name,x_mm,y_mm,z_mm,measured_x_mm,measured_y_mm,measured_z_mm,dx_mm,dy_mm,dz_mm,distance_mm";
    assert_eq!(rows[0], columns(expected));
    assert_eq!(rows[1][2], "brow, left");
    assert_eq!(numbers(&rows[1][3..]), [1.0, 2.0, 3.0, 1.5, 2.0, 3.0, 0.5, 0.0, 0.0, 0.5]);
    assert_eq!(rows[2][3..6], ["4.0", "5.0", "6.0"]);
    assert!(rows[2][6..].iter().all(String::is_empty));

    let muscles = muscle_states(&model, &found.state, e);
    MuscleTable::create(&run).and_then(|mut t| t.add(FRAME, &muscles)).expect("written");
    let rows = table("muscles");
    let expected = "frame,time_s,name,activation,stretch_mean,stretch_min,stretch_max,energy_uj,descending_points";
    assert_eq!(rows[0], columns(expected));
    assert_eq!((rows.len(), rows[2][2].as_str(), numbers(&rows[2][3..4])), (3, MUSCLES[1], vec![0.01]));
    assert_eq!(numbers(&rows[2][7..8]), [e.energies[2]]);
    assert_eq!(rows[2][8], "0");

    ConvergenceTable::create(&run).and_then(|mut t| t.add(FRAME, &found.history)).expect("written");
    let rows = table("convergence");
    let expected = "frame,step,place,kind,iteration,residual_mn,required_mn,damping,corrections";
    assert_eq!(rows[0], columns(expected));
    let iterations: usize = found.history.iter().map(|step| step.iterations.len()).sum();
    assert!(iterations > 1);
    assert_eq!(rows.len(), 1 + iterations + found.history.len());
    let last = &rows[rows.len() - 1];
    let residual = numbers(&last[5..7]);
    assert!(last[2] == "1.0" && last[3] == "walked" && residual[0] <= residual[1], "{last:?}");

    let output = OutputSeconds { waited: 0.5, written: 2.0 };
    let frames = [(9.0, 40), (1.0, 2), (8.0, 30), (3.0, 5)].map(|(seconds, factorisations)| FrameCost {
        seconds,
        factorisations,
        warm: factorisations < 10,
    });
    write_cost(&run, &model, &work, (output, &frames), Some((&work, 0.25))).expect("written");
    let rows = table("cost");
    assert_eq!(rows[0], columns("part,seconds,clock,points,count,flops"));
    let parts: Vec<&str> = rows[1..].iter().map(|row| row[0].as_str()).collect();
    let solver = ["assembly", "factorisation", "solve", "output", "warm frame", "writing", "estimate"];
    assert_eq!(parts, [&["tissue", MUSCLES[0], MUSCLES[1], "traction"][..], &solver].concat());
    let evaluations = work.force_evaluations + work.assemblies;
    assert_eq!(rows[1][3], (evaluations * 6 * 64).to_string());
    assert_eq!(rows[6][4], work.linear.factorisations.to_string());
    assert_eq!(
        [&rows[8][1..], &rows[10][1..]].map(|row| [row[0].as_str(), &row[1]]),
        [["0.5", "wall"], ["2.0", "writer"]]
    );
    // those that began at rest are not warm
    assert_eq!([&rows[9][1], &rows[9][4]], ["2.0", "3.5"]);
}

/// A table grows by whole frames, and what was written is on disk without closing it.
#[test]
fn tables_grow_frame_by_frame() {
    let folder = temporary();
    let run = run_in(&folder);
    let mut table = MarkerTable::create(&run).expect("created");
    for index in 0..4 {
        assert_eq!(read_csv(&run.tables().join("markers.csv")).len(), 1 + 3 * index);
        table.add(Frame { index, time_s: 0.0 }, &some_markers()).expect("written");
    }
}
