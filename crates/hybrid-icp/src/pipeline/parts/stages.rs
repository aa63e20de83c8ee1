//! The stages of the catalogue.

use super::super::catalog::{Part, PartKind};
use super::parameter::{POSITIVE, count, number, part, parts};

/// How a stage of the paper's variants ends; what `stop` is when a file does not say.
pub(crate) const PAPER_STOP: &[&str] = &["divergence", "convergence", "iteration-limit"];

pub(super) const PARTS: &[Part] = &[
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
    Part {
        kind: PartKind::Stage,
        name: "anderson",
        rust: "Anderson",
        summary: "a stage of one step, run again and again from extrapolated poses",
        source: "Anderson 1965; Pavlov et al. 2018; Zhang, Yao & Deng 2021",
        cost: "steps × the stage",
        parameters: &[
            part(
                "stage",
                "one step: an ICP stage with an iteration limit of 2",
                PartKind::Stage,
                None,
            ),
            count("max_steps", "how many at most", 0, Some(50)),
            number(
                "translation_meters",
                "m",
                "step below which it has converged",
                POSITIVE,
                Some(1e-5),
            ),
            number(
                "rotation_degrees",
                "degrees",
                "and turn below which it has",
                POSITIVE,
                Some(1e-3),
            ),
        ],
    },
];
