//! Tests that every built-in component keeps the laws of its trait.

use std::time::{Duration, Instant};

use hicp_testkit::{
    AssociationLaws, FilterLaws, MetricLaws, RendererLaws, ScoreLaws, StageLaws, StopRuleLaws,
    SwitcherLaws, check_association, check_filter, check_metric, check_metric_forwards,
    check_minimize, check_renderer, check_score, check_selection, check_stage, check_stop_rule,
    check_switcher, scenes,
};
use hybrid_icp::Preset;
use hybrid_icp::association::{
    AllSamples, BoundaryTargets, ClosestPointOnMesh, ConstantWeight, Contour, DistanceWeight,
    KNearest, MadDistance, MaxDistance, MaxNormalAngle, MedianDistance, MinPairs, NearestNeighbor,
    NormalCompatible, NormalShooting, NormalSpace, NormalWeight, ObservationToModel,
    ObservedSurface, OneToOne, Projective, ProjectiveInterpolated, ProjectiveSearch, RandomSample,
    Reciprocal, RenderedSurface, Schedule, SearchIndex, SensorNoiseWeight, StableSampling, Stride,
    Trimmed, UniformCount, VarTrimmed, VisibleSide, VisibleSurface, VoxelGrid, WithoutBoundary,
};
use hybrid_icp::core::Matrix6;
use hybrid_icp::icp::{
    AbsoluteLoss, AtResolution, Bound, Convergence, Deadline, Descent, Divergence, Guard,
    IterationLimit, KeepBest, Oscillation, Regime, SmallMotion, TimeLimit,
};
use hybrid_icp::metric::{
    Conditioned, Degeneracy, ErrorMetric, Frame, Frozen, GaussNewton, Generalized, Kernel,
    LevenbergMarquardt, MetricSchedule, Minimize, PlaneToPoint, PointToPlane, PointToPoint,
    PosePrior, Prior, Robust, Scale, Symmetric, WeightedSum,
};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::{MeanVsd, SampledMve, Vsd};
use hybrid_icp::switch::{PAPER_ALPHA, SwitchUntilStall, Threshold, Thresholds};

#[test]
fn built_in_selections_keep_the_laws() {
    check_selection(|| AllSamples);
    check_selection(VisibleSurface::default);
    check_selection(|| VisibleSide { count: 200 });
    check_selection(ObservedSurface::default);
    check_selection(WithoutBoundary::default);
    check_selection(UniformCount::default);
    check_selection(RandomSample::default);
    check_selection(VoxelGrid::default);
    check_selection(NormalSpace::default);
    check_selection(StableSampling::default);
    check_selection(|| StableSampling::new(VisibleSurface::default(), 100));
    let normals = || NormalSpace::new(WithoutBoundary::default(), 80, 2);
    check_selection(|| StableSampling::new(normals(), 20));
}

#[test]
fn built_in_associations_keep_the_laws() {
    let strict = AssociationLaws::default();
    check_association(NearestNeighbor::default, strict);
    let k_d_tree = || NearestNeighbor::new(Stride::AboutPoints(4000), SearchIndex::KdTree);
    check_association(k_d_tree, strict);
    check_association(KNearest::default, strict);
    check_association(NormalCompatible::default, strict);
    check_association(NormalShooting::default, strict);
    check_association(|| Reciprocal::new(NearestNeighbor::default()), strict);
    check_association(|| Reciprocal::new(Projective), strict);
    check_association(|| Projective, strict);
    check_association(ProjectiveSearch::default, strict);
    let interpolating = AssociationLaws {
        targets_are_the_observed: false,
        ..strict
    };
    check_association(ProjectiveInterpolated::default, interpolating);
    check_association(
        || (Projective, Reciprocal::new(NearestNeighbor::default())),
        strict,
    );
    check_association(|| vec![Projective; 2], strict);
    let from_a_render = AssociationLaws {
        sources_are_the_selected: false,
        targets_are_the_observed: false,
    };
    check_association(RenderedSurface::default, from_a_render);
    check_association(Contour::default, from_a_render);
    check_association(
        || (RenderedSurface::default(), Contour::default()),
        from_a_render,
    );
    let from_the_observation = AssociationLaws {
        sources_are_the_selected: false,
        ..strict
    };
    check_association(ObservationToModel::default, from_the_observation);
    check_association(ClosestPointOnMesh::default, from_the_observation);
}

#[test]
fn built_in_filters_keep_the_laws() {
    let removes = FilterLaws {
        keeps_weights: true,
        idempotent: false,
    };
    let limits = FilterLaws {
        idempotent: true,
        ..removes
    };
    check_filter(|| (), limits);
    check_filter(|| None::<Trimmed>, limits);
    check_filter(|| MaxDistance::diameters(0.1), limits);
    check_filter(|| MaxNormalAngle::degrees(45.0), limits);
    check_filter(OneToOne::new, limits);
    check_filter(BoundaryTargets::default, limits);
    check_filter(MinPairs::default, limits);
    check_filter(MedianDistance::default, removes);
    check_filter(MadDistance::default, removes);
    check_filter(Trimmed::default, removes);
    check_filter(VarTrimmed::default, removes);
    let weighs = FilterLaws::default();
    check_filter(ConstantWeight::default, weighs);
    check_filter(DistanceWeight::default, weighs);
    check_filter(|| NormalWeight, weighs);
    check_filter(SensorNoiseWeight::default, weighs);
    let chain = || (MaxDistance::diameters(0.2), Trimmed::new(0.8), NormalWeight);
    check_filter(chain, weighs);
    check_filter(|| vec![Trimmed::new(0.8), Trimmed::new(0.5)], removes);
    let narrowing = || Schedule::new([0.5, 0.02, 0.3].map(MaxDistance::diameters).to_vec());
    check_filter(narrowing, limits);
    check_filter(|| (Schedule::new(vec![narrowing()]), NormalWeight), weighs);
}

#[test]
fn built_in_metrics_keep_the_laws() {
    let all = MetricLaws::default();
    check_metric(|| PointToPoint, all);
    check_metric(|| PointToPlane, all);
    check_metric(|| PlaneToPoint, all);
    check_metric(|| Symmetric, all);
    check_metric(Generalized::default, all);
    let sum = || WeightedSum {
        terms: ((1.0, PointToPlane), (0.1, PointToPoint)),
    };
    check_minimize(sum, all);
    check_minimize(
        || WeightedSum {
            terms: vec![(0.5, PointToPlane), (0.5, PointToPlane)],
        },
        all,
    );
}

#[test]
fn robust_metrics_keep_the_laws() {
    let all = MetricLaws::default();
    let known = MetricLaws {
        units: false,
        ..all
    };
    let median = MetricLaws {
        multiplicity: false,
        ..all
    };
    for kernel in [
        Kernel::L2,
        Kernel::HUBER,
        Kernel::FAIR,
        Kernel::CAUCHY,
        Kernel::GEMAN_MCCLURE,
        Kernel::WELSCH,
        Kernel::TUKEY,
    ] {
        check_minimize(
            || Robust::new(PointToPlane, kernel, Scale::Meters(0.003)),
            known,
        );
        let scale = Scale::Mad { floor_meters: 0.0 };
        check_minimize(|| Robust::new(PointToPoint, kernel, scale), median);
    }
    let known_median = MetricLaws {
        units: false,
        ..median
    };
    check_minimize(Robust::<PointToPoint>::default, known_median);
    let generalized = || Robust::new(Generalized::default(), Kernel::WELSCH, Scale::default());
    check_minimize(generalized, known_median);
}

#[test]
fn decorated_metrics_keep_the_laws() {
    let all = MetricLaws::default();
    for policy in [
        Degeneracy::Damp,
        Degeneracy::Freeze,
        Degeneracy::FreezeRotations,
        Degeneracy::FreezeUnexplained,
    ] {
        let conditioned = || Conditioned {
            metric: PointToPlane,
            policy,
            threshold: Degeneracy::THRESHOLD,
        };
        check_minimize(conditioned, all);
    }
    check_minimize(GaussNewton::<PointToPlane>::default, all);
    // `Symmetric` is not tested here. λ scales the diagonal of JᵀWJ, which depends on the axes. Far
    // from the minimum, the iteration limit ends the steps early, so they differ between frames.
    check_minimize(LevenbergMarquardt::<PointToPlane>::default, all);
    let nested = MetricLaws {
        frame: false,
        units: false,
        multiplicity: false,
        ..all
    };
    check_minimize(LevenbergMarquardt::<Robust<Generalized>>::default, nested);
    let frozen = |frame| Frozen {
        metric: PointToPlane,
        frame,
        translation: [false, true, false],
        rotation: [false, false, true],
    };
    check_minimize(|| frozen(Frame::Object), all);
    let fixed = MetricLaws {
        frame: false,
        ..all
    };
    check_minimize(|| frozen(Frame::Camera), fixed);
    let prior = || {
        let prior = Prior::Gaussian {
            camera_from_object: scenes()[0].truth,
            information: Matrix6::identity() * 1e4,
        };
        PosePrior::new(PointToPlane, prior, 1e-3)
    };
    check_minimize(
        prior,
        MetricLaws {
            units: false,
            ..fixed
        },
    );
}

#[test]
fn decorators_without_effect_forward_every_method() {
    check_metric_forwards(|| PointToPoint, Frozen::<PointToPoint>::default);
    check_metric_forwards(|| Symmetric, PosePrior::<Symmetric>::default);
    check_metric_forwards(|| Symmetric, || MetricSchedule::new(vec![Symmetric]));
    // A box that does not forward `minimize` uses Gauss–Newton instead of the closed form.
    check_metric_forwards(
        || PointToPoint,
        || Box::new(PointToPoint) as Box<dyn ErrorMetric>,
    );
    check_metric_forwards(|| Symmetric, || Box::new(Symmetric) as Box<dyn ErrorMetric>);
    let shared = || Box::new(PointToPoint) as Box<dyn Minimize + Send + Sync>;
    check_metric_forwards(|| PointToPoint, shared);
    let boxed = || Box::new(Generalized::default()) as Box<dyn Minimize>;
    check_metric_forwards(
        || Robust::new(Generalized::default(), Kernel::WELSCH, Scale::default()),
        || Robust::new(boxed(), Kernel::WELSCH, Scale::default()),
    );
}

#[test]
fn built_in_stop_rules_keep_the_laws() {
    let laws = StopRuleLaws::default();
    check_stop_rule(Divergence::strict, laws);
    check_stop_rule(Divergence::count_aware, laws);
    check_stop_rule(Convergence::default, laws);
    check_stop_rule(IterationLimit::default, laws);
    check_stop_rule(AbsoluteLoss::default, laws);
    check_stop_rule(SmallMotion::default, laws);
    check_stop_rule(Bound::default, laws);
    check_stop_rule(Oscillation::default, laws);
    check_stop_rule(
        || {
            (
                Oscillation::default(),
                Convergence::default(),
                IterationLimit(7),
            )
        },
        laws,
    );
    let clock = StopRuleLaws {
        deterministic: false,
    };
    check_stop_rule(|| TimeLimit::new(Duration::from_millis(5)), clock);
    let past = Instant::now();
    check_stop_rule(|| Deadline(past), laws);
}

#[test]
fn built_in_scores_and_switchers_keep_the_laws() {
    let share = ScoreLaws {
        worst: 1.0,
        ..ScoreLaws::default()
    };
    check_score(MeanVsd::default, share);
    check_score(MeanVsd::paper, share);
    check_score(SampledMve::default, share);
    check_score(|| SampledMve::new(300, 150), share);
    let truth = scenes()[0].truth;
    check_score(
        || Vsd::new(truth),
        ScoreLaws {
            ranks_poses: false,
            extra_renders: 1,
            ..share
        },
    );
    let two = SwitcherLaws::default();
    let threshold = || Threshold {
        score: MeanVsd::default(),
        alpha: PAPER_ALPHA,
    };
    check_switcher(threshold, two);
    check_switcher(|| Regime::ALIGNED, two);
    let thresholds = || Thresholds {
        score: MeanVsd::default(),
        bounds: vec![0.2, 0.6],
    };
    check_switcher(thresholds, SwitcherLaws { regimes: 3, ..two });
}

#[test]
fn built_in_stages_keep_the_laws() {
    let laws = StageLaws::default();
    for preset in Preset::ALL {
        check_stage(|| preset.build(), laws);
    }
    let fine = || Preset::ProjectivePointToPlane.build();
    check_stage(
        || Guard {
            stage: fine(),
            score: MeanVsd::default(),
        },
        laws,
    );
    check_stage(
        || Descent {
            good_enough: 0.0,
            ..Descent::<MeanVsd>::default()
        },
        StageLaws {
            tells_the_observer: false,
        },
    );
    check_stage(
        || KeepBest {
            times: 3,
            stage: fine(),
            score: MeanVsd::default(),
        },
        laws,
    );
    check_stage(
        || SwitchUntilStall {
            switcher: Threshold {
                score: MeanVsd::default(),
                alpha: 0.4,
            },
            aligned: fine(),
            misaligned: Preset::NnPointToPoint.build(),
            max_steps: 3,
            min_gain: 0.01,
            good_enough: 0.02,
        },
        laws,
    );
    check_stage(
        || AtResolution {
            factor: 2,
            stage: fine(),
        },
        laws,
    );
}

#[test]
fn the_rasterizer_keeps_the_laws() {
    check_renderer(Rasterizer::default, RendererLaws::default());
}
