//! What a run leaves behind: is it whole, is it exact, and does it survive a crash?

#[path = "report/model.rs"]
mod model;
#[path = "report/vtu_reader.rs"]
mod vtu_reader;

use model::{MUSCLES, Random, crumpled, model};
use risorius::Error;
use risorius::forward::{Drive, Equilibrium, Settings, Solver, Work, evaluate};
use risorius::math::tensor::{apply, determinant, norm, normalised, subtract};
use risorius::mesh::{MaterialPoint, position_and_jacobian};
use risorius::model::Model;
use risorius::report::run_folder::write_atomically;
use risorius::report::summary::{Bound, FitSummary, FittedFrame, ForwardSummary, MarkerErrors};
use risorius::report::tables::{
    ActivationTable, ConvergenceTable, EnergyTable, MarkerTable, MuscleTable, ProbeTable, write_cost,
};
use risorius::report::vtu::{Field, Grid};
use risorius::report::{
    FailedFrame, Frame, Input, Manifest, MarkerPair, Outcome, Probe, RunFolder, Status, View, muscle_states,
    probe_states,
};
use risorius::term::pressure::{DiscontinuousTrilinear, PRESSURE_SPACES, Trilinear};
use std::collections::HashSet;
use std::fs;
use std::path::Path;
use vtu_reader::{Vtu, attribute};

/// The 64 points of a cubic Bezier hexahedron as VTK orders them: i, j, k of each.
const DOCUMENTED_ORDER: &str = "
    000 300 330 030 003 303 333 033
    100 200 310 320 130 230 010 020 103 203 313 323 133 233 013 023 001 002 301 302 331 332 031 032
    011 021 012 022 311 321 312 322 101 201 102 202 131 231 132 232 110 210 120 220 113 213 123 223
    111 211 121 221 112 212 122 222";

const FRAME: Frame = Frame { index: 3, time_s: 0.1 + 0.2 };

fn run_in(folder: &tempfile::TempDir) -> RunFolder {
    RunFolder::create(&folder.path().join("runs"), "smile").expect("a run folder")
}

fn temporary() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn solved(model: &Model) -> (Equilibrium, Work) {
    let mut solver = Solver::new(model, Settings::default()).expect("memory");
    let drive = Drive { controls: vec![0.02, 0.01], load: 1.0 };
    let found = solver.equilibrium(&model.rest(), &drive).unwrap_or_else(|failure| panic!("{}", failure.error));
    (found, solver.work())
}

// ---- VTU --------------------------------------------------------------------------------------------------------

/// Bernstein's cubics.
fn bernstein(x: f64) -> [f64; 4] {
    let y = 1.0 - x;
    [y * y * y, 3.0 * x * y * y, 3.0 * x * x * y, x * x * x]
}

/// The weights of the points of a cell at xi, in VTK's order.
fn weights(xi: [f64; 3]) -> Vec<f64> {
    let b = xi.map(bernstein);
    let digits = |point: &str| -> Vec<usize> { point.bytes().map(|digit| (digit - b'0') as usize).collect() };
    let weight = |ijk: Vec<usize>| b[0][ijk[0]] * b[1][ijk[1]] * b[2][ijk[2]];
    DOCUMENTED_ORDER.split_whitespace().map(|point| weight(digits(point))).collect()
}

#[test]
fn bezier_cells_are_the_elements_exactly() {
    for space in PRESSURE_SPACES {
        let model = model(space);
        let state = crumpled(&model);
        let folder = temporary();
        let run = run_in(&folder);
        View::new(&run).add(FRAME, &model, &state, &[]).expect("written");
        let vtu = Vtu::read(&run.view().join("result_0003.vtu"));

        assert!(vtu.head.contains("<VTKFile type=\"UnstructuredGrid\" version=\"2.2\" byte_order=\"LittleEndian\""));
        assert!(vtu.head.contains("Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">0.30000000000000004<"));
        assert_eq!(vtu.cells, model.mesh().elements());
        assert!(vtu.types().iter().all(|kind| *kind == 79));
        assert_eq!(vtu.vectors("HigherOrderDegrees"), vec![[3.0; 3]; vtu.cells]);
        assert_eq!(vtu.integers("element"), (0..vtu.cells as i64).collect::<Vec<_>>());

        let (points, pressure) = (vtu.vectors("Points"), vtu.scalars("pressure_kpa"));
        let (displacement, reference) = (vtu.vectors("displacement_mm"), vtu.vectors("reference_mm"));
        let x = model.current(&state);
        let mut random = Random(1);
        for cell in 0..vtu.cells {
            let ids = vtu.cell(cell);
            for _ in 0..50 {
                let at = random.point(cell);
                let w = weights(at.xi);
                let sum = |field: &[[f64; 3]]| -> [f64; 3] {
                    std::array::from_fn(|i| w.iter().zip(&ids).map(|(w, id)| w * field[*id][i]).sum())
                };
                let mesh = model.mesh();
                assert!(norm(subtract(sum(&points), mesh.interpolate(at, &x))) < 1e-12 * 30.0);
                assert!(norm(subtract(sum(&displacement), mesh.interpolate(at, &state.u))) < 1e-12 * 30.0);
                assert!(norm(subtract(sum(&reference), mesh.position(at))) < 1e-12 * 30.0);
                let ours: f64 = w.iter().zip(&ids).map(|(w, id)| w * pressure[*id]).sum();
                assert!((ours - pressure_at(&model, &state.p, at)).abs() < 1e-12 * 3.0);
            }
        }
        let (low, high) = (vtu.scalars("det_f_min"), vtu.scalars("det_f_max"));
        for element in 0..vtu.cells {
            let middle = det_f(&model, &x, MaterialPoint { element, xi: [0.5; 3] });
            assert!(low[element] <= middle && middle <= high[element] && low[element] < high[element]);
        }
    }
}

fn pressure_at(model: &Model, p: &[f64], at: MaterialPoint) -> f64 {
    let parameters = model.space().parameters(model.mesh(), at.element);
    parameters.iter().zip(model.space().values(at.xi)).map(|(k, psi)| psi * p[*k]).sum()
}

fn det_f(model: &Model, x: &[[f64; 3]], at: MaterialPoint) -> f64 {
    let local = model.mesh().local_of(at.element, x);
    let (_, jacobian) = position_and_jacobian(model.mesh().element, &local, at.xi);
    determinant(&jacobian) / determinant(&model.mesh().jacobian(at))
}

#[test]
fn linear_cells_sample_the_fields_and_fill_the_body() {
    let model = model(&DiscontinuousTrilinear);
    let state = crumpled(&model);
    let folder = temporary();
    let run = run_in(&folder);
    View::new(&run).add(FRAME, &model, &state, &[]).expect("written");
    let vtu = Vtu::read(&run.view().join("linear/result_0003.vtu"));
    assert_eq!((vtu.points, vtu.cells), (27 * 6, 8 * 6));
    assert!(vtu.types().iter().all(|kind| *kind == 12));

    let x = model.current(&state);
    let (points, dets, pressure) = (vtu.vectors("Points"), vtu.scalars("det_f"), vtu.scalars("pressure_kpa"));
    let elements = vtu.integers("element");
    for cell in 0..vtu.cells {
        let element = elements[cell] as usize;
        // corners of VTK_HEXAHEDRON, half an element wide, from the octant that the cell fills
        let ids = vtu.cell(cell);
        let octant = [cell % 2, cell / 2 % 2, cell / 4 % 2];
        let corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];
        for (corner, id) in corners.into_iter().zip(ids) {
            let at = MaterialPoint { element, xi: std::array::from_fn(|d| 0.5 * (octant[d] + corner[d]) as f64) };
            assert!(norm(subtract(points[id], model.mesh().interpolate(at, &x))) < 1e-12 * 30.0);
            assert!((dets[id] - det_f(&model, &x, at)).abs() < 1e-12);
            assert!((pressure[id] - pressure_at(&model, &state.p, at)).abs() < 1e-12 * 3.0);
        }
    }
    // at rest the cells fill the box
    let rest = risorius::report::vtu::linear::shape(&model, &model.rest(), 0.0);
    let volumes = rest.connectivity.chunks_exact(8).map(|c| {
        let edge = |k: usize| subtract(rest.points[c[k] as usize], rest.points[c[0] as usize]);
        determinant(&[edge(1), edge(3), edge(4)])
    });
    let volumes: Vec<f64> = volumes.collect();
    assert!(volumes.iter().all(|v| *v > 0.0));
    assert!((volumes.iter().sum::<f64>() - 3000.0).abs() < 1e-9);
}

/// Under x = A X + b the stretch is |A n0| and the fibre A n0 / |A n0|, whatever the mesh.
#[test]
fn muscle_points_carry_stretch_and_direction() {
    let model = model(&Trilinear);
    let a = [[1.1, 0.2, 0.0], [-0.1, 0.9, 0.05], [0.0, 0.1, 1.05]];
    let b = [3.0, -2.0, 1.0];
    let mut state = crumpled(&model);
    for (k, (u, x)) in state.u.iter_mut().zip(&model.mesh().parameters).enumerate() {
        let shift = if model.mesh().parameter_derivative[k] == 0 { b } else { [0.0; 3] };
        let moved = apply(&a, *x);
        *u = std::array::from_fn(|i| moved[i] + shift[i] - x[i]);
    }
    let folder = temporary();
    let run = run_in(&folder);
    View::new(&run).add(FRAME, &model, &state, &[]).expect("written");
    let vtu = Vtu::read(&run.view().join("muscles_0003.vtu"));
    let (points, fibre) = (vtu.vectors("Points"), vtu.vectors("fibre"));
    let (stretch, activation, muscle) = (vtu.scalars("stretch"), vtu.scalars("activation"), vtu.integers("muscle"));
    let all: Vec<_> =
        model.muscles().enumerate().flat_map(|(n, (_, m))| m.points().iter().map(move |p| (n, p))).collect();
    assert_eq!((vtu.points, vtu.cells, all.len()), (2 * 2 * 27, 2 * 2 * 27, 2 * 2 * 27));
    for (k, (number, point)) in all.into_iter().enumerate() {
        let v = apply(&a, point.fibre);
        let x = apply(&a, point.position);
        assert!((stretch[k] - norm(v)).abs() < 1e-12);
        assert!(norm(subtract(fibre[k], normalised(v))) < 1e-12);
        assert!(norm(subtract(points[k], std::array::from_fn(|i| x[i] + b[i]))) < 1e-8);
        assert_eq!((muscle[k], activation[k]), (number as i64, state.controls[number]));
    }
    let states = muscle_states(&model, &state, &evaluate(&model, &state));
    let first: f64 = vtu.scalars("volume_mm3").iter().zip(&stretch).take(54).map(|(w, s)| w * s).sum();
    assert!((states[0].mean_stretch - first / 420.0).abs() < 1e-12);
    assert!(states[1].min_stretch <= states[1].mean_stretch && states[1].mean_stretch <= states[1].max_stretch);
}

fn some_markers() -> [MarkerPair<'static>; 3] {
    [
        MarkerPair { name: "brow, left", model: [1.0, 2.0, 3.0], measured: Some([1.5, 2.0, 3.0]) },
        MarkerPair { name: "lost", model: [4.0, 5.0, 6.0], measured: None },
        MarkerPair { name: "chin", model: [0.1, 0.0, 0.0], measured: Some([0.1, 0.3, -0.4]) },
    ]
}

#[test]
fn marker_points_and_lists_of_frames() {
    let model = model(&Trilinear);
    let folder = temporary();
    let run = run_in(&folder);
    let mut view = View::new(&run);
    for index in 0..2 {
        let frame = Frame { index, time_s: 0.1 * index as f64 };
        view.add(frame, &model, &model.rest(), &some_markers()).expect("written");
    }
    let vtu = Vtu::read(&run.view().join("markers_0001.vtu"));
    assert_eq!(vtu.integers("measured"), [0, 0, 0, 1, 1]);
    assert_eq!(vtu.integers("marker"), [0, 1, 2, 0, 2]);
    assert_eq!(vtu.vectors("Points")[3..], [[1.5, 2.0, 3.0], [0.1, 0.3, -0.4]]);
    assert_eq!(vtu.vectors("residual_mm")[..3], [[0.5, 0.0, 0.0], [0.0; 3], [0.0, 0.3, -0.4]]);
    let distance = vtu.scalars("distance_mm");
    assert!(distance[1].is_nan() && (distance[2] - 0.5).abs() < 1e-15);
    for list in ["result.pvd", "linear/result.pvd", "muscles.pvd", "markers.pvd"] {
        let path = run.view().join(list);
        let text = fs::read_to_string(&path).expect("a list");
        let entries: Vec<&str> = text.lines().filter(|line| line.starts_with("<DataSet")).collect();
        assert_eq!(entries.len(), 2, "{list}");
        for (entry, time) in entries.iter().zip(["0.0", "0.1"]) {
            assert_eq!(attribute(entry, "timestep"), time);
            let file = path.with_file_name(attribute(entry, "file"));
            assert!(file.is_file(), "{}", file.display());
        }
    }
}

/// No block, one that is exactly full, and several.
#[test]
fn arrays_of_every_length_come_back() {
    let folder = temporary();
    for length in [0, 1, 32768, 32769, 100_000] {
        let mut random = Random(length as u64);
        let points: Vec<[f64; 3]> = (0..length).map(|_| [random.between(-1.0, 1.0), 0.0, 1.0]).collect();
        let values: Vec<f64> = points.iter().map(|p| p[0] * 3.0).collect();
        let grid = Grid::vertices(1.0, points.clone(), vec![Field::scalars("value", values.clone())]);
        let path = folder.path().join(format!("{length}.vtu"));
        grid.write(&path).expect("written");
        let vtu = Vtu::read(&path);
        assert!(vtu.vectors("Points") == points && vtu.scalars("value") == values, "{length}");
    }
}

// ---- tables -----------------------------------------------------------------------------------------------------

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
    let tail = columns("external_work_uj,det_f_min,det_f_max,torque_0_mn_mm,axial_force_0_mn");
    let head = columns("frame,time_s,tissue_uj");
    assert_eq!(rows[0], [&head[..], &muscles[..], &tail[..]].concat());
    let e = &found.evaluation;
    let reactions = model.supports().rotation_reactions(model.mesh(), &e.force, &x);
    let work_of_loads = model.external_work(&found.state);
    assert!(e.energies[0] > 0.0 && work_of_loads > 0.0 && reactions[0].0 != 0.0);
    let expected = [e.energies[0], e.energies[1], e.energies[2], work_of_loads, e.det_f.min, e.det_f.max];
    assert_eq!(numbers(&rows[1][2..]), [&expected[..], &[reactions[0].0, reactions[0].1]].concat());

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
    let expected = "frame,time_s,name,activation,stretch_mean,stretch_min,stretch_max,energy_uj";
    assert_eq!(rows[0], columns(expected));
    assert_eq!((rows.len(), rows[2][2].as_str(), numbers(&rows[2][3..4])), (3, MUSCLES[1], vec![0.01]));
    assert_eq!(numbers(&rows[2][7..]), [e.energies[2]]);

    ConvergenceTable::create(&run).and_then(|mut t| t.add(FRAME, &found.history)).expect("written");
    let rows = table("convergence");
    let expected = "frame,step,place,iteration,residual_mn,required_mn,damping,corrections";
    assert_eq!(rows[0], columns(expected));
    let iterations: usize = found.history.iter().map(|step| step.iterations.len()).sum();
    assert!(iterations > 1);
    assert_eq!(rows.len(), 1 + iterations + found.history.len());
    let last = numbers(&rows[rows.len() - 1][..6]);
    assert!(last[2] == 1.0 && last[4] <= last[5]);

    write_cost(&run, &model, &work, 0.5).expect("written");
    let rows = table("cost");
    assert_eq!(rows[0], columns("part,seconds,clock,points,count,flops"));
    let parts: Vec<&str> = rows[1..].iter().map(|row| row[0].as_str()).collect();
    let solver = ["assembly", "factorisation", "solve", "output"];
    assert_eq!(parts, [&["tissue", MUSCLES[0], MUSCLES[1], "traction"][..], &solver].concat());
    let evaluations = work.force_evaluations + work.assemblies;
    assert_eq!(rows[1][3], (evaluations * 6 * 64).to_string());
    assert_eq!(rows[6][4], work.linear.factorisations.to_string());
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

// ---- folder, status, manifest -----------------------------------------------------------------------------------

#[test]
fn run_folders_are_numbered_and_shared_by_nobody() {
    let folder = temporary();
    let runs = folder.path().join("deep/runs");
    let names = || -> HashSet<String> {
        let entries = fs::read_dir(&runs).expect("runs").map(|e| e.expect("an entry").file_name());
        entries.map(|name| name.to_string_lossy().into_owned()).collect()
    };
    let first = RunFolder::create(&runs, "smile").expect("made");
    assert_eq!(first.path(), runs.join("smile-0001"));
    assert!(first.tables().is_dir() && first.view().join("linear").is_dir());
    fs::create_dir(runs.join("smile-0007")).expect("made");
    assert_eq!(RunFolder::create(&runs, "smile").expect("made").path(), runs.join("smile-0008"));
    assert_eq!(RunFolder::create(&runs, "smil").expect("made").path(), runs.join("smil-0001"));
    for (name, expected) in [("../a/b", "_._a_b-0001"), ("", "run-0001"), ("né:e", "né_e-0001")] {
        assert_eq!(RunFolder::create(&runs, name).expect("made").path(), runs.join(expected));
    }
    let before = names().len();
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| RunFolder::create(&runs, "smile").expect("made"));
        }
    });
    assert_eq!(names().len(), before + 8);
}

#[test]
fn a_folder_in_use_needs_force_and_keeps_what_is_not_ours() {
    let folder = temporary();
    let out = folder.path().join("out");
    let run = RunFolder::create_at(&out, false).expect("made");
    let Err(error) = RunFolder::create_at(&out, false) else { panic!("a folder in use was taken") };
    assert!(matches!(&error, Error::FolderNotEmpty { entries: 2, .. }), "{error}");
    assert_eq!((error.code(), error.exit_code()), ("O002", 6));
    assert!(error.help().is_some_and(|help| help.contains("--force")));

    // not a run: everything stays
    fs::write(run.tables().join("mine.csv"), "mine").expect("written");
    RunFolder::create_at(&out, true).expect("taken");
    assert!(run.tables().join("mine.csv").is_file());
    // a run: its shapes go, so that no frame of it is taken for one of the next run
    Status::finished(1, Vec::new()).write(&run).expect("written");
    fs::write(run.view().join("result_0009.vtu"), "old").expect("written");
    fs::write(out.join("notes.txt"), "mine").expect("written");
    RunFolder::create_at(&out, true).expect("taken");
    assert!(!run.view().join("result_0009.vtu").exists() && run.view().join("linear").is_dir());
    assert!(out.join("notes.txt").is_file());
}

#[test]
fn what_cannot_be_written_says_where() {
    let folder = temporary();
    // a file where a folder should be
    let file = folder.path().join("file");
    fs::write(&file, "").expect("written");
    let Err(error) = RunFolder::create(&file, "smile") else { panic!("made a folder in a file") };
    assert!(matches!(&error, Error::Io { action: "create", path, .. } if *path == file), "{error}");
    assert_eq!(error.exit_code(), 6);

    let locked = folder.path().join("locked");
    fs::create_dir(&locked).expect("made");
    let mut permissions = fs::metadata(&locked).expect("there").permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&locked, permissions).expect("set");
    // root writes anyway
    if fs::write(locked.join("probe"), "").is_err() {
        let Err(error) = RunFolder::create(&locked, "smile") else { panic!("wrote into a locked folder") };
        assert!(matches!(&error, Error::Io { action: "create", .. }) && error.to_string().contains("smile-0001"));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error_and_not_a_short_file() {
    let folder = temporary();
    let run = run_in(&folder);
    // every write to /dev/full fails as on a full disk
    std::os::unix::fs::symlink("/dev/full", run.tables().join("probes.csv")).expect("linked");
    let Err(error) = ProbeTable::create(&run) else { panic!("wrote to a full disk") };
    assert!(matches!(&error, Error::Io { action: "write", path, .. } if path.ends_with("tables/probes.csv")));
    std::os::unix::fs::symlink("/dev/full", run.path().join("status.json.part")).expect("linked");
    let Err(error) = Status::running(0, Vec::new()).write(&run) else { panic!("wrote to a full disk") };
    assert!(matches!(&error, Error::Io { action: "write", path, .. } if path.ends_with("status.json")));
    assert!(!run.path().join("status.json").exists() && !run.path().join("status.json.part").exists());
}

#[test]
fn files_are_replaced_whole_or_not_at_all() {
    let folder = temporary();
    let path = folder.path().join("file.txt");
    write_atomically(&path, b"first").expect("written");
    write_atomically(&path, b"second").expect("written");
    assert_eq!(fs::read(&path).expect("there"), b"second");
    // the name is taken by a folder: the rename fails, and nothing is left lying about
    let taken = folder.path().join("taken");
    fs::create_dir_all(taken.join("full")).expect("made");
    let Err(error) = write_atomically(&taken, b"third") else { panic!("a file replaced a folder") };
    assert!(matches!(error, Error::Io { action: "rename", .. }));
    assert_eq!(fs::read_dir(folder.path()).expect("there").count(), 2);
    // readers of a file that is rewritten all the time never see a part of it
    let texts = ["a".repeat(100_000), "b".repeat(50_000)];
    write_atomically(&path, texts[0].as_bytes()).expect("written");
    std::thread::scope(|scope| {
        let writer = scope.spawn(|| {
            (0..200).for_each(|k| write_atomically(&path, texts[k % 2].as_bytes()).expect("written"));
        });
        while !writer.is_finished() {
            let found = fs::read_to_string(&path).expect("there");
            assert!(texts.contains(&found), "{} bytes", found.len());
        }
    });
}

#[test]
fn status_says_how_a_run_ended() {
    let folder = temporary();
    let run = run_in(&folder);
    let read = || -> Status {
        serde_json::from_slice(&fs::read(run.path().join("status.json")).expect("there")).expect("JSON")
    };
    Status::running(0, Vec::new()).write(&run).expect("written");
    assert_eq!((read().status, read().exit), (Outcome::Running, None));
    let error = Error::InaccurateSolve { residual: 1e-3, required: 1e-9 };
    let failed = || vec![FailedFrame::new(7, &error)];
    Status::finished(11, failed()).write(&run).expect("written");
    let text: serde_json::Value =
        serde_json::from_slice(&fs::read(run.path().join("status.json")).expect("there")).expect("JSON");
    let frame = serde_json::json!({"frame": 7, "code": "S004", "message": error.to_string()});
    let expected = serde_json::json!({"status": "partial", "exit": 4, "frames_ok": 11, "frames_failed": [frame]});
    assert_eq!(text, expected);
    for (status, word, exit) in [
        (Status::finished(3, Vec::new()), "converged", 0),
        (Status::finished(0, failed()), "failed", 4),
        (Status::interrupted(2, Vec::new()), "interrupted", 130),
        (Status::failed(2, Vec::new(), &error), "failed", 4),
    ] {
        assert_eq!(status.exit, Some(exit));
        assert_eq!(serde_json::to_value(status.status).expect("JSON"), word);
        status.write(&run).expect("written");
        assert_eq!(read(), status);
    }
    assert_eq!(read().error.expect("what went wrong").code, "S004");
}

#[test]
fn manifest_tells_one_input_from_another_and_what_was_done() {
    let folder = temporary();
    let run = run_in(&folder);
    let path = folder.path().join("problem.toml");
    fs::write(&path, "abc").expect("written");
    let input = Input::read(&path).expect("read");
    // FIPS 180-2, B.1
    assert_eq!(input.sha256, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    assert_eq!(input.bytes, 3);
    let model = model(&Trilinear);
    let work = Work { iterations: 5, ..Work::default() };
    let command = ["risorius", "run", "a b.toml"].map(String::from).to_vec();
    Manifest::now(command, vec![input], 2, Some(&model), &work, 1.5).write(&run).expect("written");
    let text = fs::read(run.path().join("manifest.json")).expect("there");
    let read: serde_json::Value = serde_json::from_slice(&text).expect("JSON");
    assert_eq!(read["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(read["command"][2], "a b.toml");
    assert_eq!(read["numerics"]["elements"], 6);
    assert_eq!(read["numerics"]["pressures"], 24);
    assert_eq!(read["numerics"]["unknowns"], model.numbering().unknowns());
    assert_eq!(read["work"]["newton_iterations"], 5);
    assert_eq!(read["wall_seconds"], 1.5);
    if cfg!(target_os = "linux") {
        assert!(read["peak_memory_bytes"].as_u64().is_some_and(|bytes| (1 << 20..1 << 40).contains(&bytes)));
        assert!(read["cpu_seconds"].as_f64().is_some_and(|seconds| (0.0..1e5).contains(&seconds)));
    }
}

// ---- summary ----------------------------------------------------------------------------------------------------

#[test]
fn forward_summary_shows_the_last_frame() {
    let model = model(&Trilinear);
    let (found, work) = solved(&model);
    let probes = [Probe { name: "tip".into(), at: MaterialPoint { element: 5, xi: [1.0; 3] } }];
    let probes = probe_states(&probes, &model, &found.state);
    let muscles = muscle_states(&model, &found.state, &found.evaluation);
    let summary = ForwardSummary {
        name: "bend",
        frames_ok: 2,
        frames_failed: 1,
        frame: FRAME,
        probes: &probes,
        muscles: &muscles,
        tissue_energy: found.evaluation.energies[0],
        external_work: model.external_work(&found.state),
        reactions: &[(12.5, -3.25)],
        det_f: found.evaluation.det_f,
        iterations: work.iterations,
        seconds: 1.234,
        folder: "runs/bend-0001",
    };
    let text = summary.to_string();
    println!("{text}");
    for part in [
        "bend: 2 frames in equilibrium, 1 frame NOT CONVERGED",
        "rotation 0: torque 12.5000 mN mm, axial force -3.2500 mN",
        &format!("{:.4}", probes[0].displacement[2]),
        &format!("{:.4}", muscles[1].mean_stretch),
        "runs/bend-0001/view/result.pvd",
    ] {
        assert!(text.contains(part), "{part} is not in\n{text}");
    }
}

#[test]
fn fit_summary_marks_bounds_and_the_worst_markers() {
    let mut errors = MarkerErrors::default();
    errors.add(FRAME, &some_markers());
    errors.add(Frame { index: 4, time_s: 0.4 }, &some_markers()[..1]);
    assert_eq!((errors.all.count, errors.all.max_mm), (3, 0.5));
    assert!((errors.all.rms_mm().expect("measured") - 0.5).abs() < 1e-15);
    let fitted = |index: usize, values: [f64; 2]| FittedFrame {
        frame: Frame { index, time_s: 0.1 * index as f64 },
        values: values.into(),
        deviations: vec![Some(0.0123), None],
        bounds: vec![Bound::Free, Bound::Lower],
    };
    let frames = [fitted(3, [0.5, 0.0]), fitted(4, [0.75, 0.0]), fitted(5, [0.25, 0.0])];
    let mut summary = FitSummary {
        name: "smile",
        controls: &MUSCLES,
        frames: &frames[..1],
        frames_failed: 0,
        errors: &errors,
        iterations: 1,
        seconds: 2.0,
        folder: "runs/smile-0001",
    };
    let one = summary.to_string();
    println!("{one}");
    for part in ["0.5000  0.0123", "0.0000       -  at its lower bound", "rms 0.500 mm, max 0.500 mm", "brow, left"] {
        assert!(one.contains(part), "{part} is not in\n{one}");
    }
    assert!(!one.contains("lost"));
    summary.frames = &frames;
    let clip = summary.to_string();
    println!("{clip}");
    let line = clip.lines().find(|line| line.contains(MUSCLES[0])).expect("a row");
    let cells: Vec<&str> = line.split_whitespace().skip(2).collect();
    assert_eq!(cells, ["0.2500", "0.7500", "0.0123", "4", "0", "0"]);
    let line = clip.lines().find(|line| line.contains(MUSCLES[1])).expect("a row");
    let cells: Vec<&str> = line.split_whitespace().skip(3).collect();
    assert_eq!(cells, ["0.0000", "0.0000", "-", "3", "3", "0"]);
}
