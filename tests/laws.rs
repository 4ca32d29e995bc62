//! Every law of the tissue and the law of the fibres: at rest, derivatives, frame indifference, symmetry.

use crate::common::{Random, assert_close, product};
use num_dual::{DualNum, HyperDual64};
use risorius::material::fibre::{Blemker, active};
use risorius::material::{Guccione, Law, MooneyRivlin, NeoHookean, PAIRS};
use risorius::math::lanes::{Lanes, MatrixLanes, WIDTH};
use risorius::math::tensor::{IDENTITY, Matrix, Vector, cross, determinant, normalised};

type DualMatrix = [[HyperDual64; 3]; 3];

/// A law and what its tests need to know about it.
struct Case {
    law: Box<dyn Law>,
    /// psi(F) once more, in dual numbers, straight from its formula.
    energy: fn(&DualMatrix) -> HyperDual64,
    /// The direction of the fibres; without any psi(F Q) = psi(F).
    fibre: Option<Vector>,
}

/// Fibres along no axis.
const FIBRE: Vector = [0.48, -0.6, 0.64];

/// Every tissue law there is.
fn cases() -> Vec<Case> {
    let guccione = |fibre: Vector| Box::new(Guccione::new(2.0, 8.0, 2.0, 4.0, fibre));
    vec![
        Case { law: Box::new(MooneyRivlin { c1: 0.5, c2: 0.2 }), energy: mooney_rivlin, fibre: None },
        Case { law: Box::new(NeoHookean { mu: 1.3 }), energy: neo_hookean, fibre: None },
        Case { law: guccione(FIBRE.map(|c| 3.0 * c)), energy: guccione_along::<true>, fibre: Some(FIBRE) },
        Case { law: guccione([1.0, 0.0, 0.0]), energy: guccione_along::<false>, fibre: Some([1.0, 0.0, 0.0]) },
    ]
}

/// mu/2 (J^(-2/3) tr C - 3)
fn neo_hookean(f: &DualMatrix) -> HyperDual64 {
    let trace: HyperDual64 = f.iter().flatten().map(|f| *f * *f).sum();
    let minor = |i: usize, j: usize| f[1][i] * f[2][j] - f[1][j] * f[2][i];
    let det = f[0][0] * minor(1, 2) - f[0][1] * minor(0, 2) + f[0][2] * minor(0, 1);
    (det.powf(-2.0 / 3.0) * trace - 3.0) * 0.65
}

/// c/2 (exp Q - 1) without axes: Q = bf (n.En)^2 + bt (tr E^2 - 2 |En|^2 + (n.En)^2) + 2 bfs (|En|^2 - (n.En)^2)
fn guccione_along<const OBLIQUE: bool>(f: &DualMatrix) -> HyperDual64 {
    let n = if OBLIQUE { FIBRE } else { [1.0, 0.0, 0.0] };
    let strain: DualMatrix = std::array::from_fn(|p| {
        std::array::from_fn(|q| {
            let c = f[0][p] * f[0][q] + f[1][p] * f[1][q] + f[2][p] * f[2][q];
            (c - if p == q { 1.0 } else { 0.0 }) * 0.5
        })
    });
    let along = strain.map(|row| row[0] * n[0] + row[1] * n[1] + row[2] * n[2]);
    let fibre = along[0] * n[0] + along[1] * n[1] + along[2] * n[2];
    let (fibre, along) = (fibre * fibre, along[0] * along[0] + along[1] * along[1] + along[2] * along[2]);
    let all: HyperDual64 = strain.iter().flatten().map(|e| *e * *e).sum();
    let q = fibre * 8.0 + (all - along * 2.0 + fibre) * 2.0 + (along - fibre) * 8.0;
    q.exp() - 1.0
}

/// c1 (J^(-2/3) tr C - 3) + c2 (J^(-4/3) ((tr C)^2 - tr C^2)/2 - 3)
fn mooney_rivlin(f: &DualMatrix) -> HyperDual64 {
    let c: DualMatrix =
        std::array::from_fn(|p| std::array::from_fn(|q| f[0][p] * f[0][q] + f[1][p] * f[1][q] + f[2][p] * f[2][q]));
    let trace = c[0][0] + c[1][1] + c[2][2];
    let of_square: HyperDual64 = (0..9).map(|k| c[k / 3][k % 3] * c[k % 3][k / 3]).sum();
    let minor = |i: usize, j: usize| f[1][i] * f[2][j] - f[1][j] * f[2][i];
    let det = f[0][0] * minor(1, 2) - f[0][1] * minor(0, 2) + f[0][2] * minor(0, 1);
    let second = (trace * trace - of_square) * 0.5;
    (det.powf(-2.0 / 3.0) * trace - 3.0) * 0.5 + (det.powf(-4.0 / 3.0) * second - 3.0) * 0.2
}

/// psi, P as 9 and A as 81 numbers: P[3 i + J], A[9 (3 i + J) + 3 k + L].
struct Derivatives {
    energy: f64,
    stress: Vec<f64>,
    tangent: Vec<f64>,
}

/// From the law, at eight deformations at once.
fn of_law(law: &dyn Law, deformations: &[Matrix; WIDTH]) -> Vec<Derivatives> {
    let f: MatrixLanes =
        std::array::from_fn(|i| std::array::from_fn(|j| Lanes(std::array::from_fn(|lane| deformations[lane][i][j]))));
    let response = law.response(&f);
    let unpack = |lane: usize| {
        let mut tangent = vec![0.0; 81];
        for (pair, &(i, k)) in PAIRS.iter().enumerate() {
            for p in 0..3 {
                for q in 0..3 {
                    let value = response.tangent[pair][p][q].0[lane];
                    tangent[9 * (3 * i + p) + 3 * k + q] = value;
                    tangent[9 * (3 * k + q) + 3 * i + p] = value;
                    if i == k {
                        let mirrored = response.tangent[pair][q][p].0[lane];
                        let scale = 1e-13 * law.shear_modulus().max(value.abs());
                        assert!((value - mirrored).abs() <= scale, "{}: not symmetric", law.name());
                    }
                }
            }
        }
        let stress = response.stress.iter().flatten().map(|s| s.0[lane]).collect();
        Derivatives { energy: response.energy.0[lane], stress, tangent }
    };
    (0..WIDTH).map(unpack).collect()
}

/// From the formula of the energy, exactly.
fn of_energy(energy: fn(&DualMatrix) -> HyperDual64, f: &Matrix) -> Derivatives {
    let seeded = |a: usize, b: usize| {
        let mut dual: DualMatrix = f.map(|row| row.map(HyperDual64::from_re));
        dual[a / 3][a % 3].eps1 = 1.0;
        dual[b / 3][b % 3].eps2 = 1.0;
        energy(&dual)
    };
    Derivatives {
        energy: seeded(0, 0).re,
        stress: (0..9).map(|a| seeded(a, a).eps1).collect(),
        tangent: (0..81).map(|ab| seeded(ab / 9, ab % 9).eps1eps2).collect(),
    }
}

fn random_deformations(seed: u64) -> [Matrix; WIDTH] {
    let mut random = Random::new(seed);
    std::array::from_fn(|_| random.deformation())
}

#[test]
fn every_law_is_tested_here() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/material");
    let text: String = std::fs::read_dir(folder)
        .expect("the folder of the family")
        .map(|entry| std::fs::read_to_string(entry.expect("an entry").path()).expect("a source file"))
        .collect();
    let names: std::collections::BTreeSet<&str> = cases().iter().map(|case| case.law.name()).collect();
    assert_eq!(text.matches("impl Law for").count(), names.len());
}

#[test]
fn at_rest_nothing_is_stored_and_the_stress_is_a_pressure() {
    for case in cases() {
        let rest = &of_law(case.law.as_ref(), &[IDENTITY; WIDTH])[3];
        let scale = 1e-14 * case.law.shear_modulus();
        assert!(rest.energy.abs() <= scale, "{}: {}", case.law.name(), rest.energy);
        for (k, stress) in rest.stress.iter().enumerate() {
            let pressure = if k % 4 == 0 { rest.stress[0] } else { 0.0 };
            assert!((stress - pressure).abs() <= scale, "{}: {:?}", case.law.name(), rest.stress);
        }
        // d2 psi / dgamma2 of the shear F = I + gamma n (x) m along the fibres
        let n = case.fibre.unwrap_or([1.0, 0.0, 0.0]);
        let m = normalised(cross(n, [0.0, 0.3, 1.0]));
        let entry = |ab: usize| {
            let (a, b) = (ab / 9, ab % 9);
            n[a / 3] * m[a % 3] * rest.tangent[ab] * n[b / 3] * m[b % 3]
        };
        let shear: f64 = (0..81).map(entry).sum();
        assert!((shear - case.law.shear_modulus()).abs() <= scale, "{}: shear modulus {shear}", case.law.name());
    }
}

#[test]
fn stress_and_tangent_are_derivatives_of_the_energy() {
    for case in cases() {
        for seed in 1..30 {
            let deformations = random_deformations(seed);
            for (ours, f) in of_law(case.law.as_ref(), &deformations).iter().zip(&deformations) {
                let exact = of_energy(case.energy, f);
                assert_close("psi", &[ours.energy], &[exact.energy], 1e-12);
                assert_close("P = dpsi/dF", &ours.stress, &exact.stress, 1e-12);
                assert_close("A = dP/dF", &ours.tangent, &exact.tangent, 1e-12);
            }
        }
    }
}

/// psi(Q F) = psi(F), P(Q F) = Q P(F); where it has no fibres psi(F Q) = psi(F), P(F Q) = P(F) Q.
#[test]
fn turning_the_body_or_its_material_changes_no_energy() {
    for case in cases() {
        for seed in 1..30 {
            let mut random = Random::new(1000 + seed);
            let deformations = random_deformations(seed);
            let turn = random.rotation();
            let before = of_law(case.law.as_ref(), &deformations);
            // an energy is a difference of numbers as large as the modulus
            let modulus = case.law.shear_modulus();
            let same_energy = |what: &str, a: &Derivatives, b: &Derivatives| {
                assert_close(what, &[modulus + a.energy], &[modulus + b.energy], 1e-13);
            };
            let matrix = |p: &[f64]| -> Matrix { std::array::from_fn(|i| std::array::from_fn(|j| p[3 * i + j])) };
            let after = of_law(case.law.as_ref(), &deformations.map(|f| product(&turn, &f)));
            for (before, after) in before.iter().zip(&after) {
                same_energy("psi(Q F)", after, before);
                let turned = product(&turn, &matrix(&before.stress));
                assert_close("P(Q F)", &after.stress, turned.as_flattened(), 1e-12);
            }
            if case.fibre.is_none() {
                let after = of_law(case.law.as_ref(), &deformations.map(|f| product(&f, &turn)));
                for (before, after) in before.iter().zip(&after) {
                    same_energy("psi(F Q)", after, before);
                    let turned = product(&matrix(&before.stress), &turn);
                    assert_close("P(F Q)", &after.stress, turned.as_flattened(), 1e-12);
                }
            }
        }
    }
}

/// The eight lanes do not know of each other.
#[test]
fn a_lane_gives_what_it_gives_alone() {
    for case in cases() {
        let deformations = random_deformations(77);
        for (together, f) in of_law(case.law.as_ref(), &deformations).iter().zip(&deformations) {
            assert!(determinant(f) > 0.0);
            let alone = &of_law(case.law.as_ref(), &[*f; WIDTH])[5];
            assert_eq!(together.energy.to_bits(), alone.energy.to_bits());
            assert_eq!(together.tangent, alone.tangent);
        }
    }
}

/// Table 2 of Wu et al. 2013, and a fibre whose optimal stretch is not one.
fn fibres() -> [Blemker; 2] {
    let table_2 = Blemker { sigma_max: 300.0, lambda_star: 1.4, lambda_ofl: 1.0, p1: 0.005, p2: 6.6 };
    [table_2, Blemker { lambda_ofl: 1.15, lambda_star: 1.3, sigma_max: 200.0, ..table_2 }]
}

#[test]
fn the_fibre_law_has_the_published_values() {
    for (s, force) in
        [(0.3, 0.0), (0.4, 0.0), (0.5, 0.09), (0.6, 0.36), (0.8, 0.84), (1.0, 1.0), (1.4, 0.36), (1.6, 0.0)]
    {
        assert!((active(s).force - force).abs() < 1e-14, "f_act({s}) = {}", active(s).force);
    }
    let law = fibres()[0];
    let e = (6.6_f64 * 0.4).exp();
    assert_eq!(law.passive(0.9).force, 0.0);
    assert!((law.passive(1.2).force - 0.005 * ((6.6_f64 * 0.2).exp() - 1.0)).abs() < 1e-14);
    assert!((law.passive(1.5).force - (0.005 * (e - 1.0) + 0.1 * 0.005 * 6.6 * e)).abs() < 1e-14);
    // the area under f_act, by Simpson's rule on every piece (exact for its parabolas)
    let simpson = |a: f64, b: f64| {
        let f = |s: f64| active(s).force;
        (b - a) / 6.0 * (f(a) + 4.0 * f(0.5 * (a + b)) + f(b))
    };
    let area = simpson(0.4, 0.6) + simpson(0.6, 1.4) + simpson(1.4, 1.6);
    assert!((active(2.0).energy - area).abs() < 1e-14, "{area}");
}

#[test]
fn fibre_force_and_slope_are_derivatives_of_the_energy() {
    const STEP: f64 = 1e-5;
    for law in fibres() {
        for activation in [0.0, 0.03, 1.0] {
            for k in 0..300 {
                let lambda = 0.303 + 0.00611 * k as f64;
                let joins =
                    [0.4, 0.6, 1.0, 1.4, 1.6].map(|s| s * law.lambda_ofl).into_iter().chain([law.lambda_star]);
                if joins.into_iter().any(|join| (lambda - join).abs() < 2.0 * STEP) {
                    continue;
                }
                let [low, here, high] = [-STEP, 0.0, STEP].map(|d| law.tension(lambda + d, activation));
                let slope = |a: f64, b: f64| (b - a) / (2.0 * STEP);
                let close = |a: f64, b: f64| (a - b).abs() <= 1e-7 * law.sigma_max;
                assert!(close(slope(low.energy, high.energy), here.force), "W' at {lambda}");
                assert!(close(slope(low.force, high.force), here.slope), "W'' at {lambda}");
                let (rest, part) = (law.tension(lambda, 0.0), law.tension_per_activation(lambda));
                assert!((rest.energy + activation * part.energy - here.energy).abs() <= 1e-13 * law.sigma_max);
                assert!((rest.force + activation * part.force - here.force).abs() <= 1e-13 * law.sigma_max);
                assert!((rest.slope + activation * part.slope - here.slope).abs() <= 1e-12 * law.sigma_max);
            }
        }
    }
}

/// Values are continuous at every join; the published slope of f_act jumps by 0.4 at 0.6 and 1.4 and nowhere else.
#[test]
fn fibre_forces_are_continuous() {
    const NEAR: f64 = 1e-12;
    for law in fibres() {
        for (join, jump) in [(0.4, 0.0), (0.6, -0.4), (1.0, 0.0), (1.4, -0.4), (1.6, 0.0)] {
            let (below, above) = (active(join - NEAR), active(join + NEAR));
            assert!((below.energy - above.energy).abs() < 1e-11, "G_act at {join}");
            assert!((below.force - above.force).abs() < 1e-10, "f_act at {join}");
            assert!((above.slope - below.slope - jump).abs() < 1e-10, "slope of f_act at {join}");
        }
        let join = law.lambda_star / law.lambda_ofl;
        let (below, above) = (law.passive(join - NEAR), law.passive(join + NEAR));
        assert!((below.energy - above.energy).abs() < 1e-11 && (below.force - above.force).abs() < 1e-11);
        assert!((below.slope - above.slope).abs() < 1e-10);
        assert_eq!((law.passive(1.0).force, law.passive(1.0).energy), (0.0, 0.0));
    }
}
