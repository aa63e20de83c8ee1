//! The stop rules of the catalogue.

use super::super::catalog::{Part, PartKind};
use super::parameter::{POSITIVE, count, number, word};

pub(super) const PARTS: &[Part] = &[
    Part {
        kind: PartKind::Stop,
        name: "divergence",
        rust: "Divergence",
        summary: "rejects a pose that lost pairs or whose mean loss rose",
        source: "§IV-B",
        cost: "O(1)",
        parameters: &[
            number(
                "pairs_lost",
                "share",
                "largest share of the pairs that may be lost",
                (0.0, 1.0),
                Some(0.05),
            ),
            word(
                "loss_rule",
                "when a rising loss counts",
                &["strict", "count-aware"],
                "strict",
            ),
            number(
                "rise_tolerance",
                "share",
                "relative rise left to the convergence rule",
                POSITIVE,
                Some(1e-3),
            ),
        ],
    },
    Part {
        kind: PartKind::Stop,
        name: "convergence",
        rust: "Convergence",
        summary: "ends when the mean loss stops changing, relatively",
        source: "§IV-B",
        cost: "O(1)",
        parameters: &[
            number(
                "relative_change",
                "share",
                "change below which it has converged",
                POSITIVE,
                Some(1e-3),
            ),
            number(
                "negligible_loss",
                "m²",
                "loss below which nothing is left to gain",
                POSITIVE,
                Some(1e-14),
            ),
        ],
    },
    Part {
        kind: PartKind::Stop,
        name: "absolute-loss",
        rust: "AbsoluteLoss",
        summary: "ends when the mean loss stops changing, absolutely, or is good enough",
        source: "-",
        cost: "O(1)",
        parameters: &[
            number(
                "change",
                "m²",
                "change below which it has converged",
                POSITIVE,
                Some(1e-12),
            ),
            number(
                "good_enough",
                "m²",
                "loss that is good enough",
                POSITIVE,
                Some(1e-10),
            ),
        ],
    },
    Part {
        kind: PartKind::Stop,
        name: "motion",
        rust: "SmallMotion",
        summary: "ends when the next increment would hardly move the object",
        source: "-",
        cost: "O(1)",
        parameters: &[
            number(
                "translation_meters",
                "m",
                "distance of the object's origin",
                POSITIVE,
                Some(1e-4),
            ),
            number("rotation_degrees", "degrees", "angle", POSITIVE, Some(0.01)),
        ],
    },
    Part {
        kind: PartKind::Stop,
        name: "bound",
        rust: "Bound",
        summary: "rejects a pose too far from the stage's initial one",
        source: "-",
        cost: "O(1)",
        parameters: &[
            number(
                "translation_meters",
                "m",
                "distance of the object's origin",
                POSITIVE,
                Some(0.1),
            ),
            number("rotation_degrees", "degrees", "angle", POSITIVE, Some(45.0)),
        ],
    },
    Part {
        kind: PartKind::Stop,
        name: "oscillation",
        rust: "Oscillation",
        summary: "ends when the pose returns to where it was two or three iterations before",
        source: "-",
        cost: "O(1)",
        parameters: &[
            number(
                "translation_meters",
                "m",
                "distance within which two poses are the same",
                POSITIVE,
                Some(1e-5),
            ),
            number(
                "rotation_degrees",
                "degrees",
                "angle within which two poses are the same",
                POSITIVE,
                Some(1e-3),
            ),
        ],
    },
    Part {
        kind: PartKind::Stop,
        name: "iteration-limit",
        rust: "IterationLimit",
        summary: "ends after a number of evaluations",
        source: "-",
        cost: "O(1)",
        parameters: &[count("iterations", "how many", 0, Some(50))],
    },
    Part {
        kind: PartKind::Stop,
        name: "time-limit",
        rust: "TimeLimit",
        summary: "ends when the stage has run for a time; results depend on the clock",
        source: "-",
        cost: "O(1)",
        parameters: &[number("milliseconds", "ms", "how long", (0.0, 1e9), None)],
    },
];
