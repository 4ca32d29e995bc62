//! Measured directions at the nodes or data points of an EX file.

use super::data::{Axes, Axis};
use crate::error::{Error, Result};
use crate::mesh::exf::ExFile;
use std::path::Path;

/// Reads a field of vectors at data points and nodes that have `coordinates`; without a name the only one.
///
/// # Errors
/// Those of [`ExFile::read`]; [`Error::Axes`] where there is no such field, or several.
pub fn read(path: &Path, field: Option<&str>) -> Result<Axes> {
    let file = ExFile::read(path)?;
    let names = file.vector_fields();
    let wrong = |message: String| Error::Axes { path: path.into(), message: message.into() };
    let name = match (field, &names[..]) {
        (Some(field), names) if names.iter().any(|name| name == field) => field,
        (None, [only]) => only,
        (_, []) => {
            return Err(wrong("no node or data point has `coordinates` and another field of 3 components".into()));
        }
        (Some(field), names) => {
            return Err(wrong(format!("no field `{field}` of 3 components, but {}", names.join(", "))));
        }
        (None, names) => return Err(wrong(format!("several fields of 3 components: {}", names.join(", ")))),
    };
    let mut axes = Axes::default();
    for (index, (position, fibre)) in file.vectors(name).into_iter().enumerate() {
        axes.add(Axis { position, fibre, sheet: None, weight: 1.0, group: index as u32 });
    }
    Ok(axes)
}
