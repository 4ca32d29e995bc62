//! The commands as a user types them: what is printed where, what is written, and the exit code.

use assert_cmd::Command;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Output;
use tempfile::TempDir;

/// The fit of a beam that is shipped.
const BEAM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/problems/beam/problem.toml");

/// A cantilever under its own weight with one muscle.
const CANTILEVER: &str = r#"
[task]
kind = "forward"
[mesh]
block = { origin_mm = [0, 0, 0], size_mm = [40, 10, 10], elements = [2, 1, 1] }
[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
[[muscle]]
name = "slab"
block = { origin_mm = [4, 2, 6], size_mm = [30, 6, 3], elements = [4, 2, 1] }
fibre_angles_deg = [0, 0, 0]
blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }
[[support]]
clamp = { face = "xi1=0" }
[[load]]
gravity = { density_kg_m3 = 1040, acceleration_m_s2 = [0, 0, -9.81] }
[controls]
slab = 0.02
[[probe]]
name = "tip"
position_mm = [40, 10, 10]
"#;

/// A solver that is not given the iterations it needs.
const HOPELESS: [&str; 4] = ["--set", "solver.max_iterations=2", "--set", "solver.step_min=0.5"];

fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("cantilever.toml"), CANTILEVER).unwrap();
    folder
}

/// `risorius <arguments>` in a folder.
fn risorius(folder: &TempDir, arguments: &[&str]) -> Output {
    Command::cargo_bin("risorius").unwrap().current_dir(folder).args(arguments).output().unwrap()
}

/// Standard output of a command that must end with an exit code.
fn stdout(folder: &TempDir, arguments: &[&str], exit: i32) -> String {
    let output = risorius(folder, arguments);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(exit), "{arguments:?}\n{stderr}");
    String::from_utf8(output.stdout).unwrap()
}

/// Standard error of a command that must end with an exit code.
fn stderr(folder: &TempDir, arguments: &[&str], exit: i32) -> String {
    let output = risorius(folder, arguments);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(exit), "{arguments:?}\n{stderr}");
    stderr
}

fn text(folder: &TempDir, path: &str) -> String {
    fs::read_to_string(folder.path().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

fn json(folder: &TempDir, path: &str) -> Value {
    serde_json::from_str(&text(folder, path)).unwrap()
}

/// The cells of a table below its header, of the named columns.
fn column(table: &str, name: &str) -> Vec<f64> {
    let at = table.lines().next().unwrap().split(',').position(|column| column == name).unwrap();
    table.lines().skip(1).map(|line| line.split(',').nth(at).unwrap().parse().unwrap()).collect()
}

#[test]
fn a_forward_run_leaves_tables_shapes_status_manifest_and_lock() {
    let folder = folder();
    let page = stdout(&folder, &["run", "cantilever.toml"], 0);
    let run = "runs/cantilever-0001";
    assert!(page.contains("1 frame in equilibrium") && page.contains("tip"), "{page}");
    assert_eq!(text(&folder, &format!("{run}/summary.txt")), page);

    let probes = text(&folder, &format!("{run}/tables/probes.csv"));
    assert_eq!(probes.lines().next(), Some("frame,time_s,load,name,x_mm,y_mm,z_mm,ux_mm,uy_mm,uz_mm"));
    assert_eq!(probes.lines().count(), 2);
    assert!(column(&probes, "uz_mm")[0] < -5.0, "it must sag: {probes}");
    assert_eq!(column(&probes, "x_mm")[0], 40.0 + column(&probes, "ux_mm")[0]);
    assert_eq!(text(&folder, &format!("{run}/tables/activations.csv")), "frame,time_s,slab\n0,0.0,0.02\n");

    let status = json(&folder, &format!("{run}/status.json"));
    assert_eq!(status, serde_json::json!({"status": "converged", "exit": 0, "frames_ok": 1, "frames_failed": []}));
    let manifest = json(&folder, &format!("{run}/manifest.json"));
    for key in [
        "version",
        "git",
        "command",
        "inputs",
        "threads",
        "host",
        "numerics",
        "work",
        "wall_seconds",
        "cpu_seconds",
        "peak_memory_bytes",
    ] {
        assert!(manifest.get(key).is_some(), "no {key} in {manifest}");
    }
    assert_eq!(manifest["inputs"][0]["path"], "cantilever.toml");
    assert_eq!(manifest["inputs"][0]["bytes"], CANTILEVER.len());
    assert_eq!(manifest["numerics"]["elements"], 2);
    assert!(manifest["work"]["newton_iterations"].as_u64().unwrap() > 0);
    for view in [
        "result.pvd",
        "result_0000.vtu",
        "muscles.pvd",
        "muscles_0000.vtu",
        "linear/result.pvd",
        "linear/result_0000.vtu",
    ] {
        assert!(folder.path().join(run).join("view").join(view).is_file(), "no {view}");
    }
    assert!(text(&folder, &format!("{run}/problem.lock.toml")).contains("kappa_kpa = 10.0"));

    stdout(&folder, &["run", "cantilever.toml"], 0);
    assert!(
        folder.path().join("runs/cantilever-0002/status.json").is_file(),
        "the second run gets a number of its own"
    );
}

#[test]
fn the_lock_file_of_a_run_reproduces_it_bit_for_bit() {
    let folder = folder();
    stdout(&folder, &["run", "cantilever.toml", "--set", "controls.slab=0.03", "--out", "first"], 0);
    // from another folder: every path in the lock file is absolute
    let lock = folder.path().join("first/problem.lock.toml").display().to_string();
    let elsewhere = tempfile::tempdir().unwrap();
    stdout(&elsewhere, &["run", &lock, "--out", "again"], 0);
    for table in ["activations.csv", "probes.csv", "energies.csv", "muscles.csv"] {
        let first = text(&folder, &format!("first/tables/{table}"));
        assert_eq!(text(&elsewhere, &format!("again/tables/{table}")), first, "{table}");
    }
    assert_eq!(text(&elsewhere, "again/problem.lock.toml"), text(&folder, "first/problem.lock.toml"));
}

#[test]
fn without_arguments_the_built_in_face_is_fitted() {
    let folder = folder();
    let page = stdout(&folder, &["--set", "fit.frames={first=0,last=0}", "--threads", "1"], 0);
    for words in ["1 frame fitted", "zygomaticus_major.L", "head: taken out from 6 bone markers"] {
        assert!(page.contains(words), "{words}:\n{page}");
    }
    assert_eq!(json(&folder, "runs/face-0001/status.json")["frames_ok"], 1);
    assert_eq!(json(&folder, "runs/face-0001/manifest.json")["threads"], 1);
    let activations = text(&folder, "runs/face-0001/tables/activations.csv");
    let row: Vec<f64> =
        activations.lines().nth(1).unwrap().split(',').skip(2).take(30).map(|a| a.parse().unwrap()).collect();
    assert!(row.len() == 30 && row.iter().all(|a| (0.0..=0.01).contains(a)), "it is at rest: {activations}");
    // its lock file names the copy of the recording
    let page = stdout(&folder, &["check", "runs/face-0001/problem.lock.toml"], 0);
    assert!(page.contains("face: fit; 560 elements"), "{page}");
}

#[test]
fn a_fit_and_its_lock_file_are_the_same_on_any_number_of_threads() {
    let folder = folder();
    let three = ["run", BEAM, "--set", "fit.frames={first=0,last=2}", "--threads", "1"];
    let page = stdout(&folder, &three, 0);
    assert!(page.contains("3 frames fitted") && page.contains("top") && page.contains("bottom"), "{page}");
    assert_eq!(json(&folder, "runs/beam-0001/status.json")["frames_ok"], 3);
    stdout(&folder, &["run", "runs/beam-0001/problem.lock.toml", "--threads", "2", "--out", "again"], 0);
    for table in ["activations.csv", "markers.csv", "muscles.csv", "energies.csv"] {
        let first = text(&folder, &format!("runs/beam-0001/tables/{table}"));
        assert!(first.lines().count() > 3, "{first}");
        assert_eq!(text(&folder, &format!("again/tables/{table}")), first, "{table}");
    }
    let activations = text(&folder, "again/tables/activations.csv");
    assert_eq!(activations.lines().next(), Some("frame,time_s,top,bottom,top_sd,bottom_sd"));
    assert!(column(&activations, "top").iter().all(|value| (0.0..=1.0).contains(value)), "{activations}");
}

#[test]
fn a_forward_run_is_the_same_on_one_and_on_two_threads() {
    let folder = folder();
    for threads in ["1", "2"] {
        stdout(&folder, &["run", "cantilever.toml", "--threads", threads, "--out", threads], 0);
    }
    for table in ["activations.csv", "probes.csv", "energies.csv", "muscles.csv", "convergence.csv"] {
        assert_eq!(
            text(&folder, &format!("1/tables/{table}")),
            text(&folder, &format!("2/tables/{table}")),
            "{table}"
        );
    }
    assert_eq!(json(&folder, "2/manifest.json")["threads"], 2);
}

#[test]
fn controls_may_follow_a_table_over_time() {
    let folder = folder();
    fs::write(folder.path().join("curves.csv"), "time_s,slab\n0,0\n0.1,0.02\n0.3,0.01\n").unwrap();
    let curves = ["--set", "controls.slab={csv=\"curves.csv\"}"];
    stdout(&folder, &[&["run", "cantilever.toml", "--out", "run"], &curves[..]].concat(), 0);
    let activations = text(&folder, "run/tables/activations.csv");
    assert_eq!(activations, "frame,time_s,slab\n0,0.0,0.0\n1,0.1,0.02\n2,0.3,0.01\n");
    let sag = column(&text(&folder, "run/tables/probes.csv"), "uz_mm");
    assert!(sag[0] < sag[2] && sag[2] < sag[1], "the muscle on top lifts the tip: {sag:?}");
    let constant = ["run", "cantilever.toml", "--set", "controls.slab=0.01", "--out", "constant"];
    stdout(&folder, &constant, 0);
    let alone = column(&text(&folder, "constant/tables/probes.csv"), "uz_mm");
    assert!((alone[0] - sag[2]).abs() < 1e-5, "an equilibrium does not remember: {} and {}", alone[0], sag[2]);
    assert_eq!(json(&folder, "run/manifest.json")["inputs"].as_array().unwrap().len(), 2);
    assert!(text(&folder, "run/view/result.pvd").contains("result_0002.vtu"));
}

#[test]
fn a_fit_holds_a_control_that_follows_a_table() {
    let folder = folder();
    fs::write(folder.path().join("curves.csv"), "time_s,bottom\n0,0.001\n1,0.002\n").unwrap();
    let held = format!("controls.bottom={{csv=\"{}\"}}", folder.path().join("curves.csv").display());
    let frame = ["--set", "fit.frames={first=15,last=15}", "--set", "fit.unknowns=[\"top\"]", "--set", &held];
    stdout(&folder, &[&["run", BEAM][..], &frame[..], &["--set", "fit.max_iterations=1", "--dry-run"]].concat(), 0);
    let page = stdout(&folder, &[&["run", BEAM][..], &frame[..], &["--out", "run"]].concat(), 0);
    assert!(page.contains("frame 15"), "{page}");
    let bottom = column(&text(&folder, "run/tables/activations.csv"), "bottom")[0];
    assert!((bottom - 0.0015).abs() < 1e-6, "half a second on the way: {bottom}");
}

#[test]
fn a_folder_that_is_not_empty_needs_force() {
    let folder = folder();
    fs::create_dir(folder.path().join("full")).unwrap();
    fs::write(folder.path().join("full/mine.txt"), "mine").unwrap();
    let message = stderr(&folder, &["run", "cantilever.toml", "--out", "full"], 6);
    assert!(message.contains("error[O002]") && message.contains("--force"), "{message}");
    assert!(!folder.path().join("full/status.json").exists());
    stdout(&folder, &["run", "cantilever.toml", "--out", "full", "--force"], 0);
    assert_eq!(json(&folder, "full/status.json")["status"], "converged");
    assert_eq!(text(&folder, "full/mine.txt"), "mine");
}

#[test]
fn a_folder_that_cannot_be_made_is_an_error_of_output() {
    let folder = folder();
    fs::write(folder.path().join("file"), "").unwrap();
    let message = stderr(&folder, &["run", "cantilever.toml", "--out", "file/run"], 6);
    assert!(message.contains("error[O001]: cannot create") && message.contains("help:"), "{message}");
}

#[test]
fn a_dry_run_writes_nothing() {
    let folder = folder();
    let message = stderr(&folder, &["run", "cantilever.toml", "--dry-run", "--out", "out"], 0);
    assert!(message.contains("252 unknowns") && message.contains("gravity"), "{message}");
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
}

#[test]
fn quiet_prints_results_alone_and_loud_prints_a_line_per_frame() {
    let folder = folder();
    let quiet = risorius(&folder, &["run", "cantilever.toml", "-q"]);
    assert_eq!(quiet.status.code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&quiet.stderr), "");
    assert!(!quiet.stdout.is_empty());
    let message = stderr(&folder, &["run", "cantilever.toml"], 0);
    assert!(message.contains("1/1 t 0.000 s: ") && !message.contains('\u{1b}'), "{message}");
    let none = stderr(&folder, &["run", "cantilever.toml", "--progress", "none"], 0);
    assert!(!none.contains("1/1 t"), "{none}");
}

#[test]
fn set_changes_the_problem_and_the_lock_file_says_so() {
    let folder = folder();
    stdout(
        &folder,
        &["run", "cantilever.toml", "--set", "tissue.kappa_kpa=20", "--set", "output.view=false", "--out", "run"],
        0,
    );
    assert!(text(&folder, "run/problem.lock.toml").contains("kappa_kpa = 20.0"));
    assert!(!folder.path().join("run/view/result.pvd").exists());
    let message = stderr(&folder, &["run", "cantilever.toml", "--set", "tissue.kapa_kpa=20"], 3);
    assert!(message.contains("--> command line:1:14") && message.contains("did you mean `kappa_kpa`?"), "{message}");
}

#[test]
fn strict_makes_a_warning_an_error() {
    let folder = folder();
    let unused = format!("{CANTILEVER}[[marker]]\nname = \"M\"\nposition_mm = [20, 5, 10]\n");
    fs::write(folder.path().join("unused.toml"), unused).unwrap();
    for command in ["check", "run"] {
        let message = stderr(&folder, &[command, "unused.toml", "--out", "run"], 0);
        assert!(message.contains("warn[C015]"), "{message}");
        let message = stderr(&folder, &[command, "unused.toml", "--strict", "-q", "--out", "strict"], 5);
        assert!(message.contains("warn[C015]") && message.contains("--> unused.toml:22:1"), "{message}");
        assert_eq!(message.contains("1 warning under --strict, nothing was run"), command == "run", "{message}");
        stdout(&folder, &[command, "cantilever.toml", "--strict", "--force", "--out", "run"], 0);
    }
    assert!(!folder.path().join("strict").exists(), "nothing is run under a warning");
}

#[test]
fn check_tells_what_is_on_and_what_it_costs() {
    let folder = folder();
    let page = stdout(&folder, &["check", "cantilever.toml"], 0);
    for words in [
        "cantilever: forward; 2 elements",
        "252 unknowns",
        "tissue ",
        "slab ",
        "gravity ",
        "Mflop",
        "MB",
        "ok: no mistakes",
    ] {
        assert!(page.contains(words), "`{words}` is not in\n{page}");
    }
    let page = stdout(&folder, &["check", BEAM], 0);
    for words in [
        "beam: fit; 24 elements",
        "40 of 40 frames used, 1.30 s at 30.0 Hz",
        "12 of 12 labels",
        "samples are missing: ",
        "0.000 mm from the surface",
    ] {
        assert!(page.contains(words), "`{words}` is not in\n{page}");
    }
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 1, "check writes nothing");
    // a problem whose solve would fail is still checked
    let page = stdout(&folder, &[&["check"], &HOPELESS[..]].concat(), 0);
    assert!(page.contains("face: fit; 560 elements") && page.contains("ok: no mistakes"), "{page}");
}

#[test]
fn inspect_tells_what_is_in_a_recording() {
    let folder = folder();
    let recording = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/beam.mcap").display().to_string();
    let page = stdout(&folder, &["inspect", &recording], 0);
    for words in ["`/markers`", "40 frames over 1.3 s", "30.000 Hz", "B11", "its unit is m"] {
        assert!(page.contains(words), "`{words}` is not in\n{page}");
    }
    let value: Value = serde_json::from_str(&stdout(&folder, &["inspect", "--json", &recording], 0)).unwrap();
    assert_eq!(value["topics"][0]["messages"], 40);
    assert_eq!(value["markers"][0]["contents"]["Ok"]["health"]["labels"].as_array().unwrap().len(), 12);
    let message = stderr(&folder, &["inspect", "cantilever.toml"], 3);
    assert!(message.contains("error[M001]"), "{message}");
}

#[test]
fn a_command_line_that_is_not_understood_ends_with_2() {
    let folder = folder();
    for arguments in [&["walk"][..], &["run", "--threads", "0"], &["run", "--nonsense"], &["inspect"]] {
        let message = stderr(&folder, arguments, 2);
        assert!(message.contains("error: ") && message.contains("--help"), "{message}");
    }
    let message = stderr(&folder, &["cantilever.toml"], 2);
    assert!(message.contains("tip: ") && message.contains("risorius run cantilever.toml"), "{message}");
    assert!(stdout(&folder, &["--help"], 0).contains("Usage: risorius"));
    assert!(stdout(&folder, &["--version"], 0).starts_with("risorius 0."));
}

#[test]
fn a_forward_solve_that_does_not_converge_says_how_far_it_came() {
    let folder = folder();
    let message = stderr(&folder, &[&["run", "cantilever.toml", "--out", "run"], &HOPELESS[..]].concat(), 4);
    for words in [
        "error[S003]",
        "% of the way",
        "worst point: element",
        "residual",
        "view/failed.vtu",
        "solver.step_min=",
        "1/1 t 0.000 s: failed",
        "not converged: 1 of 1 frames",
    ] {
        assert!(message.contains(words), "`{words}` is not in\n{message}");
    }
    let status = json(&folder, "run/status.json");
    assert_eq!((&status["status"], &status["exit"], &status["frames_ok"]), (&"failed".into(), &4.into(), &0.into()));
    assert_eq!(status["frames_failed"][0]["code"], "S003");
    assert!(status["frames_failed"][0]["message"].as_str().unwrap().contains("det F = "));
    let shape = fs::read(folder.path().join("run/view/failed.vtu")).unwrap();
    assert!(shape.windows(8).any(|word| word == b"<VTKFile"));
    assert!(folder.path().join("run/manifest.json").is_file());
}

#[test]
fn frames_that_do_not_converge_leave_the_others_intact() {
    let folder = folder();
    // at rest it converges at once, with the muscle on it does not
    fs::write(folder.path().join("curves.csv"), "time_s,slab\n0,0\n1,0.5\n2,0\n").unwrap();
    let pulse = CANTILEVER.replace("slab = 0.02", "slab = { csv = \"curves.csv\" }").replace("-9.81", "0");
    fs::write(folder.path().join("pulse.toml"), pulse).unwrap();
    let message = stderr(&folder, &[&["run", "pulse.toml", "--out", "run"], &HOPELESS[..]].concat(), 4);
    assert!(message.contains("2/3 t 1.000 s: failed") && message.contains("3/3 t 2.000 s: "), "{message}");
    let status = json(&folder, "run/status.json");
    assert_eq!((&status["status"], &status["frames_ok"]), (&"partial".into(), &2.into()));
    assert_eq!(status["frames_failed"][0]["frame"], 1);
    assert_eq!(text(&folder, "run/tables/activations.csv"), "frame,time_s,slab\n0,0.0,0.0\n2,2.0,0.0\n");
}

#[test]
fn a_fit_that_does_not_converge_says_so_frame_by_frame() {
    let folder = folder();
    let arguments =
        ["run", BEAM, "--set", "fit.frames={first=1,last=1}", "--set", "fit.max_iterations=1", "--out", "run"];
    let output = risorius(&folder, &arguments);
    assert_eq!(output.status.code(), Some(4));
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("error[F002]: frame 1: ") && message.contains("fit.max_iterations"), "{message}");
    assert!(String::from_utf8_lossy(&output.stdout).contains("1 frame NOT CONVERGED"));
    let status = json(&folder, "run/status.json");
    assert_eq!(status["frames_failed"][0]["code"], "F002");
    assert_eq!(status["frames_failed"][0]["frame"], 1);
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_does_no_harm() {
    use std::process::{Command, Stdio};
    let folder = folder();
    for arguments in [&["check"][..], &["run", "cantilever.toml", "--out", "run"]] {
        let mut child = Command::new(assert_cmd::cargo::cargo_bin("risorius"))
            .current_dir(&folder)
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop((child.stdout.take(), child.stderr.take()));
        assert_eq!(child.wait().unwrap().code(), Some(0), "{arguments:?}");
    }
    assert_eq!(json(&folder, "run/status.json")["status"], "converged");
}

#[test]
fn the_built_in_problem_can_take_another_recording() {
    let folder = folder();
    fs::create_dir(folder.path().join("data")).unwrap();
    // a file of the same name as the built-in one is not the built-in one
    fs::write(folder.path().join("data/face.mcap"), "").unwrap();
    let message = stderr(&folder, &["check", "--set", "fit.markers=data/face.mcap"], 3);
    assert!(message.contains("error[M001]") && message.contains("it is empty"), "{message}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_every_finished_frame() {
    use std::io::{BufRead, BufReader, Read};
    use std::process::{Command, Stdio};

    let folder = folder();
    let mut child = Command::new(assert_cmd::cargo::cargo_bin("risorius"))
        .current_dir(&folder)
        .args(["run", BEAM, "--out", "run", "--set", "output.view=false"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.starts_with("2/40 ") {
        line.clear();
        assert!(lines.read_line(&mut line).unwrap() > 0, "it ended before its second frame");
    }
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let mut rest = String::new();
    lines.read_to_string(&mut rest).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest}");

    let status = json(&folder, "run/status.json");
    assert_eq!((&status["status"], &status["exit"]), (&"interrupted".into(), &130.into()));
    let frames = status["frames_ok"].as_u64().unwrap() as usize;
    assert!((2..40).contains(&frames), "{frames}");
    assert!(rest.contains(&format!("interrupted: {frames} frames are finished")), "{rest}");
    let activations = text(&folder, "run/tables/activations.csv");
    assert!(activations.ends_with('\n'));
    let numbers: Vec<f64> = (0..frames).map(|frame| frame as f64).collect();
    assert_eq!(column(&activations, "frame"), numbers);
    let markers = text(&folder, "run/tables/markers.csv");
    assert_eq!(markers.lines().count(), 1 + 12 * frames);
    assert!(folder.path().join("run/manifest.json").is_file() && folder.path().join("run/tables/cost.csv").is_file());
}

/// A cube of muscle under a dead force that stretches it by half: its activation passes a limit, and it shortens at once.
const SNAPPING: &str = r#"
[task]
kind = "forward"
[mesh]
block = { origin_mm = [0, 0, 0], size_mm = [10, 10, 10], elements = [1, 1, 1] }
[tissue]
mooney-rivlin = { c1_kpa = 0.5, c2_kpa = 0.2 }
[[muscle]]
name = "all"
block = { origin_mm = [0, 0, 0], size_mm = [10, 10, 10], elements = [1, 1, 1] }
fibre_angles_deg = [0, 0, 0]
blemker = { sigma_max_kpa = 300, lambda_star = 1.4, lambda_ofl = 1.0, p1 = 0.005, p2 = 6.6 }
[[support]]
symmetry = { face = "xi1=0" }
[[support]]
symmetry = { face = "xi2=0" }
[[support]]
symmetry = { face = "xi3=0" }
[[load]]
traction = { face = "xi1=1", kpa = [34.73, 0, 0] }
[controls]
all = { csv = "curves.csv" }
"#;

#[test]
fn a_run_tells_of_snaps_of_descending_fibres_and_of_failed_steps() {
    let folder = folder();
    fs::write(folder.path().join("snapping.toml"), SNAPPING).unwrap();
    fs::write(folder.path().join("curves.csv"), "time_s,all\n0,0\n0.1,0.15\n").unwrap();
    let told = stderr(&folder, &["run", "snapping.toml", "--out", "snap", "--color", "never"], 0);
    assert!(told.contains("warn[S007]: frame 1 at 0.100 s: the body snapped"), "{told}");
    let status = json(&folder, "snap/status.json");
    assert_eq!((&status["status"], &status["frames_ok"]), (&"converged".into(), &2.into()), "{status}");
    assert_eq!((&status["warnings"][0]["code"], &status["warnings"][0]["frame"]), (&"S007".into(), &1.into()));
    assert!(text(&folder, "snap/tables/convergence.csv").contains(",snapped,"));
    let stretch = column(&text(&folder, "snap/tables/muscles.csv"), "stretch_mean");
    assert!((stretch[0] - 1.5).abs() < 1e-3 && stretch[1] < 1.0, "{stretch:?}");
    stderr(&folder, &["run", "snapping.toml", "--out", "strict", "--strict"], 5);

    // held at that length instead, its fibres lose force as they lengthen
    let held = SNAPPING.replace("[[load]]\ntraction = { face = \"xi1=1\", kpa = [34.73, 0, 0] }", HELD);
    fs::write(folder.path().join("held.toml"), held).unwrap();
    fs::write(folder.path().join("curves.csv"), "time_s,all\n0,0\n0.1,0.35\n").unwrap();
    let told = stderr(&folder, &["run", "held.toml", "--out", "held", "--color", "never"], 0);
    assert!(told.contains("warn[S008]: frame 1 at 0.100 s:") && told.contains("of muscle `all`"), "{told}");
    let points = column(&text(&folder, "held/tables/muscles.csv"), "descending_points");
    assert!(points[0] == 0.0 && points[1] > 0.0, "{points:?}");

    let arguments = [&["run", "cantilever.toml", "--out", "hopeless"], &HOPELESS[..]].concat();
    stderr(&folder, &arguments, 4);
    assert!(text(&folder, "hopeless/tables/convergence.csv").contains(",failed,"), "the failed step is kept");
}

const HELD: &str = "[[support]]\nplate = { face = \"xi1=1\", offset_mm = 4.8 }";

#[test]
fn an_estimate_of_the_error_is_told_written_and_costed() {
    let folder = folder();
    let page = stdout(&folder, &["run", "-q", "cantilever.toml", "--estimate", "--out", "out"], 0);
    assert!(
        page.contains("estimated error of the mesh: tip ") && page.contains("Newton steps on halved elements"),
        "{page}"
    );
    let out = folder.path().join("out");
    let table = fs::read_to_string(out.join("tables/estimate.csv")).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows[0], ["frame", "time_s", "kind", "name", "error_mm", "bias"]);
    assert_eq!([rows[1][2], rows[2][2], rows[2][3]], ["body", "probe", "tip"]);
    let [body, tip] = [1, 2].map(|row| rows[row][4].parse::<f64>().unwrap());
    assert!(rows.len() == 3 && tip > 1e-3 && tip <= body * (1.0 + 1e-9), "{table}");
    let cost = fs::read_to_string(out.join("tables/cost.csv")).unwrap();
    assert!(cost.lines().any(|line| line.starts_with("estimate,")), "{cost}");
    assert!(fs::read_to_string(out.join("problem.lock.toml")).unwrap().contains("\nestimate = true\n"));
    let page = stdout(&folder, &["check", "cantilever.toml", "--set", "output.estimate=true"], 0);
    assert!(page.contains("estimate of the error: a few more iterations at the end"), "{page}");
    // what is not asked for is not there
    let page = stdout(&folder, &["run", "-q", "cantilever.toml", "--out", "plain"], 0);
    assert!(!page.contains("estimated") && !folder.path().join("plain/tables/estimate.csv").exists(), "{page}");
}

#[test]
fn an_estimate_of_a_fit_tells_the_bias_of_its_controls() {
    let folder = folder();
    let coarse = ["--set", "mesh.block.elements=[3,1,1]", "--set", "fit.frames={first=10,last=11}"];
    let page = stdout(&folder, &[&["run", BEAM, "-q", "--estimate", "--out", "out"][..], &coarse].concat(), 0);
    assert!(
        page.contains("Newton steps on halved elements") && page.contains("estimated bias of what was fitted"),
        "{page}"
    );
    let table = fs::read_to_string(folder.path().join("out/tables/estimate.csv")).unwrap();
    let of = |kind: &str| table.lines().filter(|line| line.split(',').nth(2) == Some(kind)).count();
    assert_eq!([of("body"), of("marker"), of("control")], [2, 24, 4], "{table}");
    assert!(table.lines().any(|line| line.contains("control,top,,") && !line.ends_with(',')), "{table}");
}

#[test]
fn what_has_no_estimate_runs_with_a_warning() {
    let folder = folder();
    // any run leaves its mesh as an EX file
    let problem = CANTILEVER.replace("[controls]\nslab = 0.02", "[controls]\nslab = 0");
    fs::write(folder.path().join("rest.toml"), &problem).unwrap();
    stdout(&folder, &["run", "-q", "rest.toml", "--out", "rest"], 0);
    let own = "block = { origin_mm = [0, 0, 0], size_mm = [40, 10, 10], elements = [2, 1, 1] }";
    let problem = problem.replace(own, "exf = \"rest/view/result_0000.exf\"").replace("xi1=0", "1:xi1=0");
    fs::write(folder.path().join("exf.toml"), problem).unwrap();
    let said = stderr(&folder, &["run", "-q", "--strict", "exf.toml", "--estimate", "--out", "exf"], 5);
    assert!(said.contains("S013") && said.contains("elements of an EX file cannot be halved"), "{said}");
    let page = stdout(&folder, &["run", "-q", "exf.toml", "--estimate", "--out", "exf"], 0);
    assert!(page.contains("tip") && !page.contains("estimated"), "{page}");
}

/// Every template but the face (which has a test of its own) is checked without a warning; those that take a second are run.
#[test]
fn every_template_is_a_problem() {
    let folder = folder();
    for (name, words) in [
        ("forward", "forward: forward; "),
        ("fit", "40 of 40 frames used"),
        ("fibres", "axes and"),
        ("study", "64 variants"),
    ] {
        let page = stdout(&folder, &["new", name, "--template", name], 0);
        assert!(page.contains(&format!("next: risorius check {name}/problem.toml")), "{page}");
        let problem = format!("{name}/problem.toml");
        let page = stdout(&folder, &["check", "--strict", &problem], 0);
        assert!(page.contains(words), "`{words}` is not in\n{page}");
        let again = stderr(&folder, &["new", name, "--template", name], 6);
        assert!(again.contains("error[O001]") && again.contains("it is there already"), "{again}");
    }
    stdout(&folder, &["run", "-q", "fit/problem.toml", "--out", "a", "--set", "fit.frames={first=0,last=2}"], 0);
    stdout(&folder, &["run", "-q", "fibres/problem.toml", "--out", "b"], 0);
}

/// Lines of `log.jsonl`, each a JSON object with time, level and text.
fn log(folder: &TempDir, run: &str) -> Vec<Value> {
    let lines: Vec<Value> =
        text(folder, &format!("{run}/log.jsonl")).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    for line in &lines {
        assert!(line["time_s"].as_f64().is_some_and(|time| time >= 0.0) && line["text"].is_string(), "{line}");
        assert!(["stage", "info", "warn", "error"].contains(&line["level"].as_str().unwrap()), "{line}");
    }
    lines
}

#[test]
fn the_log_has_frames_stages_warnings_and_errors() {
    let folder = folder();
    let quiet = risorius(&folder, &["run", "cantilever.toml", "--out", "fine", "-q"]);
    assert!(quiet.status.success() && quiet.stderr.is_empty());
    let lines = log(&folder, "fine");
    let frames: Vec<&Value> = lines.iter().filter(|line| line["numbers"]["frame"].is_number()).collect();
    let [frame] = frames[..] else { panic!("{lines:?}") };
    let range = ["det_f_min", "det_f_max"].map(|name| frame["numbers"][name].as_f64().unwrap());
    assert!(range[0] < range[1] && frame["numbers"]["iterations"].as_f64().unwrap() >= 1.0, "{frame}");
    let stages: Vec<&str> =
        lines.iter().filter(|line| line["level"] == "stage").map(|line| line["text"].as_str().unwrap()).collect();
    for stage in ["read the problem", "order the unknowns", "solve the frames", "make the page"] {
        assert!(stages.contains(&stage), "{stages:?}");
    }
    let last = lines.last().unwrap();
    assert_eq!((last["text"].as_str(), last["numbers"]["frames_ok"].as_f64()), (Some("converged"), Some(1.0)));

    let arguments =
        ["run", "cantilever.toml", "--out", "hopeless", HOPELESS[0], HOPELESS[1], HOPELESS[2], HOPELESS[3]];
    assert_eq!(risorius(&folder, &arguments).status.code(), Some(4));
    let lines = log(&folder, "hopeless");
    assert!(lines.iter().any(|line| line["level"] == "error" && line["code"] == "S003"), "{lines:?}");
    // a later run in the same place begins a log of its own
    assert!(risorius(&folder, &["run", "cantilever.toml", "--out", "hopeless", "--force"]).status.success());
    assert!(log(&folder, "hopeless").iter().all(|line| line["level"] != "error"));
}

#[test]
fn verbose_says_what_each_stage_took() {
    let folder = folder();
    let said = stderr(&folder, &["run", "cantilever.toml", "-v"], 0);
    for stage in ["read the problem", "build the model", "solve the frames", "write tables and shapes"] {
        let line = said.lines().find(|line| line.contains(stage)).unwrap_or_else(|| panic!("{stage}: {said}"));
        let seconds: f64 = line.split_whitespace().next().unwrap().parse().unwrap();
        assert!((0.0..600.0).contains(&seconds), "{line}");
    }
    assert!(!stderr(&folder, &["run", "cantilever.toml"], 0).contains("solve the frames"));
    assert_eq!(risorius(&folder, &["run", "cantilever.toml", "-v", "-q"]).status.code(), Some(2));
}

#[test]
fn every_run_leaves_its_activations_for_opensim() {
    let folder = folder();
    let run = ["run", "cantilever.toml", "--out", "run"];
    stdout(&folder, &run, 0);
    let sto = text(&folder, "run/tables/activations.sto");
    let (head, rows) = sto.split_once("endheader\n").unwrap();
    assert!(head.contains("nRows=1\n") && head.contains("nColumns=2\n"), "{sto}");
    assert_eq!(rows, "time\tslab\n0.0\t0.02\n");
    // as the exporter writes it
    stdout(&folder, &["export", "run", "--to", "sto"], 0);
    assert_eq!(text(&folder, "run/export/activations.sto"), sto);
}

#[test]
fn meshes_and_measured_directions_are_inspected() {
    let folder = folder();
    stdout(&folder, &["run", "cantilever.toml", "--out", "run"], 0);
    let exf = "run/view/result_0000.exf";
    let found: Value = serde_json::from_str(&stdout(&folder, &["inspect", exf, "--json"], 0)).unwrap();
    assert_eq!((found["elements"].as_u64(), found["nodes"].as_u64()), (Some(2), Some(12)));
    assert_eq!(found["fields"]["deformed"]["bases"][0], "c.Hermite*c.Hermite*c.Hermite");
    let extent: Vec<f64> = (0..3).map(|i| found["extent"][1][i].as_f64().unwrap()).collect();
    // the beam at rest ends at 40 mm, and bends down
    assert!((extent[0] - 40.0).abs() < 5.0 && found["extent"][0][2].as_f64().unwrap() < 0.0, "{extent:?}");
    let page = stdout(&folder, &["inspect", exf], 0);
    assert!(page.contains("[mesh] or [[muscle]]: exf = \"result_0000.exf\", field = \"coordinates\""), "{page}");

    let vtu = "run/view/muscles_0000.vtu";
    let found: Value = serde_json::from_str(&stdout(&folder, &["inspect", vtu, "--json"], 0)).unwrap();
    let points = found["points"].as_u64().unwrap();
    let stretch = found["fields"].as_array().unwrap().iter().find(|field| field["name"] == "stretch").unwrap();
    assert!(points > 0 && stretch["components"] == 1 && stretch["on_points"] == true, "{found}");
    let uses = format!("[[fibres.data]]: file = \"muscles_0000.vtu\" ({points} axes)");
    assert_eq!(found["uses"][0], uses);
    fs::write(folder.path().join("broken.vtu"), "no file of VTK").unwrap();
    assert!(stderr(&folder, &["inspect", "broken.vtu"], 3).contains("M014"));
    fs::write(folder.path().join("broken.exf"), "EX Version: 9\n").unwrap();
    assert!(stderr(&folder, &["inspect", "broken.exf"], 3).contains("G008"));
}
