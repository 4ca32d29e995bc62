//! Where a muscle has its quadrature points, and how much of its fibres is left there.

use crate::common::{Random, curved_block};
use risorius::material::fibre::Blemker;
use risorius::mesh::Mesh;
use risorius::mesh::block::block;
use risorius::mesh::element::{TricubicHermite, Trilinear};
use risorius::mesh::fibre_angles::FibreAngles;
use risorius::mesh::location::Locator;
use risorius::model::build::build;
use risorius::scene::Scene;
use risorius::term::muscle::Muscle;
use risorius::term::muscle_rule::MuscleRule;
use risorius::term::{ElementState, ElementSystem, MAX_PRESSURES, Term, Want};
use std::path::Path;

const FIBRE: Blemker = Blemker { sigma_max: 300.0, lambda_star: 1.4, lambda_ofl: 1.0, p1: 0.005, p2: 6.6 };

fn host(elements: [usize; 3]) -> Mesh {
    block(&TricubicHermite, [0.0; 3], [60.0, 20.0, 20.0], elements)
}

fn slab(elements: [usize; 3]) -> Mesh {
    block(&Trilinear, [4.5, 2.0, 14.2], [50.0, 16.0, 4.0], elements)
}

fn embed(host: &Mesh, mesh: &Mesh, rule: &MuscleRule, angle: f64) -> Muscle {
    let angles = FibreAngles::uniform(mesh, [angle, 0.0, 0.0]);
    Muscle::with_rule("slab", &Locator::new(host), mesh, &angles, rule, FIBRE, 0).expect("embedded")
}

#[test]
fn a_cut_rule_measures_the_part_of_the_muscle_in_every_host_element() {
    let (host, slab) = (host([12, 4, 4]), slab([5, 2, 1]));
    let locator = Locator::new(&host);
    let volumes = |rule: &MuscleRule| {
        let mut volumes = vec![0.0; host.elements()];
        embed(&host, &slab, rule, 0.0).points().iter().for_each(|p| volumes[p.host.element] += p.weight);
        volumes
    };
    let overlap = |low: f64, high: f64, from: f64, to: f64| (high.min(to) - low.max(from)).max(0.0);
    let exact = |element: usize| {
        let at = [element % 12, element / 12 % 4, element / 48].map(|k| 5.0 * k as f64);
        overlap(4.5, 54.5, at[0], at[0] + 5.0)
            * overlap(2.0, 18.0, at[1], at[1] + 5.0)
            * overlap(14.2, 18.2, at[2], at[2] + 5.0)
    };
    let worst =
        |rule: &MuscleRule| volumes(rule).iter().enumerate().map(|(e, v)| (v - exact(e)).abs()).fold(0.0, f64::max);
    let (cut, uniform) = (worst(&MuscleRule::cut(&slab, &locator, 1)), worst(&MuscleRule::uniform(&slab, 8)));
    assert!(cut < 1e-6, "{cut} mm3");
    assert!(uniform > 1.0, "{uniform} mm3: what a rule that is not cut is off by");
    // along x: 4.5 to 54.5 has the host's faces at 5, 10, ..., 50 and the slab's at 14.5, 24.5, 34.5, 44.5
    assert_eq!(MuscleRule::cut(&slab, &locator, 1).points().count(), 15 * 4 * 2);
}

#[test]
fn a_cut_rule_follows_curved_meshes() {
    let host = curved_block(&TricubicHermite, [4, 2, 2], 0.05, 51);
    let mut mesh = block(&TricubicHermite, [4.0, 4.0, 8.0], [32.0, 11.0, 6.0], [1, 1, 1]);
    let mut random = Random::new(52);
    mesh.parameters.iter_mut().flatten().for_each(|x| *x += 0.2 * random.next());
    let locator = Locator::new(&host);
    let uniform = embed(&host, &mesh, &MuscleRule::uniform(&mesh, 8), 0.3);
    let rule = MuscleRule::cut(&mesh, &locator, 3);
    // it passes four host elements in one direction and two in the others
    assert_eq!(rule.points().count(), 4 * 2 * 2 * 27);
    let cut = embed(&host, &mesh, &rule, 0.3);
    assert!((cut.volume() / uniform.volume() - 1.0).abs() < 1e-4, "{} and {}", cut.volume(), uniform.volume());
}

/// The force of a muscle in a host of which each parameter moved at random.
fn force(host: &Mesh, muscle: &Muscle) -> Vec<f64> {
    let mut random = Random::new(53);
    let x: Vec<[f64; 3]> = host.parameters.iter().map(|p| p.map(|c| c + 0.4 * random.next())).collect();
    let mut all = Vec::new();
    for element in 0..host.elements() {
        let (local, u, p) = (host.local_of(element, &x), [[0.0; 64]; 3], [0.0; MAX_PRESSURES]);
        let state = ElementState {
            element,
            x: &local,
            u: &u,
            p: &p,
            controls: &[0.05],
            load: 1.0,
            easing: 0.0,
            multipliers: &[],
        };
        let mut system = ElementSystem::default();
        muscle.add(&state, Want::Force, &mut system);
        all.extend(system.force.iter().flatten().copied());
    }
    all
}

#[test]
fn three_points_in_every_part_do_more_than_eight_in_every_element() {
    let (host, slab) = (host([12, 4, 4]), slab([5, 2, 1]));
    let locator = Locator::new(&host);
    let of = |rule: &MuscleRule| force(&host, &embed(&host, &slab, rule, 0.0));
    let best = of(&MuscleRule::cut(&slab, &locator, 8));
    let scale = best.iter().map(|f| f * f).sum::<f64>().sqrt();
    let error =
        |rule: &MuscleRule| of(rule).iter().zip(&best).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt() / scale;
    let cut = error(&MuscleRule::cut(&slab, &locator, 3));
    let [three, eight] = [3, 8].map(|gauss| error(&MuscleRule::uniform(&slab, gauss)));
    println!("error of the force: cut {cut:.2e}, 3 points {three:.2e}, 8 points {eight:.2e}");
    assert!(cut < 0.1 * eight && eight < 0.5 * three, "cut {cut:.2e}, 3 points {three:.2e}, 8 points {eight:.2e}");
}

/// 3 (d/t)^2 - 2 (d/t)^3, at most 1.
fn smooth(d: f64, t: f64) -> f64 {
    let d = (d / t).min(1.0);
    d * d * (3.0 - 2.0 * d)
}

#[test]
fn a_taper_falls_along_the_fibre_to_both_its_ends() {
    let (host, slab) = (host([6, 2, 2]), slab([5, 2, 1]));
    let rule = MuscleRule::uniform(&slab, 6);
    let own = Locator::new(&slab);
    for degrees in [0.0_f64, 36.0] {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let whole = embed(&host, &slab, &rule, degrees.to_radians());
        let tapered = embed(&host, &slab, &rule, degrees.to_radians()).tapered(&own, 5.0);
        for (point, full) in tapered.points().iter().zip(whole.points()) {
            let [x, y, _] = point.position;
            let to_end = |from: f64, low: f64, high: f64, part: f64| {
                if part < 1e-12 { f64::INFINITY } else { (from - low).min(high - from) / part }
            };
            // the nearer of both ends of a straight fibre, in x or in y
            let d = if degrees == 0.0 {
                to_end(x, 4.5, 54.5, cosine)
            } else {
                let ahead = ((54.5 - x) / cosine).min((18.0 - y) / sine);
                ahead.min(((x - 4.5) / cosine).min((y - 2.0) / sine))
            };
            let (found, expected) = (point.weight / full.weight, smooth(d, 5.0));
            // an element holds what is within 1e-9 of it, here 1e-8 mm
            assert!((found - expected).abs() < 1e-8, "{degrees} degrees at {x} {y}: {found}, not {expected}");
        }
    }
    // half of each taper is left
    let fine = MuscleRule::cut(&slab, &Locator::new(&host), 8);
    let volume = embed(&host, &slab, &fine, 0.0).tapered(&own, 10.0).volume();
    assert!((volume - 40.0 * 16.0 * 4.0).abs() < 0.1, "{volume}");
}

#[test]
fn a_muscle_with_few_points_per_host_element_is_warned_of_and_a_cut_one_is_not() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("problems/slab/problem.toml");
    let help = |set: &[&str]| {
        let set: Vec<String> = set.iter().map(|s| s.to_string()).collect();
        let scene = Scene::read_changed(&path, &set, &[]).expect("a problem");
        let built = build(&scene).unwrap_or_else(|error| panic!("{error}"));
        let warning = built.warnings.into_iter().find(|warning| warning.code == "G007");
        warning.map(|warning| warning.help.expect("a remedy"))
    };
    let fine = "mesh.block.elements=[12, 4, 4]";
    let told = help(&[fine]).expect("1.5 points along a host element");
    assert!(told.contains("cut = true") && told.contains("gauss = 4,"), "{told}");
    assert_eq!(help(&[fine, "muscle.slab.gauss=4"]), None);
    assert_eq!(help(&[fine, "muscle.slab.cut=true"]), None);
    let told = help(&[fine, "muscle.slab.cut=true", "muscle.slab.gauss=1"]).expect("one point in every part");
    assert!(told.contains("gauss = 3"), "{told}");
    assert_eq!(help(&[]), None);
}
