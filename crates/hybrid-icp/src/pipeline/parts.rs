//! The entries of the catalogue: one file for each kind of part.

mod associations;
mod filters;
mod metrics;
mod parameter;
mod scores;
mod selections;
mod stages;
mod stop_rules;
mod switchers;

use super::catalog::Part;

/// The kinds, in the order of a pipeline.
const KINDS: [&[Part]; 8] = [
    stages::PARTS,
    selections::PARTS,
    associations::PARTS,
    filters::PARTS,
    metrics::PARTS,
    stop_rules::PARTS,
    scores::PARTS,
    switchers::PARTS,
];

const COUNT: usize = {
    let (mut count, mut kind) = (0, 0);
    while kind < KINDS.len() {
        count += KINDS[kind].len();
        kind += 1;
    }
    count
};

const ALL: [Part; COUNT] = {
    let mut all = [KINDS[0][0]; COUNT];
    let (mut next, mut kind) = (0, 0);
    while kind < KINDS.len() {
        let mut entry = 0;
        while entry < KINDS[kind].len() {
            all[next] = KINDS[kind][entry];
            next += 1;
            entry += 1;
        }
        kind += 1;
    }
    all
};

/// Every part, by kind in the order of a pipeline, then as a reader would look for it.
pub const PARTS: &[Part] = &ALL;
