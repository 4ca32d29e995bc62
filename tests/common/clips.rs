//! Clips as they come from a laboratory, made by a model: noise, dropouts in bursts, occlusions as zeros, gross outliers, a head
//! that moves. And what the fit makes of them, against the truth.
//!
//! Both `tests/clips.rs` and `examples/twin_table.rs` use it. The problem is `problems/beam`, fitted on 4 x 1 x 1 elements.
#![allow(dead_code)] // every crate that includes it uses a part

use risorius::fit::bias::bias;
use risorius::fit::covariance::Bound;
use risorius::fit::identifiability::Evidence;
use risorius::fit::registration::register;
use risorius::fit::sequence::settings;
use risorius::fit::{Estimate, Fit, placement};
use risorius::forward::estimate::Estimator;
use risorius::forward::{Drive, Settings, Solver};
use risorius::markers::{Frame, ReadOptions, WriteOptions, read, write_json};
use risorius::math::motion::Motion;
use risorius::math::normal::TWO_SIDED_95;
use risorius::math::tensor::{normalised, rotation};
use risorius::mesh::surface::Surface;
use risorius::model::build::build;
use risorius::model::halved::Halved;
use risorius::scene::{Scene, Units};
use std::f64::consts::PI;
use std::path::Path;

/// Frames per second.
pub const RATE_HZ: f64 = 30.0;
/// The host that is fitted.
const FITTED: &str = "mesh.block.elements=[4, 1, 1]";
/// How far a gross outlier is from where its marker is, mm.
const OUTLIER_MM: [f64; 3] = [-6.0, 10.0, 8.0];

/// Where the head is from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Head {
    /// Six markers on bone, as noisy as the others.
    Bones,
    /// Nothing shows it: it is estimated with the activations.
    Estimated,
}

/// How a clip is recorded.
#[derive(Debug, Clone, Copy)]
pub struct Conditions {
    /// Standard deviation of every coordinate, mm.
    pub noise_mm: f64,
    /// The part of the samples of markers that is lost, in bursts of two to six frames.
    pub lost: f64,
    /// How the motion of the head is known.
    pub head: Head,
    /// Frames in which face and head are at rest, the neutral ones: the first of the clip, after so many less one before it.
    pub neutral: usize,
}

/// Sums over fitted frames.
#[derive(Debug, Clone, Copy, Default)]
pub struct Score {
    frames: usize,
    values: usize,
    markers: usize,
    marker_square: f64,
    square: f64,
    covered: usize,
    square_unbiased: f64,
    covered_unbiased: usize,
}

impl Score {
    /// Frames that were fitted.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Root mean square distance of markers that are no outliers, mm.
    pub fn marker_rms(&self) -> f64 {
        (self.marker_square / self.markers as f64).sqrt()
    }

    /// Root mean square error of the activations.
    pub fn rms(&self) -> f64 {
        (self.square / self.values as f64).sqrt()
    }

    /// The same with the estimated bias taken off.
    pub fn rms_unbiased(&self) -> f64 {
        (self.square_unbiased / self.values as f64).sqrt()
    }

    /// The part of the 95 % intervals that hold the truth.
    pub fn coverage(&self) -> f64 {
        self.covered as f64 / self.values as f64
    }

    /// The same of intervals that are moved by the estimated bias.
    pub fn coverage_unbiased(&self) -> f64 {
        self.covered_unbiased as f64 / self.values as f64
    }

    /// Another clip beside this one.
    pub fn add(&mut self, other: &Score) {
        self.frames += other.frames;
        self.values += other.values;
        self.markers += other.markers;
        self.marker_square += other.marker_square;
        self.square += other.square;
        self.covered += other.covered;
        self.square_unbiased += other.square_unbiased;
        self.covered_unbiased += other.covered_unbiased;
    }
}

/// Two overlapping bumps of 40 frames, as in `examples/recordings.rs`, or the first frames of them; frame 0 is at rest.
pub fn truth(frames: usize) -> Vec<Vec<f64>> {
    let bump = |t: f64, from: f64, to: f64| match (from..=to).contains(&t) {
        true => (PI * (t - from) / (to - from)).sin().powi(2),
        false => 0.0,
    };
    let at = |k: usize| {
        let t = k as f64 / 39.0;
        vec![0.012 * bump(t, 0.0, 0.8), 0.02 * bump(t, 0.2, 1.0)]
    };
    (0..frames).map(at).collect()
}

/// The problem of the beam with other lines in `[fit]`.
fn problem(fit: &str, set: &[&str]) -> Scene {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("problems/beam");
    let text = std::fs::read_to_string(folder.join("problem.toml")).expect("the problem");
    let text = text
        .replace("../../data/beam.mcap", "clip.mcap")
        .replace("units = \"m\"\n", &format!("units = \"m\"\n{fit}"));
    let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
    Scene::parse(&text, "problem.toml", &folder, &set).unwrap_or_else(|error| panic!("{error}"))
}

/// Places of the markers in every frame, mm, without noise; `set` is what is better in the model that moves them than in the one
/// that is fitted.
pub fn positions(set: &[&str], truth: &[Vec<f64>]) -> Vec<Vec<[f64; 3]>> {
    let scene = problem("", &[&[FITTED], set].concat());
    let built = build(&scene).unwrap_or_else(|error| panic!("{error}"));
    let (model, surface) = (&built.model, Surface::new(built.model.mesh()));
    let points: Vec<_> =
        scene.markers.iter().map(|m| surface.project(m.position_mm).expect("a foot").point).collect();
    let mut solver = Solver::new(model, Settings::default()).expect("memory");
    let mut state = model.rest();
    let mut all = Vec::new();
    for controls in truth {
        let found = solver.equilibrium(&state, &Drive { controls: controls.clone(), load: 1.0 });
        state = found.unwrap_or_else(|failure| panic!("{}", failure.error)).state;
        let x = model.current(&state);
        all.push(points.iter().map(|point| model.mesh().interpolate(*point, &x)).collect());
    }
    all
}

/// Where the head is in a frame: at rest at first, turned by 15 degrees and moved by 20 mm in the middle.
fn head(frame: usize, frames: usize) -> Motion {
    let part = (PI * frame as f64 / (frames - 1) as f64).sin();
    let turn = rotation(normalised([0.3, -0.8, 0.5]), part * 15_f64.to_radians());
    Motion { scale: 1.0, turn, shift: normalised([1.0, 2.0, -1.5]).map(|x| 20.0 * part * x) }
}

/// On what the beam is clamped to, around it as a band around a head.
const BONES: [[f64; 3]; 6] = [
    [-20.0, 90.0, 40.0],
    [-20.0, -70.0, 40.0],
    [20.0, 70.0, 95.0],
    [20.0, -50.0, 95.0],
    [-40.0, 10.0, 110.0],
    [90.0, 10.0, 100.0],
];

/// Writes a recording with two gross outliers; markers are lost from the third frame on. The frames at rest that come before the
/// clip have noise only, which leaves that of the clip as it is without them.
pub fn record(path: &Path, clean: &[Vec<[f64; 3]>], conditions: &Conditions, seed: u64) {
    let mut random = super::Random::new(seed);
    let skin = clean[0].len();
    let bones = if conditions.head == Head::Bones { BONES.len() } else { 0 };
    let labels: Vec<String> =
        (0..skin).map(|k| format!("B{k:02}")).chain((0..bones).map(|k| format!("H{k}"))).collect();
    // a burst of four frames on average
    let begins = conditions.lost / (1.0 - conditions.lost) / 4.0;
    let mut left = vec![(0_usize, false); skin];
    let count = clean.len();
    let frame = |(k, clean): (usize, &Vec<[f64; 3]>)| {
        let motion = head(k, count);
        let mut positions_mm = Vec::new();
        for (marker, place) in clean.iter().chain(&BONES[..bones]).enumerate() {
            let place = motion.place(*place);
            let noisy: [f64; 3] = std::array::from_fn(|i| place[i] + conditions.noise_mm * normal(&mut random));
            // two markers jump for one frame
            let jumps = (marker, k) == (4, count / 3) || (marker, k) == (7, 2 * count / 3);
            let mut shown = Some(if jumps { std::array::from_fn(|i| noisy[i] + OUTLIER_MM[i]) } else { noisy });
            if marker < skin {
                let burst = &mut left[marker];
                if burst.0 == 0 && k > 1 && random.between(0.0, 1.0) < begins {
                    *burst = (2 + random.between(0.0, 5.0) as usize, random.next() < 0.0);
                }
                if burst.0 > 0 {
                    shown = burst.1.then_some([0.0; 3]);
                    burst.0 -= 1;
                }
            }
            positions_mm.push(shown);
        }
        Frame { time_s: 0.0, stamp_ns: 0, positions_mm }
    };
    let clip: Vec<Frame> = clean.iter().enumerate().map(frame).collect();
    let mut still = |_| {
        let places = clean[0].iter().chain(&BONES[..bones]);
        let noisy = places.map(|x| Some(x.map(|x| x + conditions.noise_mm * normal(&mut random))));
        Frame { positions_mm: noisy.collect(), ..clip[0].clone() }
    };
    let before: Vec<Frame> = (1..conditions.neutral).map(&mut still).collect();
    let at = |(k, shown): (usize, Frame)| Frame {
        time_s: k as f64 / RATE_HZ,
        stamp_ns: 1_000_000_000 + k as i64 * 33_333_333,
        ..shown
    };
    let frames: Vec<Frame> = before.into_iter().chain(clip.clone()).enumerate().map(at).collect();
    let options = WriteOptions { units: Units::M, ..WriteOptions::default() };
    write_json(path, &labels, &frames, &options).expect("written");
}

/// A standard normal number (Box and Muller 1958).
fn normal(random: &mut super::Random) -> f64 {
    let (u, v) = (random.between(1e-300, 1.0), random.between(0.0, 1.0));
    (-2.0 * u.ln()).sqrt() * (2.0 * PI * v).cos()
}

/// Fits a recording frame by frame, then the clip as a whole, and compares both with the truth; with `estimate` the error of the
/// mesh is estimated.
pub fn fit(path: &Path, truth: &[Vec<f64>], conditions: &Conditions, estimate: bool) -> [Score; 2] {
    let head = match conditions.head {
        Head::Bones => "[fit.head]\nbone_markers = [\"H0\", \"H1\", \"H2\", \"H3\", \"H4\", \"H5\"]\n",
        Head::Estimated => "[fit.head]\nestimate = true\n",
    };
    let neutral = match conditions.neutral {
        1 => "0".to_owned(),
        several => format!("{{ first = 0, last = {} }}", several - 1),
    };
    let read_as = |lines: &str| {
        let scene = problem(
            &format!(
                "neutral = {neutral}\nsd_mm = {}\nloss = {{ cauchy_sds = 4 }}\n{lines}{head}",
                conditions.noise_mm
            ),
            &[FITTED],
        );
        let built = build(&scene).unwrap_or_else(|error| panic!("{error}"));
        (scene, built)
    };
    let (scene, built) = read_as("");
    // the second derivative of the truth has an rms of 0.3 / s2, which in steps of 1 / 30 s is a deviation of 0.06 / s^(3/2)
    let (tied, _) = read_as("smoothness = { sd_per_root_s3 = 0.1 }\nclip = \"smoother\"\n");
    let model = &built.model;
    let spec = scene.fit.as_ref().expect("a fit");
    let mut clip = read(path, &ReadOptions { units: Units::M, ..ReadOptions::default() }).expect("read");
    let placed = placement::place(&scene, spec, model.mesh(), &clip).unwrap_or_else(|error| panic!("{error}"));
    register(&scene, spec, model.mesh(), &placed, &mut clip, None).unwrap_or_else(|error| panic!("{error}"));
    let mut alone = Fit::new(model, &scene, spec, &clip).unwrap_or_else(|error| panic!("{error}"));
    // those before the clip only say what is neutral
    let first = conditions.neutral - 1;
    let frames: Vec<usize> = (first..first + truth.len()).collect();
    let found: Vec<Option<Estimate>> = frames.iter().map(|k| alone.frame(&clip, *k).ok()).collect();
    let mut whole = Fit::new(model, &tied, tied.fit.as_ref().expect("a fit"), &clip).expect("as before");
    let smoothed = whole.smooth(&clip, &frames, &found, &|| false).unwrap_or_else(|error| panic!("{error}"));
    let smoothed: Vec<Option<Estimate>> = smoothed.expect("to its end").frames.into_iter().map(Result::ok).collect();

    let halved = estimate.then(|| Halved::new(&scene, model).unwrap_or_else(|w| panic!("{}", w.message)));
    let mut estimator =
        halved.as_ref().map(|halved| Estimator::new(model, halved, settings(&scene)).expect("memory"));
    let points: Vec<_> = alone.markers().iter().map(|m| m.point).collect();
    let mut scores = [Score::default(); 2];
    for frame in found.iter().zip(&smoothed) {
        // the states of both are so near each other that one estimate of the mesh does for both
        let shift = frame.0.as_ref().zip(estimator.as_mut()).map(|(fitted, estimator)| {
            let state = &fitted.equilibrium.state;
            let corrected = estimator.corrected(state).unwrap_or_else(|error| panic!("{error}"));
            estimator.shift(state, &corrected, &points)
        });
        for (score, fitted) in scores.iter_mut().zip([frame.0, frame.1]) {
            let Some(fitted) = fitted else { continue };
            let biases = shift.as_ref().map(|shift| bias(fitted, alone.markers(), alone.unknowns(), shift));
            score.count(fitted, &alone, &truth[fitted.frame - first], biases.as_deref().unwrap_or_default());
        }
    }
    scores
}

impl Score {
    fn count(&mut self, estimate: &Estimate, fit: &Fit<'_>, truth: &[f64], biases: &[Option<f64>]) {
        self.frames += 1;
        for (residual, weight) in estimate.residuals.chunks_exact(3).zip(&estimate.weights) {
            let sds = residual.iter().map(|r| r * r).sum::<f64>();
            // an outlier is an outlier for any loss
            if *weight > 0.3 && sds < 100.0 {
                let sd = fit.markers()[0].sd.expect("given");
                self.markers += 1;
                self.marker_square += sds * sd * sd;
            }
        }
        let evidence = Evidence::of(estimate, fit.controls(), fit.unknowns()).expect("deviations");
        let measured: Vec<bool> = estimate.measured_mm.iter().map(Option::is_some).collect();
        for known in evidence.told(fit.markers(), &measured).expect("solved").controls {
            let truth = truth[known.control];
            let holds = |interval: [f64; 2]| usize::from((interval[0]..=interval[1]).contains(&truth));
            let by = biases.get(known.control).copied().flatten().filter(|_| known.bound == Bound::Free);
            let unbiased = known.value - by.unwrap_or(0.0);
            let moved = match (by, known.sd) {
                (Some(_), Some(sd)) => [unbiased - TWO_SIDED_95 * sd, unbiased + TWO_SIDED_95 * sd],
                _ => known.interval,
            };
            self.values += 1;
            self.square += (known.value - truth).powi(2);
            self.square_unbiased += (unbiased - truth).powi(2);
            self.covered += holds(known.interval);
            self.covered_unbiased += holds(moved);
        }
    }
}
