//! Every element and pressure space, and the geometry built from them: what is interpolated, how elements join, how
//! points are found again.

use crate::common;
use crate::common::{Random, assert_close, curved_block, largest};
use risorius::math::quadrature::GaussRule;
use risorius::math::tensor::{IDENTITY, Matrix, Vector, cross, determinant, dot, norm, subtract};
use risorius::mesh::bezier::{bounding_box, control_values, evaluate};
use risorius::mesh::block::block;
use risorius::mesh::element::{ELEMENTS, Element, TricubicHermite, ends};
use risorius::mesh::face::{Face, Side, boundary_faces};
use risorius::mesh::fibre_angles::{FibreAngles, axes};
use risorius::mesh::location::Locator;
use risorius::mesh::map::{ElementMap, Term};
use risorius::mesh::surface::Surface;
use risorius::mesh::{MaterialPoint, Mesh, position_and_jacobian};
use risorius::term::pressure::{PRESSURE_SPACES, PressurePlace};

/// The derivative that local parameter `a` is (bit mask) and its node.
fn parameter(element: &dyn Element, a: usize) -> (usize, u8) {
    (a / element.parameters_per_node(), (a % element.parameters_per_node()) as u8)
}

/// The mixed derivative `mask` of local function `a` at xi.
fn mixed_derivative(element: &dyn Element, a: usize, mask: u8, xi: [f64; 3]) -> f64 {
    let factors = element.factors(a);
    (0..3)
        .map(|d| {
            let functions = if mask >> d & 1 == 1 { element.slopes_1d(xi[d]) } else { element.values_1d(xi[d]) };
            functions[factors[d]]
        })
        .product()
}

/// The highest power of each coordinate that the element reproduces.
fn degree(element: &dyn Element) -> i32 {
    if element.parameters_per_node() == 8 { 3 } else { 1 }
}

/// Parameter b taken from function a is 1 for a = b and 0 otherwise.
#[test]
fn a_function_has_its_own_parameter_and_no_other() {
    for element in ELEMENTS {
        for a in 0..element.functions() {
            for b in 0..element.functions() {
                let (node, mask) = parameter(element, b);
                let found = mixed_derivative(element, a, mask, ends(node).map(|end| end as f64));
                assert_eq!(found, f64::from(u8::from(a == b)), "{}: {a}, {b}", element.name());
            }
        }
    }
}

#[test]
fn values_sum_to_one_and_gradients_are_their_slopes() {
    let mut random = Random::new(1);
    for element in ELEMENTS {
        for _ in 0..50 {
            let xi = random.xi();
            let (values, gradients) = (element.values(xi), element.gradients(xi));
            let of_values = (0..element.functions()).filter(|a| parameter(element, *a).1 == 0);
            let sum: f64 = of_values.map(|a| values[a]).sum();
            assert!((sum - 1.0).abs() < 1e-14, "{}: {sum}", element.name());
            for d in 0..3 {
                let at = |step: f64| element.values(std::array::from_fn(|e| xi[e] + if e == d { step } else { 0.0 }));
                let (low, high) = (at(-1e-5), at(1e-5));
                for (a, gradient) in gradients.iter().enumerate() {
                    let slope = (high[a] - low[a]) / 2e-5;
                    assert!((gradient[d] - slope).abs() < 1e-9, "{}: function {a}", element.name());
                }
            }
        }
    }
}

/// x^i y^j z^k up to the degree of the element, from its exact values and derivatives at the corners.
#[test]
fn polynomials_are_reproduced() {
    // d-th derivative (0 or 1) of x^n
    let power = |x: f64, n: i32, d: u8| match (d, n) {
        (0, _) => x.powi(n),
        (_, 0) => 0.0,
        _ => f64::from(n) * x.powi(n - 1),
    };
    let mut random = Random::new(2);
    for element in ELEMENTS {
        let n = degree(element) + 1;
        for monomial in 0..n * n * n {
            let powers = [monomial % n, monomial / n % n, monomial / (n * n)];
            let exact =
                |xi: [f64; 3], mask: u8| -> f64 { (0..3).map(|d| power(xi[d], powers[d], mask >> d & 1)).product() };
            for _ in 0..5 {
                let xi = random.xi();
                let values = element.values(xi);
                let sum: f64 = (0..element.functions())
                    .map(|a| {
                        let (node, mask) = parameter(element, a);
                        values[a] * exact(ends(node).map(|end| end as f64), mask)
                    })
                    .sum();
                assert!((sum - exact(xi, 0)).abs() < 1e-13, "{}: {powers:?}", element.name());
            }
        }
    }
}

#[test]
fn pressures_sum_to_one_and_share_what_they_say() {
    let mesh = curved_block(&TricubicHermite, [2, 2, 1], 0.0, 0);
    let mut random = Random::new(3);
    for space in PRESSURE_SPACES {
        for _ in 0..20 {
            let xi = random.xi();
            let values = space.values(xi);
            assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-14, "{}", space.name());
            // linear functions are reproduced from their values at the corners
            let field = |x: [f64; 3]| 0.3 + x[0] - 2.0 * x[1] + 0.7 * x[2];
            let sum: f64 = (0..8).map(|c| values[c] * field(ends(c).map(|end| end as f64))).sum();
            assert!((sum - field(xi)).abs() < 1e-14, "{}", space.name());
        }
        let mut used = vec![0; space.count(&mesh)];
        for element in 0..mesh.elements() {
            for index in space.parameters(&mesh, element) {
                used[index] += 1;
                match space.place(index) {
                    PressurePlace::Node(node) => assert!(mesh.corners[element].contains(&node)),
                    PressurePlace::Element(own) => assert_eq!(own, element),
                }
            }
        }
        assert!(used.iter().all(|count| *count > 0), "{}: a parameter that nothing uses", space.name());
    }
}

/// The field and its three derivatives by x at a point of an element, where `x_of_xi` is dx/dxi of a straight element.
fn value_and_slopes(mesh: &Mesh, at: MaterialPoint, field: &[Vector], x_of_xi: &Matrix) -> Vec<f64> {
    let local = mesh.local_of(at.element, field);
    let (value, by_xi) = position_and_jacobian(mesh.element, &local, at.xi);
    let inverse = risorius::math::tensor::inverse(x_of_xi, determinant(x_of_xi));
    let by_x = common::product(&by_xi, &inverse);
    value.into_iter().chain(by_x.into_iter().flatten()).collect()
}

/// Random parameters on two elements side by side: value and slopes agree on the shared face.
#[test]
fn hermite_fields_are_smooth_across_a_face() {
    let mesh = block(&TricubicHermite, [0.0; 3], [2.0, 1.0, 1.0], [2, 1, 1]);
    let mut random = Random::new(4);
    let field: Vec<Vector> = mesh.parameters.iter().map(|_| random.triple()).collect();
    for _ in 0..20 {
        let [_, s, t] = random.xi();
        let left = value_and_slopes(&mesh, MaterialPoint { element: 0, xi: [1.0, s, t] }, &field, &IDENTITY);
        let right = value_and_slopes(&mesh, MaterialPoint { element: 1, xi: [0.0, s, t] }, &field, &IDENTITY);
        assert_close("value and slopes", &right, &left, 1e-14);
    }
}

/// The same with a neighbour that is twice as long and turned: its xi are (y, -x/2, z).
#[test]
fn a_turned_neighbour_of_another_size_joins_smoothly() {
    let straight = block(&TricubicHermite, [0.0; 3], [2.0, 1.0, 1.0], [2, 1, 1]);
    let own = |a: usize| {
        let (node, mask) = (straight.corners[0][a / 8], a % 8);
        vec![Term { global: (8 * node + mask) as u32, scale: 1.0 }]
    };
    // x = 1 + 2 (1 - xi2), y = xi1, z = xi3: corner (i, j, k) of the neighbour is the straight one's (1 - j, i, k)
    let corner = |k: usize| (1 - (k >> 1 & 1)) + 2 * (k & 1) + 4 * (k >> 2);
    let turned = |a: usize| {
        let (node, mask) = (straight.corners[1][corner(a / 8)], a % 8);
        // d/dxi1 = d/dy, d/dxi2 = -2 d/dx, d/dxi3 = d/dz
        let global_mask = (mask & 1) << 1 | mask >> 1 & 1 | mask & 4;
        let scale = if mask >> 1 & 1 == 1 { -2.0 } else { 1.0 };
        vec![Term { global: (8 * node + global_mask) as u32, scale }]
    };
    let map = ElementMap::new(64, (0..64).map(own).chain((0..64).map(turned)));
    let mut mesh = Mesh { map, ..straight.clone() };
    for node in 0..mesh.nodes {
        if mesh.parameters[8 * node][0] > 1.5 {
            mesh.parameters[8 * node][0] = 3.0;
        }
    }
    mesh.corners[1] = std::array::from_fn(|k| straight.corners[1][corner(k)]);
    let x_of_xi = [[0.0, -2.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let mut random = Random::new(5);
    let field: Vec<Vector> = mesh.parameters.iter().map(|_| random.triple()).collect();
    for _ in 0..20 {
        let [_, s, t] = random.xi();
        let (left, right) =
            (MaterialPoint { element: 0, xi: [1.0, s, t] }, MaterialPoint { element: 1, xi: [s, 1.0, t] });
        assert_close("position", &mesh.position(right), &mesh.position(left), 1e-14);
        assert_close("jacobian", mesh.jacobian(right).as_flattened(), x_of_xi.as_flattened(), 1e-14);
        let left = value_and_slopes(&mesh, left, &field, &IDENTITY);
        let right = value_and_slopes(&mesh, right, &field, &x_of_xi);
        assert_close("value and slopes", &right, &left, 1e-13);
    }
    let boundary = boundary_faces(&mesh);
    assert_eq!(boundary.len(), 10);
    assert!(!boundary.contains(&Face { element: 1, side: Side { direction: 1, end: 1 } }));
}

#[test]
fn the_bezier_form_is_the_element_and_its_box_holds_it() {
    let mut random = Random::new(6);
    for element in ELEMENTS {
        let mesh = curved_block(element, [2, 1, 1], 0.3, 7);
        for e in 0..mesh.elements() {
            let local = mesh.local(e);
            let control = local.map(|component| control_values(element, &component));
            let (low, high) = bounding_box(element, &local);
            for _ in 0..200 {
                let xi = random.xi();
                let x = mesh.position(MaterialPoint { element: e, xi });
                assert_close("Bezier form", &control.map(|c| evaluate(&c, xi)), &x, 1e-13);
                assert!((0..3).all(|i| low[i] <= x[i] && x[i] <= high[i]), "{}: outside its box", element.name());
            }
        }
    }
}

#[test]
fn a_block_has_its_size_and_its_sides() {
    for element in ELEMENTS {
        let (origin, size, counts) = ([1.0, -2.0, 3.0], [6.0, 4.0, 5.0], [3, 2, 4]);
        let mesh = block(element, origin, size, counts);
        assert_eq!((mesh.elements(), mesh.nodes), (24, 60));
        let rule = GaussRule::new(2);
        let volume: f64 = (0..mesh.elements())
            .flat_map(|e| rule.cube().map(move |(xi, w)| (MaterialPoint { element: e, xi }, w)))
            .map(|(at, w)| w * determinant(&mesh.jacobian(at)))
            .sum();
        assert!((volume - 120.0).abs() < 1e-11);
        // x is linear in xi, first element first
        let x = mesh.position(MaterialPoint { element: 0, xi: [0.25, 0.5, 0.75] });
        assert_close("position", &x, &[1.5, -1.0, 3.9375], 1e-15);
        let last = mesh.position(MaterialPoint { element: 23, xi: [1.0; 3] });
        assert_close("last corner", &last, &[7.0, 2.0, 8.0], 1e-15);

        let mut named: Vec<Face> = mesh.named_faces.values().flatten().copied().collect();
        named.sort_unstable();
        assert_eq!(named, boundary_faces(&mesh), "{}", element.name());
        for side in Side::ALL {
            let faces = &mesh.named_faces[&side.to_string()];
            let mut area = [0.0; 3];
            for face in faces {
                assert_eq!(face.side, side);
                for (st, w) in rule.square() {
                    let jacobian = mesh.jacobian(MaterialPoint { element: face.element, xi: side.lift(st) });
                    area = risorius::math::tensor::add_scaled(area, w, side.area_vector(&jacobian));
                }
            }
            // outward, as large as the side
            let mut expected = [0.0; 3];
            let across: f64 = side.tangents().iter().map(|d| size[*d]).product();
            expected[side.direction] = if side.end == 1 { across } else { -across };
            assert_close("area", &area, &expected, 1e-13);
        }
    }
}

/// Points of curved elements are found again, in the element they were made in.
#[test]
fn material_points_are_found_again() {
    for element in ELEMENTS {
        for seed in 0..5 {
            let mesh = curved_block(element, [3, 2, 2], 0.1, seed);
            let locator = Locator::new(&mesh);
            let mut random = Random::new(100 + seed);
            for _ in 0..200 {
                let at = MaterialPoint { element: (random.between(0.0, 12.0)) as usize, xi: random.xi() };
                let found = locator.locate(mesh.position(at)).expect("inside");
                assert_eq!(found.element, at.element, "{} {at:?}", element.name());
                let error = largest(&subtract(found.xi, at.xi));
                assert!(error < 1e-12, "{} {at:?}: xi off by {error:.1e}", element.name());
            }
        }
    }
}

#[test]
fn a_point_on_a_shared_face_belongs_to_the_lowest_element() {
    let mesh = curved_block(&TricubicHermite, [2, 2, 2], 0.1, 9);
    let locator = Locator::new(&mesh);
    let mut random = Random::new(10);
    for _ in 0..100 {
        let [s, t, _] = random.xi();
        for element in 0..8 {
            for side in Side::ALL {
                let neighbour = element ^ (1 << side.direction);
                if (element >> side.direction & 1 == 1) == (side.end == 1) {
                    continue;
                }
                let x = mesh.position(MaterialPoint { element, xi: side.lift([s, t]) });
                let found = locator.locate(x).expect("inside");
                assert_eq!(found.element, element.min(neighbour));
                assert!(norm(subtract(mesh.position(found), x)) < 1e-11);
            }
        }
        let centre = mesh.position(MaterialPoint { element: 7, xi: [0.0; 3] });
        assert_eq!(locator.locate(centre).expect("inside").element, 0);
    }
}

/// A point at distance d along the outward normal of a gently curved boundary is d away.
#[test]
fn outside_points_have_their_distance() {
    let mesh = curved_block(&TricubicHermite, [2, 2, 1], 0.02, 11);
    let locator = Locator::new(&mesh);
    let mut random = Random::new(12);
    for face in boundary_faces(&mesh) {
        for _ in 0..10 {
            // away from the edges, where another side may be nearer
            let st = [random.between(0.3, 0.7), random.between(0.3, 0.7)];
            let at = MaterialPoint { element: face.element, xi: face.side.lift(st) };
            let normal = risorius::math::tensor::normalised(face.side.area_vector(&mesh.jacobian(at)));
            let distance = random.between(0.05, 2.0);
            let x = risorius::math::tensor::add_scaled(mesh.position(at), distance, normal);
            let outside = locator.locate(x).expect_err("outside");
            assert!((outside.distance - distance).abs() < 1e-9, "{} instead of {distance}", outside.distance);
            assert!((norm(subtract(mesh.position(outside.nearest), x)) - outside.distance).abs() < 1e-12);
            assert!(largest(&subtract(outside.nearest.xi, at.xi)) < 1e-5);
        }
    }
}

/// Against a search over a dense grid of every face, refined around its best points.
#[test]
fn projection_finds_the_nearest_point_of_a_curved_surface() {
    let mesh = curved_block(&TricubicHermite, [2, 1, 1], 0.08, 13);
    let surface = Surface::new(&mesh);
    let at =
        |face: Face, st: [f64; 2]| mesh.position(MaterialPoint { element: face.element, xi: face.side.lift(st) });
    const GRID: usize = 24;
    let brute = |x: Vector| -> f64 {
        let mut best = f64::INFINITY;
        for face in boundary_faces(&mesh) {
            let distance = |st: [f64; 2]| norm(subtract(at(face, st), x));
            let node = |k: usize| [(k % (GRID + 1)) as f64 / GRID as f64, (k / (GRID + 1)) as f64 / GRID as f64];
            let mut st = (0..(GRID + 1) * (GRID + 1))
                .map(node)
                .min_by(|a, b| distance(*a).total_cmp(&distance(*b)))
                .expect("a grid");
            let mut step = 1.0 / GRID as f64;
            while step > 1e-9 {
                let moves = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0], [1.0, 1.0], [-1.0, -1.0]];
                let trial = moves
                    .map(|m| [(st[0] + step * m[0]).clamp(0.0, 1.0), (st[1] + step * m[1]).clamp(0.0, 1.0)])
                    .into_iter()
                    .min_by(|a, b| distance(*a).total_cmp(&distance(*b)))
                    .expect("six moves");
                if distance(trial) < distance(st) { st = trial } else { step *= 0.5 }
            }
            best = best.min(distance(st));
        }
        best
    };
    let mut random = Random::new(14);
    for _ in 0..100 {
        let x = [random.between(-5.0, 25.0), random.between(-5.0, 15.0), random.between(-5.0, 15.0)];
        let foot = surface.project(x).expect("a surface");
        let error = foot.distance - brute(x);
        assert!(error.abs() < 1e-7, "{x:?}: {error:.1e} too far");
        assert!((norm(subtract(mesh.position(foot.point), x)) - foot.distance).abs() < 1e-12);
        assert_eq!(foot.point.element, foot.face.element);
        assert_eq!(foot.point.xi[foot.face.side.direction], foot.face.side.end as f64);
    }
}

/// Right-handed and orthonormal for any geometry and angles.
#[test]
fn fibre_axes_are_orthonormal() {
    let mut random = Random::new(15);
    for _ in 0..100 {
        let jacobian = random.deformation();
        let [fibre, sheet, normal] = axes(&jacobian, random.triple().map(|a| 3.0 * a));
        for (u, v, expected) in [(fibre, fibre, 1.0), (sheet, sheet, 1.0), (fibre, sheet, 0.0)] {
            assert!((dot(u, v) - expected).abs() < 1e-14);
        }
        assert!(largest(&subtract(normal, cross(fibre, sheet))) < 1e-14);
    }
}

/// On a straight element: A turns the fibre from xi1 to xi2, B tips it towards -xi3, G leaves it and turns the sheet
/// towards the normal.
#[test]
fn fibre_angles_have_their_signs() {
    let (a, b, g) = (0.4_f64, 0.3_f64, 0.2_f64);
    assert_eq!(axes(&IDENTITY, [0.0; 3]), IDENTITY);
    let fibre = |angles: [f64; 3]| axes(&IDENTITY, angles)[0];
    assert_close("A", &fibre([a, 0.0, 0.0]), &[a.cos(), a.sin(), 0.0], 1e-15);
    assert_close("B", &fibre([0.0, b, 0.0]), &[b.cos(), 0.0, -b.sin()], 1e-15);
    assert_close("A, B", &fibre([a, b, 0.0]), &[b.cos() * a.cos(), b.cos() * a.sin(), -b.sin()], 1e-15);
    assert_close("G", &fibre([a, b, g]), &fibre([a, b, 0.0]), 1e-15);
    assert_close("sheet", &axes(&IDENTITY, [0.0, 0.0, g])[1], &[0.0, g.cos(), g.sin()], 1e-15);
    // f1 follows xi1 and f3 stands on the surface of xi1 and xi2, however skew xi3 and xi2 are
    let skew = [[2.0, 0.7, 0.3], [0.0, 1.5, -0.2], [0.0, 0.0, 3.0]];
    assert_close("skew", axes(&skew, [0.0; 3]).as_flattened(), IDENTITY.as_flattened(), 1e-15);
}

/// Angles are trilinear between the nodes; the direction follows the geometry.
#[test]
fn fibre_angles_are_interpolated() {
    let mesh = curved_block(&TricubicHermite, [2, 1, 1], 0.05, 16);
    let mut random = Random::new(17);
    let angles = FibreAngles::at_nodes((0..mesh.nodes).map(|_| random.triple()).collect());
    for corner in 0..8 {
        let xi = ends(corner).map(|end| end as f64);
        assert_eq!(angles.at(&mesh, 1, xi), angles.nodes[mesh.corners[1][corner]]);
    }
    let middle = angles.at(&mesh, 0, [0.5; 3]);
    let mean: Vector =
        std::array::from_fn(|i| mesh.corners[0].iter().map(|n| angles.nodes[*n][i]).sum::<f64>() / 8.0);
    assert_close("mean", &middle, &mean, 1e-14);
    let at = MaterialPoint { element: 0, xi: [0.5; 3] };
    let expected = axes(&mesh.jacobian(at), middle)[0];
    assert_eq!(angles.direction(&mesh, 0, &mesh.local(0), [0.5; 3]), expected);
}

/// The volume of an affine image is the determinant times that of the block; of a curved body, what a finer rule finds.
#[test]
fn volumes_are_exact() {
    let mut random = Random::new(21);
    for element in ELEMENTS {
        let mesh = block(element, [1.0, -2.0, 0.5], [6.0, 4.0, 3.0], [3, 2, 1]);
        assert!((mesh.volume(&mesh.parameters) - 72.0).abs() < 1e-11);
        let f = random.deformation();
        let apply = |x: &[f64; 3]| std::array::from_fn(|i| (0..3).map(|j| f[i][j] * x[j]).sum());
        let moved: Vec<[f64; 3]> = mesh.parameters.iter().map(apply).collect();
        let expected = 72.0 * determinant(&f);
        assert!((mesh.volume(&moved) - expected).abs() < 1e-11 * expected.abs());
    }
    let curved = curved_block(&TricubicHermite, [2, 2, 1], 0.05, 9);
    let rule = GaussRule::new(8);
    let along = || rule.points.iter().zip(&rule.weights);
    let mut finer = 0.0;
    for element in 0..curved.elements() {
        for (x, a) in along() {
            for (y, b) in along() {
                for (z, c) in along() {
                    finer += a * b * c * determinant(&curved.jacobian(MaterialPoint { element, xi: [*x, *y, *z] }));
                }
            }
        }
    }
    let volume = curved.volume(&curved.parameters);
    assert!((volume - finer).abs() < 1e-12 * finer, "{volume} {finer}");
}
