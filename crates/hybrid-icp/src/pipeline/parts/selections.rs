//! The point selections of the catalogue.

use super::super::catalog::{Part, PartKind};
use super::parameter::{KEPT, LENGTH_UNITS, POSITIVE, SPACING, count, number, part, word};

pub(super) const PARTS: &[Part] = &[
    Part {
        kind: PartKind::Selection,
        name: "all-samples",
        rust: "AllSamples",
        summary: "the model's area-uniform samples, visible or not",
        source: "§III-A",
        cost: "O(n)",
        parameters: &[],
    },
    Part {
        kind: PartKind::Selection,
        name: "visible-surface",
        rust: "VisibleSurface",
        summary: "the points visible at the stage's initial estimate: V_O",
        source: "§III-A.1",
        cost: "a render, shared with the score, and O(pixels)",
        parameters: &[KEPT, SPACING],
    },
    Part {
        kind: PartKind::Selection,
        name: "observed-surface",
        rust: "ObservedSurface",
        summary: "the observed surface, carried into the object frame at the stage's initial estimate",
        source: "-",
        cost: "O(m)",
        parameters: &[KEPT, SPACING],
    },
    Part {
        kind: PartKind::Selection,
        name: "without-boundary",
        rust: "WithoutBoundary",
        summary: "the points of another selection that are not rendered at a silhouette or a depth step",
        source: "Turk & Levoy 1994",
        cost: "a render, shared with the score",
        parameters: &[
            part(
                "selection",
                "the selection to choose from",
                PartKind::Selection,
                Some("visible-surface"),
            ),
            count("width", "how many pixels from the boundary", 0, Some(1)),
            number(
                "max_tilt_degrees",
                "degrees",
                "tilt of a surface from which on it is a depth edge",
                (0.0, 90.0),
                Some(85.0),
            ),
        ],
    },
    Part {
        kind: PartKind::Selection,
        name: "uniform-count",
        rust: "UniformCount",
        summary: "evenly spaced points of another selection",
        source: "-",
        cost: "O(n)",
        parameters: &[
            part(
                "selection",
                "the selection to choose from",
                PartKind::Selection,
                Some("all-samples"),
            ),
            count("count", "how many points are kept", 0, Some(500)),
        ],
    },
    Part {
        kind: PartKind::Selection,
        name: "random-sample",
        rust: "RandomSample",
        summary: "random points of another selection, the same for a seed",
        source: "Masuda 1996",
        cost: "O(n)",
        parameters: &[
            part(
                "selection",
                "the selection to choose from",
                PartKind::Selection,
                Some("all-samples"),
            ),
            count("count", "how many points are kept", 0, Some(500)),
            count("seed", "which draw", 0, Some(0)),
        ],
    },
    Part {
        kind: PartKind::Selection,
        name: "voxel-grid",
        rust: "VoxelGrid",
        summary: "one point of another selection per cell of a grid",
        source: "-",
        cost: "O(n log n)",
        parameters: &[
            part(
                "selection",
                "the selection to choose from",
                PartKind::Selection,
                Some("all-samples"),
            ),
            number("cell", "of `unit`", "edge of a cell", POSITIVE, Some(0.05)),
            word("unit", "what the edge counts in", LENGTH_UNITS, "diameters"),
        ],
    },
    Part {
        kind: PartKind::Selection,
        name: "normal-space",
        rust: "NormalSpace",
        summary: "points of another selection whose normals are spread evenly",
        source: "Rusinkiewicz & Levoy 2001",
        cost: "O(n)",
        parameters: &[
            part(
                "selection",
                "the selection to choose from",
                PartKind::Selection,
                Some("all-samples"),
            ),
            count("count", "how many points are kept", 0, Some(500)),
            count(
                "resolution",
                "cells along an edge of the cube of directions",
                1,
                Some(4),
            ),
        ],
    },
    Part {
        kind: PartKind::Selection,
        name: "stable-sampling",
        rust: "StableSampling",
        summary: "points of another selection that constrain all six directions alike",
        source: "Gelfand et al. 2003",
        cost: "O(n log n)",
        parameters: &[
            part(
                "selection",
                "the selection to choose from",
                PartKind::Selection,
                Some("all-samples"),
            ),
            count("count", "how many points are kept", 0, Some(500)),
        ],
    },
];
