//! The scores of the catalogue.

use super::super::catalog::{Part, PartKind};
use super::parameter::{INFINITE, count, number};

/// What an occlusion tolerance means.
const HIDES: &str = "what something outside the mask must stand in front of the object to hide it; below 0 it may also lie that far behind, where \
    the mask misses a part; inf is the paper's definition";
/// Any; a metre behind the object is nowhere near it.
const TOLERANCES: (f64, f64) = (-1.0, INFINITE);

pub(super) const PARTS: &[Part] = &[
    Part {
        kind: PartKind::Score,
        name: "mve",
        rust: "MeanVsd",
        summary: "the mean VSD estimate against the live image",
        source: "§IV-A.2",
        cost: "a render, shared with the selection, and O(pixels)",
        parameters: &[number(
            "occlusion_tolerance",
            "m",
            HIDES,
            TOLERANCES,
            Some(0.015),
        )],
    },
    Part {
        kind: PartKind::Score,
        name: "sampled-mve",
        rust: "SampledMve",
        summary: "the MVE at low resolution from points of the model instead of a render: for ranking many poses",
        source: "-",
        cost: "O(samples), whatever the mesh",
        parameters: &[
            count("samples", "number of points on the model", 0, Some(1500)),
            count(
                "pixels",
                "about how many pixels of the mask are looked at",
                1,
                Some(200),
            ),
            number("occlusion_tolerance", "m", HIDES, TOLERANCES, Some(0.015)),
        ],
    },
];
