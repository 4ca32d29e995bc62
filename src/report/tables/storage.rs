//! A storage file of OpenSim: a head, then columns between tabs, the first of them time in seconds.

/// The text of `activations.sto`: a row per time, a value per name in each. White space in names becomes `_`.
pub fn storage<'a>(
    names: impl ExactSizeIterator<Item = &'a str>,
    rows: impl ExactSizeIterator<Item = (f64, Vec<f64>)>,
) -> String {
    let mut text = format!(
        "activations\nversion=1\nnRows={}\nnColumns={}\ninDegrees=no\nendheader\ntime",
        rows.len(),
        1 + names.len()
    );
    names.for_each(|name| text += &format!("\t{}", name.replace(char::is_whitespace, "_")));
    text.push('\n');
    for (time_s, values) in rows {
        text += &format!("{time_s:?}");
        values.iter().for_each(|value| text += &format!("\t{value:?}"));
        text.push('\n');
    }
    text
}
