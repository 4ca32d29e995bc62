//! The problem with nothing left unsaid: `problem.lock.toml`.
//!
//! Every struct is taken apart field by field: a new field that is not written here does not compile.

use super::Scene;
use super::spec::*;

/// A number with the fewest digits that give the same bits again.
fn number(value: f64) -> String {
    format!("{value:?}")
}

fn numbers(values: &[f64; 3]) -> String {
    let [x, y, z] = values;
    format!("[{x:?}, {y:?}, {z:?}]")
}

/// Text in quotes, as TOML escapes it.
fn text(value: &str) -> String {
    let mut quoted = String::from("\"");
    for character in value.chars() {
        match character {
            '"' | '\\' => quoted.extend(['\\', character]),
            control if control.is_control() => quoted.push_str(&format!("\\u{:04X}", u32::from(control))),
            plain => quoted.push(plain),
        }
    }
    quoted + "\""
}

fn path(path: &std::path::Path) -> String {
    text(&path.to_string_lossy())
}

impl Scene {
    /// The text of `problem.lock.toml`: the whole problem with every default written out and every path absolute, so
    /// that it can be run from any folder. Read again, it gives the same numbers to the last bit, and the same text.
    pub fn lock(&self) -> String {
        let Scene {
            name,
            folder: _, // every path is absolute
            task,
            mesh: MeshSpec { geometry: host, place: _ },
            tissue,
            muscles,
            supports,
            loads,
            controls,
            probes,
            fit,
            markers,
            solver,
            output,
            warnings: _, // of this reading; a new one warns again
        } = self;
        let mut lines = vec![
            "# Written by risorius: the whole problem, every default spelled out. It runs as it is.".to_string(),
            format!("name = {}", text(name)),
            "\n[task]".into(),
            format!("kind = \"{}\"", task.word()),
            "\n[mesh]".into(),
            geometry(host),
        ];
        tissue_lines(tissue, &mut lines);
        muscles.iter().for_each(|muscle| muscle_lines(muscle, &mut lines));
        supports.iter().for_each(|support| lines.extend(["\n[[support]]".into(), support_line(&support.kind)]));
        loads.iter().for_each(|load| lines.extend(["\n[[load]]".into(), load_line(&load.kind)]));
        if !controls.is_empty() {
            lines.push("\n[controls]".into());
            lines.extend(controls.iter().map(control_line));
        }
        for ProbeSpec { name, position_mm, place: _ } in probes {
            lines.extend(["\n[[probe]]".into(), format!("name = {}", text(name))]);
            lines.push(format!("position_mm = {}", numbers(position_mm)));
        }
        if let Some(fit) = fit {
            fit_lines(fit, &mut lines);
        }
        for MarkerSpec { name, position_mm, sd_mm, place: _ } in markers {
            lines.extend(["\n[[marker]]".into(), format!("name = {}", text(name))]);
            lines.push(format!("position_mm = {}", numbers(position_mm)));
            lines.extend(sd_mm.map(|sd_mm| format!("sd_mm = {}", number(sd_mm))));
        }
        let SolverSpec { tolerance, max_iterations, step_max, step_min } = *solver;
        let OutputSpec { view, every } = output;
        lines.extend([
            "\n[solver]".into(),
            format!("tolerance = {}", number(tolerance)),
            format!("max_iterations = {max_iterations}"),
            format!("step_max = {}", number(step_max)),
            format!("step_min = {}", number(step_min)),
            "\n[output]".into(),
            format!("view = {view}"),
            format!("every = {every}"),
        ]);
        lines.join("\n") + "\n"
    }
}

fn geometry(geometry: &GeometrySpec) -> String {
    match geometry {
        GeometrySpec::Block(BlockSpec { origin_mm, size_mm, elements }) => {
            let (origin_mm, size_mm) = (numbers(origin_mm), numbers(size_mm));
            format!("block = {{ origin_mm = {origin_mm}, size_mm = {size_mm}, elements = {elements:?} }}")
        }
        GeometrySpec::Exf(ExfSpec { path: file, field }) => {
            let field = field.as_ref().map(|field| format!("\nfield = {}", text(field))).unwrap_or_default();
            format!("exf = {}{field}", path(file))
        }
    }
}

fn faces(FaceSpec(names): &FaceSpec) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("\"{name}\"")).collect();
    if let [one] = &quoted[..] { one.clone() } else { format!("[{}]", quoted.join(", ")) }
}

fn tissue_lines(tissue: &TissueSpec, lines: &mut Vec<String>) {
    let TissueSpec { law, pressure, kappa_kpa, gauss, place: _ } = tissue;
    let LawSpec::MooneyRivlin { c1_kpa, c2_kpa } = law;
    let pressure = match pressure {
        PressureSpec::Trilinear => "trilinear",
        PressureSpec::DiscontinuousTrilinear => "discontinuous-trilinear",
    };
    lines.extend([
        "\n[tissue]".into(),
        format!("mooney-rivlin = {{ c1_kpa = {}, c2_kpa = {} }}", number(*c1_kpa), number(*c2_kpa)),
        format!("pressure = \"{pressure}\""),
        format!("kappa_kpa = {}", number(*kappa_kpa)),
        format!("gauss = {gauss}"),
    ]);
}

fn muscle_lines(muscle: &MuscleSpec, lines: &mut Vec<String>) {
    let MuscleSpec { name, geometry: shape, element, fibres, gauss, blemker, place: _ } = muscle;
    let ElementSpec::Trilinear = element;
    let BlemkerSpec { sigma_max_kpa, lambda_star, lambda_ofl, p1, p2 } = blemker;
    lines.extend(["\n[[muscle]]".into(), format!("name = {}", text(name)), geometry(shape)]);
    if let GeometrySpec::Block(_) = shape {
        lines.push("element = \"trilinear\"".into());
    }
    lines.extend([
        match fibres {
            FibresSpec::Field(field) => format!("angles_field = {}", text(field)),
            FibresSpec::Uniform(angles) => format!("fibre_angles_deg = {}", numbers(angles)),
            FibresSpec::Nodes(nodes) => {
                nodes.iter().fold("fibre_angles_nodes_deg = [\n".to_string(), |list, angles| {
                    list + "  " + &numbers(angles) + ",\n"
                }) + "]"
            }
        },
        format!("gauss = {gauss}"),
        format!(
            "blemker = {{ sigma_max_kpa = {}, lambda_star = {}, lambda_ofl = {}, p1 = {}, p2 = {} }}",
            number(*sigma_max_kpa),
            number(*lambda_star),
            number(*lambda_ofl),
            number(*p1),
            number(*p2)
        ),
    ]);
}

fn support_line(kind: &SupportKind) -> String {
    match kind {
        SupportKind::Clamp { face } => format!("clamp = {{ face = {} }}", faces(face)),
        SupportKind::Symmetry { face } => format!("symmetry = {{ face = {} }}", faces(face)),
        SupportKind::Rotate { face, axis, through_mm, angle_deg } => format!(
            "rotate = {{ face = {}, axis = {}, through_mm = {}, angle_deg = {} }}",
            faces(face),
            numbers(axis),
            numbers(through_mm),
            number(*angle_deg)
        ),
    }
}

fn load_line(kind: &LoadKind) -> String {
    match kind {
        LoadKind::Traction { face, kpa } => {
            format!("traction = {{ face = {}, kpa = {} }}", faces(face), numbers(kpa))
        }
        LoadKind::Gravity { density_kg_m3, acceleration_m_s2 } => format!(
            "gravity = {{ density_kg_m3 = {}, acceleration_m_s2 = {} }}",
            number(*density_kg_m3),
            numbers(acceleration_m_s2)
        ),
    }
}

fn control_line(control: &ControlSpec) -> String {
    let ControlSpec { name, value, place: _ } = control;
    match value {
        ControlValue::Constant(activation) => format!("{} = {}", text(name), number(*activation)),
        ControlValue::Csv(csv) => format!("{} = {{ csv = {} }}", text(name), path(csv)),
    }
}

fn fit_lines(fit: &FitSpec, lines: &mut Vec<String>) {
    let FitSpec {
        markers,
        units,
        topic,
        sensitivity,
        unknowns,
        zero_is_missing,
        sd_mm,
        max_marker_distance_mm,
        frames: FramesSpec { first, last, step },
        tolerance,
        max_iterations,
        finite_difference_step,
        place: _,
    } = fit;
    let sensitivity = match sensitivity {
        SensitivitySpec::Tangent => "tangent",
        SensitivitySpec::FiniteDifference => "finite-difference",
    };
    let unknowns = unknowns.iter().map(|name| text(name)).collect::<Vec<_>>().join(", ");
    let last = last.map(|last| format!("last = {last}, ")).unwrap_or_default();
    lines.extend(["\n[fit]".into(), format!("markers = {}", path(markers)), format!("units = \"{units}\"")]);
    lines.extend(topic.as_ref().map(|topic| format!("topic = {}", text(topic))));
    lines.extend([
        format!("sensitivity = \"{sensitivity}\""),
        format!("unknowns = [{unknowns}]"),
        format!("zero_is_missing = {zero_is_missing}"),
    ]);
    lines.extend(sd_mm.map(|sd_mm| format!("sd_mm = {}", number(sd_mm))));
    lines.extend([
        format!("max_marker_distance_mm = {}", number(*max_marker_distance_mm)),
        format!("frames = {{ first = {first}, {last}step = {step} }}"),
        format!("tolerance = {}", number(*tolerance)),
        format!("max_iterations = {max_iterations}"),
        format!("finite_difference_step = {}", number(*finite_difference_step)),
    ]);
}
