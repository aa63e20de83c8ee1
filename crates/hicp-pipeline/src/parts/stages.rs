//! Stages and the switchers that choose among them.

use std::time::Duration;

use hicp_icp::{
    Anderson, AtResolution, Bound, BoxedStage, Cascade, ColorChoice, Descent, Guard,
    HypothesisSearch, Icp, KeepBest, MAX_ITERATIONS, RayShift, Repeat, Rotations, SearchOptions,
    Start,
};
use hicp_switch::{Switch, SwitchAmong, SwitchUntilStall, Threshold, Thresholds};

use crate::build::Parameters;
use crate::catalog::{
    BoxedAssociation, BoxedFilter, BoxedMetric, BoxedScore, BoxedSelection, BoxedStop,
    BoxedSwitcher, Catalog,
};
use crate::error::PipelineError;
use crate::range::{DEGREES, FACTOR, METERS, Range};
use crate::work::Limited::Hypotheses;

const INFINITY: f64 = f64::INFINITY;
/// When a stage of the paper's variants ends.
const PAPER_STOP: &[&str] = &["divergence", "convergence", "iteration-limit"];

pub(super) fn add(catalog: &mut Catalog) {
    catalog.add_stage("icp", |p| {
        p.about = "Runs generic ICP from its five components. Source: Algorithm 1. \
            Cost: iterations × (association + metric).";
        let icp = Icp {
            selection: p.part::<BoxedSelection>("selection", None, "points to register")?,
            association: p.part::<BoxedAssociation>(
                "association",
                None,
                "pairs them with observed points",
            )?,
            filter: p.parts::<BoxedFilter>(
                "filter",
                &[][..],
                "outlier filters and weights, in order",
            )?,
            metric: p.part::<BoxedMetric>("metric", None, "error metric to minimize")?,
            stop: p.parts::<BoxedStop>(
                "stop",
                PAPER_STOP,
                "the first rule that applies ends it",
            )?,
        };
        let engine = MAX_ITERATIONS as u64;
        let iterations = p.iterations_of("stop").fold(engine, u64::min).max(1);
        let steps = p.iterations_of("metric").fold(1, u64::max);
        p.takes("metric", iterations.saturating_mul(steps))?;
        Ok(icp)
    });
    catalog.add_stage("cascade", |p| {
        p.about = "Runs stages one after the other, each from the pose of the one before. \
            Source: §IV-B. Cost: the sum of its stages.";
        let stages = p.parts::<BoxedStage>("stages", None, "the stages, in order")?;
        let total = p.iterations_of("stages").fold(0, u64::saturating_add);
        p.takes("stages", total)?;
        Ok(Cascade(stages))
    });
    catalog.add_stage("repeat", |p| {
        p.about = "Runs a stage several times; ends early when it keeps its pose. Source: §IV-C. \
            Cost: times × the stage.";
        let times = p.count("times", 0, 2, "largest number of runs")?;
        let stage = p.part::<BoxedStage>("stage", None, "the stage to repeat")?;
        p.repeats("times", times)?;
        Ok(Repeat { times, stage })
    });
    catalog.add_stage("switch", |p| {
        p.about = "Runs one of two stages, chosen from the image at the estimate. \
            Source: §IV-A.2. Cost: the switcher's and the chosen stage's.";
        Ok(Switch {
            switcher: p.part::<BoxedSwitcher>("switcher", "threshold", "selects the stage")?,
            aligned: p.part::<BoxedStage>(
                "aligned",
                None,
                "runs if the estimate fits the image",
            )?,
            misaligned: p.part::<BoxedStage>("misaligned", None, "runs if it does not")?,
        })
    });
    catalog.add_stage("switch-among", |p| {
        p.about = "Runs one of any number of stages, chosen from the image at the estimate. \
            Source: §IV-A.2, generalized. Cost: the switcher's and the chosen stage's.";
        Ok(SwitchAmong {
            switcher: p.part::<BoxedSwitcher>("switcher", "threshold", "selects the stage")?,
            stages: p.parts::<BoxedStage>("stages", None, "the stages, by regime")?,
        })
    });
    catalog.add_stage("alternate", |p| {
        p.about = "Switches until the score stalls, and tries the other stage once; returns the \
            pose with the best score. Source: §IV-A.2, repeated. Cost: max_steps × (a stage and a \
            score).";
        let stage = SwitchUntilStall {
            switcher: p.part::<BoxedSwitcher>("switcher", "threshold", "selects and scores")?,
            aligned: p.part::<BoxedStage>(
                "aligned",
                None,
                "runs if the estimate fits the image",
            )?,
            misaligned: p.part::<BoxedStage>("misaligned", None, "runs if it does not")?,
            max_steps: p.count("max_steps", 0, 4, "largest number of steps")?,
            min_gain: p.number("min_gain", FACTOR, 0.01, "smaller gains count as a stall")?,
            good_enough: p.number("good_enough", FACTOR, 0.0, "score that ends it")?,
        };
        p.repeats("max_steps", stage.max_steps)?;
        Ok(stage)
    });
    catalog.add_stage("hypothesis-search", |p| {
        p.about = "Runs a local stage; if its score stays bad, runs it again from the best of \
            many rotations. Not local. Cost: the stage; if it fails, hypotheses × ranking, \
            aligned × align, refined × explore and up to half as many × finish.";
        let search = HypothesisSearch::new(
            p.part::<BoxedStage>("stage", None, "refines locally")?,
            (
                p.part::<BoxedStage>("align", "ray-shift", "moves many hypotheses, very cheaply")?,
                p.part::<BoxedStage>("explore", None, "refines the best of them, cheaply")?,
                p.part::<BoxedStage>("finish", "ray-shift", "fits those that may be right")?,
            ),
            (
                p.part::<BoxedScore>("ranking", "sampled-mve", "ranks hypotheses")?,
                p.part::<BoxedScore>("score", "mve", "compares poses")?,
                p.part::<BoxedScore>("doubt", "doubt", "decides if a pose is good enough")?,
            ),
            search_options(p)?,
        );
        let SearchOptions {
            aligned, refined, ..
        } = search.options;
        let runs = [
            // From the initial pose, and from some at the end.
            ("stage", 2 + refined / 6),
            ("align", aligned),
            ("explore", refined),
            ("finish", refined / 2),
        ];
        let total = runs
            .iter()
            .fold(search.options.hypotheses as u64, |sum, (name, times)| {
                let most = p.iterations_of(name).fold(0, u64::max);
                sum.saturating_add(most.saturating_mul(*times as u64))
            });
        p.takes("refined", total)?;
        Ok(search)
    });
    catalog.add_stage("color-choice", |p| {
        p.about = "Lets color decide between the pose of a stage and others that explain the depth \
            as well; without colors, or within a search, it is that stage. Cost: the stage; if \
            depth leaves a choice, up to six times the polish, the stage without its search, and \
            some milliseconds.";
        let stage = p.part::<BoxedStage>("stage", None, "finds a pose")?;
        let polish = p.part::<BoxedStage>("polish", None, "moves poses to depth and colors")?;
        let score = p.part::<BoxedScore>("score", "mve", "judges the depth")?;
        let mut choice = ColorChoice::new(stage, polish, score);
        let rise = "a pose is a choice up to 1.2 times that score of the stage's pose, plus this";
        choice.tolerance = p.number("tolerance", FACTOR, choice.tolerance, rise)?;
        let least = "correlation of colors at which they agree";
        let correlation = choice.least_correlation;
        choice.least_correlation = p.number("least_correlation", FACTOR, correlation, least)?;
        let gain = "gain in correlation that leaves the pose of the stage";
        choice.min_gain = p.number("min_gain", FACTOR, choice.min_gain, gain)?;
        // The stage runs again from the chosen pose, and each of two rankings polishes three poses.
        let runs = [("stage", 2), ("polish", 6)].map(|(name, times)| {
            let most = p.iterations_of(name).fold(0, u64::max);
            most.saturating_mul(times)
        });
        p.takes("polish", runs[0].saturating_add(runs[1]))?;
        Ok(choice)
    });
    catalog.add_stage("ray-shift", |p| {
        p.about = "Moves the model along the ray to its center by the median difference of \
            measured and rendered depth, twice: a baseline. Cost: two renders.";
        Ok(RayShift::default())
    });
    catalog.add_stage("at-resolution", |p| {
        p.about = "Runs a stage on every n-th pixel, phase-aligned; coarse-to-fine is a cascade \
            of these. A selection with points has as many points in all of them, and one with \
            pixels has fewer in the coarse ones. If a side is a cloud, it runs the stage \
            unchanged. Source: image pyramids. Cost: the stage on a coarser image.";
        Ok(AtResolution {
            factor: p.count("factor", 1, 2, "keeps every n-th pixel")?,
            stage: p.part::<BoxedStage>("stage", None, "the stage to run")?,
        })
    });
    catalog.add_stage("guard", |p| {
        p.about = "Accepts the pose of a stage only if a score improves. Cost: the stage and two \
            scores.";
        Ok(Guard {
            stage: p.part::<BoxedStage>("stage", None, "the stage to run")?,
            score: p.part::<BoxedScore>("score", "mve", "judges poses")?,
        })
    });
    catalog.add_stage("descent", |p| {
        p.about = "Lowers a score that stays high by small moves along and around all axes. \
            Source: pattern search, Hooke & Jeeves 1961. Cost: up to evaluations scores.";
        let share = Range::new(0.0, 1.0, "diameters");
        Ok(Descent {
            score: p.part::<BoxedScore>("score", "mve", "judges poses")?,
            good_enough: p.number("good_enough", FACTOR, 0.2, "score that is kept")?,
            first_step: p.number("first_step", share, 0.05, "first step of the surface")?,
            last_step: p.number("last_step", share, 0.025, "smallest step")?,
            min_gain: p.number("min_gain", FACTOR, 0.006, "smallest gain of a move")?,
            evaluations: p.count("evaluations", 1, 80, "largest number of scores")?,
        })
    });
    catalog.add_stage("keep-best", |p| {
        p.about = "Runs a stage several times; returns the best pose by a score, which may be the \
            initial one. Cost: times × (the stage and a score).";
        let stage = KeepBest {
            times: p.count("times", 0, 2, "largest number of runs")?,
            stage: p.part::<BoxedStage>("stage", None, "the stage to repeat")?,
            score: p.part::<BoxedScore>("score", "mve", "judges poses")?,
        };
        p.repeats("times", stage.times)?;
        Ok(stage)
    });
    catalog.add_stage("anderson", |p| {
        p.about = "Runs a stage of one step again and again, from extrapolated poses. A step \
            evaluates two poses, so it saves time only if it halves the number of steps. \
            Schedules, bounds, priors and time limits start again in each step. Source: Anderson \
            1965; Pavlov et al. 2018; Zhang, Yao & Deng 2021. Cost: steps × the stage.";
        let stage = Anderson {
            stage: p.part::<BoxedStage>("stage", None, "ICP with an iteration limit of 2")?,
            max_steps: p.count("max_steps", 0, 50, "largest number of steps")?,
            translation_meters: p.number("translation_meters", METERS, 1e-5, "ends below")?,
            rotation_degrees: p.number("rotation_degrees", DEGREES, 1e-3, "and below")?,
        };
        p.repeats("max_steps", stage.max_steps)?;
        Ok(stage)
    });
    catalog.add_switcher("threshold", |p| {
        p.about = "Selects misaligned if a score is at least α. Source: §IV-A.2. Cost: a score.";
        let of_score = Range::new(-INFINITY, INFINITY, "of the score");
        Ok(Threshold {
            score: p.part::<BoxedScore>("score", "mve", "the score")?,
            alpha: p.number("alpha", of_score, 0.4, "the threshold")?,
        })
    });
    catalog.add_switcher("thresholds", |p| {
        p.about = "Selects regime k if exactly k bounds are at or below a score. \
            Source: §IV-A.2, generalized. Cost: a score.";
        let score = p.part::<BoxedScore>("score", "mve", "the score")?;
        let bounds = p.numbers("bounds", "bounds of the score, ascending")?;
        if !bounds.is_sorted() {
            return Err(p.refuse("bounds", "ascending numbers".to_owned()));
        }
        Ok(Thresholds { score, bounds })
    });
}

fn search_options(p: &mut Parameters<'_>) -> Result<SearchOptions, PipelineError> {
    let starts = [("refined", Start::Refined), ("ignored", Start::Ignored)];
    let rotations = [
        ("even", Rotations::Even),
        ("view-axis", Rotations::ViewAxis),
        ("symmetry", Rotations::Symmetry),
    ];
    let tried = "rotations to try: of SO(3), around the viewing ray, or the declared symmetries";
    let least = "least angle between those; of two that are nearer the better ranked is refined";
    let near = "gain that leaves a local pose near the initial pose";
    let far = "gain that leaves one far from it";
    let used = "use of the initial pose; if ignored, the search always runs";
    let options = SearchOptions {
        start: p.word("start", &starts, used)?,
        threshold: p.number(
            "threshold",
            FACTOR,
            0.002,
            "searches above this doubt × score",
        )?,
        far_threshold: p.number(
            "far_threshold",
            FACTOR,
            0.001,
            "the same if the local pose is far from the initial one",
        )?,
        good_enough: p.number(
            "good_enough",
            FACTOR,
            0.02,
            "doubt that ends it, unless poses look alike",
        )?,
        near_gain: p.number("near_gain", FACTOR, 0.1, near)?,
        far_gain: p.number("far_gain", FACTOR, 0.04, far)?,
        rotations: p.word("rotations", &rotations, tried)?,
        hypotheses: p.limited(Hypotheses, "hypotheses", 0, 1000, "rotations to rank")?,
        aligned: p.count("aligned", 0, 256, "hypotheses that are aligned")?,
        refined: p.count("refined", 0, 24, "hypotheses that are refined")?,
        spacing_degrees: p.number("spacing_degrees", DEGREES, 20.0, least)?,
        widens: p.flag(
            "widens",
            true,
            "goes on with all hypotheses if it fails, unless the local pose is near",
        )?,
        ..SearchOptions::default()
    };
    let moved = "largest distance of the object's center from that of the initial pose";
    let turned = "largest rotation from the initial pose";
    let bound = Bound {
        translation_meters: p.number("max_translation_meters", METERS, INFINITY, moved)?,
        rotation_degrees: p.number("max_rotation_degrees", DEGREES, INFINITY, turned)?,
    };
    let bounded = bound.translation_meters.is_finite() || bound.rotation_degrees.is_finite();
    let time = "time after which a search ends; if finite, results depend on the clock";
    let milliseconds: f64 = p.number("milliseconds", Range::positive("ms"), INFINITY, time)?;
    Ok(SearchOptions {
        bound: bounded.then_some(bound),
        // A time that no duration can hold is no limit.
        time_limit: Duration::try_from_secs_f64(milliseconds / 1000.0).ok(),
        ..options
    })
}
