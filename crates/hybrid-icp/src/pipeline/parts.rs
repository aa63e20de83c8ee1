//! The entries of the catalogue.

use super::catalog::{Accepts, Parameter, Part, PartKind};

const fn number(
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    (min, max): (f64, f64),
    default: Option<f64>,
) -> Parameter {
    Parameter {
        name,
        unit,
        meaning,
        accepts: Accepts::Number { min, max, default },
    }
}

const fn count(
    name: &'static str,
    meaning: &'static str,
    min: u32,
    default: Option<u32>,
) -> Parameter {
    Parameter {
        name,
        unit: "",
        meaning,
        accepts: Accepts::Count { min, default },
    }
}

const fn word(
    name: &'static str,
    meaning: &'static str,
    words: &'static [&'static str],
    default: &'static str,
) -> Parameter {
    Parameter {
        name,
        unit: "",
        meaning,
        accepts: Accepts::Word { words, default },
    }
}

const fn part(
    name: &'static str,
    meaning: &'static str,
    kind: PartKind,
    default: Option<&'static str>,
) -> Parameter {
    Parameter {
        name,
        unit: "",
        meaning,
        accepts: Accepts::Part { kind, default },
    }
}

const fn parts(
    name: &'static str,
    meaning: &'static str,
    kind: PartKind,
    default: Option<&'static [&'static str]>,
) -> Parameter {
    Parameter {
        name,
        unit: "",
        meaning,
        accepts: Accepts::Parts { kind, default },
    }
}

const INFINITE: f64 = f64::INFINITY;
const POSITIVE: (f64, f64) = (0.0, INFINITE);

/// How a stage of the paper's variants ends; what `stop` is when a file does not say.
pub(crate) const PAPER_STOP: &[&str] = &["divergence", "convergence", "iteration-limit"];

/// Every part, by kind in the order of a pipeline, then as a reader would look for it.
pub const PARTS: &[Part] = &[
    // Stages.
    Part {
        kind: PartKind::Stage,
        name: "icp",
        rust: "Icp",
        summary: "generic ICP from its five components",
        source: "Algorithm 1",
        cost: "iterations × (association + metric)",
        parameters: &[
            part(
                "selection",
                "which points are registered",
                PartKind::Selection,
                None,
            ),
            part(
                "association",
                "to which observed points",
                PartKind::Association,
                None,
            ),
            parts(
                "filter",
                "which pairs are kept, and with what weight; applied in order",
                PartKind::Filter,
                Some(&[]),
            ),
            part("metric", "what is minimised", PartKind::Metric, None),
            parts(
                "stop",
                "when it ends; the first that says so wins",
                PartKind::Stop,
                Some(PAPER_STOP),
            ),
        ],
    },
    Part {
        kind: PartKind::Stage,
        name: "cascade",
        rust: "Cascade",
        summary: "stages one after the other, each from where the last ended",
        source: "§IV-B",
        cost: "the sum of its stages",
        parameters: &[parts(
            "stages",
            "the stages in order",
            PartKind::Stage,
            None,
        )],
    },
    Part {
        kind: PartKind::Stage,
        name: "repeat",
        rust: "Repeat",
        summary: "a stage several times; ends early when it keeps its pose",
        source: "§IV-C",
        cost: "times × the stage",
        parameters: &[
            count("times", "how many times at most", 0, Some(2)),
            part("stage", "what is repeated", PartKind::Stage, None),
        ],
    },
    Part {
        kind: PartKind::Stage,
        name: "switch",
        rust: "Switch",
        summary: "one of two stages, chosen from the image at the estimate",
        source: "§IV-A.2",
        cost: "the switcher's and the chosen stage's",
        parameters: &[
            part(
                "switcher",
                "who decides",
                PartKind::Switcher,
                Some("threshold"),
            ),
            part(
                "aligned",
                "runs where the estimate agrees with the image",
                PartKind::Stage,
                None,
            ),
            part(
                "misaligned",
                "runs where it does not",
                PartKind::Stage,
                None,
            ),
        ],
    },
    Part {
        kind: PartKind::Stage,
        name: "switch-among",
        rust: "SwitchAmong",
        summary: "one of any number of stages, chosen from the image at the estimate",
        source: "§IV-A.2, generalised",
        cost: "the switcher's and the chosen stage's",
        parameters: &[
            part(
                "switcher",
                "who decides",
                PartKind::Switcher,
                Some("threshold"),
            ),
            parts("stages", "what runs, by regime", PartKind::Stage, None),
        ],
    },
    Part {
        kind: PartKind::Stage,
        name: "at-resolution",
        rust: "AtResolution",
        summary: "a stage on every n-th pixel, phase-aligned; coarse-to-fine is a cascade of these",
        source: "image pyramids",
        cost: "the stage on a coarser image",
        parameters: &[
            count("factor", "every how many pixels", 1, Some(2)),
            part("stage", "what is run", PartKind::Stage, None),
        ],
    },
    Part {
        kind: PartKind::Stage,
        name: "guard",
        rust: "Guard",
        summary: "a stage whose pose is accepted only if a score improves",
        source: "-",
        cost: "the stage and two scores",
        parameters: &[
            part("stage", "what is run", PartKind::Stage, None),
            part("score", "the judge", PartKind::Score, Some("mve")),
        ],
    },
    Part {
        kind: PartKind::Stage,
        name: "keep-best",
        rust: "KeepBest",
        summary: "a stage several times; the best pose met, the initial one included, by a score",
        source: "-",
        cost: "times × (the stage and a score)",
        parameters: &[
            count("times", "how many times at most", 0, Some(2)),
            part("stage", "what is repeated", PartKind::Stage, None),
            part("score", "the judge", PartKind::Score, Some("mve")),
        ],
    },
    // Selections.
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
        parameters: &[
            count(
                "points",
                "about how many points are kept, on a pixel grid",
                1,
                Some(2000),
            ),
            count(
                "pixels",
                "or the spacing of the grid; 0 leaves it to `points`",
                0,
                Some(0),
            ),
        ],
    },
    // Associations.
    Part {
        kind: PartKind::Association,
        name: "nearest-neighbor",
        rust: "NearestNeighbor",
        summary: "the closest observed point",
        source: "§III-A.1; Besl & McKay 1992",
        cost: "O(n log m), and O(m log m) once per observation",
        parameters: &[
            count(
                "points",
                "about how many observed points are searched, on a pixel grid",
                1,
                Some(4000),
            ),
            count(
                "pixels",
                "or the spacing of the grid; 0 leaves it to `points`",
                0,
                Some(0),
            ),
        ],
    },
    Part {
        kind: PartKind::Association,
        name: "projective",
        rust: "Projective",
        summary: "the observed point at the pixel that the model point projects to",
        source: "§III-A.1; Blais & Levine 1995",
        cost: "O(n)",
        parameters: &[],
    },
    // Filters.
    Part {
        kind: PartKind::Filter,
        name: "max-distance",
        rust: "MaxDistance",
        summary: "removes pairs further apart than τ_max",
        source: "§III-A.1; Turk & Levoy 1994",
        cost: "O(n)",
        parameters: &[
            number("limit", "of `unit`", "τ_max", POSITIVE, Some(0.25)),
            word(
                "unit",
                "what the limit counts in",
                &["diameters", "meters"],
                "diameters",
            ),
        ],
    },
    Part {
        kind: PartKind::Filter,
        name: "max-normal-angle",
        rust: "MaxNormalAngle",
        summary: "removes pairs whose normals differ by more than θ_max",
        source: "§III-A.1; Pulli 1999",
        cost: "O(n)",
        parameters: &[number(
            "degrees",
            "degrees",
            "θ_max",
            (0.0, 180.0),
            Some(90.0),
        )],
    },
    // Metrics.
    Part {
        kind: PartKind::Metric,
        name: "point-to-point",
        rust: "PointToPoint",
        summary: "‖T o − c‖², in closed form",
        source: "§III-A.2; Besl & McKay 1992, Umeyama 1991",
        cost: "O(n)",
        parameters: &[],
    },
    Part {
        kind: PartKind::Metric,
        name: "point-to-plane",
        rust: "PointToPlane",
        summary: "(nᵀ(T o − c))², by Gauss–Newton",
        source: "§III-A.2; Chen & Medioni 1991, Low 2004",
        cost: "O(n)",
        parameters: &[],
    },
    // Stop rules.
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
        rust: "Motion",
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
    // Scores.
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
    // Switchers.
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
