//! A layout for Foxglove and Lichtblick: the scene on the left, activations and residuals on the right.

use crate::report::playback::Playback;
use serde_json::json;

/// The text of the file.
pub(super) fn text(run: &Playback) -> String {
    let visible = |topics: &[&str]| {
        topics.iter().map(|topic| ((*topic).to_owned(), json!({"visible": true}))).collect::<serde_json::Map<_, _>>()
    };
    let path = |value: String, label: &str| json!({"value": value, "label": label, "enabled": true, "timestampMethod": "receiveTime"});
    let of_control = |name: &str| format!("/risorius/activations.controls[:]{{name==\"{name}\"}}.value");
    let curves: Vec<_> = run.controls.iter().map(|control| path(of_control(&control.name), &control.name)).collect();
    let residuals = ["marker_rms_mm", "marker_max_mm", "newton_iterations"]
        .map(|field| path(format!("/risorius/solver.{field}"), field));
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in &run.skin.rest {
        for d in 0..3 {
            low[d] = low[d].min(1e-3 * point[d]);
            high[d] = high[d].max(1e-3 * point[d]);
        }
    }
    let middle: Vec<f64> = (0..3).map(|d| 0.5 * (low[d] + high[d])).collect();
    let distance = 2.0 * (0..3).map(|d| high[d] - low[d]).fold(0.0, f64::max);
    let layout = json!({
        "configById": {
            "3D!risorius": {
                "followTf": "head",
                "cameraState": {
                    "perspective": true, "distance": distance, "phi": 60, "thetaOffset": 30, "target": middle,
                    "targetOffset": middle, "targetOrientation": [0, 0, 0, 1], "fovy": 45, "near": 0.001, "far": 100,
                },
                "topics": visible(&["/risorius/skin", "/risorius/muscles", "/risorius/markers"]),
            },
            "Plot!activations": {"title": "activations", "paths": curves, "showLegend": true, "legendDisplay": "floating",
                "xAxisVal": "timestamp", "minYValue": 0},
            "Plot!residuals": {"title": "markers and solver", "paths": residuals, "showLegend": true, "legendDisplay": "floating",
                "xAxisVal": "timestamp"},
        },
        "globalVariables": {}, "userNodes": {}, "playbackConfig": {"speed": 0.5},
        "layout": {
            "direction": "row", "splitPercentage": 60, "first": "3D!risorius",
            "second": {"direction": "column", "first": "Plot!activations", "second": "Plot!residuals"},
        },
    });
    format!("{layout:#}\n")
}
