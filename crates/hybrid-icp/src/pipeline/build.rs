//! From a tree to a pipeline: every field is read through the catalogue, which knows its range and its default.

use hicp_association::{
    AllSamples, BoundaryTargets, ClosestPointOnMesh, ConstantWeight, DataAssociation,
    DistanceWeight, KNearest, Length, MadDistance, MaxDistance, MaxNormalAngle, MedianDistance,
    MinPairs, NearestNeighbor, NormalCompatible, NormalShooting, NormalSpace, NormalWeight,
    ObservationToModel, ObservedSurface, OneToOne, OrganizedNearestNeighbor, OutlierFilter,
    PointSelection, Projective, ProjectiveInterpolated, ProjectiveSearch, RandomSample, Reciprocal,
    Schedule, SensorNoise, SensorNoiseWeight, StableSampling, Stride, Trimmed, UniformCount,
    VarTrimmed, VisibleSurface, VoxelGrid, WarmNearestNeighbor, WithoutBoundary,
};
use hicp_icp::{
    AbsoluteLoss, Anderson, AtResolution, Bound, Cascade, Convergence, Divergence, Guard,
    HypothesisSearch, Icp, IterationLimit, KeepBest, LossRule, Oscillation, Repeat, SmallMotion,
    StopRule, TimeLimit,
};
use hicp_metric::{
    Conditioned, Degeneracy, ErrorMetric, Frame, Frozen, GaussNewton, Generalized, Kernel,
    LevenbergMarquardt, MetricSchedule, PlaneToPoint, PointToPlane, PointToPoint, PosePrior, Prior,
    Robust, Scale, Symmetric, WeightedSum,
};
use hicp_score::{MeanVsd, SampledMve, Score};
use hicp_switch::{Switch, SwitchAmong, SwitchUntilStall, Switcher, Threshold, Thresholds};

use super::catalog::PartKind;
use super::error::PipelineError;
use super::reader::Reader;
use super::search::search_options;
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
        "alternate" => Box::new(SwitchUntilStall {
            score: score(&part.part("score")?)?,
            alpha: part.number("alpha")?,
            aligned: one("aligned")?,
            misaligned: one("misaligned")?,
            max_steps: part.count("max_steps")? as usize,
            min_gain: part.number("min_gain")?,
            good_enough: part.number("good_enough")?,
        }),
        "hypothesis-search" => Box::new(HypothesisSearch::new(
            one("stage")?,
            one("explore")?,
            score(&part.part("ranking")?)?,
            score(&part.part("score")?)?,
            search_options(part)?,
        )),
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
        "anderson" => Box::new(Anderson {
            stage: one("stage")?,
            max_steps: part.count("max_steps")? as usize,
            translation_meters: part.number("translation_meters")?,
            rotation_degrees: part.number("rotation_degrees")?,
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

#[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
fn selection(part: &Reader<'_>) -> Result<Selection, PipelineError> {
    let inner = || selection(&part.part("selection")?);
    Ok(match part.name() {
        "all-samples" => Box::new(AllSamples),
        "visible-surface" => Box::new(VisibleSurface {
            stride: stride(part)?,
        }),
        "observed-surface" => Box::new(ObservedSurface {
            stride: stride(part)?,
        }),
        "without-boundary" => Box::new(WithoutBoundary {
            inner: inner()?,
            width: part.count("width")?,
            max_tilt_degrees: part.number("max_tilt_degrees")? as f32,
        }),
        "uniform-count" => Box::new(UniformCount {
            inner: inner()?,
            count: part.count("count")? as usize,
        }),
        "random-sample" => Box::new(RandomSample {
            inner: inner()?,
            count: part.count("count")? as usize,
            seed: u64::from(part.count("seed")?),
        }),
        "voxel-grid" => Box::new(VoxelGrid::new(inner()?, length(part, "cell")?)),
        "normal-space" => Box::new(NormalSpace::new(
            inner()?,
            part.count("count")? as usize,
            part.count("resolution")? as usize,
        )),
        "stable-sampling" => Box::new(StableSampling::new(inner()?, part.count("count")? as usize)),
        _ => return Err(part.unknown(PartKind::Selection)),
    })
}

/// A length and the word that says what it counts in.
#[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
fn length(part: &Reader<'_>, field: &str) -> Result<Length, PipelineError> {
    let value = part.number(field)? as f32;
    Ok(match part.word("unit")? {
        "meters" => Length::Meters(value),
        _ => Length::Diameters(value),
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

#[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
fn association(part: &Reader<'_>) -> Result<Association, PipelineError> {
    Ok(match part.name() {
        "nearest-neighbor" => Box::new(NearestNeighbor {
            targets: stride(part)?,
        }),
        "warm-nearest-neighbor" => Box::new(WarmNearestNeighbor::new(stride(part)?)),
        "organized-nearest-neighbor" => Box::new(OrganizedNearestNeighbor::new(stride(part)?)),
        "projective" => Box::new(Projective),
        "k-nearest" => Box::new(KNearest::new(part.count("k")? as usize, stride(part)?)),
        "normal-compatible" => Box::new(NormalCompatible::new(
            part.number("max_angle_degrees")? as f32,
            part.count("k")? as usize,
            stride(part)?,
        )),
        "normal-shooting" => {
            let limited = part.number("max_offset")?.is_finite();
            let max_offset = limited.then(|| length(part, "max_offset")).transpose()?;
            // Read whether or not it counts, so that a wrong word is refused.
            part.word("unit")?;
            Box::new(NormalShooting::new(
                part.count("k")? as usize,
                max_offset,
                stride(part)?,
            ))
        }
        "reciprocal" => Box::new(Reciprocal::new(association(&part.part("association")?)?)),
        "projective-search" => Box::new(ProjectiveSearch {
            radius: part.count("radius")?,
        }),
        "projective-interpolated" => Box::new(ProjectiveInterpolated {
            max_step: part.number("max_step")? as f32,
        }),
        "observation-to-model" => Box::new(ObservationToModel {
            stride: stride(part)?,
            samples: part.count("samples")? as usize,
            visible_only: part.flag("visible_only")?,
        }),
        "closest-point-on-mesh" => Box::new(ClosestPointOnMesh {
            stride: stride(part)?,
            visible_only: part.flag("visible_only")?,
        }),
        _ => return Err(part.unknown(PartKind::Association)),
    })
}

#[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
fn filter(part: &Reader<'_>) -> Result<Filter, PipelineError> {
    Ok(match part.name() {
        "max-distance" => Box::new(MaxDistance::new(length(part, "limit")?)),
        "max-normal-angle" => Box::new(MaxNormalAngle::degrees(part.number("degrees")? as f32)),
        "median-distance" => Box::new(MedianDistance::new(part.number("factor")? as f32)),
        "mad-distance" => Box::new(MadDistance::new(
            part.number("factor")? as f32,
            part.number("floor_meters")? as f32,
        )),
        "trimmed" => Box::new(Trimmed::new(part.number("keep")? as f32)),
        "var-trimmed" => Box::new(VarTrimmed::new(
            part.number("min_keep")? as f32,
            part.number("max_keep")? as f32,
            part.number("lambda")? as f32,
        )),
        "one-to-one" => Box::new(OneToOne::default()),
        "boundary-targets" => Box::new(BoundaryTargets {
            width: part.count("width")?,
            max_tilt_degrees: part.number("max_tilt_degrees")? as f32,
        }),
        "min-pairs" => Box::new(MinPairs {
            count: part.count("count")? as usize,
        }),
        "constant-weight" => Box::new(ConstantWeight {
            weight: part.number("weight")? as f32,
        }),
        "distance-weight" => Box::new(DistanceWeight {
            max: length(part, "max")?,
        }),
        "normal-weight" => Box::new(NormalWeight),
        "sensor-noise-weight" => Box::new(SensorNoiseWeight {
            noise: SensorNoise {
                constant: part.number("constant")? as f32,
                linear: part.number("linear")? as f32,
                quadratic: part.number("quadratic")? as f32,
                tilt: part.number("tilt")? as f32,
            },
        }),
        "schedule" => Box::new(Schedule::new(each(part, "filters", filter)?)),
        _ => return Err(part.unknown(PartKind::Filter)),
    })
}

fn metric(part: &Reader<'_>) -> Result<Metric, PipelineError> {
    let inner = || metric(&part.part("metric")?);
    Ok(match part.name() {
        "point-to-point" => Box::new(PointToPoint),
        "point-to-plane" => Box::new(PointToPlane),
        "plane-to-point" => Box::new(PlaneToPoint),
        "symmetric" => Box::new(Symmetric),
        "generalized" => Box::new(Generalized {
            epsilon: part.number("epsilon")?,
        }),
        "weighted-sum" => {
            let metrics = each(part, "metrics", metric)?;
            let weights = part.numbers("weights")?;
            if weights.len() != metrics.len() || weights.iter().any(|w| *w < 0.0) {
                let expected = format!("{} numbers of 0 or more, one per metric", metrics.len());
                return Err(part.refuse("weights", expected));
            }
            Box::new(WeightedSum {
                terms: weights.into_iter().zip(metrics).collect::<Vec<_>>(),
            })
        }
        "robust" => {
            let meters = part.number("meters")?;
            let scale = match part.word("scale")? {
                "meters" => Scale::Meters(meters),
                _ => Scale::Mad {
                    floor_meters: meters,
                },
            };
            Box::new(Robust::new(inner()?, kernel(part)?, scale))
        }
        "pose-prior" => {
            let prior = Prior::AboutInitial {
                translation_meters: part.number("translation_meters")?,
                rotation_degrees: part.number("rotation_degrees")?,
            };
            Box::new(PosePrior::new(
                inner()?,
                prior,
                part.number("sigma_meters")?,
            ))
        }
        "metric-schedule" => Box::new(MetricSchedule::new(each(part, "metrics", metric)?)),
        "frozen" => Box::new(Frozen {
            metric: inner()?,
            frame: match part.word("frame")? {
                "object" => Frame::Object,
                _ => Frame::Camera,
            },
            translation: part.flags("translation")?,
            rotation: part.flags("rotation")?,
        }),
        "conditioned" => Box::new(Conditioned {
            metric: inner()?,
            policy: match part.word("policy")? {
                "damp" => Degeneracy::Damp,
                "refuse" => Degeneracy::Refuse,
                "ignore" => Degeneracy::Ignore,
                _ => Degeneracy::Freeze,
            },
            threshold: part.number("threshold")?,
        }),
        "gauss-newton" => {
            let mut solver = GaussNewton::new(inner()?);
            solver.max_iterations = part.count("iterations")? as usize;
            solver.tolerance = part.number("tolerance")?;
            Box::new(solver)
        }
        "levenberg-marquardt" => {
            let mut solver = LevenbergMarquardt::new(inner()?);
            solver.max_iterations = part.count("iterations")? as usize;
            solver.tolerance = part.number("tolerance")?;
            solver.initial_damping = part.number("initial_damping")?;
            Box::new(solver)
        }
        _ => return Err(part.unknown(PartKind::Metric)),
    })
}

fn kernel(part: &Reader<'_>) -> Result<Kernel, PipelineError> {
    let tuning = part.number("tuning")?;
    let own = |usual: Kernel, tuned: fn(f64) -> Kernel| {
        if tuning > 0.0 { tuned(tuning) } else { usual }
    };
    Ok(match part.word("kernel")? {
        "fair" => own(Kernel::FAIR, Kernel::Fair),
        "cauchy" => own(Kernel::CAUCHY, Kernel::Cauchy),
        "geman-mcclure" => own(Kernel::GEMAN_MCCLURE, Kernel::GemanMcClure),
        "welsch" => own(Kernel::WELSCH, Kernel::Welsch),
        "tukey" => own(Kernel::TUKEY, Kernel::Tukey),
        "l2" => Kernel::L2,
        _ => own(Kernel::HUBER, Kernel::Huber),
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
            Box::new(SmallMotion {
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
        "sampled-mve" => {
            let (samples, pixels) = (part.count("samples")?, part.count("pixels")?);
            let mut sampled = SampledMve::new(samples as usize, pixels as usize);
            sampled.occlusion_tolerance = part.number("occlusion_tolerance")?;
            Box::new(sampled)
        }
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
