//! Seconds and GFlop/s of every stage: `cargo run --release --example benchmark`.
//!
//! Prints, for the slab beam and for a 28 x 20 x 1 block of the size of a whole face, the time of an assembly, a
//! factorisation and solves, beside the machine's own dense matrix product of the same minute; and the time per frame of
//! the default fit. Medians of repeated runs on all threads of the pool; compare ratios, not absolute times.

use risorius::fit::Fit;
use risorius::forward::{Drive, Solver};
use risorius::markers::{ReadOptions, read};
use risorius::math::factor::{Factor, Precision};
use risorius::model::build::build;
use risorius::model::{Model, Workspace};
use risorius::scene::Scene;
use risorius::term::Want;
use std::path::Path;
use std::time::Instant;

const SLAB: &str = r#"
[task]
kind = "forward"
[mesh]
block = { origin_mm = [0, 0, 0], size_mm = [60, 20, 20], elements = [6, 2, 2] }
[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
gauss = 4
[[muscle]]
name = "slab"
block = { origin_mm = [4.5, 2.0, 14.2], size_mm = [50, 16, 4], elements = [5, 2, 1] }
fibre_angles_deg = [0, 0, 0]
blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }
[[support]]
clamp = { face = "xi1=0" }
[controls]
slab = 0.05
"#;

const FACE_SIZED: &str = r#"
[task]
kind = "forward"
[mesh]
block = { origin_mm = [0, 0, 0], size_mm = [140, 200, 8], elements = [20, 28, 1] }
[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
gauss = 4
[[muscle]]
name = "strap"
block = { origin_mm = [40, 40, 2], size_mm = [60, 10, 3], elements = [12, 2, 1] }
fibre_angles_deg = [0, 0, 0]
blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }
[[support]]
clamp = { face = "xi2=0" }
[controls]
strap = 0.01
"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("threads {}", rayon::current_num_threads());
    stages("slab beam, 6 x 2 x 2 elements", SLAB)?;
    stages("block of 20 x 28 x 1 elements", FACE_SIZED)?;
    fitted_frames()
}

/// Times the frames of the default fit.
fn fitted_frames() -> Result<(), Box<dyn std::error::Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("problems/beam/problem.toml");
    let scene = Scene::read(&path, &[])?;
    let spec = scene.fit.as_ref().ok_or("problems/beam is a fit")?;
    let model = build(&scene)?.model;
    let recording =
        read(&spec.markers, &ReadOptions { units: spec.units.unwrap_or_default(), ..ReadOptions::default() })?;
    let mut fit = Fit::new(&model, &scene, spec, &recording)?;
    let mut seconds = Vec::new();
    let mut factorisations = Vec::new();
    for k in 0..recording.frames.len() {
        let before = fit.work().linear.factorisations;
        let start = Instant::now();
        fit.frame(&recording, k)?;
        seconds.push(start.elapsed().as_secs_f64());
        factorisations.push(fit.work().linear.factorisations - before);
    }
    seconds.sort_by(f64::total_cmp);
    factorisations.sort_unstable();
    let half = seconds.len() / 2;
    println!(
        "\ndefault fit: {} frames, {} controls, {} markers",
        seconds.len(),
        model.controls().len(),
        scene.markers.len()
    );
    println!(
        "  a frame, median                      {:8.2} ms   {} factorisations",
        1e3 * seconds[half],
        factorisations[half]
    );
    println!("  the slowest                          {:8.2} ms", 1e3 * seconds[seconds.len() - 1]);
    Ok(())
}

/// Times every stage of one Newton iteration at the equilibrium of a scene.
fn stages(name: &str, text: &str) -> Result<(), Box<dyn std::error::Error>> {
    let scene = Scene::parse(text, name, Path::new("."), &[])?;
    let (model, build_seconds) = {
        let start = Instant::now();
        (build(&scene)?.model, start.elapsed().as_secs_f64())
    };
    let mut solver = Solver::new(&model, Default::default())?;
    let mut controls = vec![0.0; model.controls().len()];
    for control in &scene.controls {
        let own = model.controls_of(&control.name);
        for (k, value) in own.iter().zip(control.value.constants(own.len()).unwrap_or_default()) {
            controls[*k] = value;
        }
    }
    let start = Instant::now();
    let found = solver.equilibrium(&model.rest(), &Drive { controls, load: 1.0 }).map_err(risorius::Error::from)?;
    let solve_seconds = start.elapsed().as_secs_f64();
    let work = solver.work();

    let gemm = gemm_rate();
    let mut workspace = Workspace::default();
    let force = median(9, || drop(model.evaluate(&found.state, Want::Force, None, &mut workspace)));
    let stiffness = median(9, || drop(model.evaluate(&found.state, Want::Stiffness, None, &mut workspace)));
    let mut tangent = model.tangent();
    let assemble = median(9, || model.assemble(&workspace, &mut tangent));
    let factored = |precision: Precision| -> risorius::Result<(Factor, f64)> {
        let mut factor = Factor::new(model.symbolic().clone(), precision)?;
        factor.refactor(&tangent.matrix)?;
        let mut failed = None;
        let seconds = median(5, || failed = factor.refactor(&tangent.matrix).err());
        failed.map_or(Ok((factor, seconds)), Err)
    };
    let (mut factor, factorise) = factored(Precision::Double)?;
    let (mut single, factorise_single) = factored(Precision::Single)?;
    let n = model.numbering().unknowns();
    let solve = |columns: usize, factor: &mut Factor| {
        median(5, || {
            let mut rhs: Vec<f64> = (0..n * columns).map(|k| ((k * 7919 % 1000) as f64) / 1000.0 - 0.5).collect();
            drop(factor.solve(&tangent.matrix, &mut rhs, columns, 1e-12));
        })
    };
    let (one, thirty) = (solve(1, &mut factor), solve(30, &mut factor));
    let one_single = solve(1, &mut single);
    let flops = model.factor_flops();

    let sizes = |model: &Model| (model.mesh().elements(), model.mesh().nodes, model.numbering().unknowns());
    let (elements, nodes, unknowns) = sizes(&model);
    println!(
        "\n{name}: {elements} elements, {nodes} nodes, {unknowns} unknowns, {:.2} M entries of the factor",
        model.symbolic().factor_nnz() as f64 / 1e6
    );
    println!("  dense product of this minute         {gemm:8.1} GFlop/s");
    println!("  build: mesh, points, ordering        {:8.1} ms", 1e3 * build_seconds);
    println!(
        "  force of all elements                {:8.2} ms   {:6.1} us per element",
        1e3 * force,
        1e6 * force / elements as f64
    );
    println!(
        "  stiffness of all elements            {:8.2} ms   {:6.1} us per element",
        1e3 * stiffness,
        1e6 * stiffness / elements as f64
    );
    println!("  scatter into the matrix              {:8.2} ms", 1e3 * assemble);
    println!(
        "  factorisation                        {:8.2} ms   {:6.1} GFlop/s, {:.2} Gflop",
        1e3 * factorise,
        flops / factorise / 1e9,
        flops / 1e9
    );
    println!(
        "  the same in single precision         {:8.2} ms   {:6.2} of it",
        1e3 * factorise_single,
        factorise_single / factorise
    );
    println!("  solve, 1 right-hand side             {:8.2} ms", 1e3 * one);
    println!("  solve with the one in single         {:8.2} ms", 1e3 * one_single);
    println!(
        "  solve, 30 right-hand sides           {:8.2} ms   {:6.2} of a factorisation",
        1e3 * thirty,
        thirty / factorise
    );
    println!(
        "  one Newton iteration                 {:8.2} ms",
        1e3 * (stiffness + assemble + factorise + one + force)
    );
    println!(
        "  equilibrium from rest                {:8.2} s    {} iterations, {} factorisations, {} force evaluations",
        solve_seconds, work.iterations, work.linear.factorisations, work.force_evaluations
    );
    Ok(())
}

/// GFlop/s of a dense product of 512 x 512 matrices, the multiplication and the addition counted.
fn gemm_rate() -> f64 {
    use faer::Mat;
    let n = 512;
    let a = Mat::from_fn(n, n, |i, j| ((i * 31 + j * 17) % 13) as f64);
    let b = Mat::from_fn(n, n, |i, j| ((i * 7 + j * 29) % 11) as f64);
    let mut c: Mat<f64> = Mat::zeros(n, n);
    let seconds = median(7, || {
        faer::linalg::matmul::matmul(c.as_mut(), faer::Accum::Replace, a.as_ref(), b.as_ref(), 1.0, faer::Par::Seq);
    });
    2.0 * (n * n * n) as f64 / seconds / 1e9
}

/// Median wall time of `runs` calls after one that is not counted, s.
fn median(runs: usize, mut f: impl FnMut()) -> f64 {
    f();
    let mut seconds: Vec<f64> = (0..runs)
        .map(|_| {
            let start = Instant::now();
            f();
            start.elapsed().as_secs_f64()
        })
        .collect();
    seconds.sort_by(f64::total_cmp);
    seconds[runs / 2]
}
