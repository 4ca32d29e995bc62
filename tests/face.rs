//! The face that is built in: its mesh, its landmarks, its muscles, a run, and the template.

use assert_cmd::Command;
use risorius::fit::sensitivity::{Sensitivity, sensitivities};
use risorius::forward::{Drive, Settings, Solver};
use risorius::material::fibre::Blemker;
use risorius::math::tensor::{Vector, add_scaled, determinant, dot, norm, normalised, subtract};
use risorius::mesh::element::ends;
use risorius::mesh::face::Face;
use risorius::mesh::facial::{BodySide, Course, FACES, Landmark, Options, host};
use risorius::mesh::fibre_angles::FibreAngles;
use risorius::mesh::location::Locator;
use risorius::mesh::{MaterialPoint, Mesh, position_and_jacobian};
use risorius::model::build::build;
use risorius::report::frame::contact_states;
use risorius::scene::{GeometrySpec, Scene, built_in_face};
use risorius::term::contact::surface::{Arch, RigidSurface};
use risorius::term::muscle::Muscle;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

const WHOLE: Options = Options { layers: 1, halved: false, half: false };
const LAYERS: Options = Options { layers: 2, ..WHOLE };
const HALVED: Options = Options { halved: true, ..WHOLE };
const HALF: Options = Options { half: true, ..WHOLE };

fn mesh(options: Options) -> Mesh {
    host(&built_in_face().sheet, options)
}

fn landmark(name: &str) -> Landmark {
    let face = built_in_face();
    face.landmarks.iter().find(|l| l.name == name).unwrap_or_else(|| panic!("no {name}")).clone()
}

fn close(a: Vector, b: Vector, tolerance: f64, what: &str) {
    assert!(norm(subtract(a, b)) <= tolerance, "{what}: {a:?} is not {b:?}");
}

fn mirrored([x, y, z]: Vector) -> Vector {
    [-x, y, z]
}

/// Gauss points of order 5 on [0, 1] (Abramowitz and Stegun, table 25.4).
fn gauss() -> [f64; 5] {
    [-0.906179845938664, -0.538469310105683, 0.0, 0.538469310105683, 0.906179845938664].map(|x| 0.5 + 0.5 * x)
}

#[test]
fn the_mesh_has_the_papers_size_and_no_element_is_inside_out() {
    // Wu et al. 2013, section 4: 560 elements; 1180 nodes there, 1240 here, which count both sides of the slits
    for (options, elements, nodes, least) in [
        (WHOLE, 560, 1240, 0.1),
        (LAYERS, 1120, 1860, 0.1),
        (HALVED, 2240, 4724, 0.1),
        (HALF, 280, 642, 0.1),
        (Options { layers: 4, half: true, ..HALVED }, 4480, 6010, 0.1),
    ] {
        let mesh = mesh(options);
        assert_eq!((mesh.elements(), mesh.nodes), (elements, nodes), "{options:?}");
        assert_eq!(mesh.parameters.len(), 8 * nodes);
        let (mut smallest, mut worst, mut where_worst) = (f64::INFINITY, f64::INFINITY, 0);
        for element in 0..mesh.elements() {
            let local = mesh.local(element);
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            for point in 0..125 {
                let xi = [point % 5, point / 5 % 5, point / 25].map(|k| gauss()[k]);
                let det = determinant(&position_and_jacobian(mesh.element, &local, xi).1);
                (low, high) = (low.min(det), high.max(det));
            }
            smallest = smallest.min(low);
            if low / high < worst {
                (worst, where_worst) = (low / high, element);
            }
        }
        println!("| {options:?} | {smallest:.2} mm3 | {worst:.3} in {where_worst} |");
        assert!(smallest > 0.0 && worst > least, "{options:?}: {smallest} mm3, ratio {worst} in {where_worst}");
    }
}

/// Pairs of elements that share a face, with the direction through it: the first is below.
fn neighbours(mesh: &Mesh) -> Vec<(usize, usize, usize)> {
    let key = |element: usize, direction: usize, end: usize| -> [usize; 4] {
        let on: Vec<usize> =
            (0..8).filter(|k| ends(*k)[direction] == end).map(|k| mesh.corners[element][k]).collect();
        on.try_into().unwrap()
    };
    let mut pairs = Vec::new();
    for direction in 0..3 {
        let lower: HashMap<[usize; 4], usize> = (0..mesh.elements()).map(|e| (key(e, direction, 1), e)).collect();
        for e in 0..mesh.elements() {
            if let Some(below) = lower.get(&key(e, direction, 0)) {
                pairs.push((*below, e, direction));
            }
        }
    }
    pairs
}

#[test]
fn tangents_are_continuous_everywhere_but_across_the_slits() {
    for options in [WHOLE, Options { layers: 2, ..HALVED }] {
        let mesh = mesh(options);
        let pairs = neighbours(&mesh);
        let (n, m) = if options.halved { (56, 40) } else { (28, 20) };
        let slits = if options.halved { 12 + 16 } else { 6 + 8 };
        let inner = ((n - 1) * m + n * (m - 1) - slits) * options.layers + n * m * (options.layers - 1);
        assert_eq!(pairs.len(), inner);
        for (below, above, direction) in pairs {
            for [s, t] in [[0.0, 0.0], [0.3, 0.8], [1.0, 0.4], [0.7, 1.0]] {
                let at = |element: usize, end: f64| {
                    let mut xi = [0.0; 3];
                    xi[(direction + 1) % 3] = s;
                    xi[(direction + 2) % 3] = t;
                    xi[direction] = end;
                    position_and_jacobian(mesh.element, &mesh.local(element), xi)
                };
                let ((x, a), (y, b)) = (at(below, 1.0), at(above, 0.0));
                close(x, y, 1e-9, "position");
                (0..3).for_each(|i| close(a[i], b[i], 1e-9, &format!("tangents of {below} and {above}")));
            }
        }
    }
}

#[test]
fn the_right_half_mirrors_the_left_one() {
    let mesh = mesh(WHOLE);
    for element in 0..mesh.elements() {
        let other = element / 28 * 28 + 27 - element % 28;
        for xi in [[0.0, 0.3, 0.0], [0.2, 0.9, 1.0], [1.0, 0.5, 0.5]] {
            let x = mesh.position(MaterialPoint { element, xi });
            let y = mesh.position(MaterialPoint { element: other, xi: [1.0 - xi[0], xi[1], xi[2]] });
            close(mirrored(x), y, 1e-9, "mirror image");
        }
    }
}

#[test]
fn refined_meshes_and_half_a_face_have_the_same_shape() {
    let coarse = mesh(WHOLE);
    let (layers, halved, half) = (mesh(LAYERS), mesh(HALVED), mesh(HALF));
    for element in 0..560 {
        let (s, t) = (element % 28, element / 28);
        for xi in [[0.2f64, 0.7, 0.3], [0.9, 0.1, 0.8]] {
            let x = coarse.position(MaterialPoint { element, xi });
            let upper = usize::from(xi[2] > 0.5);
            let in_layer = [xi[0], xi[1], 2.0 * xi[2] - upper as f64];
            close(layers.position(MaterialPoint { element: element + 560 * upper, xi: in_layer }), x, 1e-9, "layers");
            let part = [0, 1].map(|d| usize::from(xi[d] > 0.5));
            let there = [2.0 * xi[0] - part[0] as f64, 2.0 * xi[1] - part[1] as f64, xi[2]];
            let fine = 2 * s + part[0] + 56 * (2 * t + part[1]);
            close(halved.position(MaterialPoint { element: fine, xi: there }), x, 1e-9, "halved");
            if s >= 14 {
                close(half.position(MaterialPoint { element: s - 14 + 14 * t, xi }), x, 1e-9, "half");
            }
        }
    }
}

#[test]
fn every_named_face_is_where_its_name_says() {
    let whole = mesh(WHOLE);
    let half = mesh(HALF);
    for name in FACES {
        let missing = if name == "midline" { &whole } else { &half };
        let in_both = !name.ends_with(".R") && name != "midline";
        assert!(whole.named_faces.contains_key(name) || name == "midline", "{name}");
        assert_eq!(missing.named_faces.contains_key(name), in_both, "{name}");
    }
    assert!(half.named_faces.contains_key("midline"));
    let count = |name: &str| whole.named_faces[name].len();
    assert_eq!((count("skin"), count("deep"), count("rim")), (560, 560, 2 * (28 + 20)));
    assert_eq!((count("lip.upper"), count("lip.lower"), count("lid.upper.L"), count("lid.lower.R")), (6, 6, 4, 4));
    let parts = ["deep.perioral", "deep.nose", "deep.sliding", "deep.eye.L", "deep.eye.R"].map(count);
    assert_eq!(parts.iter().sum::<usize>(), 560, "{parts:?}");
    // the border: on the skull above the line between the lips, on the jaw below the chin, on neither between them
    let parts = ["rim", "rim.skull", "rim.jaw"].map(|name| whole.named_faces[name].clone());
    assert_eq!(parts.each_ref().map(Vec::len), [96, 28 + 2 * 14, 16]);
    assert!(parts[1].iter().chain(&parts[2]).all(|face| parts[0].contains(face)));
    let nodes = |faces: &[Face]| -> BTreeSet<usize> {
        faces.iter().flat_map(|f| f.side.nodes().map(|k| whole.corners[f.element][k])).collect()
    };
    assert!(nodes(&parts[1]).is_disjoint(&nodes(&parts[2])));
    // what lies on the jaw ends at the line between the lips
    for part in ["deep.perioral", "deep.sliding"] {
        let height = |face: &Face| whole.position(MaterialPoint { element: face.element, xi: [0.5, 0.5, 0.0] })[1];
        let [jaw, skull] = ["jaw", "skull"].map(|bone| &whole.named_faces[&format!("{part}.{bone}")]);
        // the cheeks between the two lie on neither
        let cheek = whole.named_faces.get(&format!("{part}.cheek")).map_or(0, Vec::len);
        assert_eq!(
            (jaw.len() + skull.len() + cheek, cheek),
            (count(part), if part == "deep.sliding" { 40 } else { 0 })
        );
        let mouth = |face: &&Face| (12..16).contains(&(face.element % 28));
        assert!(jaw.iter().filter(mouth).all(|face| height(face) < landmark("cheilion").position[1]));
        assert!(skull.iter().filter(mouth).all(|face| height(face) > landmark("cheilion").position[1]));
    }
    // the margins of the lips are round: one above the other, 0.2 mm apart where they are nearest, which is within their
    // thickness, 4.4 mm at the back and 1.6 mm at the skin; at the corners they meet
    let (upper, lower) = (&whole.named_faces["lip.upper"], &whole.named_faces["lip.lower"]);
    let gap = |k: usize, s: f64, w: f64| {
        let above = whole.position(MaterialPoint { element: upper[k].element, xi: [s, 0.0, w] });
        let [x, y, z] = subtract(above, whole.position(MaterialPoint { element: lower[k].element, xi: [s, 1.0, w] }));
        assert!(x.abs() < 1e-9 && y > -1e-9 && z.abs() < 1e-9, "{x} {y} {z}");
        y
    };
    let middle: Vec<f64> = (0..=100).map(|k| gap(3, 0.0, k as f64 / 100.0)).collect();
    let nearest = middle.iter().copied().fold(f64::INFINITY, f64::min);
    assert!((0.2..0.201).contains(&nearest) && (middle[0] - 4.4).abs() < 1e-9 && (middle[100] - 1.6).abs() < 1e-9);
    for k in 0..6 {
        assert!(gap(k, 0.5, 0.0) > 0.1 && (0..=10).all(|w| gap(k, 0.5, 0.1 * w as f64) > 0.0));
    }
    assert!(gap(0, 0.0, 0.0) < 1e-9 && gap(5, 1.0, 0.4) < 1e-9);
    let ends = |name: &str, s: f64| {
        let faces = &whole.named_faces[name];
        let element = if s == 1.0 { faces[faces.len() - 1].element } else { faces[0].element };
        whole.position(MaterialPoint { element, xi: [s, 0.0, 1.0] })
    };
    for (what, found) in [
        ("cheilion", ends("lip.upper", 1.0)),
        ("endocanthion", ends("lid.upper.L", 0.0)),
        ("exocanthion", ends("lid.upper.L", 1.0)),
    ] {
        let distance = norm(subtract(found, landmark(what).position));
        println!("{what}: the corner of the slit is {distance:.2} mm from the landmark");
        assert!(distance < 2.0, "{what} is at {:?}, the slit ends at {found:?}", landmark(what).position);
    }
    // the lids stand as far apart as in the mean face, 8.0 mm
    let upper =
        whole.position(MaterialPoint { element: whole.named_faces["lid.upper.L"][2].element, xi: [0.0, 0.0, 1.0] });
    let lower =
        whole.position(MaterialPoint { element: whole.named_faces["lid.lower.L"][2].element, xi: [0.0, 1.0, 1.0] });
    assert!((6.5..10.0).contains(&norm(subtract(upper, lower))), "{upper:?} {lower:?}");
}

#[test]
fn the_sheet_goes_through_every_landmark_with_its_thickness() {
    let face = built_in_face();
    assert!(face.landmarks.len() >= 70);
    for l in &face.landmarks {
        let (skin, deep) = (face.sheet.at(l.u, l.v, 1.0).position, face.sheet.at(l.u, l.v, 0.0).position);
        close(skin, l.position, 1e-6, &l.name);
        assert!((norm(subtract(skin, deep)) - l.thickness).abs() < 1e-6, "{}", l.name);
    }
    // by differences: the derivatives by u, v and w, on both sides
    let step = 1e-4;
    for [u, v, w] in [[12.3, -20.1, 0.4], [-40.2, 22.2, 1.0], [71.0, 5.0, 0.0], [0.0, -60.0, 0.7]] {
        let spot = face.sheet.at(u, v, w);
        for d in 0..3 {
            let at = |h: f64| {
                let mut p = [u, v, w];
                p[d] += h;
                face.sheet.at(p[0], p[1], p[2]).position
            };
            let difference = subtract(at(step), at(-step)).map(|x| x / (2.0 * step));
            close(spot.along[d], difference, 1e-6, "derivative");
        }
    }
}

#[test]
fn distances_and_thicknesses_are_published_ones() {
    let at = |name: &str| landmark(name).position;
    let across = |name: &str| 2.0 * at(name)[0];
    let between = |a: &str, b: &str| norm(subtract(at(a), at(b)));
    // the mean face of the ICT FaceKit, mm; in brackets what Kim et al. publish as means of one population (men / women)
    for (what, found, wanted, within) in [
        ("ex-ex (98.2 / 94.4)", across("exocanthion"), 89.2, 1.0),
        ("en-en (32.2 / 32.1)", across("endocanthion"), 36.9, 1.0),
        ("ch-ch (55.9 / 52.0)", across("cheilion"), 50.7, 1.0),
        ("al-al (43.2 / 40.7)", across("alare"), 36.9, 2.0),
        ("n-sn (51.0 / 47.6)", between("sellion", "subnasale"), 50.1, 1.0),
        ("n-gn", between("sellion", "menton"), 113.1, 1.0),
        ("zy-zy (133.8 / 130.1)", across("zygion"), 133.8, 6.0),
    ] {
        println!("| {what} | {found:.1} | {wanted} |");
        assert!((found - wanted).abs() <= within, "{what}: {found} mm, not {wanted} +- {within}");
    }
    // medians by region of the ArtiSynth face model (Badin subject), mm, between landmarks too
    let face = built_in_face();
    for (region, places, wanted, within) in [
        ("forehead", vec![[0.0, 66.0], [15.0, 72.0], [30.0, 70.0]], 8.6, 1.0),
        ("nose", vec![[0.0, 20.0], [0.0, 12.0], [10.0, 10.0]], 7.1, 1.0),
        ("below the eye", vec![[32.0, 12.0], [30.0, 10.0]], 9.1, 1.5),
        ("upper lip", vec![[0.0, -20.0], [10.0, -20.0], [5.0, -24.0]], 10.6, 1.0),
        ("lower lip", vec![[0.0, -44.0], [10.0, -44.0], [5.0, -48.0]], 10.5, 1.0),
        ("chin", vec![[0.0, -64.0], [10.0, -66.0]], 13.1, 1.0),
        ("mid cheek", vec![[56.0, -14.0], [60.0, -22.0]], 20.0, 1.5),
    ] {
        for [u, v] in places {
            let thickness = norm(subtract(face.sheet.at(u, v, 1.0).position, face.sheet.at(u, v, 0.0).position));
            assert!((thickness - wanted).abs() <= within, "{region} at ({u}, {v}): {thickness} mm, not {wanted}");
        }
    }
}

/// Length along the middle, mean width and mean thickness of a muscle's mesh, mm.
fn size(course: &Course) -> [f64; 3] {
    let (mesh, _) = course.mesh(&built_in_face().sheet, BodySide::Left);
    let [n1, n2, n3] = course.elements;
    let at = |i: usize, j: f64, k: f64| {
        // the middle of an even number of elements is a node, of an odd number the middle of an element
        let part = |x: f64, n: usize| ((x * n as f64) as usize).min(n - 1);
        let (j0, k0) = (part(j, n2), part(k, n3));
        let element = i.min(n1 - 1) + n1 * (j0 + n2 * k0);
        let xi = [(i - i.min(n1 - 1)) as f64, j * n2 as f64 - j0 as f64, k * n3 as f64 - k0 as f64];
        mesh.position(MaterialPoint { element, xi })
    };
    let length = (0..n1).map(|i| norm(subtract(at(i + 1, 0.5, 0.5), at(i, 0.5, 0.5)))).sum();
    let mean = |f: &dyn Fn(usize) -> f64| (0..=n1).map(f).sum::<f64>() / (n1 + 1) as f64;
    let width = mean(&|i| {
        (0..n2)
            .map(|j| {
                let y = |j: usize| j as f64 / n2 as f64;
                norm(subtract(at(i, y(j + 1), 0.5), at(i, y(j), 0.5)))
            })
            .sum()
    });
    [length, width, mean(&|i| norm(subtract(at(i, 0.5, 1.0), at(i, 0.5, 0.0))))]
}

/// Name, abbreviation, number, and published ranges of length, width and thickness in mm; `None` where none was found. Sources:
/// lengths of muscle lines of the ArtiSynth face model ("A", 3 mm of doubt), diagonals of the boxes of BodyParts3D ("B", an upper
/// bound of a straight muscle, 5 mm of doubt), cadavers and ultrasound as named.
type Row = (&'static str, &'static str, Option<usize>, Option<[f64; 2]>, Option<[f64; 2]>, [f64; 2], &'static str);
#[rustfmt::skip]
const MUSCLES: [Row; 15] = [
    ("buccinator", "BUC", Some(46836), Some([30.8 - 3.0, 43.2 + 3.0]), Some([10.0, 35.1]), [1.5, 3.0], "A; B height 35.1; van Alfen 2013"),
    ("corrugator_supercilii", "COR", Some(46797), Some([29.24 - 6.4, 29.24 + 6.4]), Some([12.62 - 3.3, 12.62 + 3.3]), [1.62 - 0.4, 1.62 + 0.4], "50 hemibrows"),
    ("depressor_anguli_oris", "DAO", Some(46830), Some([25.1 - 3.0, 28.8 + 3.0]), Some([5.0, 23.3]), [1.5, 3.0], "A; B; van Alfen 2013"),
    ("depressor_labii_inferioris", "DLI", Some(46818), Some([16.1 - 3.0, 21.4 + 3.0]), Some([5.0, 29.6]), [1.5, 3.0], "A; B; van Alfen 2013"),
    ("frontalis", "FRO", None, None, None, [1.5, 3.0], "van Alfen 2013; only its part below the hairline"),
    ("levator_anguli_oris", "LAO", Some(46824), Some([34.9 - 3.0, 34.9 + 3.0]), Some([5.0, 16.4]), [1.5, 3.0], "A; B; van Alfen 2013"),
    ("levator_labii_superioris", "LLS", Some(46807), Some([35.1 - 3.0, 35.1 + 3.0]), Some([5.0, 26.2]), [1.5, 3.0], "A; B; van Alfen 2013"),
    ("levator_labii_superioris_alaeque_nasi", "LLSAN", Some(46804), Some([28.8 - 3.0, 36.6 + 3.0]), Some([3.0, 7.0]), [1.4, 3.0], "A; B; van Alfen 2013"),
    ("mentalis", "MEN", Some(46827), Some([16.4 - 3.0, 16.8 + 3.0]), Some([5.0, 13.2]), [1.5, 6.8], "A; B"),
    ("orbicularis_oris", "OOR", Some(46841), Some([74.6 - 8.0, 75.7 + 8.0]), Some([7.0, 14.0]), [1.5, 3.0], "A, half ring; B; van Alfen 2013"),
    ("orbicularis_oculi_orbital", "OOC", Some(46783), None, Some([5.0, 12.0]), [1.4, 3.0], "B outer box less inner box; van Alfen 2013"),
    ("orbicularis_oculi_palpebral", "POC", Some(46786), None, Some([3.0, 7.0]), [0.8, 3.0], "B inner box less the opening; van Alfen 2013"),
    ("risorius", "RIS", Some(46840), Some([41.9 - 5.0, 53.0 + 3.0]), Some([3.0, 12.0]), [1.4, 3.0], "A; B; van Alfen 2013"),
    ("zygomaticus_major", "ZMA", Some(46813), Some([45.5 - 5.0, 55.7 + 3.0]), Some([8.5 - 2.0, 8.9 + 2.0]), [1.5, 3.0], "51 cadavers, Stoltidou 2011; A; van Alfen 2013"),
    ("zygomaticus_minor", "ZMI", Some(46815), Some([35.0, 52.9]), Some([3.0, 8.0]), [1.5, 3.0], "B; van Alfen 2013"),
];

#[test]
fn the_fifteen_muscles_have_published_sizes() {
    let face = built_in_face();
    assert_eq!(face.muscles.len(), 15);
    println!("| muscle | length | width | thickness | published | source |");
    for (name, abbreviation, fma, length, width, thickness, source) in MUSCLES {
        let course = face.muscle(name).unwrap_or_else(|| panic!("no {name}"));
        assert_eq!((&course.abbreviation[..], course.fma), (abbreviation, fma), "{name}");
        let found = size(course);
        println!(
            "| {abbreviation} | {:.1} | {:.1} | {:.2} | {length:?} {width:?} {thickness:?} | {source} |",
            found[0], found[1], found[2]
        );
        for (found, range) in found.into_iter().zip([length, width, Some(thickness)]) {
            let Some([low, high]) = range else { continue };
            assert!(low <= found && found <= high, "{name}: {found} mm is not from {low} to {high} ({source})");
        }
    }
    // the rings lie in the boxes around them: outer 43 x 48 mm, inner 33 x 23 mm, 5 mm of doubt on each side
    for (name, width, height) in
        [("orbicularis_oculi_orbital", 42.9, 48.1), ("orbicularis_oculi_palpebral", 32.7, 23.4)]
    {
        let (mesh, _) = face.muscle(name).unwrap().mesh(&face.sheet, BodySide::Left);
        for (d, wanted) in [(0, width), (1, height)] {
            let extent = mesh
                .parameters
                .iter()
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], x| [l.min(x[d]), h.max(x[d])]);
            let found = extent[1] - extent[0];
            println!("{name}: {found:.1} mm, box {wanted} mm");
            assert!((found - wanted).abs() <= 10.0, "{name}: {found} mm, not {wanted} +- 10 mm");
        }
    }
}

/// Middle and fibre of every element of a muscle.
fn fibres((mesh, angles): &(Mesh, FibreAngles)) -> Vec<(Vector, Vector)> {
    (0..mesh.elements())
        .map(|element| {
            let local = mesh.local(element);
            let (x, _) = position_and_jacobian(mesh.element, &local, [0.5; 3]);
            (x, angles.direction(mesh, element, &local, [0.5; 3]))
        })
        .collect()
}

#[test]
fn fibres_run_along_their_muscles_circulate_and_converge() {
    let face = built_in_face();
    for course in &face.muscles {
        let left = course.mesh(&face.sheet, BodySide::Left);
        let right = course.mesh(&face.sheet, BodySide::Right);
        let (own, other) = (fibres(&left), fibres(&right));
        let [n1, n2, _] = course.elements;
        for (index, (x, fibre)) in own.iter().enumerate() {
            assert!((norm(*fibre) - 1.0).abs() < 1e-12);
            let (i, j, k) = (index % n1, index / n1 % n2, index / n1 / n2);
            let (y, mirror) = other[i + n1 * (n2 - 1 - j + n2 * k)];
            close(mirrored(*x), y, 1e-9, &course.name);
            close(mirrored(*fibre), mirror, 1e-9, &course.name);
            // along the chord between the elements before and after, unless the fibres of the muscle converge
            let (back, next) = match course.closed {
                true => ((i + n1 - 1) % n1, (i + 1) % n1),
                false => (i.saturating_sub(1), (i + 1).min(n1 - 1)),
            };
            if course.focus.is_none() {
                let along = normalised(subtract(own[index - i + next].0, own[index - i + back].0));
                assert!(dot(along, *fibre) > 0.95, "{}: {along:?} {fibre:?} in element {index}", course.name);
            }
        }
        assert_eq!(course.closed, course.name.starts_with("orbicularis_oculi"));
        // the fibres of a ring turn once around
        if course.closed {
            let turned: f64 = (0..n1)
                .map(|i| {
                    let (a, b) = (own[i].1, own[(i + 1) % n1].1);
                    (a[0] * b[1] - a[1] * b[0]).atan2(a[0] * b[0] + a[1] * b[1])
                })
                .sum();
            assert!((turned.abs() - std::f64::consts::TAU).abs() < 1e-6, "{}: {turned}", course.name);
            assert_eq!(left.0.nodes, n1 * (n2 + 1) * 2);
        }
    }
    // along the surface, the fibres of buccinator point to the modiolus, which lines along its strip miss
    let course = face.muscle("buccinator").unwrap();
    let [u, v] = course.focus.expect("a fan");
    let focus = face.sheet.at(u, v, 0.2).position;
    let (mesh, angles) = course.mesh(&face.sheet, BodySide::Left);
    let (mut fan, mut strip): (f64, f64) = (0.0, 0.0);
    for element in 0..mesh.elements() {
        let local = mesh.local(element);
        let (x, jacobian) = position_and_jacobian(mesh.element, &local, [0.5; 3]);
        let normal = normalised(jacobian.map(|row| row[2]));
        let flat = |a: Vector| normalised(add_scaled(a, -dot(a, normal), normal));
        let to = flat(subtract(focus, x));
        let angle = |d: Vector| dot(flat(d), to).min(1.0).acos().to_degrees();
        fan = fan.max(angle(angles.direction(&mesh, element, &local, [0.5; 3])));
        strip = strip.max(angle(jacobian.map(|row| row[0])));
    }
    println!("buccinator: fibres point within {fan:.1} degrees of the modiolus, its strip within {strip:.1}");
    assert!(fan < 4.0 && strip > 12.0, "{fan} {strip}");
}

#[test]
fn every_point_of_every_muscle_is_inside_every_mesh_of_the_face() {
    let face = built_in_face();
    let law = Blemker { sigma_max: 300.0, lambda_star: 1.4, lambda_ofl: 1.0, p1: 0.005, p2: 6.6 };
    for options in [WHOLE, LAYERS, HALVED] {
        let host = mesh(options);
        let locator = Locator::new(&host);
        for course in &face.muscles {
            for side in BodySide::ALL {
                let (mesh, angles) = course.mesh(&face.sheet, side);
                let muscle = Muscle::new(&course.name, &locator, &mesh, &angles, 3, law, 0);
                let muscle = muscle.unwrap_or_else(|error| panic!("{} {options:?}: {error:?}", course.name));
                assert_eq!(muscle.points().len(), mesh.elements() * 27);
            }
        }
        for ligament in &face.ligaments {
            for side in BodySide::ALL {
                let at = face.ligament(&ligament.name, side).unwrap();
                assert!(locator.locate(at).is_ok(), "{} {options:?}", ligament.name);
            }
        }
    }
}

const HALF_FACE: &str = r#"
[task]
kind = "forward"
[mesh]
face = { half = true }
[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
gauss = 4
[[muscle]]
face = "zygomaticus_major"
side = "L"
blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }
[[support]]
clamp = { face = ["rim", "deep.sliding", "deep.nose"] }
[[support]]
symmetry = { face = "midline" }
[[attachment]]
ligament = "mandibular.L"
stiffness_mn_per_mm = 20
[controls]
zygomaticus_major.L = 0.01
[[probe]]
name = "mouth corner"
position_mm = [27.0, -35.5, 99.0]
"#;

fn parse(text: &str, overrides: &[&str]) -> risorius::Result<Scene> {
    let overrides: Vec<String> = overrides.iter().map(|o| (*o).to_owned()).collect();
    Scene::parse(text, "face.toml", Path::new("."), &overrides)
}

#[test]
fn a_muscle_pulls_the_corner_of_the_mouth_to_its_origin() {
    let scene = parse(HALF_FACE, &[]).unwrap();
    let built = build(&scene).unwrap();
    let mut solver = Solver::new(&built.model, Settings::default()).unwrap();
    let found = solver.equilibrium(&built.model.rest(), &Drive { controls: vec![0.01], load: 1.0 });
    let found = found.unwrap_or_else(|failure| panic!("{}", failure.error));
    let moved = built.model.mesh().interpolate(built.probes[0], &found.state.u);
    let face = built_in_face();
    let path = &face.muscle("zygomaticus_major").unwrap().path;
    let end = |p: [f64; 3]| face.sheet.at(p[0], p[1], p[2]).position;
    let pull = normalised(subtract(end(path[0]), end(path[path.len() - 1])));
    println!("the corner of the mouth moves by {moved:?} mm");
    assert!(norm(moved) > 0.2 && dot(moved, pull) > 0.8 * norm(moved), "{moved:?}, pulled along {pull:?}");
    assert_eq!(found.negative_modes, Some(0));
}

/// Teeth and jaws lie close behind the lips and touch them nowhere; half a face and finer meshes have the same ones.
#[test]
fn the_arch_is_close_behind_the_lips() {
    let arch = |mesh: &Mesh| Arch::new(mesh, &mesh.named_faces["deep.perioral"]);
    let [whole, half, halved] = [WHOLE, HALF, HALVED].map(mesh);
    let surfaces = [&whole, &half, &halved].map(arch);
    let (mut nearest, mut farthest, mut sum, mut count) = (f64::INFINITY, 0.0_f64, 0.0, 0.0);
    for face in &whole.named_faces["deep.perioral"] {
        for [s, t] in gauss().into_iter().flat_map(|s| gauss().map(|t| [s, t])) {
            let x = whole.position(MaterialPoint { element: face.element, xi: face.side.lift([s, t]) });
            let gaps =
                surfaces.each_ref().map(|arch| arch.gap(x).unwrap_or_else(|| panic!("beyond it at {x:?}")).value);
            assert!((gaps[1] - gaps[0]).abs() < 1e-9, "half a face: {gaps:?} at {x:?}");
            assert!((gaps[2] - gaps[0]).abs() < 0.1, "halved elements: {gaps:?} at {x:?}");
            (nearest, farthest) = (nearest.min(gaps[0]), farthest.max(gaps[0]));
            (sum, count) = (sum + gaps[0], count + 1.0);
        }
    }
    println!("the arch is {nearest:.3} to {farthest:.2} mm behind the lips, {:.2} mm in the mean", sum / count);
    assert!(nearest > 0.0 && farthest < 4.0, "{nearest} to {farthest}");
}

/// The face as in problems/smile with all muscles of the left side.
fn all_muscles() -> Scene {
    let text = std::fs::read_to_string("problems/smile/problem.toml").unwrap();
    let face = built_in_face();
    let names: Vec<String> = face.muscles.iter().map(|m| format!("\"{}\"", m.name)).collect();
    let fixed = face.muscles.iter().filter(|m| !m.origin.is_empty()).map(|m| format!("\"{}\"", m.name));
    let (names, fixed) = (names.join(", "), fixed.collect::<Vec<_>>().join(", "));
    let four = "[\"zygomaticus_major\", \"zygomaticus_minor\", \"risorius\", \"levator_labii_superioris\"]";
    let text = text.replace(&format!("face = {four}"), &format!("face = [{names}]"));
    let text = text.replace(&format!("origin = {four}"), &format!("origin = [{fixed}]"));
    let (head, tail) = text.split_once("[controls]").unwrap();
    let text = format!("{head}\n[[probe]]{}", tail.split_once("[[probe]]").unwrap().1);
    parse(&text, &[]).unwrap()
}

#[test]
fn each_muscle_alone_draws_its_insertion_to_its_origin() {
    let scene = all_muscles();
    let built = build(&scene).unwrap();
    let mesh = built.model.mesh();
    let face = built_in_face();
    let locator = Locator::new(mesh);
    println!("muscle at 1 %: towards its origin mm, of mm, iterations");
    for (k, muscle) in built.model.controls().iter().enumerate() {
        let mut solver = Solver::new(&built.model, Settings::default()).unwrap();
        let mut controls = vec![0.0; built.model.controls().len()];
        controls[k] = 0.01;
        let found = solver.equilibrium(&built.model.rest(), &Drive { controls, load: 1.0 });
        let found = found.unwrap_or_else(|failure| panic!("{}: {}", muscle.name, failure.error));
        let course = face.muscle(muscle.name.trim_end_matches(".L")).unwrap();
        let at = |p: [f64; 3]| face.sheet.at(p[0], p[1], p[2]).position;
        let (first, last) = (course.path[0], course.path[course.path.len() - 1]);
        let moved = |x: Vector| {
            mesh.interpolate(locator.locate(x).unwrap_or_else(|_| panic!("{x:?} is outside")), &found.state.u)
        };
        let u = moved(at(last));
        let pull = normalised(subtract(at(first), at(last)));
        let steps: usize = found.history.iter().map(|step| step.iterations.len()).sum();
        println!("{:42} {:6.2} {:6.2} {steps:4} {u:.2?}", muscle.name, dot(u, pull), norm(u));
        // rings have no insertion
        let ring = course.name.starts_with("orbicularis");
        assert!(ring || dot(u, pull) > 0.9 * norm(u), "{}: {u:?}, pulled along {pull:?}", muscle.name);
        assert!(norm(u) > 0.2, "{}: {u:?}", muscle.name);
        assert_eq!(found.negative_modes, Some(0), "{}", muscle.name);
    }
}

/// The smile at two thirds, by the implicit function theorem and by central differences of whole equilibria.
#[test]
fn sensitivities_agree_where_the_face_slides_and_the_lips_touch() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("problems/smile/problem.toml");
    let built = build(&Scene::read(&path, &[]).unwrap()).unwrap();
    let settings = Settings { tolerance: 1e-10, ..Settings::default() };
    let mut solver = Solver::new(&built.model, settings).unwrap();
    let drive = Drive { controls: vec![0.06, 0.05, 0.04, 0.04], load: 1.0 };
    let at = solver.equilibrium(&built.model.rest(), &drive);
    let at = at.unwrap_or_else(|failure| panic!("{}", failure.error));
    for contact in contact_states(&built.model, &at.state) {
        println!("{}: {:.0} mm2, {:.1} kPa at most", contact.name, contact.area, contact.max_pressure);
        assert!(contact.max_pressure > 0.1, "{} is not active", contact.name);
    }
    let unknowns = [0, 3];
    let tangent = sensitivities(Sensitivity::Tangent, &mut solver, &at, &unknowns).unwrap();
    // kinks of contact and of slack fibres lie between neighbours that are too far apart
    let how = Sensitivity::FiniteDifference { step: 1e-5 };
    let difference = sensitivities(how, &mut solver, &at, &unknowns).unwrap();
    for (control, (a, b)) in unknowns.iter().zip(tangent.iter().zip(&difference)) {
        let scale = a.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("{}: {:.1e} apart", built.model.controls()[*control].name, worst / scale);
        assert!(worst < 1e-5 * scale, "control {control}: {:.1e}", worst / scale);
    }
}

#[test]
fn a_face_is_read_expanded_and_locked() {
    let text = HALF_FACE.replace("half = true", "layers = 2, halved = true").replace("side = \"L\"\n", "");
    let text = text.replace("face = \"zygomaticus_major\"", "face = [\"zygomaticus_major\", \"risorius\"]");
    let text = text.replace("[[support]]\nsymmetry = { face = \"midline\" }\n", "");
    let scene = parse(&text, &["muscle.risorius.R.gauss=2"]).unwrap();
    let names: Vec<&str> = scene.muscles.iter().map(|m| &m.name[..]).collect();
    assert_eq!(names, ["zygomaticus_major.L", "zygomaticus_major.R", "risorius.L", "risorius.R"]);
    assert_eq!(scene.muscles.iter().map(|m| m.gauss).collect::<Vec<_>>(), [3, 3, 3, 2]);
    let GeometrySpec::Face(face) = &scene.mesh.geometry else { panic!("{:?}", scene.mesh.geometry) };
    assert_eq!((face.layers, face.halved, face.half), (2, true, false));
    let at = built_in_face().ligament("mandibular", BodySide::Left).unwrap();
    assert_eq!(scene.attachments[0].position_mm, at);
    let lock = scene.lock();
    assert_eq!(parse(&lock, &[]).unwrap_or_else(|error| panic!("{error}\n{lock}")).lock(), lock);
    let code = |text: &str| parse(text, &[]).err().map(|error| error.code());
    assert_eq!(
        code(&HALF_FACE.replace("side = \"L\"", "side = \"R\"").replace("major.L =", "major.R =")),
        Some("C005"),
        "half a face has no right side"
    );
    assert_eq!(code(&HALF_FACE.replace("mandibular.L", "mandibula.L")), Some("C009"));
    assert_eq!(
        code(&HALF_FACE.replace("mandibular.L", "mandibular.R")),
        Some("C005"),
        "half a face has no right side"
    );
    let positions = |text: &str| -> Vec<[f64; 3]> {
        parse(text, &[]).unwrap_or_else(|error| panic!("{error}")).attachments.iter().map(|a| a.position_mm).collect()
    };
    // a name without a side is both sides, of the half the left one; a list is all of them
    let named = |names: &str| text.replace("ligament = \"mandibular.L\"", names);
    let face = built_in_face();
    let of = |side| face.origin("mentalis", side).unwrap();
    assert_eq!(positions(&named("origin = \"mentalis.R\"")), of(BodySide::Right));
    assert_eq!(positions(&named("origin = \"mentalis\"")), [of(BodySide::Left), of(BodySide::Right)].concat());
    assert_eq!(
        positions(&HALF_FACE.replace("ligament = \"mandibular.L\"", "origin = \"mentalis\"")),
        of(BodySide::Left)
    );
    assert_eq!(positions(&named("ligament = [\"mandibular\", \"zygomatic.R\"]")).len(), 3);
    assert_eq!(code(&named("origin = \"orbicularis_oris\"")), Some("C009"), "it has none");
    assert_eq!(code(&HALF_FACE.replace("ligament =", "position_mm = [0, 0, 0]\nligament =")), Some("C011"));
    assert_eq!(code(&HALF_FACE.replace("half = true", "whole = true")), Some("C002"));
}

#[test]
fn what_holds_the_face_to_the_bone_is_inside() {
    let face = built_in_face();
    for options in [WHOLE, HALVED] {
        let mesh = mesh(options);
        let locator = Locator::new(&mesh);
        for side in BodySide::ALL {
            let origins = face
                .muscles
                .iter()
                .flat_map(|m| face.origin(&m.name, side).unwrap().into_iter().map(|at| (&m.name, at)));
            let ligaments = face.ligaments.iter().map(|l| (&l.name, face.ligament(&l.name, side).unwrap()));
            for (name, at) in origins.chain(ligaments) {
                assert!(locator.locate(at).is_ok(), "{name}: {at:?} is outside");
            }
        }
    }
}

#[test]
fn landmarks_of_a_user_take_the_place_of_those_built_in() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("problem.toml", &HALF_FACE.replace("half = true", "half = true, landmarks = \"mine.toml\""));
    write("mine.toml", "[[landmark]]\nname = \"pronasale\"\nposition_mm = [0, 6.1, 134.7]\n");
    let read = || Scene::read(&folder.path().join("problem.toml"), &[]);
    let scene = read().unwrap();
    let GeometrySpec::Face(face) = &scene.mesh.geometry else { panic!("{:?}", scene.mesh.geometry) };
    let nose = landmark("pronasale");
    close(face.face.sheet.at(nose.u, nose.v, 1.0).position, [0.0, 6.1, 134.7], 1e-6, "the tip");
    let chin = landmark("pogonion");
    close(face.face.sheet.at(chin.u, chin.v, 1.0).position, chin.position, 1e-6, "the chin");
    assert_eq!(face.face.muscles.len(), 15);
    // locked, the same file is read again from anywhere
    write("lock.toml", &scene.lock());
    assert_eq!(Scene::read(&folder.path().join("lock.toml"), &[]).unwrap().lock(), scene.lock());
    // all mistakes of both files at once
    write(
        "mine.toml",
        "[[landmark]]\nname = \"pronasale\"\nposition_mm = [1, 6.1, 134.7]\n[[muscle]]\nname = \"mine\"\nwide = 3\n",
    );
    write(
        "problem.toml",
        &HALF_FACE.replace("half = true", "landmarks = \"mine.toml\"").replace("kind = \"forward\"", "kind = 3"),
    );
    let told = match read() {
        Err(risorius::Error::Mistakes(all)) => all.iter().map(|e| e.code()).collect::<Vec<_>>(),
        other => panic!("{other:?}"),
    };
    assert!(["C004", "C005", "C002", "C003"].iter().all(|code| told.contains(code)), "{told:?}");
}

#[test]
fn the_template_is_a_problem_that_can_be_checked_and_is_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let risorius = |arguments: &[&str]| {
        Command::cargo_bin("risorius").unwrap().current_dir(&folder).args(arguments).output().unwrap()
    };
    let output = risorius(&["new", "mine", "--template", "face"]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && text.contains("risorius check mine"), "{output:?}");
    let face = std::fs::read_to_string(folder.path().join("mine/face.toml")).unwrap();
    assert_eq!(face, risorius::scene::FACE);
    let output = risorius(&["check", "mine/problem.toml"]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success() && text.contains("560 elements, 1240 nodes") && text.contains("risorius.R"),
        "{output:?}"
    );
    let output = risorius(&[
        "check",
        "mine/problem.toml",
        "--estimate",
        "--set",
        "mesh.face.half=true",
        "--set",
        "muscle=[]",
        "--set",
        "controls={}",
    ]);
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && text.contains("elements of a face cannot be halved yet"), "{output:?}");
    std::fs::write(folder.path().join("mine/face.toml"), "# mine").unwrap();
    std::fs::remove_file(folder.path().join("mine/problem.toml")).unwrap();
    let output = risorius(&["new", "mine"]);
    assert_eq!(output.status.code(), Some(6), "{output:?}");
    assert_eq!(std::fs::read_to_string(folder.path().join("mine/face.toml")).unwrap(), "# mine");
    assert!(!folder.path().join("mine/problem.toml").exists(), "nothing is written where something is in the way");
}
