//! From a tree to a pipeline: every field is read through the catalogue, which knows its range and its default.

use hicp_association::{
    AllSamples, DataAssociation, MaxDistance, MaxNormalAngle, NearestNeighbor, OutlierFilter,
    PointSelection, Projective, Stride, VisibleSurface,
};
use hicp_icp::{
    AbsoluteLoss, AtResolution, Bound, Cascade, Convergence, Divergence, Guard, Icp,
    IterationLimit, KeepBest, LossRule, Motion, Oscillation, Repeat, StopRule, TimeLimit,
};
use hicp_metric::{ErrorMetric, PointToPlane, PointToPoint};
use hicp_score::{MeanVsd, Score};
use hicp_switch::{Switch, SwitchAmong, Switcher, Threshold, Thresholds};

use super::catalog::PartKind;
use super::error::PipelineError;
use super::reader::Reader;
use crate::preset::BoxedStage;

type Boxed<T> = Box<T>;
type Selection = Boxed<dyn PointSelection + Send>;
type Association = Boxed<dyn DataAssociation + Send>;
type Filter = Boxed<dyn OutlierFilter + Send>;
type Metric = Boxed<dyn ErrorMetric + Send>;
type Stop = Boxed<dyn StopRule + Send>;
type BoxedScore = Boxed<dyn Score + Send>;
type BoxedSwitcher = Boxed<dyn Switcher + Send>;

/// Builds a stage.
pub(crate) fn stage(part: &Reader<'_>) -> Result<BoxedStage, PipelineError> {
    let one = |field: &str| stage(&part.part(field)?);
    let many = |field: &str| {
        part.parts(field)?
            .iter()
            .map(stage)
            .collect::<Result<Vec<_>, _>>()
    };
    Ok(match part.name() {
        "icp" => Box::new(Icp {
            selection: selection(&part.part("selection")?)?,
            association: association(&part.part("association")?)?,
            filter: each(part, "filter", filter)?,
            metric: metric(&part.part("metric")?)?,
            stop: each(part, "stop", stop)?,
        }),
        "cascade" => Box::new(Cascade(many("stages")?)),
        "repeat" => Box::new(Repeat {
            times: part.count("times")? as usize,
            stage: one("stage")?,
        }),
        "switch" => Box::new(Switch {
            switcher: switcher(&part.part("switcher")?)?,
            aligned: one("aligned")?,
            misaligned: one("misaligned")?,
        }),
        "switch-among" => Box::new(SwitchAmong {
            switcher: switcher(&part.part("switcher")?)?,
            stages: many("stages")?,
        }),
        "at-resolution" => Box::new(AtResolution {
            factor: part.count("factor")?,
            stage: one("stage")?,
        }),
        "guard" => Box::new(Guard {
            stage: one("stage")?,
            score: score(&part.part("score")?)?,
        }),
        "keep-best" => Box::new(KeepBest {
            times: part.count("times")? as usize,
            stage: one("stage")?,
            score: score(&part.part("score")?)?,
        }),
        _ => return Err(part.unknown(PartKind::Stage)),
    })
}

fn each<T>(
    part: &Reader<'_>,
    field: &str,
    build: impl Fn(&Reader<'_>) -> Result<T, PipelineError>,
) -> Result<Vec<T>, PipelineError> {
    part.parts(field)?.iter().map(build).collect()
}

fn selection(part: &Reader<'_>) -> Result<Selection, PipelineError> {
    Ok(match part.name() {
        "all-samples" => Box::new(AllSamples),
        "visible-surface" => Box::new(VisibleSurface {
            stride: stride(part)?,
        }),
        _ => return Err(part.unknown(PartKind::Selection)),
    })
}

fn stride(part: &Reader<'_>) -> Result<Stride, PipelineError> {
    let (pixels, points) = (part.count("pixels")?, part.count("points")?);
    Ok(if pixels > 0 {
        Stride::Pixels(pixels)
    } else {
        Stride::AboutPoints(points as usize)
    })
}

fn association(part: &Reader<'_>) -> Result<Association, PipelineError> {
    Ok(match part.name() {
        "nearest-neighbor" => Box::new(NearestNeighbor {
            targets: stride(part)?,
        }),
        "projective" => Box::new(Projective),
        _ => return Err(part.unknown(PartKind::Association)),
    })
}

#[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
fn filter(part: &Reader<'_>) -> Result<Filter, PipelineError> {
    Ok(match part.name() {
        "max-distance" => {
            let limit = part.number("limit")? as f32;
            Box::new(match part.word("unit")? {
                "meters" => MaxDistance::meters(limit),
                _ => MaxDistance::diameters(limit),
            })
        }
        "max-normal-angle" => Box::new(MaxNormalAngle::degrees(part.number("degrees")? as f32)),
        _ => return Err(part.unknown(PartKind::Filter)),
    })
}

fn metric(part: &Reader<'_>) -> Result<Metric, PipelineError> {
    Ok(match part.name() {
        "point-to-point" => Box::new(PointToPoint),
        "point-to-plane" => Box::new(PointToPlane),
        _ => return Err(part.unknown(PartKind::Metric)),
    })
}

fn stop(part: &Reader<'_>) -> Result<Stop, PipelineError> {
    let motion = || {
        Ok((
            part.number("translation_meters")?,
            part.number("rotation_degrees")?,
        ))
    };
    Ok(match part.name() {
        "divergence" => Box::new(Divergence {
            pairs_lost: part.number("pairs_lost")?,
            loss_rule: match part.word("loss_rule")? {
                "count-aware" => LossRule::CountAware,
                _ => LossRule::Strict,
            },
            rise_tolerance: part.number("rise_tolerance")?,
        }),
        "convergence" => Box::new(Convergence {
            relative_change: part.number("relative_change")?,
            negligible_loss: part.number("negligible_loss")?,
        }),
        "absolute-loss" => Box::new(AbsoluteLoss {
            change: part.number("change")?,
            good_enough: part.number("good_enough")?,
        }),
        "motion" => {
            let (translation_meters, rotation_degrees) = motion()?;
            Box::new(Motion {
                translation_meters,
                rotation_degrees,
            })
        }
        "bound" => {
            let (translation_meters, rotation_degrees) = motion()?;
            Box::new(Bound {
                translation_meters,
                rotation_degrees,
            })
        }
        "oscillation" => {
            let (translation_meters, rotation_degrees) = motion()?;
            Box::new(Oscillation::new(translation_meters, rotation_degrees))
        }
        "iteration-limit" => Box::new(IterationLimit(part.count("iterations")? as usize)),
        "time-limit" => {
            let seconds = part.number("milliseconds")? / 1000.0;
            Box::new(TimeLimit::new(std::time::Duration::from_secs_f64(seconds)))
        }
        _ => return Err(part.unknown(PartKind::Stop)),
    })
}

fn score(part: &Reader<'_>) -> Result<BoxedScore, PipelineError> {
    Ok(match part.name() {
        "mve" => {
            let tolerance = part.number("occlusion_tolerance")?;
            Box::new(MeanVsd {
                occlusion_tolerance: tolerance.is_finite().then_some(tolerance),
            })
        }
        _ => return Err(part.unknown(PartKind::Score)),
    })
}

fn switcher(part: &Reader<'_>) -> Result<BoxedSwitcher, PipelineError> {
    Ok(match part.name() {
        "threshold" => Box::new(Threshold {
            score: score(&part.part("score")?)?,
            alpha: part.number("alpha")?,
        }),
        "thresholds" => Box::new(Thresholds {
            score: score(&part.part("score")?)?,
            bounds: part.numbers("bounds")?,
        }),
        _ => return Err(part.unknown(PartKind::Switcher)),
    })
}
