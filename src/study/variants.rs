//! Which variants a study solves.

use crate::scene::{Change, Design, Study};

/// One way to solve the problem.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// What it is called: its levels, as `host = [6, 2, 2], kappa_kpa = 10`.
    pub name: String,
    /// The level of every factor, by index; `None` in a variant that is spelled out.
    pub levels: Option<Vec<usize>>,
    /// What it changes in the problem.
    pub change: Change,
}

/// All variants of a study, each once: those of its factors, then those that are spelled out.
pub fn variants(study: &Study) -> Vec<Variant> {
    let counts: Vec<usize> = study.factors.iter().map(|factor| factor.levels.len()).collect();
    let mut combinations: Vec<Vec<usize>> = match study.design {
        Design::Grid => grid(&counts),
        Design::OneAtATime => one_at_a_time(&counts),
    };
    if study.factors.is_empty() {
        combinations.clear();
    }
    let of_levels = |levels: Vec<usize>| {
        let chosen = study.factors.iter().zip(&levels).map(|(factor, level)| (factor, &factor.levels[*level]));
        let named: Vec<String> =
            chosen.clone().map(|(factor, level)| format!("{} = {}", factor.name, level.label)).collect();
        let change = chosen.fold(study.base.clone(), |change, (_, level)| change.then(&level.change));
        Variant { name: named.join(", "), levels: Some(levels), change }
    };
    let spelled = study.variants.iter().map(|v| Variant {
        name: v.name.clone(),
        levels: None,
        change: study.base.then(&v.change),
    });
    combinations.into_iter().map(of_levels).chain(spelled).collect()
}

/// All combinations, the last factor fastest.
fn grid(counts: &[usize]) -> Vec<Vec<usize>> {
    counts.iter().fold(vec![Vec::new()], |all, count| {
        all.into_iter().flat_map(|levels| (0..*count).map(move |level| [&levels[..], &[level]].concat())).collect()
    })
}

/// The first level of every factor, then each other level alone.
fn one_at_a_time(counts: &[usize]) -> Vec<Vec<usize>> {
    let base = vec![0; counts.len()];
    let alone = |(factor, count): (usize, &usize)| {
        let base = base.clone();
        (1..*count).map(move |level| {
            let mut levels = base.clone();
            levels[factor] = level;
            levels
        })
    };
    std::iter::once(base.clone()).chain(counts.iter().enumerate().flat_map(alone)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_has_all_combinations_and_one_at_a_time_the_lines_through_the_first() {
        assert_eq!(grid(&[2, 3]), [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2]]);
        assert_eq!(one_at_a_time(&[2, 3]), [[0, 0], [1, 0], [0, 1], [0, 2]]);
        assert_eq!(one_at_a_time(&[1]), [[0]]);
    }
}
