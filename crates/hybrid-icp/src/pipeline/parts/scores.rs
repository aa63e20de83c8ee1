//! The scores of the catalogue.

use super::super::catalog::{Part, PartKind};
use super::parameter::{POSITIVE, count, number};

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
            "what something must stand in front of the object to hide it; inf is the paper's definition",
            POSITIVE,
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
        ],
    },
];
