//! The scores of the catalogue.

use super::super::catalog::{Part, PartKind};
use super::parameter::{POSITIVE, number};

pub(super) const PARTS: &[Part] = &[Part {
    kind: PartKind::Score,
    name: "mve",
    rust: "MeanVsd",
    summary: "the mean VSD estimate against the live image",
    source: "§IV-A.2",
    cost: "a render, shared with the selection, and O(pixels)",
    parameters: &[number(
        "occlusion_tolerance",
        "m",
        "what something must stand in front of the object to hide it; inf is the paper's definition",
        POSITIVE,
        Some(0.015),
    )],
}];
