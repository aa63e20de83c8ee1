//! Reports missing and damaged files of a dataset.

use std::collections::BTreeSet;

use hicp_bop::{Fault, FaultKind};

use crate::terminal::{complain, counted, warn};

/// Largest number of damaged files that are reported one by one.
const SHOWN: usize = 10;

/// Reports damaged files, each once. If there are any, returns a clause with their number.
///
/// Also warns of the first missing image and the first missing mask.
pub(crate) fn report<'a>(
    faults: impl Iterator<Item = &'a Fault> + Clone,
    broken_models: impl Iterator<Item = &'a String>,
) -> Option<String> {
    let of_kind = |kind: FaultKind| -> Vec<&'a String> {
        let mut seen = BTreeSet::new();
        let of_kind = faults.clone().filter(|fault| fault.kind == kind);
        let texts = of_kind.map(|fault| &fault.text);
        texts.filter(|text| seen.insert(*text)).collect()
    };
    for missing in [FaultKind::Missing, FaultKind::MissingMask].map(of_kind) {
        match missing[..] {
            [] => {}
            [only] => warn(only),
            [first, ..] => warn(format_args!(
                "{first} (and {} more like it)",
                missing.len() - 1
            )),
        }
    }
    let damaged = of_kind(FaultKind::Damaged);
    let damaged: Vec<&String> = broken_models.chain(damaged).collect();
    damaged.iter().take(SHOWN).for_each(complain);
    (!damaged.is_empty()).then(|| format!("{} could not be used", counted(damaged.len(), "file")))
}
