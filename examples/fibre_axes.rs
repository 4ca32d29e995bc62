//! Writes the measured directions of `problems/fibres`: axes and traces of a fan-shaped muscle with noise, outliers and a
//! part without data. Seeded: the same
//! files every time.

use std::fmt::Write;
use std::path::Path;

/// The fibre of the fan at a point, mm: towards (95, 20), 30 degrees from side to side through the thickness, tipped by 6.
fn fibre([x, y, z]: [f64; 3]) -> [f64; 3] {
    let a = (20.0 - y).atan2(95.0 - x) + (30.0 * (z / 8.0 - 0.5)).to_radians();
    let b = 6.0_f64.to_radians();
    [b.cos() * a.cos(), b.cos() * a.sin(), -b.sin()]
}

/// Uniform in [0, 1).
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*state >> 11) as f64 / (1_u64 << 53) as f64
}

fn normal(state: &mut u64) -> f64 {
    (0..12).map(|_| random(state)).sum::<f64>() - 6.0
}

fn main() -> std::io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("problems/fibres");
    let mut state = 2013;
    let mut axes = "x,y,z,vx,vy,vz\n".to_string();
    for _ in 0..2000 {
        let x = [60.0, 40.0, 8.0].map(|size| size * random(&mut state));
        // nothing was measured in a corner
        if x[0] > 38.0 && x[1] > 18.0 {
            continue;
        }
        let n = fibre(x);
        let sd = 8.0_f64.to_radians();
        let mut v = n.map(|c| c + sd * normal(&mut state));
        if random(&mut state) < 0.15 {
            v = std::array::from_fn(|_| 2.0 * random(&mut state) - 1.0);
        }
        if random(&mut state) < 0.5 {
            v = v.map(|c| -c);
        }
        writeln!(axes, "{:.2},{:.2},{:.2},{:.3},{:.3},{:.3}", x[0], x[1], x[2], v[0], v[1], v[2])
            .map_err(std::io::Error::other)?;
    }
    // fascicles on the upper surface, drawn by hand as it were
    let mut traces = "trace,x,y,z\n".to_string();
    for trace in 1..=8 {
        let mut x = [1.0, 2.0 + 4.0 * f64::from(trace), 7.9];
        while x[0] < 59.0 && x[1] > 0.0 && x[1] < 40.0 && !(x[0] > 38.0 && x[1] > 18.0) {
            let shaken = [x[0], x[1] + 0.15 * normal(&mut state)];
            writeln!(traces, "{trace},{:.2},{:.2},{:.2}", shaken[0], shaken[1], x[2])
                .map_err(std::io::Error::other)?;
            let n = fibre(x);
            x = [x[0] + 3.0 * n[0], x[1] + 3.0 * n[1], x[2]];
        }
    }
    std::fs::write(folder.join("axes.csv"), axes)?;
    std::fs::write(folder.join("traces.csv"), traces)
}
