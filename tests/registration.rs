//! Is what keeps a recording from lying on its model told by name? The rows of a table of classic mistakes, on markers that are
//! nearly symmetric, as those of a face are.

use crate::common::Random;
use risorius::fit::placement::place;
use risorius::fit::registration::{Registration, register};
use risorius::markers::{Frame, ReadOptions, Recording, WriteOptions, read, write_json};
use risorius::math::motion::Motion;
use risorius::math::tensor::{norm, normalised, rotation, subtract};
use risorius::mesh::Mesh;
use risorius::model::build::host;
use risorius::scene::{Scene, Units};
use risorius::{Error, Warning};
use std::fmt::Write;
use std::path::Path;

/// Half of the markers: the front of a block of 120 x 140 x 80 mm, its sides and its top, at y from -60 to 60.
const LEFT: [(&str, [f64; 3]); 11] = [
    ("brow_mid", [12.0, 50.0, 80.0]),
    ("brow_lat", [45.0, 45.0, 80.0]),
    ("eye", [35.0, 30.0, 80.0]),
    ("temple", [60.0, 35.0, 50.0]),
    ("nose", [14.0, 5.0, 80.0]),
    ("cheek", [40.0, 0.0, 80.0]),
    ("jaw", [60.0, -20.0, 30.0]),
    ("lip", [22.0, -25.0, 80.0]),
    ("lip_up", [9.0, -18.0, 80.0]),
    ("chin", [15.0, -50.0, 80.0]),
    ("neck", [20.0, -70.0, 40.0]),
];

/// 24 markers: two on the midline, eleven pairs whose right ones are about `uneven` mm off the mirror image of the left.
fn markers(uneven: f64) -> Vec<(String, [f64; 3])> {
    let mut random = Random::new(7);
    let mut all = vec![("forehead".to_owned(), [0.0, 70.0, 60.0]), ("gnathion".to_owned(), [0.0, -70.0, 70.0])];
    for (name, [x, y, z]) in LEFT {
        all.push((format!("{name}.L"), [x, y, z]));
        // along the faces of the block only
        let [dx, dy, dz] = random.triple().map(|d| uneven * 1.5 * d);
        let dx = if x == 60.0 { 0.0 } else { dx };
        let dy = if y == -70.0 { 0.0 } else { dy };
        let dz = if z == 80.0 { 0.0 } else { dz };
        all.push((format!("{name}.R"), [-x + dx, y + dy, z + dz]));
    }
    all
}

fn problem(markers: &[(String, [f64; 3])], fit: &str) -> String {
    let mut text = String::from(
        r#"
[task]
kind = "fit"
[mesh]
block = { origin_mm = [-60, -70, 0], size_mm = [120, 140, 80], elements = [2, 2, 1] }
[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
[[muscle]]
name = "slab"
block = { origin_mm = [-20, -20, 30], size_mm = [40, 10, 5], elements = [2, 1, 1] }
fibre_angles_deg = [0, 0, 0]
blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }
[[support]]
clamp = { face = "xi3=0" }
"#,
    );
    for (name, [x, y, z]) in markers {
        writeln!(text, "[[marker]]\nname = \"{name}\"\nposition_mm = [{x:?}, {y:?}, {z:?}]").unwrap();
    }
    format!("{text}[fit]\nmarkers = \"face.mcap\"\n{fit}")
}

/// A recording that shows the labels at these positions, in millimetres as they stand in the file.
fn recording(frames: &[Vec<(String, [f64; 3])>]) -> Recording {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("face.mcap");
    let labels: Vec<String> = frames[0].iter().map(|(label, _)| label.clone()).collect();
    let frame = |(k, shown): (usize, &Vec<(String, [f64; 3])>)| Frame {
        time_s: 0.1 * k as f64,
        stamp_ns: 1_000_000_000 + 100_000_000 * k as i64,
        positions_mm: shown.iter().map(|(_, p)| Some(*p)).collect(),
    };
    let frames: Vec<Frame> = frames.iter().enumerate().map(frame).collect();
    write_json(&path, &labels, &frames, &WriteOptions::default()).unwrap();
    read(&path, &ReadOptions::default()).unwrap()
}

/// Registers a recording on the block; gives it as it then is.
fn registered(
    markers: &[(String, [f64; 3])],
    mut recording: Recording,
    fit: &str,
) -> Result<(Registration, Vec<Warning>, Recording), Error> {
    let scene = Scene::parse(&problem(markers, fit), "face.toml", Path::new("."), &[]).unwrap();
    let mesh: Mesh = host(&scene.mesh).unwrap();
    let spec = scene.fit.as_ref().unwrap();
    if let Some(units) = spec.units {
        for position in recording.frames.iter_mut().flat_map(|f| f.positions_mm.iter_mut().flatten()) {
            *position = position.map(|x| x * units.mm());
        }
    }
    let placed = place(&scene, spec, &mesh, &recording)?;
    let (registration, warnings) = register(&scene, spec, &mesh, &placed, &mut recording, None)?;
    Ok((registration, warnings, recording))
}

/// The markers with 0.3 mm of measurement noise per coordinate (uniform, of that standard deviation).
fn noisy(markers: &[(String, [f64; 3])], seed: u64) -> Vec<(String, [f64; 3])> {
    let mut random = Random::new(seed);
    let mut jitter = |x: f64| x + 0.3 * 3.0_f64.sqrt() * random.next();
    markers.iter().map(|(name, p)| (name.clone(), p.map(&mut jitter))).collect()
}

fn moved(markers: &[(String, [f64; 3])], motion: &Motion) -> Vec<(String, [f64; 3])> {
    markers.iter().map(|(name, p)| (name.clone(), motion.place(*p))).collect()
}

/// Two labels on each other's markers.
fn exchanged(markers: &[(String, [f64; 3])], a: &str, b: &str) -> Vec<(String, [f64; 3])> {
    let other = |name: &str| {
        if name == a {
            b.to_owned()
        } else if name == b {
            a.to_owned()
        } else {
            name.to_owned()
        }
    };
    markers.iter().map(|(name, p)| (other(name), *p)).collect()
}

fn sides_exchanged(markers: &[(String, [f64; 3])]) -> Vec<(String, [f64; 3])> {
    let other = |name: &str| match name.split_once('.') {
        Some((stem, "L")) => format!("{stem}.R"),
        Some((stem, _)) => format!("{stem}.L"),
        None => name.to_owned(),
    };
    markers.iter().map(|(name, p)| (other(name), *p)).collect()
}

fn elsewhere() -> Motion {
    Motion { scale: 1.0, turn: rotation(normalised([0.3, 1.0, -0.4]), 0.6), shift: [300.0, -20.0, 1200.0] }
}

/// What a registration says must be one of these codes, whatever motion is allowed, and hold the words.
#[track_caller]
fn told(shown: &[Vec<(String, [f64; 3])>], fits: &[&str], code: &str, words: &[&str]) {
    for fit in fits {
        let error = registered(&markers(1.5), recording(shown), fit).expect_err(fit);
        assert_eq!(error.code(), code, "{fit}: {error}");
        let text = format!("{error}\n{}", error.help().unwrap());
        for words in words {
            assert!(text.contains(words), "{fit}: `{words}` is not in\n{text}");
        }
        assert!(error.place().is_some());
    }
}

const NONE: &str = "units = \"mm\"\n";
const RIGID: &str = "units = \"mm\"\nregister = \"rigid\"\n";
const SIMILARITY: &str = "units = \"mm\"\nregister = \"similarity\"\n";

#[test]
fn a_correct_recording_lies_on_its_model() {
    let markers = markers(1.5);
    let shown = noisy(&markers, 1);
    for fit in [NONE, RIGID, SIMILARITY] {
        let (registration, warnings, found) =
            registered(&markers, recording(std::slice::from_ref(&shown)), fit).unwrap();
        assert!(warnings.is_empty(), "{fit}: {warnings:?}");
        assert!(registration.rms_mm < 0.7 && registration.markers.iter().all(|m| !m.off), "{registration}");
        assert!(registration.motion.angle() < 0.01 && registration.moved_mm < 0.2, "{registration}");
        let scale = registration.scale.unwrap();
        assert!(scale.interval[0] < 1.0 && 1.0 < scale.interval[1], "{scale:?}");
        let same = fit == NONE;
        assert_eq!(found.frames[0].positions_mm[0] == Some(shown[0].1), same, "only what was asked for is moved");
    }
}

#[test]
fn wrong_units_are_told_by_size() {
    let shown = [noisy(&markers(1.5), 2)];
    told(&shown, &["units = \"m\"\n", "units = \"m\"\nregister = \"rigid\"\n"], "K001", &["999.", "units = \"mm\""]);
    told(&shown, &["units = \"cm\"\nregister = \"similarity\"\n"], "K001", &["9.9", "units = \"mm\""]);
    // inches are none of the units there are
    let inches = Motion { scale: 1.0 / 25.4, ..Motion::REST };
    told(&[moved(&shown[0], &inches)], &[NONE], "K001", &["0.039 times", "units = \"estimate\""]);
}

#[test]
fn left_handed_axes_are_told_from_exchanged_sides() {
    let mirror = Motion { turn: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]], ..Motion::REST };
    let shown = noisy(&markers(1.5), 3);
    let left_handed = [moved(&shown, &mirror)];
    told(&left_handed, &[NONE, RIGID, SIMILARITY], "K007", &["left-handed", "axes = [\"-x\", \"y\", \"z\"]"]);
    let sides = [sides_exchanged(&shown)];
    told(&sides, &[NONE, RIGID, SIMILARITY], "K008", &["11 pairs", "`brow_mid.L` and `brow_mid.R`"]);
    // and both wherever the recording stands
    let left_handed = [moved(&left_handed[0], &elsewhere())];
    told(&left_handed, &[NONE, RIGID], "K007", &["left-handed"]);
    told(&[moved(&sides[0], &elsewhere())], &[NONE, RIGID], "K008", &["11 pairs"]);
    // the remedy mends it
    let mended = format!("{RIGID}axes = [\"-x\", \"y\", \"z\"]\n");
    let (registration, warnings, _) = registered(&markers(1.5), recording(&left_handed), &mended).unwrap();
    assert!(registration.rms_mm < 0.7 && warnings.is_empty(), "{registration}");
}

#[test]
fn symmetric_markers_leave_open_which_of_the_two_it_is() {
    let even = markers(0.0);
    let shown = recording(&[noisy(&sides_exchanged(&even), 4)]);
    let error = registered(&even, shown, RIGID).unwrap_err();
    let text = format!("{error}\n{}", error.help().unwrap());
    assert_eq!(error.code(), "K007");
    for words in ["do not tell the two apart", "`cheek.L` and `cheek.R`", "find out which"] {
        assert!(text.contains(words), "{words} is not in\n{text}");
    }
}

#[test]
fn exchanged_labels_are_named() {
    let shown = noisy(&markers(1.5), 5);
    let two = exchanged(&shown, "eye.L", "chin.R");
    told(std::slice::from_ref(&two), &[NONE, RIGID, SIMILARITY], "K009", &["`eye.L` is where `chin.R` should be"]);
    told(&[moved(&two, &elsewhere())], &[RIGID], "K009", &["`chin.R` is where `eye.L` should be"]);
    // three in a circle, beside a pair
    let three = exchanged(&exchanged(&two, "nose.L", "jaw.R"), "jaw.R", "temple.L");
    told(&[three], &[NONE, RIGID], "K009", &["`jaw.R` is where", "`temple.L` is where", "`eye.L` is where"]);
}

#[test]
fn a_frame_that_is_not_neutral_is_told_with_one_that_is() {
    let rest = markers(1.5);
    // a wide mouth: the lower third moves out and up by 8 mm
    let smile: Vec<_> = rest
        .iter()
        .map(|(name, [x, y, z])| {
            let by = if *y < -10.0 && x.abs() < 50.0 { 8.0 } else { 0.0 };
            (name.clone(), [x + by * x.signum(), y + by, *z])
        })
        .collect();
    let frames = [noisy(&smile, 6), noisy(&smile, 7), noisy(&rest, 8), noisy(&smile, 9)];
    told(&frames, &[RIGID, SIMILARITY], "K010", &["frame 0, taken as neutral", "neutral = 2 in [fit]"]);
    // nothing hangs on it where the recording stands on the model already
    let (registration, warnings, _) = registered(&rest, recording(&frames), NONE).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}, {registration}");
    let (registration, ..) = registered(&rest, recording(&frames), &format!("{RIGID}neutral = 2\n")).unwrap();
    assert!(registration.rms_mm < 0.7, "{registration}");
    // with no better frame there is nothing to name but those that are off
    let (registration, warnings, _) = registered(&rest, recording(&frames[..2]), RIGID).unwrap();
    assert_eq!(warnings.iter().map(|w| w.code).collect::<Vec<_>>(), ["K013"], "{registration}");
}

#[test]
fn offsets_of_markers_are_taken_out_as_far_as_the_neutral_frame_tells_them() {
    let places = markers(2.0);
    let mut random = Random::new(11);
    let offsets: Vec<[f64; 3]> = places.iter().map(|_| random.triple().map(|d| 3.0 * d - 1.5)).collect();
    let shown = |by: f64| -> Vec<(String, [f64; 3])> {
        let beside = |((name, p), o): (&(String, [f64; 3]), &[f64; 3])| {
            (name.clone(), std::array::from_fn(|i| p[i] + o[i] + if i == 1 { by } else { 0.0 }))
        };
        places.iter().zip(&offsets).map(beside).collect()
    };
    // three markers that the neutral frame does not show cannot be told their offsets
    let film = || {
        let mut film = recording(&[shown(0.0), shown(0.5)]);
        film.frames[0].positions_mm[..3].fill(None);
        film
    };
    for (sd, prior, part) in [(0.3, 0.4, 0.64), (0.3, 3.0, 9.0 / 9.09)] {
        let fit = format!("units = \"mm\"\nneutral = 0\nsd_mm = {sd}\noffset_sd_mm = {prior}\n");
        let scene = Scene::parse(&problem(&places, &fit), "face.toml", Path::new("."), &[]).unwrap();
        let mesh: Mesh = host(&scene.mesh).unwrap();
        let placed = place(&scene, scene.fit.as_ref().unwrap(), &mesh, &film()).unwrap();
        let (registration, _, found) = registered(&places, film(), &fit).unwrap();
        let mut squares = 0.0;
        for (k, marker) in placed.iter().enumerate() {
            let (part, left) = if k < 3 { (0.0, prior * prior) } else { (part, part * sd * sd) };
            assert!((marker.sd.unwrap() - f64::sqrt(sd * sd + left)).abs() < 1e-12);
            let at = found.frames[1].positions_mm[marker.column].unwrap();
            let x = mesh.position(marker.point);
            for i in 0..3 {
                let moved = if i == 1 { 0.5 } else { 0.0 };
                let whole = places[k].1[i] + offsets[k][i] - x[i];
                assert!((at[i] - x[i] - moved - (1.0 - part) * whole).abs() < 1e-9, "{} {i}", marker.name);
                squares += if k < 3 { 0.0 } else { (part * whole).powi(2) };
            }
        }
        let rms = (squares / (placed.len() - 3) as f64).sqrt();
        assert!((registration.offset_rms_mm.unwrap() - rms).abs() < 1e-9);
        assert!(registration.to_string().contains("offsets of markers"), "{registration}");
    }
}

const BONES: &str =
    "[fit.head]\nbone_markers = [\"forehead\", \"temple.L\", \"temple.R\", \"neck.L\", \"brow_mid.R\"]\n";

/// A head that turns while the face is at rest: its frames are brought together, and their mean has less than half of the noise of one.
#[test]
fn neutral_frames_are_brought_together_and_averaged() {
    let rest = markers(1.5);
    let turned = |frame: usize| {
        let part = 0.04 * frame as f64;
        let head =
            Motion { scale: 1.0, turn: rotation(normalised([0.3, -0.8, 0.5]), part), shift: [9.0 * part, 4.0, part] };
        elsewhere().then(&head)
    };
    let film = || {
        let frames: Vec<_> = (0..9).map(|k| moved(&noisy(&rest, 40 + k as u64), &turned(k))).collect();
        let mut film = recording(&frames);
        // a marker counts in the frames that show it
        (1..4).for_each(|k| film.frames[k].positions_mm[3 + k] = None);
        film
    };
    // bone markers, or the face as a whole
    for head in [BONES, "[fit.head]\nestimate = true\n"] {
        let rms = |neutral: &str| {
            let (registration, warnings, found) =
                registered(&rest, film(), &format!("{RIGID}{neutral}\n{head}")).unwrap();
            assert!(warnings.is_empty(), "{warnings:?}");
            (registration, found)
        };
        let (one, _) = rms("neutral = 0");
        let (nine, found) = rms("neutral = { first = 0, last = 8 }");
        println!("{head}{} and {} mm", one.rms_mm, nine.rms_mm);
        assert!(nine.rms_mm < 0.5 * one.rms_mm, "{} and {} mm", one.rms_mm, nine.rms_mm);
        assert_eq!((nine.neutral.len(), nine.markers.len()), (9, rest.len()));
        assert!(nine.to_string().contains("the mean of its frames 0 to 8 fits the model"), "{nine}");
        if let Some(bones) = found.bones {
            assert_eq!(bones.neutral, (0..9).collect::<Vec<_>>());
        }
    }
}

/// What n neutral frames leave open of an offset s is s^2 e^2 / (s^2 + e^2) with e^2 = sd^2 / n, of each marker its own n.
#[test]
fn offsets_are_as_sure_as_the_neutral_frames_that_show_them_are_many() {
    let places = markers(2.0);
    let mut film = recording(&vec![places.clone(); 5]);
    film.frames[2].positions_mm[1] = None;
    (0..4).for_each(|k| film.frames[k].positions_mm[2] = None);
    let (sd, s) = (0.3, 0.4);
    let fit = format!("units = \"mm\"\nneutral = {{ first = 0, last = 3 }}\nsd_mm = {sd}\noffset_sd_mm = {s}\n");
    let scene = Scene::parse(&problem(&places, &fit), "face.toml", Path::new("."), &[]).unwrap();
    let mesh: Mesh = host(&scene.mesh).unwrap();
    let placed = place(&scene, scene.fit.as_ref().unwrap(), &mesh, &film).unwrap();
    for (marker, part) in [(0, 0.16 / (0.16 + 0.0225)), (1, 0.16 / (0.16 + 0.03)), (2, 0.0)] {
        assert!((placed[marker].offset_part - part).abs() < 1e-12, "{:?}", placed[marker]);
        // (1 - part) s^2 is s^2 e^2 / (s^2 + e^2)
        let left: f64 = sd * sd + (1.0 - part) * s * s;
        assert!((placed[marker].sd.unwrap() - left.sqrt()).abs() < 1e-12, "{:?}", placed[marker]);
    }
}

#[test]
fn neutral_frames_must_exist_and_be_still() {
    let rest = markers(1.5);
    let frame = |k: u64| {
        let mut shown = noisy(&rest, 60 + k);
        // the left half of the face is pulled back
        shown.iter_mut().filter(|(name, _)| name.ends_with(".L")).for_each(|(_, p)| p[2] -= 2.5 * k as f64);
        shown
    };
    let film = || recording(&(0..6).map(frame).collect::<Vec<_>>());
    let neutral = |of: &str| registered(&rest, film(), &format!("{RIGID}neutral = {of}\n"));
    for (of, frame) in [("{ first = 2, last = 6 }", 6), ("{ first = 9 }", 9), ("6", 6)] {
        let error = neutral(of).unwrap_err();
        assert!(error.code() == "K004" && error.to_string().contains(&format!("no frame {frame} to")), "{error}");
    }
    for sd in ["", "sd_mm = 0.3\n"] {
        let warned = |of: &str| {
            let (_, warnings, _) = registered(&rest, film(), &format!("{NONE}{sd}neutral = {of}\n")).unwrap();
            warnings.into_iter().filter(|w| w.code == "K019").map(|w| w.message).collect::<Vec<_>>()
        };
        let told = warned("{ first = 0, last = 5 }");
        assert_eq!(told.len(), 1, "{told:?}");
        let words = |told: &String| {
            told.contains("frames 0 to 5") && told.contains("mm about") && told.contains("is farthest off")
        };
        assert!(told.iter().all(words), "{told:?}");
        assert_eq!(warned("{ first = 0, last = 1 }"), [""; 0]);
        assert_eq!(warned("0"), [""; 0]);
    }
}

#[test]
fn a_recording_that_stands_elsewhere_is_brought_home_only_when_asked() {
    let rest = markers(1.5);
    let shown = moved(&noisy(&rest, 10), &elsewhere());
    told(
        std::slice::from_ref(&shown),
        &[NONE],
        "K011",
        &["turned by 34.", "register = \"rigid\"", "nothing was moved"],
    );
    let (registration, warnings, found) = registered(&rest, recording(std::slice::from_ref(&shown)), RIGID).unwrap();
    assert!(warnings.is_empty() && (registration.motion.angle() - 0.6).abs() < 0.01, "{registration}");
    for ((_, truth), position) in rest.iter().zip(&found.frames[0].positions_mm) {
        assert!(norm(subtract(*truth, position.unwrap())) < 1.2);
    }
    // a third that is off does not turn it
    let mut random = Random::new(11);
    let spoilt: Vec<_> = shown
        .iter()
        .enumerate()
        .map(|(k, (name, p))| {
            let d = normalised(random.triple());
            (name.clone(), if k % 4 == 1 { std::array::from_fn(|i| p[i] + 25.0 * d[i]) } else { *p })
        })
        .collect();
    let (registration, warnings, _) = registered(&rest, recording(&[spoilt]), RIGID).unwrap();
    assert_eq!(registration.markers.iter().filter(|m| m.off).count(), 6, "{registration}");
    assert!(registration.rms_mm < 0.7 && (registration.motion.angle() - 0.6).abs() < 0.01, "{registration}");
    assert_eq!(warnings.iter().map(|w| w.code).collect::<Vec<_>>(), ["K013"]);
}

/// Recordings without a true size: the interval of the scale covers it in 90 to 99 of 100 noisy copies.
#[test]
fn an_estimated_scale_comes_with_an_interval_that_covers_it() {
    let rest = markers(1.5);
    let unknown = Motion { scale: 0.0217, ..elsewhere() };
    let fit = "units = \"estimate\"\nregister = \"similarity\"\n";
    let mut covered = 0;
    for copy in 0..200 {
        let shown = moved(&noisy(&rest, 100 + copy), &unknown);
        let (registration, ..) = registered(&rest, recording(&[shown]), fit).unwrap();
        let interval = registration.scale.unwrap().interval;
        covered += usize::from((interval[0]..interval[1]).contains(&(1.0 / 0.0217)));
        assert!((registration.motion.scale * 0.0217 - 1.0).abs() < 0.01);
        assert!(interval[1] - interval[0] < 0.02 / 0.0217);
    }
    println!("the interval covers the scale in {covered} of 200");
    assert!((180..=199).contains(&covered), "{covered} of 200");
}

#[test]
fn labels_may_differ_from_names() {
    let rest = markers(1.5);
    let shown: Vec<_> = rest.iter().map(|(name, p)| (name.replace('.', "_"), *p)).collect();
    let text = problem(&rest, NONE).replace("name = \"cheek.L\"", "name = \"cheek.L\"\nlabel = \"cheek_L\"");
    let scene = Scene::parse(&text, "face.toml", Path::new("."), &[]).unwrap();
    let mesh = host(&scene.mesh).unwrap();
    let error = place(&scene, scene.fit.as_ref().unwrap(), &mesh, &recording(&[shown])).unwrap_err();
    let missing: Vec<String> = error.mistakes().iter().map(Error::to_string).collect();
    assert!(missing.len() == 21 && missing.iter().all(|m| !m.contains("cheek_L`;")), "{missing:?}");
    assert_eq!(scene.fit.unwrap().units, Some(Units::Mm));
}
