//! Fibre angles from a million measured axes on a bent tricubic mesh of 560 elements: what each part takes, and the memory.
//!
//! `cargo run --release --example million_axes [trilinear|tricubic] [axes]`

use risorius::fibres::{data, fit};
use risorius::mesh::block::block;
use risorius::mesh::element::TricubicHermite;
use risorius::mesh::exf::write_mesh;
use risorius::report::machine::{cpu_seconds, peak_memory_bytes};
use risorius::scene::{Problem, Units};
use std::fmt::Write;
use std::time::Instant;

const SIZE_MM: [f64; 3] = [100.0, 80.0, 35.0];

/// Bends the block: x and z turn about an axis along y, by 57 degrees from end to end.
fn bent([x, y, z]: [f64; 3]) -> [f64; 3] {
    let (angle, radius) = ((x - 50.0) / 100.0, 100.0 + z);
    [radius * angle.sin(), y, radius * angle.cos()]
}

/// The derivatives of [`bent`] by x, z, and both.
fn derivatives([x, _, z]: [f64; 3]) -> [[f64; 3]; 3] {
    let (angle, radius) = ((x - 50.0) / 100.0, 100.0 + z);
    let ((s, c), rate) = (angle.sin_cos(), 0.01);
    [[radius * rate * c, 0.0, -radius * rate * s], [s, 0.0, c], [rate * c, 0.0, -rate * s]]
}

/// Uniform in [0, 1).
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*state >> 11) as f64 / (1_u64 << 53) as f64
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let count: usize = std::env::args().nth(2).map_or(Ok(1_000_000), |count| count.parse())?;
    let field = if std::env::args().nth(1).as_deref() == Some("tricubic") { "tricubic" } else { "trilinear" };
    let elements = [10, 8, 7];
    let mut mesh = block(&TricubicHermite, [0.0; 3], SIZE_MM, elements);
    let step: [f64; 3] = std::array::from_fn(|d| SIZE_MM[d] / elements[d] as f64);
    for node in mesh.parameters.chunks_exact_mut(8) {
        let x = node[0];
        let [by_x, by_z, by_both] = derivatives(x);
        node[0] = bent(x);
        node[1] = by_x.map(|v| v * step[0]);
        node[4] = by_z.map(|v| v * step[2]);
        node[5] = by_both.map(|v| v * step[0] * step[2]);
    }
    let folder = std::env::temp_dir().join("risorius-million-axes");
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join("body.exf"), write_mesh(&mesh, &[("coordinates", &mesh.parameters)]))?;
    // a helix through the thickness and a fan, with 10 degrees of noise
    let (mut state, mut text) = (7, String::from("x,y,z,vx,vy,vz\n"));
    for _ in 0..count {
        let at = SIZE_MM.map(|size| size * random(&mut state));
        let a = (60.0 * (at[2] / 35.0 - 0.5) + 0.4 * (at[1] - 40.0)).to_radians();
        let noise = |state: &mut u64| 0.35 * (random(state) + random(state) + random(state) - 1.5);
        let [along, up, _] = derivatives(at);
        let (p, q, r) = (a.cos() + noise(&mut state), a.sin() + noise(&mut state), noise(&mut state));
        let along = along.map(|v| v / (1.0 + 0.01 * at[2]));
        let v: [f64; 3] = std::array::from_fn(|i| p * along[i] + r * up[i] + if i == 1 { q } else { 0.0 });
        let [x, y, z] = bent(at);
        writeln!(text, "{x:.4},{y:.4},{z:.4},{:.4},{:.4},{:.4}", v[0], v[1], v[2])?;
    }
    std::fs::write(folder.join("axes.csv"), text)?;
    let toml = format!(
        "[task]\nkind = \"fibres\"\n[mesh]\nexf = \"body.exf\"\n[fibres]\nfield = \"{field}\"\nangles = [\"A\", \"B\"]\n\
         outside = {{ project_mm = 0.5 }}\n[[fibres.data]]\nfile = \"axes.csv\"\nunits = \"{}\"\n",
        Units::Mm.name()
    );
    std::fs::write(folder.join("problem.toml"), toml)?;

    let (start, cpu) = (Instant::now(), cpu_seconds());
    let Problem::Fibres(problem) = Problem::read(&folder.join("problem.toml"), &[])? else { unreachable!() };
    let (mesh, names, _) = risorius::fibres::mesh(&problem.body)?;
    let axes = data::read(&problem.data)?;
    println!(
        "{:>8.2} s  read {} axes and {} elements",
        start.elapsed().as_secs_f64(),
        axes.all.len(),
        mesh.elements()
    );
    let found = fit(&problem, &mesh, &names, &axes.all)?;
    for (what, seconds) in &found.stages {
        println!("{seconds:>8.2} s  {what}");
    }
    let spent = cpu_seconds().zip(cpu).map_or(f64::NAN, |(now, then)| now - then);
    println!(
        "{:>8.2} s  in all, {spent:.2} s of processors; {:.0} MB at most; {field}, median error {:.2} degrees, held out {:.2}, {} steps, {} \
         outside",
        start.elapsed().as_secs_f64(),
        peak_memory_bytes().map_or(f64::NAN, |bytes| bytes as f64 / 1e6),
        found.spread.median.to_degrees(),
        found.held_out.map_or(f64::NAN, |spread| spread.median.to_degrees()),
        found.steps,
        found.outside.count
    );
    Ok(())
}
