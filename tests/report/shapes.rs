//! VTU: are the cells the elements, and do all arrays come back?

use super::model::{Random, crumpled, model};
use super::support::{FRAME, run_in, some_markers, temporary};
use super::vtu_reader::{Vtu, attribute};
use risorius::forward::evaluate;
use risorius::math::tensor::{apply, determinant, norm, normalised, subtract};
use risorius::mesh::{MaterialPoint, position_and_jacobian};
use risorius::model::Model;
use risorius::report::vtu::{Field, Grid};
use risorius::report::{Frame, View, muscle_states};
use risorius::term::pressure::{DiscontinuousTrilinear, PRESSURE_SPACES, Trilinear};
use std::fs;

/// The 64 points of a cubic Bezier hexahedron as VTK orders them: i, j, k of each.
const DOCUMENTED_ORDER: &str = "
    000 300 330 030 003 303 333 033
    100 200 310 320 130 230 010 020 103 203 313 323 133 233 013 023 001 002 301 302 331 332 031 032
    011 021 012 022 311 321 312 322 101 201 102 202 131 231 132 232 110 210 120 220 113 213 123 223
    111 211 121 221 112 212 122 222";

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
        View::new(&run).add(FRAME, &model, &state, &[], &[]).expect("written");
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
    View::new(&run).add(FRAME, &model, &state, &[], &[]).expect("written");
    let vtu = Vtu::read(&run.view().join("linear/result_0003.vtu"));
    assert_eq!((vtu.points, vtu.cells), (27 * 6, 8 * 6));
    assert!(vtu.types().iter().all(|kind| *kind == 12));

    let x = model.current(&state);
    let (points, dets, pressure) = (vtu.vectors("Points"), vtu.scalars("det_f"), vtu.scalars("pressure_kpa"));
    let elements = vtu.integers("element");
    for (cell, element) in elements.into_iter().enumerate() {
        let element = element as usize;
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
    View::new(&run).add(FRAME, &model, &state, &[], &[]).expect("written");
    let vtu = Vtu::read(&run.view().join("muscles_0003.vtu"));
    let (points, fibre) = (vtu.vectors("Points"), vtu.vectors("fibre"));
    let (stretch, activation, muscle) = (vtu.scalars("stretch"), vtu.scalars("activation"), vtu.integers("muscle"));
    let tension = vtu.scalars("tension_kpa");
    let laws: Vec<_> = model.muscles().map(|(_, muscle)| muscle.law()).collect();
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
        // sigma_max f(s) / lambda_ofl, from the law by hand: its energy changes by it per stretch
        let law = laws[number];
        let energy = |stretch: f64| law.tension(stretch, activation[k]).energy;
        let slope = (energy(norm(v) + 1e-5) - energy(norm(v) - 1e-5)) / 2e-5;
        assert!((tension[k] - slope).abs() < 1e-5 * (1.0 + slope.abs()), "{} {slope}", tension[k]);
    }
    let states = muscle_states(&model, &state, &evaluate(&model, &state));
    let first: f64 = vtu.scalars("volume_mm3").iter().zip(&stretch).take(54).map(|(w, s)| w * s).sum();
    assert!((states[0].mean_stretch - first / 420.0).abs() < 1e-12);
    assert!(states[1].min_stretch <= states[1].mean_stretch && states[1].mean_stretch <= states[1].max_stretch);
}

#[test]
fn marker_points_and_lists_of_frames() {
    let model = model(&Trilinear);
    let folder = temporary();
    let run = run_in(&folder);
    let mut view = View::new(&run);
    for index in 0..2 {
        let frame = Frame { index, time_s: 0.1 * index as f64 };
        view.add(frame, &model, &model.rest(), &some_markers(), &[]).expect("written");
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
        // the same in JSON
        let series = fs::read_to_string(path.with_extension("vtu.series")).expect("a series");
        let series: serde_json::Value = serde_json::from_str(&series).expect("JSON");
        assert_eq!(series["file-series-version"], "1.0");
        for (number, (entry, time)) in entries.iter().zip([0.0, 0.1]).enumerate() {
            let file = &series["files"][number];
            assert_eq!((file["name"].as_str(), file["time"].as_f64()), (Some(attribute(entry, "file")), Some(time)));
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
