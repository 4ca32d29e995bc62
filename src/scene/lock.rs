//! The problem with nothing left unsaid: `problem.lock.toml`.
//!
//! Every struct is taken apart field by field: a new field that is not written here does not compile.

use super::Scene;
use super::objectives::{ClipSpec, EffortSpec, MarkerLossSpec, ObjectivesSpec, PriorSpec, SmoothSpec};
use super::outer::{OuterSpec, OuterUnknown, OuterWhat};
use super::spec::*;
use super::units::Units;

/// The first line.
pub(super) const HEADER: &str =
    "# Written by risorius: the whole problem, every default spelled out. It runs as it is.";

/// A number with the fewest digits that give the same bits again.
pub(super) fn number(value: f64) -> String {
    format!("{value:?}")
}

pub(super) fn numbers(values: &[f64; 3]) -> String {
    let [x, y, z] = values;
    format!("[{x:?}, {y:?}, {z:?}]")
}

/// Text in quotes, as TOML escapes it.
pub(super) fn text(value: &str) -> String {
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

pub(super) fn path(path: &std::path::Path) -> String {
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
            regions,
            muscles,
            bones,
            supports,
            slidings,
            contacts,
            loads,
            attachments,
            controls,
            probes,
            fit,
            markers,
            solver,
            output,
            warnings: _, // of this reading; a new one warns again
        } = self;
        let mut lines = vec![
            HEADER.to_string(),
            format!("name = {}", text(name)),
            "\n[task]".into(),
            format!("kind = \"{}\"", task.word()),
            "\n[mesh]".into(),
            geometry(host),
        ];
        tissue_lines(tissue, &mut lines);
        regions.iter().for_each(|region| region_lines(region, &mut lines));
        muscles.iter().for_each(|muscle| muscle_lines(muscle, &mut lines));
        bones.iter().for_each(|bone| bone_lines(bone, &mut lines));
        supports.iter().for_each(|support| lines.extend(["\n[[support]]".into(), support_line(&support.kind)]));
        slidings.iter().for_each(|sliding| contact_lines("sliding", sliding, &mut lines));
        contacts.iter().for_each(|contact| contact_lines("contact", contact, &mut lines));
        loads.iter().for_each(|load| lines.extend(["\n[[load]]".into(), load_line(&load.kind)]));
        for AttachmentSpec { position_mm, tie, bone, place: _ } in attachments {
            lines.extend(["\n[[attachment]]".into(), format!("position_mm = {}", numbers(position_mm))]);
            lines.push(match tie {
                TieSpec::Spring { stiffness_mn_per_mm } => {
                    format!("stiffness_mn_per_mm = {}", number(*stiffness_mn_per_mm))
                }
                TieSpec::Rigid => "rigid = true".into(),
            });
            lines.extend(bone_line(bone));
        }
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
        for MarkerSpec { name, label, position_mm, sd_mm, place: _ } in markers {
            lines.extend(["\n[[marker]]".into(), format!("name = {}", text(name))]);
            lines.push(format!("label = {}", text(label)));
            lines.push(format!("position_mm = {}", numbers(position_mm)));
            lines.extend(sd_mm.map(|sd_mm| format!("sd_mm = {}", number(sd_mm))));
        }
        let SolverSpec { tolerance, max_iterations, step_max, step_min, precision } = *solver;
        let OutputSpec { view, every, estimate } = output;
        lines.extend([
            "\n[solver]".into(),
            format!("tolerance = {}", number(tolerance)),
            format!("max_iterations = {max_iterations}"),
            format!("step_max = {}", number(step_max)),
            format!("step_min = {}", number(step_min)),
            format!("precision = {}", text(precision.word())),
            "\n[output]".into(),
            format!("view = {view}"),
            format!("every = {every}"),
            format!("estimate = {estimate}"),
        ]);
        lines.join("\n") + "\n"
    }
}

pub(super) fn geometry(geometry: &GeometrySpec) -> String {
    match geometry {
        GeometrySpec::Block(BlockSpec { origin_mm, size_mm, elements }) => {
            let (origin_mm, size_mm) = (numbers(origin_mm), numbers(size_mm));
            format!("block = {{ origin_mm = {origin_mm}, size_mm = {size_mm}, elements = {elements:?} }}")
        }
        GeometrySpec::Blocks(blocks) => {
            let entry =
                |NamedBlockSpec { name, block: BlockSpec { origin_mm, size_mm, elements } }: &NamedBlockSpec| {
                    let (origin_mm, size_mm) = (numbers(origin_mm), numbers(size_mm));
                    format!(
                        "{{ name = {}, origin_mm = {origin_mm}, size_mm = {size_mm}, elements = {elements:?} }}",
                        text(name)
                    )
                };
            format!("blocks = [{}]", blocks.iter().map(entry).collect::<Vec<_>>().join(", "))
        }
        GeometrySpec::Exf(ExfSpec { path: file, field }) => {
            let field = field.as_ref().map(|field| format!("\nfield = {}", text(field))).unwrap_or_default();
            format!("exf = {}{field}", path(file))
        }
        GeometrySpec::Face(FaceMeshSpec { landmarks, layers, halved, half, face: _ }) => {
            let landmarks =
                landmarks.as_ref().map(|file| format!("landmarks = {}, ", path(file))).unwrap_or_default();
            format!("face = {{ {landmarks}layers = {layers}, halved = {halved}, half = {half} }}")
        }
        GeometrySpec::FaceMuscle(FaceMuscleSpec { name, side, face: _ }) => {
            format!("face = {}\nside = \"{}\"", text(name), side.letter())
        }
    }
}

fn faces(FaceSpec(names): &FaceSpec) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("\"{name}\"")).collect();
    if let [one] = &quoted[..] { one.clone() } else { format!("[{}]", quoted.join(", ")) }
}

fn tissue_lines(tissue: &TissueSpec, lines: &mut Vec<String>) {
    let TissueSpec { law, pressure, kappa_kpa, gauss, place: _ } = tissue;
    let pressure = match pressure {
        PressureSpec::Trilinear => "trilinear",
        PressureSpec::DiscontinuousTrilinear => "discontinuous-trilinear",
    };
    lines.extend([
        "\n[tissue]".into(),
        law_line(law),
        format!("pressure = \"{pressure}\""),
        format!("kappa_kpa = {}", number(*kappa_kpa)),
        format!("gauss = {gauss}"),
    ]);
}

fn law_line(law: &LawSpec) -> String {
    let constants = match law {
        LawSpec::MooneyRivlin { c1_kpa, c2_kpa } => {
            format!("c1_kpa = {}, c2_kpa = {}", number(*c1_kpa), number(*c2_kpa))
        }
        LawSpec::NeoHookean { mu_kpa } => format!("mu_kpa = {}", number(*mu_kpa)),
        LawSpec::Guccione { c_kpa, bf, bt, bfs, fibre } => format!(
            "c_kpa = {}, bf = {}, bt = {}, bfs = {}, fibre = {}",
            number(*c_kpa),
            number(*bf),
            number(*bt),
            number(*bfs),
            numbers(fibre)
        ),
    };
    format!("{} = {{ {constants} }}", law.word())
}

fn region_lines(region: &RegionSpec, lines: &mut Vec<String>) {
    let RegionSpec { name, part, law, place: _ } = region;
    lines.extend([
        "\n[[region]]".into(),
        format!("name = {}", text(name)),
        match part {
            PartSpec::Elements(elements) => format!("elements = {elements:?}"),
            PartSpec::Box([lower, upper]) => format!("box_mm = [{}, {}]", numbers(lower), numbers(upper)),
        },
        law_line(law),
    ]);
}

pub(super) fn muscle_lines(muscle: &MuscleSpec, lines: &mut Vec<String>) {
    let MuscleSpec {
        name,
        geometry: shape,
        element,
        fibres,
        activation,
        gauss,
        cut,
        taper_mm,
        fibre_turn_deg,
        blemker,
        place: _,
    } = muscle;
    let activation = match activation {
        ActivationSpec::Uniform => "uniform",
        ActivationSpec::Field => "field",
    };
    let ElementSpec::Trilinear = element;
    let BlemkerSpec { sigma_max_kpa, lambda_star, lambda_ofl, p1, p2 } = blemker;
    lines.extend(["\n[[muscle]]".into(), format!("name = {}", text(name)), geometry(shape)]);
    if let GeometrySpec::Block(_) = shape {
        lines.push("element = \"trilinear\"".into());
    }
    lines.extend(match fibres {
        FibresSpec::Face => None,
        FibresSpec::Field(field) => Some(format!("angles_field = {}", text(field))),
        FibresSpec::Uniform(angles) => Some(format!("fibre_angles_deg = {}", numbers(angles))),
        FibresSpec::Nodes(nodes) => Some(
            nodes.iter().fold("fibre_angles_nodes_deg = [\n".to_string(), |list, angles| {
                list + "  " + &numbers(angles) + ",\n"
            }) + "]",
        ),
    });
    lines.extend([format!("activation = \"{activation}\""), format!("gauss = {gauss}"), format!("cut = {cut}")]);
    lines.extend(taper_mm.map(|taper| format!("taper_mm = {}", number(taper))));
    if *fibre_turn_deg != [0.0; 4] {
        lines.push(format!("fibre_turn_deg = [{}]", fibre_turn_deg.map(number).join(", ")));
    }
    lines.extend([format!(
        "blemker = {{ sigma_max_kpa = {}, lambda_star = {}, lambda_ofl = {}, p1 = {}, p2 = {} }}",
        number(*sigma_max_kpa),
        number(*lambda_star),
        number(*lambda_ofl),
        number(*p1),
        number(*p2)
    )]);
}

fn bone_lines(bone: &BoneSpec, lines: &mut Vec<String>) {
    let BoneSpec { name, hinge, slide, place: _ } = bone;
    lines.extend(["\n[[bone]]".into(), format!("name = {}", text(name))]);
    lines.extend(hinge.map(|HingeSpec { axis, through_mm, bounds_deg }| {
        let (axis, through_mm) = (numbers(&axis), numbers(&through_mm));
        format!("hinge = {{ axis = {axis}, through_mm = {through_mm}, bounds_deg = {bounds_deg:?} }}")
    }));
    lines.extend(slide.map(|SlideSpec { direction, bounds_mm }| {
        format!("slide = {{ direction = {}, bounds_mm = {bounds_mm:?} }}", numbers(&direction))
    }));
}

/// `bone = ...` where something is tied to one.
fn bone_line(bone: &Option<String>) -> Option<String> {
    bone.as_ref().map(|bone| format!("bone = {}", text(bone)))
}

fn support_line(kind: &SupportKind) -> String {
    match kind {
        SupportKind::Clamp { face, bone } => {
            let bone = bone_line(bone).map(|line| format!(", {line}")).unwrap_or_default();
            format!("clamp = {{ face = {}{bone} }}", faces(face))
        }
        SupportKind::Symmetry { face } => format!("symmetry = {{ face = {} }}", faces(face)),
        SupportKind::Plate { face, offset_mm } => {
            format!("plate = {{ face = {}, offset_mm = {} }}", faces(face), number(*offset_mm))
        }
        SupportKind::Rotate { face, axis, through_mm, angle_deg } => format!(
            "rotate = {{ face = {}, axis = {}, through_mm = {}, angle_deg = {} }}",
            faces(face),
            numbers(axis),
            numbers(through_mm),
            number(*angle_deg)
        ),
    }
}

fn contact_lines(kind: &str, contact: &ContactSpec, lines: &mut Vec<String>) {
    let ContactSpec { name, face, surface, bone, law, initial, gauss, place: _ } = contact;
    let initial = match initial {
        InitialSpec::Refuse => "refuse",
        InitialSpec::Relax => "relax",
    };
    lines.extend([
        format!("\n[[{kind}]]"),
        format!("name = {}", text(name)),
        format!("face = {}", faces(face)),
        format!("surface = {{ {} }}", surface_entry(surface)),
        format!("law = {{ {} }}", law_entry(law)),
        format!("initial = \"{initial}\""),
        format!("gauss = {gauss}"),
    ]);
    lines.extend(bone_line(bone));
}

fn surface_entry(surface: &SurfaceSpec) -> String {
    let round = |radius: &f64, inside: &bool| format!("radius_mm = {}, inside = {inside}", number(*radius));
    match surface {
        SurfaceSpec::Plane { through_mm, normal } => {
            format!("plane = {{ through_mm = {}, normal = {} }}", numbers(through_mm), numbers(normal))
        }
        SurfaceSpec::Sphere { centre_mm, radius_mm, inside } => {
            format!("sphere = {{ centre_mm = {}, {} }}", numbers(centre_mm), round(radius_mm, inside))
        }
        SurfaceSpec::Cylinder { through_mm, axis, radius_mm, inside } => format!(
            "cylinder = {{ through_mm = {}, axis = {}, {} }}",
            numbers(through_mm),
            numbers(axis),
            round(radius_mm, inside)
        ),
        SurfaceSpec::Capsule { from_mm, to_mm, radius_mm, inside } => format!(
            "capsule = {{ from_mm = {}, to_mm = {}, {} }}",
            numbers(from_mm),
            numbers(to_mm),
            round(radius_mm, inside)
        ),
        SurfaceSpec::Reference(None) => "reference = true".into(),
        SurfaceSpec::Arch(face) => format!("arch = {}", faces(face)),
        SurfaceSpec::Reference(Some(face)) => format!("reference = {}", faces(face)),
        SurfaceSpec::Faces { face, depth_mm } => {
            let depth = depth_mm.map(|depth| format!(", depth_mm = {}", number(depth))).unwrap_or_default();
            format!("faces = {{ face = {}{depth} }}", faces(face))
        }
        SurfaceSpec::Itself { depth_mm } => {
            let depth = depth_mm.map(|depth| format!(" depth_mm = {} ", number(depth))).unwrap_or_default();
            format!("itself = {{{depth}}}")
        }
    }
}

fn law_entry(law: &ContactLawSpec) -> String {
    match law {
        ContactLawSpec::Penalty { kpa_per_mm } => format!("penalty = {{ kpa_per_mm = {} }}", number(*kpa_per_mm)),
        ContactLawSpec::Augmented { kpa_per_mm, gap_mm } => {
            format!("augmented = {{ kpa_per_mm = {}, gap_mm = {} }}", number(*kpa_per_mm), number(*gap_mm))
        }
        ContactLawSpec::Smooth { kpa_per_mm, range_mm } => {
            format!("smooth = {{ kpa_per_mm = {}, range_mm = {} }}", number(*kpa_per_mm), number(*range_mm))
        }
        ContactLawSpec::Barrier { kpa_per_mm, range_mm } => {
            format!("barrier = {{ kpa_per_mm = {}, range_mm = {} }}", number(*kpa_per_mm), number(*range_mm))
        }
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
        LoadKind::BodyForce { mn_mm3 } => format!("body_force = {{ mn_mm3 = {} }}", numbers(mn_mm3)),
        LoadKind::Pressure { face, kpa } => {
            format!("pressure = {{ face = {}, kpa = {} }}", faces(face), number(*kpa))
        }
        LoadKind::NodalForce { position_mm, mn } => {
            format!("nodal_force = {{ position_mm = {}, mn = {} }}", numbers(position_mm), numbers(mn))
        }
        LoadKind::Spring { face, kpa_per_mm, normal_only } => format!(
            "spring = {{ face = {}, kpa_per_mm = {}, normal_only = {normal_only} }}",
            faces(face),
            number(*kpa_per_mm)
        ),
    }
}

fn control_line(control: &ControlSpec) -> String {
    let ControlSpec { name, value, place: _ } = control;
    match value {
        ControlValue::Constant(activation) => format!("{} = {}", text(name), number(*activation)),
        ControlValue::Nodes(activations) => format!("{} = {activations:?}", text(name)),
        ControlValue::Csv(csv) => format!("{} = {{ csv = {} }}", text(name), path(csv)),
    }
}

/// All but the priors, which are tables of their own.
fn objective_lines(objectives: &ObjectivesSpec, lines: &mut Vec<String>) {
    let ObjectivesSpec {
        loss,
        effort,
        sparsity,
        similarity,
        clip,
        smoothness: SmoothSpec { first, second },
        priors: _,
    } = objectives;
    lines.push(match clip {
        ClipSpec::Causal => "clip = \"causal\"".into(),
        ClipSpec::Smoother => "clip = \"smoother\"".into(),
    });
    lines.push(match loss {
        MarkerLossSpec::Quadratic => "loss = \"quadratic\"".into(),
        MarkerLossSpec::HuberSds(sds) => format!("loss = {{ huber_sds = {} }}", number(*sds)),
        MarkerLossSpec::CauchySds(sds) => format!("loss = {{ cauchy_sds = {} }}", number(*sds)),
    });
    lines.extend(effort.map(|EffortSpec { sd, exponent, by_volume }| {
        let by = if by_volume { "volume" } else { "muscle" };
        format!("effort = {{ sd = {}, exponent = {}, by = \"{by}\" }}", number(sd), number(exponent))
    }));
    lines.extend(sparsity.map(|scale| format!("sparsity = {{ scale = {} }}", number(scale))));
    lines.extend(similarity.map(|sd| format!("similarity = {{ sd = {} }}", number(sd))));
    let rates = [("sd_per_root_s", first), ("sd_per_root_s3", second)];
    let rates = rates.into_iter().filter_map(|(key, sd)| Some(format!("{key} = {}", number((*sd)?))));
    let rates: Vec<String> = rates.collect();
    if !rates.is_empty() {
        lines.push(format!("smoothness = {{ {} }}", rates.join(", ")));
    }
}

fn fit_lines(fit: &FitSpec, lines: &mut Vec<String>) {
    let FitSpec {
        markers,
        units,
        topic,
        sensitivity,
        reuse,
        unknowns,
        zero_is_missing,
        allow_truncated,
        allow_unchecked,
        sd_mm,
        objectives,
        outer,
        max_marker_distance_mm,
        frames,
        chunks: ChunksSpec { count, overlap },
        registration:
            RegistrationSpec {
                register,
                neutral,
                offset_sd_mm,
                axes,
                head,
                head_place: _,
                register_place: _,
                neutral_place: _,
            },
        tolerance,
        max_iterations,
        finite_difference_step,
        place: _,
        markers_place: _,
        units_place: _,
        frames_place: _,
    } = fit;
    let sensitivity = match sensitivity {
        SensitivitySpec::Tangent => "tangent",
        SensitivitySpec::FiniteDifference => "finite-difference",
    };
    let reuse = match reuse {
        ReuseSpec::Fresh => "fresh",
        ReuseSpec::Frozen => "frozen",
        ReuseSpec::Broyden => "broyden",
        ReuseSpec::Adjoint => "adjoint",
    };
    let unknowns = unknowns.iter().map(|name| text(name)).collect::<Vec<_>>().join(", ");
    let range = |FramesSpec { first, last, step }: &FramesSpec| {
        let last = last.map(|last| format!("last = {last}, ")).unwrap_or_default();
        format!("{{ first = {first}, {last}step = {step} }}")
    };
    let neutral = match neutral {
        None => "\"first\"".into(),
        Some(frames) if frames.last == Some(frames.first) => frames.first.to_string(),
        Some(frames) => range(frames),
    };
    lines.extend([
        "\n[fit]".into(),
        format!("markers = {}", path(markers)),
        format!("units = \"{}\"", units.map_or("estimate", Units::name)),
    ]);
    lines.extend(topic.as_ref().map(|topic| format!("topic = {}", text(topic))));
    lines.extend([
        format!("sensitivity = \"{sensitivity}\""),
        format!("reuse = \"{reuse}\""),
        format!("unknowns = [{unknowns}]"),
        format!("zero_is_missing = {zero_is_missing}"),
        format!("allow_truncated = {allow_truncated}"),
        format!("allow_unchecked = {allow_unchecked}"),
    ]);
    lines.extend(sd_mm.map(|sd_mm| format!("sd_mm = {}", number(sd_mm))));
    objective_lines(objectives, lines);
    lines.extend([
        format!("max_marker_distance_mm = {}", number(*max_marker_distance_mm)),
        format!("frames = {}", range(frames)),
        format!("chunks = {{ count = {count}, overlap = {overlap} }}"),
        format!("register = \"{}\"", register.word()),
        format!("neutral = {neutral}"),
    ]);
    lines.extend(offset_sd_mm.map(|sd| format!("offset_sd_mm = {}", number(sd))));
    lines.extend([
        format!("axes = [{}]", axes.map(|axis| text(axis.word())).join(", ")),
        match tolerance {
            FitToleranceSpec::Change(part) => format!("tolerance = {}", number(*part)),
            FitToleranceSpec::Sds(sds) => format!("tolerance = {{ sds = {} }}", number(*sds)),
        },
        format!("max_iterations = {max_iterations}"),
        format!("finite_difference_step = {}", number(*finite_difference_step)),
    ]);
    let quoted = |labels: &[String]| labels.iter().map(|label| text(label)).collect::<Vec<_>>().join(", ");
    match head {
        HeadSpec::None => {}
        HeadSpec::BoneMarkers(labels) => {
            lines.extend(["\n[fit.head]".into(), format!("bone_markers = [{}]", quoted(labels))]);
        }
        HeadSpec::Estimate => lines.extend(["\n[fit.head]".into(), "estimate = true".into()]),
        HeadSpec::PoseTopic(topic) => lines.extend(["\n[fit.head]".into(), format!("pose_topic = {}", text(topic))]),
    }
    if let Some(outer) = outer {
        outer_lines(outer, lines);
    }
    for PriorSpec { csv, sd, gain, delay_s } in &objectives.priors {
        lines.extend(["\n[[fit.prior]]".into(), format!("csv = {}", path(csv)), format!("sd = {}", number(*sd))]);
        lines.extend([format!("gain = {}", number(*gain)), format!("delay_s = {}", number(*delay_s))]);
    }
}

fn outer_lines(outer: &OuterSpec, lines: &mut Vec<String>) {
    let OuterSpec { unknowns, frames, held_out, tolerance, max_iterations, place: _ } = outer;
    let list = |frames: &[usize]| frames.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    lines.push("\n[fit.outer]".into());
    lines.extend(frames.as_ref().map(|frames| format!("frames = [{}]", list(frames))));
    if !held_out.is_empty() {
        lines.push(format!("held_out = [{}]", list(held_out)));
    }
    lines.extend([format!("tolerance = {}", number(*tolerance)), format!("max_iterations = {max_iterations}")]);
    for OuterUnknown { what, sd, bounds: [lower, upper], place: _ } in unknowns {
        lines.push("\n[[fit.outer.unknown]]".into());
        match what {
            OuterWhat::Stiffness(region) => {
                lines.push(format!("stiffness = {}", text(region.as_deref().unwrap_or("tissue"))));
            }
            OuterWhat::SigmaMax(muscle) => lines.push(format!("sigma_max = {}", text(muscle))),
            OuterWhat::FibreAngle(muscle, mode) => {
                lines.extend([format!("fibre_angle = {}", text(muscle)), format!("mode = \"{}\"", mode.word())]);
            }
        }
        let unit = if what.is_factor() { "" } else { "_deg" };
        lines.extend(sd.map(|sd| format!("sd{unit} = {}", number(sd))));
        lines.push(format!("bounds{unit} = [{}, {}]", number(*lower), number(*upper)));
    }
}
