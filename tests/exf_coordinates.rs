//! Coordinates of EX files that are no tricubic Hermite in x, y, z: curvilinear, or with a map per component.
//!
//! The files in `exf_files` were written for these tests; expected values were evaluated by Zinc 4.2.1 and are restated:
//! `prolate.exf` is a ventricle of 4 x 2 x 1 elements whose first ring ends in the apex, `polar.exf` a part of a tube,
//! `mixed.exf` two blocks whose x, y and z have different bases.

use proptest::prelude::*;
use risorius::Error;
use risorius::math::tensor::{Vector, norm, subtract};
use risorius::mesh::block::block;
use risorius::mesh::continuous::continuous;
use risorius::mesh::element::{Element, TricubicHermite, Trilinear};
use risorius::mesh::exf::{ExFile, Geometry, write_mesh};
use risorius::mesh::face::Side;
use risorius::mesh::{MaterialPoint, Mesh};
use std::f64::consts::FRAC_PI_2;

const PROLATE: &str = include_str!("exf_files/prolate.exf");
const POLAR: &str = include_str!("exf_files/polar.exf");
const MIXED: &str = include_str!("exf_files/mixed.exf");
const VERSION_1: &str = include_str!("exf_files/version_1.exf");
const VERSION_3: &str = include_str!("exf_files/version_3.exf");
const LAGRANGE: &str = include_str!("exf_files/lagrange.exf");

/// Where Zinc evaluated.
const POINTS: [[f64; 3]; 2] = [[0.25, 0.5, 0.75], [0.9, 0.2, 0.55]];

fn parse(text: &str) -> Result<ExFile, Error> {
    ExFile::parse(text, "heart.exf")
}

fn geometry(text: &str) -> Geometry {
    parse(text).and_then(|file| file.geometry(None)).unwrap_or_else(|error| panic!("{error}"))
}

fn close(found: Vector, expected: Vector, tolerance: f64) {
    let error = norm(subtract(found, expected));
    assert!(error < tolerance, "{found:?} is not {expected:?}: {error:e}");
}

/// One point of an element as Zinc evaluates it.
struct Evaluated {
    /// Index of the element.
    element: usize,
    /// Index of the point.
    point: usize,
    x: Vector,
    /// dx/dxi1, dx/dxi2, dx/dxi3.
    slopes: [Vector; 3],
}

#[rustfmt::skip]
const BY_ZINC: [(&str, &[Evaluated]); 3] = [
    (PROLATE, &[
        Evaluated { element: 0, point: 0, x: [41.77469661178168, 10.070821557812467, -8.40852462750265],
            slopes: [[-0.16056730906733027, -12.704363714272763, -15.029771290634697], [-17.069398747229684, 19.38624544701564, -16.18633805993582],
                [9.505895675373061, 5.001096092567344, -5.030183091923873]] },
        Evaluated { element: 1, point: 1, x: [43.33565683511631, -4.727695275309285, 0.09027521776045741],
            slopes: [[-0.016586669765259396, 0.14044544647393256, 7.091446815219701], [-7.078740141584746, -23.388226277547425, 0.4465975697002426],
                [9.09490172946085, -2.755002373024485, 0.289077652244015]] },
        Evaluated { element: 2, point: 0, x: [41.42812662374954, -10.936411647937547, 6.7669100000966145],
            slopes: [[-0.14419302036141582, 10.242533435250028, 16.347588208077944], [-17.989052592695522, -20.39002296556605, 12.616336578178194],
                [9.318245082261273, -5.617893331841451, 4.232246242264517]] },
        Evaluated { element: 3, point: 1, x: [43.40468603551683, 4.707928741789838, -0.6268385733113365],
            slopes: [[0.054422624877303295, -1.1014443792853905, -8.39728295054855], [-6.449024886009273, 23.4826842231067, -3.1266089788641764],
                [9.135136588531463, 2.708891394557071, -0.6002456183487723]] },
        Evaluated { element: 4, point: 1, x: [21.039542254030824, -2.6489640442816405, -24.00871171856711],
            slopes: [[-0.0032605646720453908, -36.011976989207994, 3.983330544991298], [-35.30680493088503, -3.7170202022581234, -11.663933931261893],
                [4.517936717910464, -2.7115880912237196, -13.56378332676678]] },
        Evaluated { element: 5, point: 0, x: [10.230377936186581, -18.68637919187875, -23.350886664679358],
            slopes: [[-0.1526932115405426, -34.37855864986174, 28.839037286598806], [-40.937317628972586, -6.463839223669206, -3.2907343346856326],
                [2.3495000568140956, -11.134842824067755, -11.521023780836067]] },
        Evaluated { element: 7, point: 0, x: [10.085483272704499, 16.423567878552262, 23.79668854937972],
            slopes: [[0.2921760385572543, 43.58293943231895, -27.621388843502714], [-40.34772112041948, 6.0593478575722735, 3.689260302590254],
                [2.2714647658506824, 10.122772171834992, 12.122071142689812]] },
        Evaluated { element: 7, point: 1, x: [21.152936399048677, 24.21489822753371, -3.718365355990808],
            slopes: [[0.283577856377159, -5.783137084416797, -43.30977447247206], [-35.493282704257595, 11.664131541623567, -4.26969609244845],
                [4.58233987634235, 13.507191901355052, -3.3134168280752867]] },
    ]),
    (POLAR, &[
        Evaluated { element: 0, point: 0, x: [9.264264078359107, 6.719302804533276, 5.580975341796877],
            slopes: [[2.8818678405599325, 2.797083869676084, 0.19411621093749865], [-3.722940933646761, 5.97963947221809, 0.017187500000001653],
                [0.07549839456621266, 0.33751293462179677, 5.968383789062503]] },
        Evaluated { element: 0, point: 1, x: [12.303330917512396, 6.3131846691255, 4.497568687499999],
            slopes: [[3.2704256416012427, 2.4658792476983225, 0.22264421874999893], [-3.3384214640050676, 7.600305995274342, 0.08911999999999805],
                [0.07028390544770899, 0.25546978441801693, 5.975871249999998]] },
        Evaluated { element: 1, point: 0, x: [4.0204197858475945, 11.24750202693742, 5.634100341796871],
            slopes: [[0.7756145552295143, 3.9441727435789797, 0.1941162109374969], [-6.738097418661621, 2.936404507991473, 0.017187499999985922],
                [-0.13767912693572615, 0.3245569747030879, 5.905883789062484]] },
        Evaluated { element: 1, point: 1, x: [6.827949092277083, 12.597058938520934, 4.585193687499999],
            slopes: [[1.2845800643518341, 3.8938747619396787, 0.22264421874999918], [-7.310172513690461, 4.5305579974281445, 0.0891199999999939],
                [-0.09244646886854413, 0.25389697088149565, 5.733371249999992]] },
    ]),
    (MIXED, &[
        Evaluated { element: 0, point: 0, x: [2.75, 4.4375, 4.4783935546875],
            slopes: [[10.0, 0.25, 0.07666015625], [0.326904296875, 8.0, -0.0047760009765625],
                [0.0, 0.5, 5.99462890625]] },
        Evaluated { element: 0, point: 1, x: [9.14346985, 2.1, 3.3011620540000015],
            slopes: [[10.023851500000003, 0.25, 0.08957778000000002], [0.5041905624999997, 8.0, 0.16361189750000008],
                [0.07559099999999988, 0.5, 5.886943239999998]] },
        Evaluated { element: 1, point: 0, x: [12.75, 4.6875, 4.5916748046875],
            slopes: [[10.0, 0.25, 0.06103515625], [0.204833984375, 8.0, 0.3702239990234375],
                [0.0, 0.5, 5.96337890625]] },
        Evaluated { element: 1, point: 1, x: [19.16732135, 2.35, 3.3119745540000016],
            slopes: [[10.023851500000003, 0.25, 0.14707778000000019], [0.5141286875000001, 8.0, 0.40361189750000015],
                [0.072681, 0.5, 5.7656932399999965]] },
    ]),
];

#[test]
fn fields_have_the_values_and_derivatives_of_zinc() {
    for (text, evaluated) in BY_ZINC {
        let field = parse(text).and_then(|file| file.coordinates(None)).unwrap();
        for Evaluated { element, point, x, slopes } in evaluated {
            close(field.position(*element, POINTS[*point]), *x, 1e-12);
            let jacobian = field.jacobian(*element, POINTS[*point]);
            for (d, slope) in slopes.iter().enumerate() {
                close([jacobian[0][d], jacobian[1][d], jacobian[2][d]], *slope, 1e-12);
            }
        }
    }
}

#[test]
fn spherical_polar_coordinates_have_the_values_of_zinc() {
    let text = POLAR.replace("cylindrical polar", "spherical polar");
    let field = parse(&text).and_then(|file| file.coordinates(None)).unwrap();
    close(field.position(0, POINTS[0]), [7.07249318738736, 5.129627448775354, -7.3920485282304185], 1e-12);
    close(field.position(0, POINTS[1]), [-2.622723877406462, -1.3457932884357193, -13.51067771135042], 1e-12);
    close(field.position(1, POINTS[0]), [3.20281608849814, 8.960178878359592, -7.219919713643103], 1e-12);
    close(field.position(1, POINTS[1]), [-0.8661430656063739, -1.5979696244331527, -14.212778474900276], 1e-12);
}

/// The ways along xi1 around the apex; the second ring has its angles given, the first takes them from there.
#[test]
fn angles_unwind_as_in_zinc() {
    let of = |words: &str| {
        let text = PROLATE.replace("decreasing in xi1", words);
        parse(&text).and_then(|file| file.coordinates(None)).unwrap()
    };
    // the other way round, through three quarters of a turn
    close(
        of("increasing in xi1").position(2, POINTS[0]),
        [41.42812662374954, -6.7669100000966145, -10.936411647937547],
        1e-12,
    );
    close(
        of("increasing in xi1").position(4, POINTS[0]),
        [10.295466505930559, 20.58994472995507, 22.293879744429773],
        1e-12,
    );
    close(
        of("increasing in xi1").position(6, POINTS[1]),
        [20.655126325027883, 12.901829298870013, 18.996220885208952],
        1e-12,
    );
    close(
        of("non-decreasing in xi1").position(2, POINTS[0]),
        [41.42812662374954, -6.7669100000966145, -10.936411647937547],
        1e-12,
    );
    close(
        of("non-decreasing in xi1").position(4, POINTS[0]),
        [10.295466505930559, 20.58994472995507, 22.293879744429773],
        1e-12,
    );
    close(
        of("non-decreasing in xi1").position(6, POINTS[1]),
        [20.655126325027883, 12.901829298870013, 18.996220885208952],
        1e-12,
    );
    let expected = of("decreasing in xi1");
    for words in ["non-increasing in xi1", "closest in xi1"] {
        let found = of(words);
        for element in 0..8 {
            close(found.position(element, POINTS[0]), expected.position(element, POINTS[0]), 1e-12);
        }
    }
}

/// Where two elements have a face in common: the side of each, and xi of one for xi of the other.
fn seams(mesh: &Mesh) -> Vec<[(usize, Side); 2]> {
    let corners = |(element, side): (usize, Side)| {
        let mut nodes = side.nodes().map(|k| mesh.corners[element][k]);
        nodes.sort_unstable();
        nodes
    };
    let faces: Vec<(usize, Side)> =
        (0..mesh.elements()).flat_map(|element| Side::ALL.map(|side| (element, side))).collect();
    let pairs = faces.iter().enumerate().flat_map(|(k, one)| faces[..k].iter().map(|other| [*one, *other]));
    pairs.filter(|[one, other]| one.0 != other.0 && corners(*one) == corners(*other)).collect()
}

/// The largest gap of a field between elements at their common faces, which must be aligned.
fn gap(mesh: &Mesh, field: &[Vector]) -> f64 {
    let mut worst = 0.0_f64;
    for seam in seams(mesh) {
        for st in [[0.2, 0.3], [0.7, 0.1], [0.5, 0.5], [0.9, 0.8]] {
            let [a, b] = seam.map(|(element, side)| {
                let at = MaterialPoint { element, xi: side.lift(st) };
                mesh.interpolate(at, field)
            });
            worst = worst.max(norm(subtract(a, b)));
        }
    }
    worst
}

/// Global parameters without any relation.
fn arbitrary(mesh: &Mesh) -> Vec<Vector> {
    let number = |k: usize| (k as f64 * 0.754_877_666).fract() - 0.5;
    (0..mesh.parameters.len()).map(|p| std::array::from_fn(|i| number(3 * p + i))).collect()
}

#[test]
fn components_with_bases_of_their_own_are_the_same_shape_in_one_map() {
    let (read, field) = (geometry(MIXED), parse(MIXED).and_then(|file| file.coordinates(None)).unwrap());
    assert_eq!((read.mesh.element.name(), read.mesh.nodes, read.conversion), ("tricubic-hermite", 12, None));
    assert!(read.warning(&risorius::error::Place::whole("face.exf")).is_none());
    for element in 0..2 {
        for xi in [[0.1, 0.7, 0.4], [0.9, 0.2, 0.55], [0.0, 1.0, 0.5], [0.31, 0.62, 0.93]] {
            close(read.mesh.position(MaterialPoint { element, xi }), field.position(element, xi), 1e-13);
        }
    }
    // a node has its value; 20 edges and 11 faces at both or all four of their ends; and 8 per element
    assert_eq!(read.mesh.parameters.len(), 12 + 2 * 20 + 4 * 11 + 8 * 2);
    assert_eq!(seams(&read.mesh).len(), 1);
    assert!(gap(&read.mesh, &arbitrary(&read.mesh)) < 1e-14);
}

#[test]
fn components_with_versions_of_their_own_stay_trilinear() {
    // y of the second element is version 2, an eighth of a mm higher: there are two bodies
    let plain =
        |basis: &str| format!(" {basis}. l.Lagrange*l.Lagrange*l.Lagrange, no modify, standard node based.\n");
    let mut text: String = MIXED[..MIXED.find("#Scale factor sets").unwrap()].into();
    for (element, y) in [(0, "value"), (1, "value(2)")] {
        text += "#Scale factor sets=0\n#Nodes=8\n#Fields=1\n";
        text += "1) coordinates, coordinate, rectangular cartesian, real, #Components=3\n";
        for (component, label) in [("x", "value"), ("y", y), ("z", "value")] {
            text += &(plain(component) + "  #Nodes=8\n");
            (1..=8).for_each(|node| text += &format!("  {node}. #Values=1\n   Value labels: {label}\n"));
        }
        let nodes = [1, 2, 4, 5, 7, 8, 10, 11].map(|node| (node + element).to_string()).join(" ");
        text += &format!("Element: {}\n Nodes:\n {nodes}\n", element + 1);
        if element == 0 {
            text += "Shape. Dimension=3, line*line*line\n";
        }
    }
    let read = geometry(&text);
    assert_eq!((read.mesh.element.name(), read.mesh.nodes, read.mesh.parameters.len()), ("trilinear", 16, 16));
    assert_eq!(read.nodes.iter().filter(|node| **node == 2).count(), 2, "node 2 is at two places");
    let y = |element: usize, xi: [f64; 3]| read.mesh.position(MaterialPoint { element, xi })[1];
    assert_eq!(y(1, [0.0; 3]) - y(0, [1.0, 0.0, 0.0]), 0.125);
}

#[test]
fn polar_coordinates_keep_their_nodal_derivatives() {
    let (read, field) = (geometry(POLAR), parse(POLAR).and_then(|file| file.coordinates(None)).unwrap());
    // eight parameters at each of twelve nodes, as in the file, and no scale
    assert_eq!((read.mesh.nodes, read.mesh.parameters.len()), (12, 96));
    corners_agree(&read, &field);
    let conversion = read.conversion.expect("it is no polynomial");
    println!("{conversion:?}");
    assert!((0.01..0.1).contains(&conversion.difference), "{conversion:?}");
    let element = read.elements.iter().position(|identifier| *identifier == conversion.element).unwrap();
    let mesh = read.mesh.position(MaterialPoint { element, xi: conversion.xi });
    assert_eq!(norm(subtract(mesh, field.position(element, conversion.xi))), conversion.difference);
    let warning = read.warning(&risorius::error::Place::whole("heart.exf")).expect("a warning");
    assert!(warning.code == "G025" && warning.message.contains("mm between"), "{}", warning.message);

    // with cross derivatives that the file does not use, the nodes cannot share those in x, y, z: its edges and faces do
    let labels = "value d/ds1 d/ds2 d2/ds1ds2";
    assert!(POLAR.contains(labels));
    let text = POLAR.replace(labels, "value d/ds1 d/ds2 zero");
    let (read, field) = (geometry(&text), parse(&text).and_then(|file| file.coordinates(None)).unwrap());
    assert_eq!(read.mesh.parameters.len(), 12 + 2 * 20 + 4 * 11 + 8 * 2);
    corners_agree(&read, &field);
    assert!(gap(&read.mesh, &arbitrary(&read.mesh)) < 1e-14);
}

/// Values and derivatives at the corners of all elements.
fn corners_agree(read: &Geometry, field: &risorius::mesh::exf::Coordinates) {
    for element in 0..read.mesh.elements() {
        for corner in 0..8 {
            let xi: [f64; 3] = std::array::from_fn(|d| (corner >> d & 1) as f64);
            let at = MaterialPoint { element, xi };
            close(read.mesh.position(at), field.position(element, xi), 1e-12);
            let (ours, theirs) = (read.mesh.jacobian(at), field.jacobian(element, xi));
            (0..3).for_each(|i| close(ours[i], theirs[i], 1e-12));
            // the cross derivative d2x/dxi1dxi2 by a difference of the field's own derivatives
            let step = |h: f64| {
                let mut moved = xi;
                moved[1] = h;
                field.jacobian(element, moved)
            };
            let h = 1e-5;
            let (from, to) = if xi[1] == 0.0 { (0.0, h) } else { (1.0 - h, 1.0) };
            let (a, b, local) = (step(from), step(to), read.mesh.local(element));
            for i in 0..3 {
                let difference = (b[i][0] - a[i][0]) / h;
                assert!(
                    (difference - local[i][8 * corner + 3]).abs() < 1e-3,
                    "{difference} {}",
                    local[i][8 * corner + 3]
                );
            }
        }
    }
}

#[test]
fn a_ventricle_in_prolate_coordinates_is_closed_at_its_apex() {
    let (read, field) = (geometry(PROLATE), parse(PROLATE).and_then(|file| file.coordinates(None)).unwrap());
    // theta of the apex is 0 and means nothing: one node within, one without
    assert_eq!((read.mesh.nodes, read.mesh.elements()), (18, 8));
    assert_eq!(read.mesh.corners[0][0], read.mesh.corners[0][1]);
    assert!(!read.mesh.named_faces.contains_key("1:xi2=0"), "the collapsed side is no face");
    assert_eq!(read.mesh.named_faces["boundary"].len(), 8 + 8 + 4);
    corners_agree(&read, &field);
    let conversion = read.conversion.expect("it is no polynomial");
    println!("{conversion:?}");
    assert!((0.01..2.0).contains(&conversion.difference), "{conversion:?}");
    // in every motion the ventricle stays whole, around the apex and across the seam of theta, and its axis a line
    let motion = arbitrary(&read.mesh);
    // two rings of four, four between them, and six pairs of the four sides that are the axis
    assert_eq!(seams(&read.mesh).len(), 4 + 4 + 4 + 6);
    assert!(gap(&read.mesh, &read.mesh.parameters) < 1e-12 && gap(&read.mesh, &motion) < 1e-14);
    for element in 0..4 {
        let at = |a: f64, c: f64| read.mesh.interpolate(MaterialPoint { element, xi: [a, 0.0, c] }, &motion);
        [0.0, 0.3, 1.0].iter().for_each(|c| close(at(0.0, *c), at(0.6, *c), 1e-14));
    }
}

/// A quarter of a tube in cylindrical polar coordinates (r, theta, z), radii 4 and 7, with `around` elements around.
fn tube(element: &'static dyn Element, around: usize) -> String {
    let polar = block(element, [4.0, 0.0, 0.0], [3.0, FRAC_PI_2, 5.0], [1, around, 1]);
    let text = write_mesh(&polar, &[("coordinates", &polar.parameters)]);
    text.replace("rectangular cartesian", "cylindrical polar")
}

/// The cubic Hermite of an arc of angle t and radius r is r t^4 / 384 too short in its middle.
#[test]
fn the_difference_falls_with_the_fourth_power_of_the_angle() {
    for element in [&TricubicHermite as &'static dyn Element, &Trilinear] {
        let mut parameters = Vec::new();
        for around in [1, 2, 4, 8] {
            let read = geometry(&tube(element, around));
            let found = read.conversion.expect("arcs are no cubics").difference;
            let expected = 7.0 * (FRAC_PI_2 / around as f64).powi(4) / 384.0;
            println!("{around} around: {found:.3e} mm, {expected:.3e} by the leading term");
            assert!((found / expected - 1.0).abs() < 0.1 / around as f64, "{around}: {found:e} {expected:e}");
            parameters.push(read.mesh.parameters.len());
        }
        // linear coordinates have no derivatives that nodes could share
        assert_eq!(parameters[3] == 8 * 36, element.parameters_per_node() == 8, "{parameters:?}");
    }
}

/// Runs a problem whose host and muscle are in cylindrical polar coordinates.
#[test]
fn a_problem_in_polar_coordinates_runs_and_warns() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("tube.exf"), tube(&TricubicHermite, 2)).unwrap();
    let muscle = block(&Trilinear, [5.0, 0.2, 1.0], [1.0, 1.2, 3.0], [1, 4, 1]);
    let text = write_mesh(&muscle, &[("coordinates", &muscle.parameters)]);
    let text = text.replace("rectangular cartesian", "cylindrical polar");
    std::fs::write(folder.path().join("muscle.exf"), text).unwrap();
    let problem = "[task]\nkind = \"forward\"\n[mesh]\nexf = \"tube.exf\"\n\
        [tissue]\nmooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }\n\
        [[muscle]]\nname = \"ring\"\nexf = \"muscle.exf\"\nfibre_angles_deg = [90, 0, 0]\n\
        blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }\n\
        [[support]]\nclamp = { face = \"xi2=0\" }\n[controls]\nring = 0.02\n\
        [[probe]]\nname = \"tip\"\nposition_mm = [0.0, 6.5, 2.5]\n";
    let file = folder.path().join("problem.toml");
    std::fs::write(&file, problem).unwrap();
    let out = folder.path().join("out");
    let mut command = assert_cmd::Command::cargo_bin("risorius").unwrap();
    let ended = command.arg("run").arg(&file).arg("--out").arg(&out).output().unwrap();
    let printed = String::from_utf8_lossy(&ended.stderr).into_owned() + &String::from_utf8_lossy(&ended.stdout);
    assert!(ended.status.success(), "{printed}");
    assert_eq!(printed.matches("G025").count(), 2, "{printed}");
    assert!(printed.contains("is no tricubic Hermite in x, y and z"), "{printed}");
    // the tube bends as the ring shortens, and not along its axis, by symmetry
    let probes = std::fs::read_to_string(out.join("tables/probes.csv")).unwrap();
    let tip: Vec<f64> = probes.lines().last().unwrap().split(',').filter_map(|cell| cell.parse().ok()).collect();
    let [.., ux, _, uz] = tip[..] else { panic!("{probes}") };
    assert!(ux.abs() > 0.1 && uz.abs() < 1e-9, "{probes}");
}

/// Writes and reads, and asks for the same bits.
fn survives(mesh: &Mesh) {
    let again = geometry(&write_mesh(mesh, &[("coordinates", &mesh.parameters)])).mesh;
    assert_eq!(again.corners, mesh.corners);
    for element in 0..mesh.elements() {
        assert_eq!(again.local(element), mesh.local(element));
    }
}

#[test]
fn meshes_of_shared_edges_and_faces_read_back() {
    survives(&geometry(MIXED).mesh);
    survives(&geometry(PROLATE).mesh);
}

/// A block whose elements run along other axes: their parameters are permuted and reversed, the body is the same.
#[test]
fn elements_that_run_along_other_axes_share_edges_and_faces() {
    let straight = block(&TricubicHermite, [0.0; 3], [20.0, 10.0, 10.0], [2, 1, 1]);
    let locals: Vec<_> = (0..2).map(|element| straight.local(element)).collect();
    // in the second element xi1, xi2, xi3 run along y, z, x, and xi1 backwards
    let corner = |k: usize| (1 - (k & 1)) << 1 | (k >> 1 & 1) << 2 | k >> 2;
    let label = |m: usize| (m & 1) << 1 | (m >> 1 & 1) << 2 | m >> 2;
    let mut turned = [[0.0; 64]; 3];
    for (i, component) in turned.iter_mut().enumerate() {
        for (a, value) in component.iter_mut().enumerate() {
            let sign = if a & 1 == 1 { -1.0 } else { 1.0 };
            *value = sign * locals[1][i][8 * corner(a / 8) + label(a % 8)];
        }
    }
    let corners = vec![straight.corners[0], std::array::from_fn(|k| straight.corners[1][corner(k)])];
    let mesh = continuous(&TricubicHermite, corners, &[locals[0], turned]);
    assert_eq!(mesh.parameters.len(), 12 + 2 * 20 + 4 * 11 + 8 * 2);
    let motion = arbitrary(&mesh);
    for (field, tolerance) in [(&mesh.parameters, 1e-12), (&motion, 1e-14)] {
        for st in [[0.2, 0.3], [0.7, 0.1], [0.5, 0.5]] {
            let one = mesh.interpolate(MaterialPoint { element: 0, xi: [1.0, st[0], st[1]] }, field);
            let other = mesh.interpolate(MaterialPoint { element: 1, xi: [1.0 - st[0], st[1], 0.0] }, field);
            close(one, other, tolerance);
        }
    }
    // values alone are shared by nodes
    let plain = block(&Trilinear, [0.0; 3], [20.0, 10.0, 10.0], [2, 1, 1]);
    let locals: Vec<_> = (0..2).map(|element| plain.local(element)).collect();
    assert_eq!(continuous(&Trilinear, plain.corners.clone(), &locals).parameters.len(), 12);
}

#[test]
fn what_cannot_be_evaluated_is_told_with_its_line() {
    let focus = ", focus= 0.3525E+02";
    let cases = [
        ("prolate spheroidal", "oblate spheroidal", "G009", "lambda.", "oblate spheroidal coordinates"),
        (focus, "", "G009", "lambda.", "without `focus=`"),
        (focus, ", focus= far", "G008", "focus= far", "a field, as in"),
        (focus, ", focus= -3", "G008", "focus= -3", "a field, as in"),
        ("decreasing in xi1", "decreasing in xi2", "G009", "decreasing in xi2", "`decreasing in xi2`"),
    ];
    for (old, new, code, line, message) in cases {
        assert!(PROLATE.contains(old), "{old}");
        let read = parse(&PROLATE.replace(old, new)).and_then(|file| file.geometry(None).map(drop));
        let error = read.expect_err(new);
        let place = error.place().expect("a place");
        assert_eq!((error.code(), &*place.file), (code, "heart.exf"), "{new}: {error}");
        assert!(place.text.contains(line) && error.to_string().contains(message), "{new}: {error} {place:?}");
        assert!(error.help().is_some());
    }
}

proptest! {
    #[test]
    fn garbage_never_panics(which in 0..6usize, at in 0.0..1.0f64, length in 0..40usize, junk in "[ -~\\n]{0,12}") {
        let text = [PROLATE, POLAR, MIXED, VERSION_1, VERSION_3, LAGRANGE][which];
        let start = (at * text.len() as f64) as usize;
        let end = (start + length).min(text.len());
        let text = format!("{}{junk}{}", &text[..start], &text[end..]);
        if let Ok(file) = parse(&text) {
            let _ = file.coordinates(None);
            if let Ok(read) = file.geometry(None) {
                prop_assert_eq!(read.mesh.corners.len(), read.elements.len());
            }
        }
    }
}
