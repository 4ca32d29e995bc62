//! The same scene on halved elements, and its states carried over: what an estimate of the error compares with.
//!
//! Everything else stays: loads, supports, bones, the number of points per host element. A muscle's rule gets twice as
//! many points in each direction, so that it too has as many per host element as before.

use super::build::{Built, build};
use super::{Model, State};
use crate::error::{Error, Warning};
use crate::mesh::element::ends;
use crate::mesh::halved::Halving;
use crate::mesh::{MaterialPoint, Mesh};
use crate::scene::{BlockSpec, GeometrySpec, PartSpec, Scene};

/// A scene on halved elements.
pub struct Halved {
    /// Its model, with the controls and the terms of the scene's own.
    pub built: Built,
    halving: Halving,
}

impl Halved {
    /// Of the scene whose model is `coarse`.
    ///
    /// # Errors
    /// The warning to give where there is none: a host that is no block, contacts whose multipliers belong to points, a
    /// factor that does not fit into memory.
    pub fn new(scene: &Scene, coarse: &Model) -> Result<Halved, Box<Warning>> {
        let (scene, halving) = halved(scene, coarse.mesh())?;
        let built = build(&scene).map_err(|error| {
            let message = format!("on halved elements: {}", one_line(&error));
            refusal(message, error.help())
        })?;
        let multipliers = |model: &Model| model.rest().multipliers.iter().map(Vec::len).collect::<Vec<_>>();
        if let Some(term) = multipliers(coarse).iter().zip(multipliers(&built.model)).position(|(a, b)| *a != b) {
            let message = format!(
                "`{}` has a multiplier at each of its points, and halved faces have other points",
                coarse.terms()[term].name()
            );
            return Err(refusal(message, Some("give it the law penalty or barrier for an estimate".into())));
        }
        Ok(Halved { built, halving })
    }

    /// A state of the scene's own model, with the same displacement and pressure everywhere.
    pub fn carry(&self, coarse: &Model, state: &State) -> State {
        let fine = &self.built.model;
        State {
            u: self.halving.carry(coarse.mesh(), fine.mesh(), &state.u),
            p: self.pressure(coarse, state),
            ..state.clone()
        }
    }

    /// The same material point.
    pub fn point(&self, at: MaterialPoint) -> MaterialPoint {
        self.halving.point(at)
    }

    /// Parameters of every pressure space are its values at the corners of an element, in their order.
    fn pressure(&self, coarse: &Model, state: &State) -> Vec<f64> {
        let (fine, space) = (&self.built.model, coarse.space());
        let mut p = vec![0.0; fine.numbering().pressures()];
        for (element, parent) in self.halving.parents().iter().enumerate() {
            let known = space.parameters(coarse.mesh(), parent.element);
            for (corner, index) in space.parameters(fine.mesh(), element).into_iter().enumerate() {
                let xi = ends(corner).map(|end| end as f64);
                let weights = space.values(self.halving.in_parent(element, xi));
                p[index] = known.iter().zip(weights).map(|(k, w)| w * state.p[*k]).sum();
            }
        }
        p
    }
}

fn one_line(error: &Error) -> String {
    error.to_string().lines().next().unwrap_or_default().to_owned()
}

/// The scene with halved elements.
fn halved(scene: &Scene, mesh: &Mesh) -> Result<(Scene, Halving), Box<Warning>> {
    let mut scene = scene.clone();
    let halve = |spec: &mut BlockSpec| {
        let before = spec.elements;
        spec.elements = before.map(|n| 2 * n);
        before
    };
    let blocks = match &mut scene.mesh.geometry {
        GeometrySpec::Block(spec) => vec![halve(spec)],
        GeometrySpec::Blocks(all) => all.iter_mut().map(|named| halve(&mut named.block)).collect(),
        other => {
            let (what, help) = match other {
                GeometrySpec::Face(_) => ("a face", "compare with face = { halved = true } instead"),
                _ => ("an EX file", "compare with a finer mesh of the same body instead"),
            };
            return Err(Box::new(Warning {
                place: Some(scene.mesh.place.clone()),
                ..*refusal(format!("elements of {what} cannot be halved yet"), Some(help.into()))
            }));
        }
    };
    let halving = Halving::new(&blocks);
    for region in &mut scene.regions {
        let own = super::tissue::elements(&region.part, mesh);
        region.part = PartSpec::Elements(own.into_iter().flat_map(|element| halving.parts(element)).collect());
    }
    // a rule that is cut at the elements of the host follows them
    for muscle in scene.muscles.iter_mut().filter(|muscle| !muscle.cut) {
        muscle.gauss *= 2;
    }
    Ok((scene, halving))
}

fn refusal(message: String, help: Option<String>) -> Box<Warning> {
    Box::new(Warning { code: "S013", message: format!("no estimate of the error: {message}"), place: None, help })
}
