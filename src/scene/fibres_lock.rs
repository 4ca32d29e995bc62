//! `problem.lock.toml` of a fit of fibre angles: nothing left unsaid.

use super::fibres::{AnglesSpec, FibreBody, FibreDataSpec, FibreProblem, FixedNodeSpec};
use super::lock::{HEADER, geometry, muscle_lines, number, numbers, path, text};
use super::spec::MeshSpec;
use super::{LossSpec, OutsideSpec, SmoothnessSpec};

impl FibreProblem {
    /// The text of `problem.lock.toml`, as of [`Scene::lock`](super::Scene::lock).
    pub fn lock(&self) -> String {
        let FibreProblem { name, body, angles, field, data, outside, smoothness, loss, folds, fixed, place: _ } =
            self;
        let mut lines =
            vec![HEADER.to_string(), format!("name = {}", text(name)), "\n[task]".into(), "kind = \"fibres\"".into()];
        let (host, muscle) = match body {
            FibreBody::Mesh(host) => (Some(host), None),
            FibreBody::Muscle { muscle, host } => (host.as_ref(), Some(muscle)),
        };
        if let Some(MeshSpec { geometry: shape, place: _ }) = host {
            lines.extend(["\n[mesh]".into(), geometry(shape)]);
        }
        muscle.iter().for_each(|muscle| muscle_lines(muscle, &mut lines));
        let letters = match angles {
            AnglesSpec::A => "\"A\"",
            AnglesSpec::AB => "\"A\", \"B\"",
            AnglesSpec::ABG => "\"A\", \"B\", \"G\"",
        };
        lines.push("\n[fibres]".into());
        lines.extend(muscle.map(|muscle| format!("muscle = {}", text(&muscle.name))));
        lines.extend([
            format!("angles = [{letters}]"),
            format!("field = \"{}\"", field.word()),
            match outside {
                OutsideSpec::Drop => "outside = \"drop\"".into(),
                OutsideSpec::ProjectMm(limit) => format!("outside = {{ project_mm = {} }}", number(*limit)),
            },
            match smoothness {
                SmoothnessSpec::Gcv => "smoothness = \"gcv\"".into(),
                SmoothnessSpec::Weight(weight) => format!("smoothness = {}", number(*weight)),
            },
            match loss {
                LossSpec::Quadratic => "loss = \"quadratic\"".into(),
                LossSpec::HuberDeg(scale) => format!("loss = {{ huber_deg = {} }}", number(*scale)),
                LossSpec::CauchyDeg(scale) => format!("loss = {{ cauchy_deg = {} }}", number(*scale)),
            },
            format!("folds = {folds}"),
        ]);
        for FibreDataSpec { file, units, field, weight, place: _ } in data {
            lines.extend(["\n[[fibres.data]]".into(), format!("file = {}", path(file))]);
            lines.push(format!("units = \"{}\"", units.name()));
            lines.extend(field.as_ref().map(|field| format!("field = {}", text(field))));
            lines.push(format!("weight = {}", number(*weight)));
        }
        for FixedNodeSpec { node, angles_deg, place: _ } in fixed {
            lines.extend(["\n[[fibres.fixed]]".into(), format!("node = {node}")]);
            lines.push(format!("angles_deg = {}", numbers(angles_deg)));
        }
        lines.join("\n") + "\n"
    }
}
