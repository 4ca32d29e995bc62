//! Bones that move: what they carry, sensitivities through it, reactions, and a fit that finds where the jaw was.

use crate::common;
use crate::common::assert_close;
use risorius::fit::Fit;
use risorius::fit::sensitivity::{Sensitivity, sensitivities};
use risorius::forward::{Drive, Equilibrium, Settings, Solver};
use risorius::markers::{Frame, ReadOptions, WriteOptions, read, write_json};
use risorius::math::tensor::{Vector, add_scaled, cross, dot, norm, subtract};
use risorius::mesh::MaterialPoint;
use risorius::model::Model;
use risorius::model::build::{Built, build};
use risorius::report::bone_states;
use risorius::scene::{Scene, Units};
use risorius::term::bone::{Bone, Hinge, Slide, Wrench};
use std::fmt::Write;
use std::path::Path;

/// A strip of 40 x 10 x 10 mm with a slab in its top, held at one end, with a jaw behind the other.
const STRIP: &str = r#"
[task]
kind = "forward"
[mesh]
block = { origin_mm = [0, 0, 0], size_mm = [40, 10, 10], elements = [4, 1, 1] }
[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
gauss = 4
[[muscle]]
name = "slab"
block = { origin_mm = [4, 2, 6], size_mm = [30, 6, 3], elements = [4, 1, 1] }
fibre_angles_deg = [20, 0, 0]
blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }
[[bone]]
name = "jaw"
hinge = { axis = [0, 2, 0.1], through_mm = [60, 0, -10], bounds_deg = [-5, 35] }
slide = { direction = [3, 0, 1], bounds_mm = [-3, 8] }
[[support]]
clamp = { face = "xi1=0" }
"#;
const FACE: &str = "[[support]]\nclamp = { face = \"xi1=1\", bone = \"jaw\" }\n";
/// A ball below the strip, half a millimetre away.
const BALL: &str = r#"[[contact]]
face = "xi3=0"
surface = { sphere = { centre_mm = [20, 5, -20.5], radius_mm = 20 } }
bone = "jaw"
law = { penalty = { kpa_per_mm = 20 } }
"#;
const SPRING: &str = "[[attachment]]\nposition_mm = [10, 5, 10]\nstiffness_mn_per_mm = 20\nbone = \"jaw\"\n";
const TIE: &str = "[[attachment]]\nposition_mm = [22, 3, 10]\nrigid = true\nbone = \"jaw\"\n";

fn scene(parts: &[&str]) -> Scene {
    Scene::parse(&parts.concat(), "jaw.toml", Path::new("."), &[]).unwrap_or_else(|error| panic!("{error}"))
}

fn built(parts: &[&str]) -> Built {
    build(&scene(parts)).unwrap_or_else(|error| panic!("{error}"))
}

fn solver(model: &Model) -> Solver<'_> {
    Solver::new(model, Settings { tolerance: 1e-10, ..Settings::default() }).expect("memory")
}

fn drive(controls: [f64; 3]) -> Drive {
    Drive { controls: controls.to_vec(), load: 1.0 }
}

/// The equilibrium from rest.
fn solve(model: &Model, controls: [f64; 3]) -> Equilibrium {
    let found = solver(model).equilibrium(&model.rest(), &drive(controls));
    found.unwrap_or_else(|failure| panic!("{}", failure.error))
}

/// Corners, edges, sides and centres of all elements.
fn points(model: &Model) -> impl Iterator<Item = MaterialPoint> {
    let place = |k: usize| [k % 3, k / 3 % 3, k / 9].map(|i| i as f64 / 2.0);
    (0..model.mesh().elements())
        .flat_map(move |element| (0..27).map(move |k| MaterialPoint { element, xi: place(k) }))
}

fn places(model: &Model, found: &Equilibrium) -> Vec<f64> {
    let x = model.current(&found.state);
    points(model).flat_map(|point| model.mesh().interpolate(point, &x)).collect()
}

/// (8 (f(h) - f(-h)) - (f(2h) - f(-2h))) / 12h
fn slope(f: impl Fn(f64) -> Vec<f64>, h: f64) -> Vec<f64> {
    let [a, b, c, d] = [-2.0 * h, -h, h, 2.0 * h].map(f);
    (0..a.len()).map(|k| (8.0 * (c[k] - b[k]) - (d[k] - a[k])) / (12.0 * h)).collect()
}

/// Controls near an equilibrium, and the equilibrium there.
fn near(model: &Model, at: &Equilibrium, control: usize, by: f64) -> Equilibrium {
    let mut controls = at.state.controls.clone();
    controls[control] += by;
    let found = solver(model).equilibrium(&at.state, &Drive { controls, load: 1.0 });
    found.unwrap_or_else(|failure| panic!("{}", failure.error))
}

const HINGE: Hinge = Hinge { axis: [0.0, 0.6, 0.8], through: [3.0, -2.0, 1.0], control: 0 };
const SLIDE: Slide = Slide { direction: [0.8, 0.6, 0.0], control: 1 };

/// The pose, by hand; its twists are its derivatives; the power of a force is its work per unit of a control.
#[test]
fn poses_have_exact_derivatives() {
    let bone = Bone::new("jaw", Some(HINGE), Some(SLIDE));
    let (reference, force) = ([7.0, 5.0, -4.0], [0.3, -2.0, 1.5]);
    let place = |controls: [f64; 2]| bone.pose(&controls).place(reference);
    assert_eq!(place([0.0, 0.0]), reference);
    assert_close("slide", &place([0.0, 5.0]), &[11.0, 8.0, -4.0], 1e-15);
    // a half turn: 2 (a . r) a - r about the axis
    let arm = subtract(reference, HINGE.through);
    let turned = add_scaled(arm.map(|r| -r), 2.0 * dot(HINGE.axis, arm), HINGE.axis);
    assert_close("half a turn", &place([180.0, 0.0]), &add_scaled(HINGE.through, 1.0, turned), 1e-14);
    let at = [23.0, 4.0];
    let pose = bone.pose(&at);
    assert_close("back again", &pose.reference(pose.place(reference)), &reference, 1e-14);
    for control in 0..2 {
        let moved = |by: f64| {
            let mut controls = at;
            controls[control] += by;
            controls
        };
        let twist = bone.twist(control, &at).expect("a control of the bone");
        let velocity = twist.velocity(pose.place(reference));
        assert_close("velocity", &velocity, &slope(|h| place(moved(h)).to_vec(), 1e-2), 1e-9);
        let found = slope(|h| bone.pose(&moved(h)).turn(arm).to_vec(), 1e-2);
        let error = norm(subtract(twist.turning(pose.turn(arm)), [found[0], found[1], found[2]]));
        assert!(error < 1e-9, "turning: {error}");
        let mut wrench = Wrench::default();
        wrench.add_force(force, pose.place(reference));
        assert_close("power", &[wrench.power(&twist)], &[dot(force, velocity)], 1e-13);
    }
    assert_eq!(bone.twist(2, &at), None);
}

/// A body that is tied to nothing but the jaw goes with it, without strain or force: clamp, sliding on where the face
/// was, spring and rigid tie agree. No step turns it by more than pi/8.
#[test]
fn what_is_on_a_bone_alone_moves_rigidly() {
    let free = STRIP.replace("clamp = { face = \"xi1=0\" }", "clamp = { face = \"xi1=0\", bone = \"jaw\" }");
    let deep = "[[sliding]]\nface = \"xi3=0\"\nsurface = { reference = true }\nbone = \"jaw\"\n";
    let law = "law = { augmented = { kpa_per_mm = 50, gap_mm = 1e-6 } }\n";
    // one tie is redundant: its point lies on a face that the jaw carries
    let again = TIE.replace("[22, 3, 10]", "[0, 5, 5]");
    let Built { model, warnings, .. } = built(&[&free, deep, law, SPRING, TIE, &again]);
    assert!(warnings.is_empty(), "{warnings:?}");
    let found = solve(&model, [0.0, 35.0, 5.0]);
    let [bone] = model.bones() else { panic!("one bone") };
    let pose = bone.pose(&found.state.controls);
    let carried: Vec<f64> = points(&model).flat_map(|point| pose.place(model.mesh().position(point))).collect();
    assert_close("places", &places(&model, &found), &carried, 1e-9);
    let scale = model.shear_modulus() * model.volume();
    let energy: f64 = found.evaluation.energies.iter().map(|e| e.abs()).sum();
    assert!(energy < 1e-12 * scale, "energy {energy} uJ of {scale}");
    let state = bone_states(&model, &found.state, &found.evaluation)[0];
    assert!(state.torque.expect("a hinge").abs() < 1e-9 * scale && norm(state.force) < 1e-9 * scale, "{state:?}");
    let rates = solver(&model).rates(&found.state, &[1, 2]).expect("a regular tangent");
    for (control, rate) in [1, 2].into_iter().zip(&rates) {
        let twist = bone.twist(control, &found.state.controls).expect("its own");
        let du = model.displacement_rate(&found.state, control, rate);
        let moved: Vec<f64> = points(&model).flat_map(|point| model.mesh().interpolate(point, &du)).collect();
        let places = points(&model).map(|point| pose.place(model.mesh().position(point)));
        assert_close("rates", &moved, &places.flat_map(|x| twist.velocity(x)).collect::<Vec<f64>>(), 1e-8);
    }
    let mut last = 0.0;
    for place in found.history.iter().map(|step| step.place) {
        assert!((place - last) * 35.0 <= 22.5 + 1e-9, "a step of {} degrees", (place - last) * 35.0);
        last = place;
    }
}

/// Steps are even in ln(activation + onset) where a muscle contracts too; its last one then turns the jaw the most.
#[test]
fn steps_of_a_path_turn_a_bone_by_no_more_than_they_may() {
    let model = built(&[STRIP, FACE]).model;
    let (activation, angle) = (0.1, 30.0);
    let found = solve(&model, [activation, angle, 0.0]);
    let exponent = (1.0 + activation * 300.0 / 1.4_f64).ln();
    let place = |t: f64| (exponent * t).exp_m1() / exponent.exp_m1();
    let turns: Vec<f64> = std::iter::once(0.0).chain(found.history.iter().map(|s| place(s.place))).collect();
    let largest = turns.windows(2).map(|pair| (pair[1] - pair[0]) * angle).fold(0.0, f64::max);
    println!("{} steps, the longest turns by {largest:.1} degrees", turns.len() - 1);
    assert!(largest <= 22.5 && turns.len() < 16, "{turns:?}");
}

/// All that a jaw carries at once, and a muscle: implicit sensitivities of all places, those on the jaw too, against
/// differences of whole equilibria; torque and force of the jaw against differences of the energy.
fn check(name: &str, parts: &[&str], at: [f64; 3], scale: f64, tolerance: f64) {
    // without the passive force, whose kink at stretch 1 differences would see
    let Built { model, .. } = built(&[&parts.concat().replace("p1 = 0.005", "p1 = 0")]);
    let found = solve(&model, at);
    let closed = |found: &Equilibrium| -> Vec<bool> {
        let pressed =
            |term: usize| model.contact_points(&found.state, term).iter().map(|p| p.pressure != 0.0).collect();
        model.contacts().flat_map(|(term, _)| -> Vec<bool> { pressed(term) }).collect()
    };
    let active = closed(&found);
    let mut solver = solver(&model);
    let rates = sensitivities(Sensitivity::Tangent, &mut solver, &found, &[0, 1, 2]).expect("a regular tangent");
    common::assert_pulled_back(name, &mut solver, &found, &rates);
    let [state] = bone_states(&model, &found.state, &found.evaluation)[..] else { panic!("one bone") };
    let work = [None, state.torque.map(f64::to_radians), state.slide_force];
    for (control, step) in [5e-4, 2e-2, 1e-2].map(|step| scale * step).into_iter().enumerate() {
        let neighbours = [-2.0, -1.0, 1.0, 2.0].map(|k| near(&model, &found, control, k * step));
        assert!(neighbours.iter().all(|n| closed(n) == active), "{name}: the active set differs");
        let fetch =
            |h: f64| &neighbours[[-2, -1, 1, 2].iter().position(|k| *k == (h / step).round() as i32).unwrap()];
        let difference = slope(|h| places(&model, fetch(h)), step);
        let du = model.displacement_rate(&found.state, control, &rates[control]);
        let moved: Vec<f64> = points(&model).flat_map(|point| model.mesh().interpolate(point, &du)).collect();
        let largest = common::largest(&difference);
        let error = moved.iter().zip(&difference).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / largest;
        println!("{name}, control {control}: {error:.1e} of {largest:.3} mm per unit");
        assert_close(&format!("{name}, control {control}"), &moved, &difference, tolerance);
        if let Some(work) = work[control] {
            let energy = slope(|h| vec![fetch(h).evaluation.energies.iter().sum()], step);
            println!("  work per unit {work:.6}, {:.6} by differences", energy[0]);
            assert_close(&format!("{name}, work of control {control}"), &[work], &energy, 1e-7);
        }
    }
    let pressed = active.iter().filter(|a| **a).count();
    println!("{name}: {pressed} of {} points closed", active.len());
    assert!(active.is_empty() || (pressed > 0 && pressed < active.len()), "{name}: {pressed} points are closed");
}

const AT: [f64; 3] = [0.02, 4.0, 0.8];

#[test]
fn sensitivities_and_reactions_of_a_face() {
    check("face", &[STRIP, FACE], AT, 1.0, 1e-6);
}

#[test]
fn sensitivities_and_reactions_of_springs_and_ties() {
    check("springs", &[STRIP, SPRING], AT, 1.0, 1e-6);
    check("ties", &[STRIP, TIE], AT, 1.0, 1e-6);
}

#[test]
fn sensitivities_and_reactions_of_everything_at_once() {
    let ball = BALL.replace("[20, 5, -20.5], radius_mm = 20", "[20, 5, -50.1], radius_mm = 50");
    check("all, penalty", &[STRIP, FACE, &ball, SPRING, TIE], AT, 1.0, 1e-6);
    // stiff, so that differences of equilibria see little of the gap that is left
    let ball = ball.replace("penalty = { kpa_per_mm = 20 }", "augmented = { kpa_per_mm = 4000, gap_mm = 1e-9 }");
    check("all, augmented", &[STRIP, FACE, &ball, SPRING, TIE], AT, 0.3, 1e-5);
}

/// A jaw closes one lip on the other: both yield, and the motion of the lower one goes through their contact.
#[test]
fn sensitivities_and_reactions_of_lips() {
    const LIPS: &str = r#"
[task]
kind = "forward"
[mesh]
blocks = [{ name = "lower", origin_mm = [0, 0, 0], size_mm = [20, 10, 9], elements = [2, 1, 1] },
          { name = "upper", origin_mm = [0, 0, 9.3], size_mm = [20, 10, 9], elements = [2, 1, 1] }]
[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
gauss = 4
[[muscle]]
name = "slab"
block = { origin_mm = [3, 2, 12], size_mm = [14, 6, 3], elements = [2, 1, 1] }
fibre_angles_deg = [0, 0, 0]
blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }
[[bone]]
name = "jaw"
hinge = { axis = [0, 1, 0], through_mm = [25, 0, 0], bounds_deg = [-5, 10] }
slide = { direction = [0, 0, 1], bounds_mm = [-1, 2] }
[[support]]
clamp = { face = "upper:xi3=1" }
[[support]]
clamp = { face = "lower:xi3=0", bone = "jaw" }
[[contact]]
face = "upper:xi3=0"
surface = { faces = { face = "lower:xi3=1" } }
"#;
    let at = [0.01, 3.0, 0.1];
    check("lips, penalty", &[LIPS, "law = { penalty = { kpa_per_mm = 5 } }"], at, 0.3, 1e-5);
    // few points: more than the lips can follow would be closed slowly
    check(
        "lips, augmented",
        &[LIPS, "law = { augmented = { kpa_per_mm = 4000, gap_mm = 1e-9 } }\ngauss = 2"],
        at,
        0.3,
        1e-5,
    );
}

/// The sensitivities by differences that the fit offers agree too; the hinge stands on its lower bound.
#[test]
fn the_differences_of_the_fit_agree() {
    let lower = STRIP.replace("bounds_deg = [-5, 35]", "bounds_deg = [0, 35]");
    let model = built(&[&lower, FACE, SPRING]).model;
    let found = solve(&model, [0.02, 0.0, 0.8]);
    let mut solver = solver(&model);
    let tangent = sensitivities(Sensitivity::Tangent, &mut solver, &found, &[1, 2]).expect("a tangent");
    let how = Sensitivity::FiniteDifference { step: 1e-5 };
    let difference = sensitivities(how, &mut solver, &found, &[1, 2]).expect("neighbours");
    for (a, b) in tangent.iter().zip(&difference) {
        let (a, b) = (model.displacement_of(a), model.displacement_of(b));
        assert_close("rates", a.as_flattened(), b.as_flattened(), 1e-5);
    }
}

/// A rigid tie is the limit of stiff springs: what they leave falls like one over the stiffness.
#[test]
fn a_rigid_tie_is_an_endless_spring() {
    let model = built(&[STRIP, TIE]).model;
    let at = [0.02, 10.0, 1.0];
    let rigid = solve(&model, at);
    let x = model.current(&rigid.state);
    let spec = scene(&[STRIP, TIE]).attachments[0].position_mm;
    let Ok(on) = risorius::mesh::location::Locator::new(model.mesh()).locate(spec) else { panic!("it is inside") };
    let anchor = model.bones()[0].pose(&rigid.state.controls).place(spec);
    let gap = norm(subtract(model.mesh().interpolate(on, &x), anchor));
    assert!(gap < 1e-8, "gap {gap} mm");
    let left = |stiffness: &str| {
        let sprung = built(&[STRIP, &TIE.replace("rigid = true", stiffness)]).model;
        let (a, b) = (places(&model, &rigid), places(&sprung, &solve(&sprung, at)));
        a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let (soft, stiff) = (left("stiffness_mn_per_mm = 1e4"), left("stiffness_mn_per_mm = 1e5"));
    println!("springs of 1e4 and 1e5 mN/mm are off by {soft:.2e} and {stiff:.2e} mm");
    assert!((soft / stiff - 10.0).abs() < 0.1 && stiff < 1e-2, "{soft} and {stiff} mm");
}

/// A face and a jaw that cannot both have their way are a conflict, even though they agree at rest; a symmetry plane
/// that the jaw moves in is none.
#[test]
fn supports_that_a_bone_would_tear_apart_are_refused() {
    let tear = "[[support]]\nclamp = { face = \"xi2=0\" }\n";
    let error = build(&scene(&[STRIP, FACE, tear])).err().expect("a conflict");
    assert_eq!(error.code(), "G005");
    let plane = "[[support]]\nsymmetry = { face = \"xi2=0\" }\n";
    assert!(build(&scene(&[&STRIP.replace("[0, 2, 0.1]", "[0, 2, 0]"), FACE, plane])).is_ok());
    assert_eq!(build(&scene(&[STRIP, FACE, plane])).err().map(|e| e.code()), Some("G005"));
}

const MARKERS: [Vector; 8] = [
    [12.0, 5.0, 10.0],
    [20.0, 5.0, 10.0],
    [28.0, 5.0, 10.0],
    [36.0, 5.0, 10.0],
    [20.0, 0.0, 5.0],
    [32.0, 0.0, 5.0],
    [32.0, 10.0, 5.0],
    [40.0, 5.0, 8.0],
];

/// Markers of a forward run give hinge, slide and activation back, in several frames; a jaw that is not named holds.
#[test]
fn a_fit_finds_the_jaw() {
    let truth = [[0.02, 3.0, 0.5], [0.03, 12.0, 1.5], [0.01, 6.0, -1.0]];
    let parts = [STRIP, FACE, BALL, SPRING];
    let model = built(&parts).model;
    let surface = risorius::mesh::surface::Surface::new(model.mesh());
    let seen = |controls: &[f64; 3]| -> Vec<Option<Vector>> {
        let x = model.current(&solve(&model, *controls).state);
        let at = |marker: &Vector| surface.project(*marker).expect("a surface").point;
        MARKERS.iter().map(|marker| Some(model.mesh().interpolate(at(marker), &x))).collect()
    };
    let frame = |(k, controls): (usize, &[f64; 3])| Frame {
        time_s: k as f64 / 30.0,
        stamp_ns: 1_000_000_000 + k as i64 * 33_333_333,
        positions_mm: seen(controls),
    };
    let frames: Vec<Frame> = truth.iter().enumerate().map(frame).collect();
    let labels: Vec<String> = (0..MARKERS.len()).map(|k| format!("M{k}")).collect();
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("jaw.mcap");
    write_json(&path, &labels, &frames, &WriteOptions { units: Units::M, ..WriteOptions::default() })
        .expect("written");
    let recording = read(&path, &ReadOptions { units: Units::M, ..ReadOptions::default() }).expect("read");

    let mut text = parts.concat().replace("kind = \"forward\"", "kind = \"fit\"");
    for (label, [x, y, z]) in labels.iter().zip(MARKERS) {
        writeln!(text, "[[marker]]\nname = \"{label}\"\nposition_mm = [{x}, {y}, {z}]").expect("text");
    }
    let unknowns = "unknowns = [\"jaw.hinge\", \"slab\", \"jaw.slide\"]\n";
    for how in ["tangent", "finite-difference"] {
        let fit = format!("[fit]\nmarkers = \"jaw.mcap\"\nunits = \"m\"\nsensitivity = \"{how}\"\n{unknowns}");
        let scene = scene(&[&text, &fit]);
        let built = build(&scene).expect("a model");
        let mut fit = Fit::new(&built.model, &scene, scene.fit.as_ref().expect("a fit"), &recording).expect("a fit");
        assert_eq!(fit.unknowns(), [1, 0, 2]);
        for (k, truth) in truth.iter().enumerate() {
            let found = fit.frame(&recording, k).unwrap_or_else(|error| panic!("frame {k}: {error}"));
            let controls = &found.equilibrium.state.controls;
            println!("{how}, frame {k}: {controls:?}, {} steps, rms {:.1e} mm", found.iterations.len(), found.rms_mm);
            for ((found, truth), range) in controls.iter().zip(truth).zip([1.0, 40.0, 11.0]) {
                assert!((found - truth).abs() < 1e-6 * range, "frame {k}: {found} instead of {truth}");
            }
            assert!(found.sd.iter().all(Option::is_some), "all three are determined");
        }
    }
    // by default muscles are sought, and the jaw holds where the problem has it
    let held = "[fit]\nmarkers = \"jaw.mcap\"\nunits = \"m\"\n[controls]\n\"jaw.hinge\" = 12\njaw.slide = 1.5\n";
    let scene = scene(&[&text, held]);
    let mut fit = Fit::new(&model, &scene, scene.fit.as_ref().expect("a fit"), &recording).expect("a fit");
    assert_eq!(fit.unknowns(), [0]);
    let found = fit.frame(&recording, 1).expect("a fit");
    assert_close("held", &found.equilibrium.state.controls, &truth[1], 1e-7);
}

fn risorius(folder: &Path, arguments: &[&str]) -> String {
    let output =
        assert_cmd::Command::cargo_bin("risorius").unwrap().current_dir(folder).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// A jaw that opens along a table of curves, as a user runs it: tables, page, and the lock file gives the same bits.
#[test]
fn a_run_shows_its_bones() {
    let folder = tempfile::tempdir().unwrap();
    let controls =
        "[controls]\nslab = 0.01\njaw.hinge = { csv = \"open.csv\" }\njaw.slide = { csv = \"open.csv\" }\n";
    std::fs::write(folder.path().join("jaw.toml"), [STRIP, FACE, TIE, controls].concat()).unwrap();
    std::fs::write(folder.path().join("open.csv"), "time_s,jaw.slide,jaw.hinge\n0,0,0\n0.5,1,10\n").unwrap();
    let page = risorius(folder.path(), &["check", "jaw.toml"]);
    assert!(page.contains("bone jaw") && page.contains("jaw.hinge from -5 to 35 deg"), "{page}");
    assert!(page.contains("rigid attachment on jaw"), "{page}");
    let page = risorius(folder.path(), &["run", "jaw.toml", "--out", "run"]);
    assert!(page.lines().any(|line| line.contains("jaw") && line.contains("10.0000")), "{page}");
    let table =
        |run: &str, name: &str| std::fs::read_to_string(folder.path().join(run).join("tables").join(name)).unwrap();
    let activations = table("run", "activations.csv");
    assert!(activations.starts_with("frame,time_s,slab,jaw.hinge,jaw.slide\n"), "{activations}");
    assert!(activations.ends_with("1,0.5,0.01,10.0,1.0\n"), "{activations}");
    let bones = table("run", "bones.csv");
    let rows: Vec<Vec<&str>> = bones.lines().map(|line| line.split(',').collect()).collect();
    let header = "frame,time_s,name,hinge_deg,slide_mm,torque_mn_mm,slide_force_mn,force_x_mn,force_y_mn,force_z_mn";
    assert_eq!((rows.len(), rows[0].join(",")), (3, header.to_owned()));
    assert_eq!(rows[2][2..5], ["jaw", "10.0", "1.0"]);
    // torque = axis . moment is not less than nothing: opening stretches the strip
    let number = |k: usize| rows[2][k].parse::<f64>().unwrap();
    let along = (3.0 * number(7) + number(9)) / 10.0_f64.sqrt();
    assert!((number(6) - along).abs() < 1e-9 * along.abs() && number(5) > 0.0, "{bones}");
    risorius(folder.path(), &["run", "run/problem.lock.toml", "--out", "again"]);
    for name in ["activations.csv", "bones.csv", "energies.csv"] {
        assert_eq!(table("run", name), table("again", name), "{name}");
    }
}

/// Forces turn with everything: a moment taken by hand.
#[test]
fn wrenches_add_up() {
    let mut wrench = Wrench::default();
    let (force, at) = ([1.0, 2.0, 3.0], [4.0, -1.0, 2.0]);
    wrench.add_force(force, at);
    wrench.add(&wrench.clone());
    assert_eq!(wrench, Wrench { force: force.map(|f| 2.0 * f), moment: cross(at, force).map(|m| 2.0 * m) });
}
