//! Inflation of a thick sphere of incompressible Mooney-Rivlin tissue (Green and Shield 1950; Ogden, Non-linear Elastic
//! Deformations, 1984, section 5.3.2).
//!
//! r^3 = a^3 + R^3 - A^3 keeps the volume. With the stretch l = r/R along the sphere the energy is
//! w(l) = c1 (2 l^2 + l^-4 - 3) + c2 (l^4 + 2 l^-2 - 3), and the pressure inside is the integral of w'(l)/(l^3 - 1) from l of
//! the outer surface to l of the inner:
//!   pressure = c1 [-4/l - 1/l^4] + c2 [4 l - 2/l^2]   between these two.
//!
//! An octant between symmetry planes, made of three blocks that meet along the diagonal (a cube blown up to a sphere), so
//! that no element is collapsed at a pole. Elements share edges and faces, but no derivatives across them. Errors are the
//! largest on a surface, within elements too; they fall with the third power of the size, as a trilinear pressure lets them.

use super::support::{Discretisation, body, solve};
use risorius::material::MooneyRivlin;
use risorius::math::tensor::{Vector, norm};
use risorius::mesh::continuous::continuous;
use risorius::mesh::element::{TricubicHermite, ends};
use risorius::mesh::face::{Face, Side};
use risorius::mesh::{MaterialPoint, Mesh};
use risorius::model::supports::Support;
use risorius::term::load::FollowerPressure;
use std::collections::HashMap;
use std::f64::consts::FRAC_PI_4;

const RADII: [f64; 2] = [1.0, 1.3];
const LAW: MooneyRivlin = MooneyRivlin { c1: 2.0, c2: 6.0 };
/// Stretch of the inner surface.
const STRETCH: f64 = 1.25;

/// The radius to which a surface of radius R comes.
fn radius(reference: f64) -> f64 {
    ((STRETCH.powi(3) - 1.0) * RADII[0].powi(3) + reference.powi(3)).cbrt()
}

fn pressure() -> f64 {
    let primitive = |l: f64| LAW.c1 * (-4.0 / l - 1.0 / l.powi(4)) + LAW.c2 * (4.0 * l - 2.0 / (l * l));
    primitive(STRETCH) - primitive(radius(RADII[1]) / RADII[1])
}

/// The unit vector along (1, tan a, tan b) and its derivatives d/da, d/db, d2/dadb.
///
/// With s = tan a, t = tan b, v = (1, s, t), q = |v|: d/ds = e2/q - s v/q^3, d2/dsdt = -(t e2 + s e3)/q^3 + 3 s t v/q^5,
/// and ds/da = 1 + s^2.
fn direction(a: f64, b: f64) -> [Vector; 4] {
    let (s, t) = (a.tan(), b.tan());
    let (ds, dt) = (1.0 + s * s, 1.0 + t * t);
    let q = (1.0 + s * s + t * t).sqrt();
    let (v, e2, e3) = ([1.0, s, t], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let each = |f: &dyn Fn(usize) -> f64| -> Vector { [f(0), f(1), f(2)] };
    [
        each(&|i| v[i] / q),
        each(&|i| ds * (e2[i] / q - s * v[i] / q.powi(3))),
        each(&|i| dt * (e3[i] / q - t * v[i] / q.powi(3))),
        each(&|i| ds * dt * (3.0 * s * t * v[i] / q.powi(5) - (t * e2[i] + s * e3[i]) / q.powi(3))),
    ]
}

/// An octant of the sphere of `radial` x `around` x `around` elements in each of three blocks: xi1 = r, and the block about
/// x, y or z in turn. Its inner faces, and its faces in the planes normal to x, y and z.
fn octant([radial, around]: [usize; 2]) -> (Mesh, Vec<Face>, [Vec<Face>; 3]) {
    let (dr, da) = ((RADII[1] - RADII[0]) / radial as f64, FRAC_PI_4 / around as f64);
    let (mut corners, mut locals) = (Vec::new(), Vec::new());
    let (mut inner, mut planes) = (Vec::new(), [const { Vec::new() }; 3]);
    let mut nodes: HashMap<[i64; 3], usize> = HashMap::new();
    for about in 0..3 {
        for element in 0..radial * around * around {
            let index = locals.len();
            let at = [element % radial, element / radial % around, element / radial / around];
            let mut local = [[0.0; 64]; 3];
            let own: [usize; 8] = std::array::from_fn(|k| {
                let [i, j, l] = std::array::from_fn(|d| (at[d] + ends(k)[d]) as f64);
                let (r, n) = (RADII[0] + i * dr, direction(j * da, l * da));
                for m in 0..8 {
                    let scale = if m & 1 == 1 { dr } else { r } * [1.0, da, da, da * da][m >> 1];
                    // (1, s, t) are (x, y, z), (y, z, x) and (z, x, y)
                    (0..3).for_each(|i| local[(i + about) % 3][8 * k + m] = scale * n[m >> 1][i]);
                }
                let key = std::array::from_fn(|i| (local[i][8 * k] * 1e6).round() as i64);
                let next = nodes.len();
                *nodes.entry(key).or_insert(next)
            });
            corners.push(own);
            locals.push(local);
            let face = |direction: usize| Face { element: index, side: Side { direction, end: 0 } };
            (at[0] == 0).then(|| inner.push(face(0)));
            (at[1] == 0).then(|| planes[(1 + about) % 3].push(face(1)));
            (at[2] == 0).then(|| planes[(2 + about) % 3].push(face(2)));
        }
    }
    (continuous(&TricubicHermite, corners, &locals), inner, planes)
}

/// The largest errors of the radii that the inner and the outer surface come to, at points within their elements too.
fn errors(elements: [usize; 2]) -> [f64; 2] {
    let (mesh, inner, planes) = octant(elements);
    let load = FollowerPressure::new(&mesh, &inner, pressure(), 5);
    let symmetry = planes.into_iter().enumerate().map(|(axis, faces)| Support::Symmetry { faces, axis }).collect();
    let model = body(mesh, LAW, Discretisation::trilinear(100.0, 5), vec![Box::new(load)], symmetry);
    let found = solve(&model, &[], 1.0);
    assert_eq!(found.negative_modes, Some(0));
    let x = model.current(&found.state);
    let mut worst = [0.0_f64; 2];
    for element in 0..model.mesh().elements() {
        for (end, worst) in worst.iter_mut().enumerate() {
            if element % elements[0] != end * (elements[0] - 1) {
                continue;
            }
            for st in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5], [0.3, 0.8]] {
                let at = MaterialPoint { element, xi: [end as f64, st[0], st[1]] };
                *worst = worst.max((norm(model.mesh().interpolate(at, &x)) - radius(RADII[end])).abs());
            }
        }
    }
    worst
}

#[test]
fn the_radii_of_an_inflated_sphere_converge_to_the_closed_form() {
    let levels = [[1, 1], [2, 2], [3, 3]].map(|elements| (elements[0] as f64, errors(elements)));
    for (k, what) in ["inner", "outer"].into_iter().enumerate() {
        let errors = levels.map(|(n, errors)| (n, errors[k]));
        println!("{what} radius {:.6}: {errors:?}", radius(RADII[k]));
        for pair in errors.windows(2) {
            let order = (pair[0].1 / pair[1].1).ln() / (pair[1].0 / pair[0].0).ln();
            println!("order {order:.2}");
            assert!(order > 2.5, "{what} radius: {errors:?}, order {order:.2}");
        }
        assert!(errors[2].1 < 5e-5, "{what} radius: {errors:?}");
    }
}
