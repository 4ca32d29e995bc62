//! "Did you mean": the known word nearest to a mistaken one, and the units that keys end with.

/// The endings of keys and the units they stand for.
const UNITS: [(&str, &str); 10] = [
    ("_mn_per_mm", "mN/mm"),
    ("_kpa_per_mm", "kPa/mm"),
    ("_mn_mm3", "mN/mm3"),
    ("_mn", "mN"),
    ("_mm", "mm"),
    ("_kpa", "kPa"),
    ("_deg", "degrees"),
    ("_kg_m3", "kg/m3"),
    ("_m_s2", "m/s2"),
    ("_s", "s"),
];

/// Endings that people write for other units.
const FOREIGN: [&str; 8] = ["_m", "_cm", "_pa", "_mpa", "_rad", "_g_cm3", "_mm_s2", "_ms"];

/// The unit of the number under `key`, if its ending tells.
pub(super) fn unit_of(key: &str) -> Option<&'static str> {
    // `kpa` alone and an entry of a list (`size_mm[0]`) carry their unit as well.
    let key = key.split('[').next().unwrap_or(key);
    UNITS.iter().find(|(ending, _)| key.ends_with(ending) || key == &ending[1..]).map(|(_, unit)| *unit)
}

/// `key` without the unit at its end.
fn stem(key: &str) -> &str {
    let endings = UNITS.iter().map(|(ending, _)| *ending).chain(FOREIGN);
    let stems = endings.filter_map(|ending| key.strip_suffix(ending));
    stems.min_by_key(|stem| stem.len()).unwrap_or(key)
}

/// Whether two keys differ in nothing but the unit they end with.
pub(super) fn same_but_for_unit(written: &str, known: &str) -> bool {
    written != known && stem(&plain(written)) == stem(&plain(known))
}

/// The word as it sounds: case and the kind of dash do not matter.
fn plain(word: &str) -> String {
    word.trim().to_lowercase().replace([' ', '-'], "_")
}

/// The word of `known` that `written` most likely means, if any is near.
pub(super) fn nearest<'k>(written: &str, known: impl Iterator<Item = &'k str>) -> Option<&'k str> {
    let plain_written = plain(written);
    let distance = |word: &str| {
        let plain_word = plain(word);
        let edits = strsim::damerau_levenshtein(&plain_written, &plain_word);
        // Up to a third of the letters may be wrong, and the unit as a whole.
        let near = edits <= (plain_word.chars().count() / 3).max(1) || stem(&plain_written) == stem(&plain_word);
        near.then_some(edits)
    };
    known.filter_map(|word| Some((distance(word)?, word))).min_by_key(|(edits, _)| *edits).map(|(_, word)| word)
}
