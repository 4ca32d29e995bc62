//! What was done, in a paragraph that can be copied, and from what.

use super::frame::{escape, table};
use crate::report::playback::Playback;
use crate::scene::{GeometrySpec, LawSpec, SensitivitySpec};
use serde_json::Value;

/// The paragraph.
pub(super) fn paragraph(run: &Playback, manifest: &Value) -> String {
    let scene = &run.scene;
    let number =
        |key: &str| manifest["numerics"][key].as_u64().map_or("an unknown number of".into(), |n| n.to_string());
    let body = match &scene.mesh.geometry {
        GeometrySpec::Block(_) | GeometrySpec::Blocks(_) => "A block of soft tissue",
        GeometrySpec::Exf(_) => "A body of soft tissue, given as a mesh,",
        GeometrySpec::Face(_) | GeometrySpec::FaceMuscle(_) => "The superficial tissue of a face",
    };
    let law = match scene.tissue.law {
        LawSpec::MooneyRivlin { c1_kpa, c2_kpa } => {
            format!("a Mooney-Rivlin solid (c1 = {c1_kpa} kPa, c2 = {c2_kpa} kPa)")
        }
        LawSpec::NeoHookean { mu_kpa } => format!("a neo-Hookean solid (mu = {mu_kpa} kPa)"),
        LawSpec::Guccione { c_kpa, bf, bt, bfs, .. } => {
            format!("the transversely isotropic law of Guccione (c = {c_kpa} kPa, bf = {bf}, bt = {bt}, bfs = {bfs})")
        }
    };
    let mut text = format!(
        "{body} was modelled with {} tricubic Hermite elements ({} nodes, {} unknowns) as {law}, nearly incompressible by a mixed \
         formulation in displacement and pressure with a volumetric term of {} kPa.",
        number("elements"),
        number("nodes"),
        number("unknowns"),
        scene.tissue.kappa_kpa
    );
    if !scene.muscles.is_empty() {
        text += &format!(
            " {} (Wu et al. 2013); fibres follow the force-stretch relation of Blemker et al. 2005.",
            if scene.muscles.len() == 1 {
                "A muscle was embedded with a mesh of its own".into()
            } else {
                format!("{} muscles were embedded with meshes of their own", scene.muscles.len())
            }
        );
    }
    match &scene.fit {
        Some(fit) => {
            let how = match fit.sensitivity {
                SensitivitySpec::Tangent => "exact sensitivities from the tangent of the balance",
                SensitivitySpec::FiniteDifference => "finite differences",
            };
            let noise = fit
                .sd_mm
                .map_or("estimated from the residuals".into(), |sd| format!("taken as {sd} mm per coordinate"));
            text += &format!(
                " {} found from {} surface markers in {} frames by bounded Gauss-Newton steps with {how}; activations were kept \
                 between 0 and 1. The noise of the markers was {noise}; intervals follow from it to first order.",
                if fit.unknowns.len() == 1 {
                    "One control was".into()
                } else {
                    format!("The {} controls were", fit.unknowns.len())
                },
                run.markers.len(),
                run.frames.len()
            );
        }
        None => text += &format!(" Equilibria were computed for given activations in {} frames.", run.frames.len()),
    }
    text += &format!(
        " Every equilibrium was solved by Newton's method to a residual of {:e} of the element forces (risorius {}).",
        scene.solver.tolerance,
        manifest["version"].as_str().unwrap_or(env!("CARGO_PKG_VERSION"))
    );
    format!(
        "<p>{}</p>\n<p class=\"note\">Wu, Hung, Hunter, Mithraratne 2013, Finite Elements in Analysis and Design 76, 63-70. Blemker, \
         Pinsky, Delp 2005, Journal of Biomechanics 38, 657-665.</p>",
        escape(&text)
    )
}

/// From what and with what it was made.
pub(super) fn provenance(run: &Playback, manifest: &Value) -> String {
    let text = |value: &Value| match value {
        Value::Null => "-".to_owned(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let command = manifest["command"].as_array().map(|words| words.iter().map(text).collect::<Vec<_>>().join(" "));
    let seconds = |key: &str| manifest[key].as_f64().map_or("-".into(), |s| format!("{s:.1} s"));
    let memory = manifest["peak_memory_bytes"].as_f64().map_or("-".into(), |bytes| format!("{:.0} MB", bytes / 1e6));
    let mut rows = vec![
        ["folder".to_owned(), run.folder.display().to_string()],
        ["command".into(), command.unwrap_or_else(|| "-".into())],
        ["risorius".into(), format!("{}, commit {}", text(&manifest["version"]), text(&manifest["git"]))],
        [
            "machine".into(),
            format!(
                "{} {}, {}",
                text(&manifest["host"]["os"]),
                text(&manifest["host"]["arch"]),
                text(&manifest["host"]["cpu"])
            ),
        ],
        [
            "threads, wall, processor, memory".into(),
            format!(
                "{}, {}, {}, {memory}",
                text(&manifest["threads"]),
                seconds("wall_seconds"),
                seconds("cpu_seconds")
            ),
        ],
    ];
    for input in manifest["inputs"].as_array().into_iter().flatten() {
        rows.push([
            text(&input["path"]),
            format!("{} bytes, SHA-256 {}", text(&input["bytes"]), text(&input["sha256"])),
        ]);
    }
    format!(
        "{}<details><summary>The whole problem, every default spelt out (problem.lock.toml)</summary><pre>{}</pre></details>",
        table(["what", "is"], &rows),
        escape(&run.lock)
    )
}
