//! The families of contact: every surface has exact derivatives of its gap, every law those of its energy.

use crate::common::{Random, assert_close, curved_block};
use risorius::math::tensor::{Matrix, Vector, add_scaled, apply, dot, norm, normalised, subtract};
use risorius::mesh::Mesh;
use risorius::mesh::block::block;
use risorius::mesh::element::{TricubicHermite, Trilinear};
use risorius::mesh::surface::Surface;
use risorius::term::contact::law::{Allows, Augmented, Barrier, ContactLaw, Penalty, Smooth};
use risorius::term::contact::surface::{
    Arch, Capsule, Cylinder, FreeSide, Gap, Patches, Plane, RigidSurface, Sphere,
};

/// A wavy sheet: the top of a block with all its parameters moved.
fn sheet() -> Mesh {
    curved_block(&TricubicHermite, [3, 2, 1], 0.08, 51)
}

/// Every surface, each with points on both of its sides.
fn surfaces() -> Vec<(Box<dyn RigidSurface>, Vec<Vector>)> {
    let mut random = Random::new(52);
    let axis = normalised([1.0, -2.0, 0.5]);
    let mut around = |centre: Vector, from: f64, to: f64| -> Vec<Vector> {
        (0..40)
            .map(|_| {
                let direction = normalised(random.triple());
                add_scaled(centre, random.between(from, to), direction)
            })
            .collect()
    };
    let mut all: Vec<(Box<dyn RigidSurface>, Vec<Vector>)> = vec![(
        Box::new(Plane { through: [1.0, 2.0, 3.0], normal: normalised([1.0, 1.0, 2.0]) }),
        around([1.0, 2.0, 3.0], 0.0, 9.0),
    )];
    for free in [FreeSide::Outside, FreeSide::Inside] {
        let (centre, radius) = ([3.0, -1.0, 2.0], 5.0);
        all.push((Box::new(Sphere { centre, radius, free }), around(centre, 1.0, 9.0)));
        all.push((Box::new(Cylinder { through: centre, axis, radius, free }), around(centre, 1.0, 9.0)));
        let ends = [centre, add_scaled(centre, 6.0, axis)];
        all.push((Box::new(Capsule { ends, radius, free }), around(centre, 2.0, 9.0)));
        let mesh = sheet();
        let patches = Patches::new(&mesh, &mesh.named_faces["xi3=1"], free);
        // above and below the sheet, away from its edge
        let mut random = Random::new(55);
        let over = (0..40).map(|_| [random.between(3.0, 27.0), random.between(3.0, 17.0), random.between(8.0, 12.0)]);
        all.push((Box::new(patches), over.collect()));
    }
    let mesh = sheet();
    let mut random = Random::new(57);
    let under = (0..40).map(|_| [random.between(3.0, 27.0), random.between(3.0, 17.0), random.between(-5.0, 3.0)]);
    all.push((Box::new(Arch::new(&mesh, &mesh.named_faces["xi3=0"])), under.collect()));
    all
}

fn gap(surface: &dyn RigidSurface, x: Vector) -> Gap {
    surface.gap(x).unwrap_or_else(|| panic!("{} has no gap at {x:?}", surface.name()))
}

/// dg/dx and d2g/dx2 by differences of fourth order; the normal is a unit vector that the curvature leaves alone.
#[test]
fn gaps_have_exact_derivatives() {
    const H: f64 = 1e-3;
    for (surface, points) in surfaces() {
        let (mut behind, mut before) = (0, 0);
        for x in points {
            let here = gap(surface.as_ref(), x);
            if here.value < 0.0 {
                behind += 1
            } else {
                before += 1
            }
            let what = format!("{} at {x:?}", surface.name());
            assert!((norm(here.normal) - 1.0).abs() < 1e-13, "{what}: normal of length {}", norm(here.normal));
            assert!(norm(apply(&here.curvature, here.normal)) < 1e-12, "{what}: curvature along the normal");
            for d in 0..3 {
                let at = |step: f64| {
                    let mut moved = x;
                    moved[d] += step * H;
                    gap(surface.as_ref(), moved)
                };
                let [a, b, c, e] = [-2.0, -1.0, 1.0, 2.0].map(at);
                let slope = |f: &dyn Fn(&Gap) -> f64| (8.0 * (f(&c) - f(&b)) - (f(&e) - f(&a))) / (12.0 * H);
                assert!((slope(&|g| g.value) - here.normal[d]).abs() < 1e-9, "{what}: normal {d}");
                for i in 0..3 {
                    let found = slope(&|g| g.normal[i]);
                    assert!((found - here.curvature[i][d]).abs() < 1e-8, "{what}: curvature {i}{d}: {found}");
                }
            }
        }
        assert!(behind > 3 && before > 3, "{}: points on one side only", surface.name());
    }
}

/// The signed distance from elementary geometry.
#[test]
fn gaps_are_signed_distances() {
    let free = FreeSide::Outside;
    let sphere = Sphere { centre: [0.0; 3], radius: 5.0, free };
    assert_close("sphere", &[gap(&sphere, [0.0, 3.0, 4.5]).value], &[29.25_f64.sqrt() - 5.0], 1e-12);
    let hollow = Sphere { free: FreeSide::Inside, ..sphere };
    assert_close("cavity", &[gap(&hollow, [0.0, 3.0, 0.0]).value], &[2.0], 1e-14);
    let cylinder = Cylinder { through: [7.0, 0.0, 0.0], axis: [1.0, 0.0, 0.0], radius: 5.0, free };
    assert_close("cylinder", &[gap(&cylinder, [99.0, 6.0, 8.0]).value], &[5.0], 1e-14);
    let capsule = Capsule { ends: [[0.0; 3], [10.0, 0.0, 0.0]], radius: 2.0, free };
    assert_close("capsule, side", &[gap(&capsule, [4.0, 3.0, 0.0]).value], &[1.0], 1e-14);
    assert_close("capsule, end", &[gap(&capsule, [13.0, 4.0, 0.0]).value], &[3.0], 1e-14);
    let mesh = block(&Trilinear, [0.0; 3], [20.0, 10.0, 10.0], [2, 1, 1]);
    let top = Patches::new(&mesh, &mesh.named_faces["xi3=1"], FreeSide::Outside);
    let x = [9.0, 4.0, 12.5];
    assert_close("flat patches", &[gap(&top, x).value], &[2.5], 1e-13);
    assert_close("flat patches", &gap(&top, x).normal, &[0.0, 0.0, 1.0], 1e-13);
    let bottom = Patches::new(&mesh, &mesh.named_faces["xi3=0"], FreeSide::Inside);
    assert_close("flat patches from inside", &[gap(&bottom, x).value], &[12.5], 1e-13);
}

/// Patches agree with the projection on the surface of the mesh, and are as smooth across element borders.
#[test]
fn patches_find_the_closest_point() {
    let mesh = sheet();
    let patches = Patches::new(&mesh, &mesh.named_faces["xi3=1"], FreeSide::Outside);
    let surface = Surface::new(&mesh);
    let mut random = Random::new(53);
    for _ in 0..60 {
        let x = [random.between(2.0, 28.0), random.between(2.0, 18.0), random.between(10.0, 14.0)];
        let foot = surface.project(x).expect("a surface");
        assert_eq!(foot.face.side.to_string(), "xi3=1");
        let found = gap(&patches, x);
        assert_close("distance", &[found.value.abs()], &[foot.distance], 1e-9);
        // the foot x - g n lies on the surface, where the gap is zero and the normal the same
        let on = gap(&patches, add_scaled(x, -found.value, found.normal));
        assert!(on.value.abs() < 1e-12, "gap {} at the foot", on.value);
        assert!(norm(subtract(on.normal, found.normal)) < 1e-10);
    }
}

/// Beyond the edge of the set the patches go on for an element, and then there is nothing.
#[test]
fn patches_end_an_element_beyond_their_edge() {
    let mesh = block(&TricubicHermite, [0.0; 3], [20.0, 10.0, 10.0], [2, 1, 1]);
    let top = Patches::new(&mesh, &mesh.named_faces["xi3=1"], FreeSide::Outside);
    for (x, there) in [(-9.9, true), (-10.1, false), (29.9, true), (30.1, false)] {
        assert_eq!(top.gap([x, 5.0, 11.0]).is_some(), there, "x = {x}");
    }
    assert!(top.gap([10.0, 19.9, 11.0]).is_some() && top.gap([10.0, 20.1, 11.0]).is_none());
    assert!(top.gap([f64::NAN, 5.0, 11.0]).is_none());
}

fn laws() -> Vec<(Box<dyn ContactLaw>, Vec<Allows>)> {
    let both = vec![Allows::Closed, Allows::ClosedOrOpen];
    vec![
        (Box::new(Penalty { stiffness: 40.0 }), both.clone()),
        (Box::new(Augmented { stiffness: 40.0, tolerance: 1e-6 }), both),
        (Box::new(Smooth { stiffness: 40.0, range: 0.5 }), vec![Allows::ClosedOrOpen]),
        (Box::new(Barrier { stiffness: 40.0, range: 2.0 }), vec![Allows::ClosedOrOpen]),
    ]
}

/// psi' and psi'' by differences; a law that lets go pushes and never pulls.
#[test]
fn laws_have_exact_derivatives() {
    const H: f64 = 1e-4;
    for (law, kinds) in laws() {
        for allows in kinds {
            for (multiplier, easing) in [(0.0, 0.0), (-3.0, 0.0), (0.0, 0.7)] {
                for gap in [-1.5, -0.2, 0.01, 0.3, 1.1, 1.9, 2.5] {
                    let at = |step: f64| law.eased(easing, gap + step * H, allows, multiplier);
                    let here = at(0.0);
                    let what =
                        format!("{} {allows:?} at {gap} with {multiplier}, eased by {easing}: {here:?}", law.name());
                    let plain = law.response(gap, allows, multiplier);
                    if easing == 0.0 || law.eases().is_none() {
                        assert!(here == plain || here.energy.is_nan(), "{what}: {plain:?}");
                    } else {
                        assert!(
                            here.energy <= plain.energy && here.slope.abs() <= plain.slope.abs(),
                            "{what}: {plain:?}"
                        );
                    }
                    if law.name() == "barrier" && gap < 0.0 {
                        assert!(here.energy.is_nan() && here.slope.is_nan(), "{what}: never admitted");
                        continue;
                    }
                    let [a, b, c, e] = [-2.0, -1.0, 1.0, 2.0].map(at);
                    let slope = |b: f64, c: f64, a: f64, e: f64| (8.0 * (c - b) - (e - a)) / (12.0 * H);
                    let (first, second) =
                        (slope(b.energy, c.energy, a.energy, e.energy), slope(b.slope, c.slope, a.slope, e.slope));
                    let tolerance = 1e-6 * (1.0 + here.slope.abs() + here.stiffness.abs());
                    assert!((first - here.slope).abs() < tolerance, "{what}: slope {first}");
                    assert!((second - here.stiffness).abs() < tolerance, "{what}: stiffness {second}");
                    if allows == Allows::ClosedOrOpen {
                        assert!(here.slope <= 0.0 && here.stiffness >= 0.0, "{what}");
                    }
                }
            }
        }
    }
}

/// A rotated and shifted surface gives the same gaps with turned normals.
#[test]
fn gaps_move_with_their_surface() {
    let mut random = Random::new(54);
    let (turn, shift): (Matrix, Vector) = (random.rotation(), random.triple().map(|t| 10.0 * t));
    let moved = |x: Vector| add_scaled(apply(&turn, x), 1.0, shift);
    let mesh = sheet();
    let mut carried = mesh.clone();
    for (parameter, x) in carried.parameters.iter_mut().enumerate() {
        let value = mesh.parameter_derivative[parameter] == 0;
        *x = if value { moved(*x) } else { apply(&turn, *x) };
    }
    let faces = &mesh.named_faces["xi3=1"];
    let (before, after) =
        (Patches::new(&mesh, faces, FreeSide::Inside), Patches::new(&carried, faces, FreeSide::Inside));
    for _ in 0..40 {
        let x = [random.between(2.0, 28.0), random.between(2.0, 18.0), random.between(8.0, 12.0)];
        let (here, there) = (gap(&before, x), gap(&after, moved(x)));
        assert!((here.value - there.value).abs() < 1e-11);
        assert!((dot(apply(&turn, here.normal), there.normal) - 1.0).abs() < 1e-12);
    }
}

/// On a flat set of patches the gap is the height, also where a point is about to cross from one patch to the next.
#[test]
fn patches_have_no_seams() {
    let mesh = block(&TricubicHermite, [0.0; 3], [60.0, 20.0, 20.0], [6, 2, 2]);
    let bottom = Patches::new(&mesh, &mesh.named_faces["xi3=0"], FreeSide::Inside);
    let mut random = Random::new(56);
    for n in 0..20_000 {
        // every other point within 1e-3 to 1e-13 mm of an edge between patches
        let near = 10.0_f64.powf(random.between(-13.0, -3.0)) * random.next();
        let x = if n % 2 == 0 { 10.0 * (n / 2 % 7) as f64 + near } else { random.between(-4.0, 64.0) };
        let z = random.between(-0.2, 0.2);
        let at = [x, random.between(-4.0, 24.0), z];
        let found = bottom.gap(at).unwrap_or_else(|| panic!("no gap at {at:?}"));
        assert!((found.value - z).abs() < 1e-12, "{at:?}: {}", found.value);
    }
}
