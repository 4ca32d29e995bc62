//! EX files: is every element the one that the file means, and does what is written read back?
//!
//! The files in `exf_files` were written for these tests. Their nodal parameters follow the formula [`nodal`], so that the
//! expected element parameters are computed here; values at a point were evaluated by Zinc 4.2.1 and are restated.

use proptest::prelude::*;
use risorius::Error;
use risorius::math::tensor::Vector;
use risorius::mesh::block::block;
use risorius::mesh::element::{TricubicHermite, Trilinear};
use risorius::mesh::exf::{ExFile, Geometry, Points, write_mesh, write_points};
use risorius::mesh::map::{ElementMap, Term};
use risorius::mesh::{MaterialPoint, Mesh};
use std::path::Path;

const VERSION_1: &str = include_str!("exf_files/version_1.exf");
const VERSION_2: &str = include_str!("exf_files/version_2.exf");
const VERSION_3: &str = include_str!("exf_files/version_3.exf");
const LAGRANGE: &str = include_str!("exf_files/lagrange.exf");
const POINT: [f64; 3] = [0.25, 0.5, 0.75];

/// The parameter with derivative mask `label` of component `c` at node `n` in the test files.
fn nodal(n: usize, label: usize, c: usize, version: usize) -> f64 {
    let sign = if (n + c).is_multiple_of(2) { 1.0 } else { -1.0 };
    0.125 * n as f64 + c as f64 + 0.25 * label as f64 * sign + 16.0 * (version as f64 - 1.0)
}

fn parse(text: &str) -> Result<ExFile, Error> {
    ExFile::parse(text, "face.exf")
}

fn geometry(text: &str) -> Geometry {
    parse(text).and_then(|file| file.geometry(None)).unwrap_or_else(|error| panic!("{error}"))
}

fn close(found: Vector, expected: Vector) {
    let error = (0..3).map(|i| (found[i] - expected[i]).abs()).fold(0.0, f64::max);
    assert!(error < 1e-14, "{found:?} is not {expected:?}");
}

#[test]
fn version_1_has_scale_factors_indices_and_versions() {
    let file = parse(VERSION_1).unwrap();
    let read = file.geometry(None).unwrap();
    assert_eq!((read.elements.as_slice(), read.mesh.nodes), (&[1, 2][..], 12));
    for element in 0..2 {
        let local = read.mesh.local(element);
        for corner in 0..8 {
            for label in 0..8 {
                // index 0 stands for the factor 1; element 2 takes d/ds1 from version 2
                let derivative = 0.5 * (element + 1) as f64 + 0.0625 * label as f64 + 0.25 * corner as f64;
                let scale = if label == 0 { 1.0 } else { derivative };
                let version = if element == 1 && label == 1 { 2 } else { 1 };
                for c in 0..3 {
                    let expected = scale * nodal(1 + 4 * element + corner, label, c, version);
                    assert_eq!(local[c][8 * corner + label], expected, "element {element} corner {corner} {label}");
                }
            }
        }
    }
    let at = |element| read.mesh.position(MaterialPoint { element, xi: POINT });
    close(at(0), [0.6234149932861328, 1.1317768096923828, 2.267702102661133]);
    close(at(1), [4.06010627746582, 4.52452278137207, 5.69560432434082]);
    let angles = file.angles("fibres", &read).unwrap();
    close(angles.at(&read.mesh, 0, POINT), [0.0525, 0.1525, 0.2525]);
    close(angles.at(&read.mesh, 1, POINT), [0.0925, 0.1925, 0.2925]);
}

#[test]
fn version_2_has_labels_versions_of_single_labels_and_mixed_bases() {
    let read = geometry(VERSION_2);
    assert_eq!((read.elements.as_slice(), read.mesh.element.name()), (&[7][..], "tricubic-hermite"));
    let hermite = |x: f64| {
        let (x2, x3) = (x * x, x * x * x);
        [1.0 - 3.0 * x2 + 2.0 * x3, x - 2.0 * x2 + x3, 3.0 * x2 - 2.0 * x3, x3 - x2]
    };
    for xi in [[0.1, 0.7, 0.4], [0.9, 0.2, 0.55], POINT] {
        let (l, h2, h3) = ([1.0 - xi[0], xi[0]], hermite(xi[1]), hermite(xi[2]));
        let expected: Vector = std::array::from_fn(|c| {
            let term = |k: usize| {
                let (node, d2, d3) = (k / 4, k >> 1 & 1, k & 1);
                let (i, j, m) = (node & 1, node >> 1 & 1, node >> 2);
                // the upper nodes take d/ds3 from version 2
                let version = if (d2, d3) == (0, 1) && m == 1 { 2 } else { 1 };
                l[i] * h2[2 * j + d2] * h3[2 * m + d3] * nodal(node + 1, 2 * d2 + 4 * d3, c, version)
            };
            (0..32).map(term).sum()
        });
        close(read.mesh.position(MaterialPoint { element: 0, xi }), expected);
    }
    close(read.mesh.position(MaterialPoint { element: 0, xi: POINT }), [-1.625, -0.8125, 0.1875]);
}

#[test]
fn version_3_has_sums_zeros_products_of_scale_factors_and_collapsed_edges() {
    let read = geometry(VERSION_3);
    assert_eq!((read.elements.as_slice(), read.mesh.nodes), (&[3][..], 6), "the marker is no node of the mesh");
    assert_eq!(read.mesh.corners[0], [0, 1, 2, 3, 0, 4, 2, 5]);
    let local = read.mesh.local(0);
    for c in 0..3 {
        let at = |n: usize, label: usize| nodal(n, label, c, 1);
        // corner 5 is node 1: d1 = d/ds1 - d/ds3; corner 2 is node 2: d1 = -d/ds3, d2 = d/ds2 / 2, d3 = -d/ds1 / 2
        assert_eq!(local[c][32..40], [at(1, 0), at(1, 1) - at(1, 4), at(1, 2), 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(local[c][8..16], [at(2, 0), -at(2, 4), 0.5 * at(2, 2), 0.0, -0.5 * at(2, 1), 0.0, 0.0, 0.0]);
    }
    let expected = [0.40622711181640625, 1.3190689086914062, 2.5585708618164062];
    close(read.mesh.position(MaterialPoint { element: 0, xi: POINT }), expected);
    // the collapsed side xi1 = 0 is no face
    assert!(read.mesh.named_faces.contains_key("3:xi1=1") && !read.mesh.named_faces.contains_key("3:xi1=0"));
    assert_eq!(read.mesh.named_faces["boundary"].len(), 5);
}

#[test]
fn faces_and_their_mesh_are_passed_over() {
    let faces = "!#mesh mesh2d, dimension=2, nodeset=nodes\nDefine element template: face\nShape. Dimension=2, line*line\n\
                 #Scale factor sets=0\n#Nodes=0\n#Fields=0\nElement template: face\nElement: 1\nElement: 2\n\
                 !#mesh mesh3d, dimension=3, face mesh=mesh2d, nodeset=nodes";
    let text = VERSION_3.replacen("!#mesh mesh3d, dimension=3, nodeset=nodes", faces, 1);
    let with_faces = text.replacen(" Nodes:", " Faces:\n 1 2 -1 2 1 -1\n Nodes:", 1);
    assert!(text.len() > VERSION_3.len() && with_faces.len() > text.len());
    let (read, plain) = (geometry(&with_faces), geometry(VERSION_3));
    assert_eq!((read.elements, &read.mesh.corners), (plain.elements, &plain.mesh.corners));
    assert_eq!(bits(&read.mesh, &read.mesh.parameters), bits(&plain.mesh, &plain.mesh.parameters));
}

#[test]
fn lagrange_bases_are_the_same_polynomials() {
    let read = geometry(LAGRANGE);
    assert_eq!((read.field.as_str(), read.mesh.nodes, read.mesh.parameters.len()), ("lattice", 8, 24));
    // Lagrange's interpolation at equidistant points
    let lagrange = |x: f64, i: usize, count: usize| -> f64 {
        let at = |k: usize| k as f64 / (count - 1) as f64;
        (0..count).filter(|k| *k != i).map(|k| (x - at(k)) / (at(i) - at(k))).product()
    };
    for xi in [[0.1, 0.7, 0.4], [0.9, 0.2, 0.55], POINT] {
        let expected: Vector = std::array::from_fn(|c| {
            let value = |n: usize| (((n + 1) * 7 + c * 5) % 11) as f64 * 0.25;
            let weight =
                |n: usize| lagrange(xi[0], n % 3, 3) * lagrange(xi[1], n / 3 % 2, 2) * lagrange(xi[2], n / 6, 4);
            (0..24).map(|n| weight(n) * value(n)).sum()
        });
        close(read.mesh.position(MaterialPoint { element: 0, xi }), expected);
    }
    close(
        read.mesh.position(MaterialPoint { element: 0, xi: POINT }),
        [2.0732421875, 0.9881591796875, 1.6661376953125],
    );
}

/// Every element parameter, by its bits.
fn bits(mesh: &Mesh, field: &[Vector]) -> Vec<u64> {
    let locals = (0..mesh.elements()).map(|element| mesh.local_of(element, field));
    locals.flat_map(|local| local.concat()).map(f64::to_bits).collect()
}

/// Writes and reads, and asks for the same bits of the geometry and of a second field.
fn survives(mesh: &Mesh) {
    let second: Vec<Vector> =
        (0..mesh.parameters.len()).map(|k| [0.1 + k as f64, 1.0 / (3.0 + k as f64), 1e-17]).collect();
    let mut text = write_mesh(mesh, &[("coordinates", &mesh.parameters), ("deformed", &second)]);
    text += &write_points(
        "/muscles",
        &[Points::Vectors("coordinates", &second[..2]), Points::Scalars("stretch", &[1.0, 0.1])],
    );
    let file = parse(&text).unwrap_or_else(|error| panic!("{error}\n{:?}", error.place()));
    for (name, values) in [("coordinates", &mesh.parameters), ("deformed", &second)] {
        let read = file.geometry(Some(name)).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(bits(&read.mesh, &read.mesh.parameters), bits(mesh, values), "{name}");
        assert_eq!((&read.mesh.corners, read.mesh.element.name()), (&mesh.corners, mesh.element.name()));
    }
}

#[test]
fn what_is_written_reads_back_bit_for_bit() {
    survives(&block(&TricubicHermite, [1.0, 0.1, -3.0], [30.0, 10.0, 1.0 / 3.0], [3, 2, 1]));
    survives(&block(&Trilinear, [1.0, 0.1, -3.0], [30.0, 10.0, 1.0 / 3.0], [2, 1, 2]));
    for text in [VERSION_1, VERSION_2, VERSION_3] {
        survives(&geometry(text).mesh);
    }
}

#[test]
fn scaled_and_permuted_maps_read_back_bit_for_bit() {
    // the second element runs along other axes: its d1 is -1.3 d/ds3, its d3 is 0.7 d/ds1 + 0.1 d/ds2
    let mut mesh = block(&TricubicHermite, [0.0; 3], [20.0, 10.0, 10.0], [2, 1, 1]);
    let map = mesh.map.clone();
    let locals = (0..2).flat_map(|element| (0..64).map(move |a| (element, a)));
    let terms = locals.map(|(element, a)| {
        let own = map.terms(element, a).to_vec();
        let node = own[0].global - (a % 8) as u32;
        let term = |label: u32, scale: f64| Term { global: node + label, scale };
        match (element, a % 8) {
            (1, 1) => vec![term(4, -1.3)],
            (1, 4) => vec![term(1, 0.7), term(2, 0.1)],
            (1, 3) => Vec::new(),
            _ => own,
        }
    });
    mesh.map = ElementMap::new(64, terms.collect::<Vec<_>>());
    survives(&mesh);
}

/// The error for a text in which the first `old` is `new`.
fn error(text: &str, old: &str, new: &str, field: Option<&str>) -> Error {
    assert!(text.contains(old), "`{old}` is in the text");
    match parse(&text.replacen(old, new, 1)).and_then(|file| file.geometry(field)) {
        Ok(_) => panic!("`{new}` for `{old}` is accepted"),
        Err(error) => error,
    }
}

#[test]
fn what_cannot_be_read_is_told_with_its_line() {
    let rc = "rectangular cartesian, real, #Components=3\n x. l.";
    let cases: &[(&str, &str, &str, &str, &str, &str)] = &[
        (VERSION_2, "EX Version: 2", "EX Version: 4", "G008", "EX Version: 4", "version 1, 2 or 3"),
        (VERSION_2, "Value labels: value d/ds2", "Value labels: value d/ds7", "G008", "d/ds7", "not `d/ds7`"),
        (VERSION_2, "  1. #Values=4", "  9. #Values=4", "G008", "9. #Values", "from 0 to #Nodes=8"),
        (VERSION_2, " 1 2 3 4 5 6 7 8", " 1 2 3 4 5 6 7 x", "G008", "7 x", "not `x`"),
        (VERSION_2, " 1 2 3 4 5 6 7 8", " 1 2 3 4", "G008", "", "8 numbers of nodes"),
        (VERSION_2, " 1 2 3 4 5 6 7 8", " 1 2 3 4 5 6 7 9", "G011", "", "node 9"),
        (
            VERSION_2,
            "(value,d/ds2,d/ds3(2),d2/ds2ds3)",
            "(value,d/ds2,d/ds3(3),d2/ds2ds3)",
            "G008",
            "d/ds3(3)",
            "component",
        ),
        (VERSION_2, "d/ds3(2) d2", "d/ds3(5) d2", "G011", "", "d/ds3 (version 5) of component 1"),
        (
            VERSION_2,
            "Dimension=3, line*line*line",
            "Dimension=3, simplex(2;3)*simplex*simplex",
            "G009",
            "Element: 7",
            "simplex",
        ),
        (
            VERSION_2,
            rc,
            "oblate spheroidal, focus=35, real, #Components=3\n x. l.",
            "G009",
            "x. l.Lagrange",
            "oblate",
        ),
        (VERSION_2, "no modify, standard", "decreasing in xi3, standard", "G009", "decreasing in xi3", "decreasing"),
        (VERSION_2, "x. l.Lagrange*", "x. l.Hermite*", "G009", "l.Hermite", "basis"),
        (VERSION_3, "scale factor set=scaling1", "scale factor set=scaling2", "G008", "scaling2", "not `scaling2`"),
        (VERSION_3, "Scale factor indices: 0 1 2", "Scale factor indices: 0 1 3", "G008", "0 1 3", "1 to 2"),
        (VERSION_3, " -1.0 0.5", " -1.0 NaN", "G008", "NaN", "finite"),
        (
            VERSION_3,
            "Element template: element1\nE",
            "Element template: element2\nE",
            "G008",
            "element2",
            "defined before",
        ),
        (
            LAGRANGE,
            "  1. #Values=1\n   Value labels: value",
            "  1+2. #Values=1\n   Value labels: value+value",
            "G009",
            "Element: 1",
            "corner 1 of element 1",
        ),
        (LAGRANGE, "Node: 24\n", "Node: 24\n junk\n", "G008", "junk", "numbers"),
        (
            VERSION_1,
            "Value indices:     1 2",
            "Value indices:     1 99",
            "G011",
            "Element:",
            "value 99 of component `x`",
        ),
        (VERSION_1, "Element:          2 0 0", "Element:          2", "G008", "Element:", "three numbers"),
    ];
    for (text, old, new, code, line, message) in cases {
        let error = error(text, old, new, None);
        let place = error.place().expect("every one has a place");
        assert_eq!((error.code(), &*place.file), (*code, "face.exf"), "{new}: {error}");
        assert!(place.text.contains(line), "{new}: {place:?}");
        assert!(error.to_string().contains(message), "{new}: {error}");
        assert!(error.help().is_some(), "{new}");
    }
    // a position that hangs between two nodes in all components alike
    let hanging =
        LAGRANGE.replace("  1. #Values=1\n   Value labels: value", "  1+2. #Values=1\n   Value labels: value+value");
    let hanging = parse(&hanging).and_then(|file| file.geometry(None)).unwrap_err();
    assert!(hanging.code() == "G009" && hanging.to_string().contains("corner 1 of element 1"), "{hanging}");
}

#[test]
fn fields_are_chosen_by_name() {
    let mesh = geometry(VERSION_2).mesh;
    let two = write_mesh(&mesh, &[("rest", &mesh.parameters), ("smile", &mesh.parameters)]);
    let unknown = error(&two, "Region", "Region", Some("smiles"));
    assert_eq!(unknown.code(), "G010");
    assert_eq!(unknown.help().as_deref(), Some("name one of its fields: rest, smile"));
    assert_eq!(error(&two, "Region", "Region", None).code(), "G010", "two fields of coordinates, none called so");
    assert_eq!(parse(&two).unwrap().geometry(Some("smile")).unwrap().field, "smile");
    let angles = |field: &str| parse(VERSION_1).unwrap().angles(field, &geometry(VERSION_1)).unwrap_err();
    assert_eq!(angles("fibre").help().as_deref(), Some("name one of its fields: fibres"));
    assert_eq!(angles("coordinates").code(), "G009");
    assert_eq!(error("EX Version: 3\nRegion: /\n", "/", "/", None).code(), "G010");
}

proptest! {
    #[test]
    fn garbage_never_panics(which in 0..4usize, at in 0.0..1.0f64, length in 0..40usize, junk in "[ -~\\n]{0,12}") {
        let text = [VERSION_1, VERSION_2, VERSION_3, LAGRANGE][which];
        let start = (at * text.len() as f64) as usize;
        let end = (start + length).min(text.len());
        let text = format!("{}{junk}{}", &text[..start], &text[end..]);
        if let Ok(file) = parse(&text)
            && let Ok(read) = file.geometry(None)
        {
            let _ = file.angles("fibres", &read);
            prop_assert_eq!(read.mesh.corners.len(), read.elements.len());
        }
    }
}

// ---- in problems

/// A trilinear muscle of one element with fibre angles (in radians) at its nodes, 20 x 6 x 2 mm at (5, 2, 6).
fn muscle_text() -> String {
    let mesh = block(&Trilinear, [5.0, 2.0, 6.0], [20.0, 6.0, 2.0], [1, 1, 1]);
    let mut text = write_mesh(&mesh, &[("coordinates", &mesh.parameters)]);
    text += "!#nodeset nodes\nDefine node template: angles\nShape. Dimension=0\n#Fields=1\n1) fibres, field, fibre, real, #Components=1\n \
             fibre angle. #Values=1 (value)\nNode template: angles\n";
    (1..=8).for_each(|node| text += &format!("Node: {node}\n {:?}\n", 0.1 * f64::from(node)));
    text += "!#mesh mesh3d, dimension=3, nodeset=nodes\nDefine element template: angles\nShape. Dimension=3, line*line*line\n\
             #Scale factor sets=0\n#Nodes=8\n#Fields=1\n1) fibres, field, fibre, real, #Components=1\n \
             fibre angle. l.Lagrange*l.Lagrange*l.Lagrange, no modify, standard node based.\n  #Nodes=8\n";
    (1..=8).for_each(|node| text += &format!("  {node}. #Values=1\n   Value labels: value\n"));
    text + "Element template: angles\nElement: 1\n Nodes:\n 1 2 3 4 5 6 7 8\n"
}

/// A problem with the given host and muscle.
fn problem(host: &str, muscle: &str, clamped: &str) -> String {
    format!(
        "[task]\nkind = \"forward\"\n[mesh]\n{host}\n[tissue]\nmooney-rivlin = {{ c1_kpa = 0.5, c2_kpa = 0.2 }}\n\
         [[muscle]]\nname = \"slab\"\n{muscle}\n\
         blemker = {{ sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }}\n\
         [[support]]\nclamp = {{ face = {clamped} }}\n[[load]]\ntraction = {{ face = \"xi1=1\", kpa = [0, 0, -0.01] }}\n\
         [controls]\nslab = 0.01\n[[probe]]\nname = \"tip\"\nposition_mm = [30, 10, 10]\n"
    )
}

const HOST: &str = "block = { origin_mm = [0, 0, 0], size_mm = [30, 10, 10], elements = [2, 1, 1] }";
const MUSCLE: &str = "block = { origin_mm = [5, 2, 6], size_mm = [20, 6, 2], elements = [1, 1, 1] }";

/// Runs a problem in a folder; the table of its probes, or what was printed where it fails.
fn run(folder: &Path, problem: &str, name: &str) -> Result<String, String> {
    let file = folder.join("problem.toml");
    std::fs::write(&file, problem).unwrap();
    let out = folder.join(name);
    let mut command = assert_cmd::Command::cargo_bin("risorius").unwrap();
    let ended = command.arg("run").arg(&file).arg("--out").arg(&out).output().unwrap();
    match ended.status.success() {
        true => Ok(std::fs::read_to_string(out.join("tables/probes.csv")).unwrap()),
        false => Err(String::from_utf8_lossy(&ended.stderr).into_owned()),
    }
}

#[test]
fn a_problem_from_ex_files_is_the_same_as_from_blocks() {
    let folder = tempfile::tempdir().unwrap();
    let host = block(&TricubicHermite, [0.0; 3], [30.0, 10.0, 10.0], [2, 1, 1]);
    std::fs::write(folder.path().join("host.exf"), write_mesh(&host, &[("coordinates", &host.parameters)])).unwrap();
    std::fs::write(folder.path().join("muscle.exf"), muscle_text()).unwrap();
    let angles: Vec<String> =
        (1..=8).map(|node| format!("[{:?}, 0, 0]", (0.1 * f64::from(node)).to_degrees())).collect();
    let blocks = problem(HOST, &format!("{MUSCLE}\nfibre_angles_nodes_deg = [{}]", angles.join(", ")), "\"xi1=0\"");
    let (exf, fibres) =
        ("exf = \"host.exf\"\nfield = \"coordinates\"", "exf = \"muscle.exf\"\nangles_field = \"fibres\"");
    let expected = run(folder.path(), &blocks, "blocks").unwrap();
    let tip = |table: &str| -> Vec<f64> {
        table.lines().last().unwrap().split(',').filter_map(|cell| cell.parse().ok()).collect()
    };
    for (name, clamped) in [("by side", "\"xi1=0\""), ("by element", "[\"1:xi1=0\"]")] {
        let found = run(folder.path(), &problem(exf, fibres, clamped), name).unwrap();
        let (found, expected) = (tip(&found), tip(&expected));
        assert!(expected.len() > 5 && found.len() == expected.len());
        let error = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < 1e-6, "{found:?} is not {expected:?}");
    }
    // the lock file of the run runs, and its result is a host again
    let lock = std::fs::read_to_string(folder.path().join("by element/problem.lock.toml")).unwrap();
    assert_eq!(tip(&run(folder.path(), &lock, "locked").unwrap()), tip(&run(folder.path(), &lock, "again").unwrap()));
    let file = ExFile::read(&folder.path().join("locked/view/result_0000.exf")).unwrap();
    let (rest, deformed) = (file.geometry(None).unwrap(), file.geometry(Some("deformed")).unwrap());
    assert_eq!(bits(&rest.mesh, &rest.mesh.parameters), bits(&host, &host.parameters));
    let end = MaterialPoint { element: 1, xi: [1.0; 3] };
    let locked = tip(&std::fs::read_to_string(folder.path().join("locked/tables/probes.csv")).unwrap());
    let moved = deformed.mesh.position(end);
    assert!(locked.windows(3).any(|xyz| (0..3).all(|i| (xyz[i] - moved[i]).abs() < 1e-9)), "{moved:?} in {locked:?}");
}

#[test]
fn mistakes_with_ex_files_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let host = block(&TricubicHermite, [0.0; 3], [30.0, 10.0, 10.0], [2, 1, 1]);
    write("host.exf", &write_mesh(&host, &[("coordinates", &host.parameters)]));
    write("muscle.exf", &muscle_text());
    let (exf, fibres) = ("exf = \"host.exf\"", "exf = \"muscle.exf\"\nangles_field = \"fibres\"");
    let side = "\"xi1=0\"";
    let cases = [
        (problem(exf, fibres, "\"2:xi1=0\""), "G012", "no face `2:xi1=0`"),
        (problem(HOST, fibres, "\"1:xi1=0\""), "G012", "the faces of a block are"),
        (problem(exf, fibres, "\"xi1=2\""), "C006", "xi1=2"),
        (problem(exf, fibres, "[]"), "C007", "at least one face"),
        (problem("exf = \"muscle.exf\"", fibres, side), "G013", "is trilinear"),
        (problem("exf = \"nowhere.exf\"", fibres, side), "C012", "nowhere.exf"),
        (problem(&format!("{HOST}\n{exf}"), fibres, side), "C011", "exactly one of `block`, `blocks`, `exf`, `face`"),
        (problem(exf, &format!("{MUSCLE}\nangles_field = \"fibres\""), side), "C002", "angles_field"),
        (problem(exf, "exf = \"muscle.exf\"", side), "C003", "angles_field"),
        (problem(exf, &fibres.replace("fibres", "fibers"), side), "G010", "`fibers`"),
        (problem(&format!("{exf}\nfield = \"smile\""), fibres, side), "G010", "name one of its fields: coordinates"),
    ];
    for (index, (text, code, message)) in cases.iter().enumerate() {
        let printed = run(folder.path(), text, &format!("run {index}")).expect_err("a mistake");
        assert!(printed.contains(code) && printed.contains(message), "{code} {message} in:\n{printed}");
    }
}
