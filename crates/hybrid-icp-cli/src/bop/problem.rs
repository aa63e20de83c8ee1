//! Telling what is missing or damaged in a dataset.

use std::collections::BTreeSet;

use hicp_bop::{Fault, FaultKind};

use crate::terminal::{complain, warn};

/// Most problems that are told one by one.
const PROBLEMS_SHOWN: usize = 10;

/// Warns of the first image and of the first mask that are missing, complains about what is damaged, each once; returns how many things are
/// damaged.
pub(crate) fn tell<'a>(
    faults: impl Iterator<Item = &'a Fault> + Clone,
    broken_models: impl Iterator<Item = &'a String>,
) -> usize {
    let texts = |kind: FaultKind| -> Vec<String> {
        let mut seen = BTreeSet::new();
        let of_kind = faults.clone().filter(|f| f.kind == kind);
        let texts = of_kind.map(|f| f.text.clone());
        texts.filter(|text| seen.insert(text.clone())).collect()
    };
    let mut damaged: Vec<String> = broken_models.cloned().collect();
    damaged.extend(texts(FaultKind::Damaged));
    for missing in [FaultKind::Missing, FaultKind::MissingMask].map(texts) {
        if let Some(first) = missing.first() {
            warn(format_args!(
                "{first}{}",
                match missing.len() - 1 {
                    0 => String::new(),
                    more => format!(" (and {more} more like it)"),
                }
            ));
        }
    }
    for text in damaged.iter().take(PROBLEMS_SHOWN) {
        complain(text);
    }
    damaged.len()
}
