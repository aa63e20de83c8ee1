//! The switchers of the catalogue.

use super::super::catalog::{Accepts, Parameter, Part, PartKind};
use super::parameter::{INFINITE, number, part};

pub(super) const PARTS: &[Part] = &[
    Part {
        kind: PartKind::Switcher,
        name: "threshold",
        rust: "Threshold",
        summary: "misaligned where a score is α or more",
        source: "§IV-A.2",
        cost: "a score",
        parameters: &[
            part("score", "the score", PartKind::Score, Some("mve")),
            number(
                "alpha",
                "of the score",
                "the threshold",
                (f64::NEG_INFINITY, INFINITE),
                Some(0.4),
            ),
        ],
    },
    Part {
        kind: PartKind::Switcher,
        name: "thresholds",
        rust: "Thresholds",
        summary: "regime k where exactly k bounds are at or below a score",
        source: "§IV-A.2, generalised",
        cost: "a score",
        parameters: &[
            part("score", "the score", PartKind::Score, Some("mve")),
            Parameter {
                name: "bounds",
                unit: "of the score",
                meaning: "the bounds, ascending",
                accepts: Accepts::NumberList,
            },
        ],
    },
];
