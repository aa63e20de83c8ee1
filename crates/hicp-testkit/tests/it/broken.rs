//! Tests that components with one broken law are detected, and that the message names the law.

use std::panic::{AssertUnwindSafe, catch_unwind};

use hicp_testkit::{
    AssociationLaws, FilterLaws, MetricLaws, RendererLaws, ScoreLaws, StageLaws, StopRuleLaws,
    SwitcherLaws, check_association, check_filter, check_metric, check_metric_forwards,
    check_minimize, check_renderer, check_score, check_selection, check_stage, check_stop_rule,
    check_switcher,
};
use hybrid_icp::association::{DataAssociation, OutlierFilter, PointSelection, Projective};
use hybrid_icp::core::Iteration;
use hybrid_icp::core::{
    Context, Correspondences, Isometry3, Model, Observation, Pair, PinholeCamera, PixelRegion,
    Problem, RenderedView, Renderer, Surfel, TriMesh, Vector3,
};
use hybrid_icp::icp::Judgment;
use hybrid_icp::icp::{
    Outcome, Progress, Regime, RegimeEvent, Session, Stage, StopRule, Termination,
};
use hybrid_icp::metric::Minimize;
use hybrid_icp::metric::{ErrorMetric, NormalEquations, PointToPlane, PointToPoint, Step};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::Score;
use hybrid_icp::switch::Switcher;

/// Runs a check that must fail with a message that names the law.
fn caught(law: &str, check: impl FnOnce()) {
    let Err(payload) = catch_unwind(AssertUnwindSafe(check)) else {
        panic!("the check did not detect that {law:?} is broken");
    };
    let message = payload
        .downcast_ref::<String>()
        .expect("a message with the law, the input and the value found");
    assert!(message.contains(law), "expected {law:?} in: {message}");
    for part in ["breaks the law", "input: ", "found: "] {
        assert!(message.contains(part), "expected {part:?} in: {message}");
    }
}

/// The single fault of a metric.
#[derive(Clone, Copy)]
enum Fault {
    NanLoss,
    WrongSign,
    CameraAxis,
    ForgetsWeights,
    Panics,
    NotItsRows,
    Negative,
}

impl ErrorMetric for Fault {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        let (p, c) = (pair.source.point.cast(), pair.target.point.cast::<f64>());
        let weight = match self {
            Self::ForgetsWeights => 1.0,
            _ => f64::from(pair.weight),
        };
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let mut residual: f64 = axis.dot(&(p - c));
            if matches!(self, Self::WrongSign) {
                residual = -residual;
            }
            let depth = matches!(self, Self::CameraAxis) && axis.z == 1.0;
            system.add_row(
                &p,
                &axis,
                residual,
                if depth { weight * 9.0 } else { weight },
            );
        }
    }

    fn squared_error(&self, pair: &Pair) -> f64 {
        let mut rows = NormalEquations::new(pair.source.point.cast(), 1.0);
        self.linearize(
            &Pair {
                weight: 1.0,
                ..*pair
            },
            &mut rows,
        );
        rows.loss()
            * if matches!(self, Self::NotItsRows) {
                2.0
            } else {
                1.0
            }
    }

    fn step(&self, pairs: &Correspondences) -> Option<Step> {
        let increment = self.linearize_all(pairs)?.solve()?;
        let mut mean_loss = self.mean_squared_error(pairs)?;
        match self {
            Self::NanLoss => mean_loss = f64::NAN,
            Self::Negative => mean_loss = -1.0,
            Self::Panics => assert!(pairs.len() != 2, "two pairs"),
            _ => {}
        }
        Some(Step {
            increment,
            mean_loss,
        })
    }
}

#[test]
fn broken_metrics_are_detected() {
    let all = MetricLaws::default();
    for (law, fault) in [
        ("the loss is finite", Fault::NanLoss),
        ("the loss is finite and not negative", Fault::Negative),
        ("downhill", Fault::WrongSign),
        ("frame", Fault::CameraAxis),
        ("rows carry the weight", Fault::ForgetsWeights),
        ("never panics", Fault::Panics),
        ("squared_error", Fault::NotItsRows),
    ] {
        caught(law, || check_metric(|| fault, all));
    }
}

/// A decorator whose loss depends on the number of calls.
#[derive(Clone, Copy)]
struct Stateful(u32);

impl Minimize for Stateful {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        None
    }

    fn system(&mut self, _: &Iteration<'_>, pairs: &Correspondences) -> Option<NormalEquations> {
        PointToPlane.linearize_all(pairs)
    }

    fn mean_loss(&mut self, _: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        self.0 += 1;
        Some(PointToPlane.mean_squared_error(pairs)? * f64::from(self.0))
    }

    fn add_squared_errors(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
        factor: f64,
        errors: &mut [f64],
    ) {
        PointToPlane.add_squared_errors(iteration, pairs, factor, errors);
    }

    fn label(&self) -> &'static str {
        "stateful"
    }
}

#[test]
fn a_decorator_that_counts_its_calls_is_detected() {
    caught("pure", || {
        check_minimize(|| Stateful(0), MetricLaws::default());
    });
}

/// A wrapper that forwards the required methods but not the provided ones.
struct Unforwarded<M>(M);

impl<M: ErrorMetric> ErrorMetric for Unforwarded<M> {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        self.0.linearize(pair, system);
    }
}

#[test]
fn a_wrapper_that_forwards_no_provided_method_is_detected() {
    caught("forwards every method", || {
        check_metric_forwards(|| PointToPoint, || Unforwarded(PointToPoint));
    });
}

/// A selection that differs at each call or returns points that are not finite.
struct Sloppy {
    calls: usize,
    nan: bool,
}

impl PointSelection for Sloppy {
    fn select(
        &mut self,
        context: &mut Context<'_>,
        pose: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        let skip = self.calls;
        self.calls += 1;
        let samples = context.problem.model().map_or(&[][..], Model::samples);
        source.extend(samples.iter().skip(skip).take(9));
        if self.nan {
            source[0].point.x = pose.translation.x as f32 * f32::INFINITY;
        }
    }
}

#[test]
fn broken_selections_are_detected() {
    let sloppy = |nan| move || Sloppy { calls: 0, nan };
    caught("pure", || check_selection(sloppy(false)));
    caught("points are finite", || check_selection(sloppy(true)));
}

/// An association that changes the pairs of a correct association.
struct Spoilt(fn(&[Surfel], &mut Pair));

impl DataAssociation for Spoilt {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        pose: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        Projective.associate(context, source, pose, pairs);
        let change = self.0;
        pairs
            .as_mut_slice()
            .iter_mut()
            .for_each(|pair| change(source, pair));
    }
}

/// An association that removes pairs of other associations.
struct Clears;

impl DataAssociation for Clears {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        pose: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        pairs.retain(|_| false);
        Projective.associate(context, source, pose, pairs);
    }
}

/// An association that adds nothing to the pairs of others.
struct Continues;

impl DataAssociation for Continues {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        pose: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        if pairs.is_empty() {
            Projective.associate(context, source, pose, pairs);
        }
    }
}

#[test]
fn broken_associations_are_detected() {
    let laws = AssociationLaws::default();
    caught("moved by the pose", || {
        let unmoved = |source: &[Surfel], pair: &mut Pair| {
            pair.source = source[pair.source_index as usize];
        };
        check_association(|| Spoilt(unmoved), laws);
    });
    caught("not negative", || {
        check_association(|| Spoilt(|_, pair| pair.weight = -1.0), laws);
    });
    caught("source indices", || {
        check_association(|| Spoilt(|_, pair| pair.source_index += 10_000), laws);
    });
    caught("target indices", || {
        check_association(|| Spoilt(|_, pair| pair.target_index = u32::MAX), laws);
    });
    let computing = AssociationLaws {
        targets_are_the_observed: false,
        ..laws
    };
    caught("or unlisted", || {
        check_association(|| Spoilt(|_, pair| pair.target_index = 1 << 31), computing);
    });
    caught("observed surfels of their indices", || {
        check_association(|| Spoilt(|_, pair| pair.target.point.z += 0.01), laws);
    });
    caught("already there do not change", || {
        check_association(|| Clears, laws);
    });
    caught("change those that are added", || {
        check_association(|| Continues, laws);
    });
    caught("pairs are finite", || {
        check_association(|| Spoilt(|_, pair| pair.source.point.z /= 0.0), laws);
    });
}

/// A filter given by a function.
#[derive(Clone, Copy)]
struct By(fn(&mut Correspondences));

impl OutlierFilter for By {
    fn filter(&mut self, _iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        self.0(pairs);
    }
}

#[test]
fn broken_filters_are_detected() {
    let laws = FilterLaws::default();
    let spoils = |filter: fn(&mut Correspondences)| move || By(filter);
    caught("keeps their order", || {
        check_filter(spoils(|pairs| pairs.as_mut_slice().reverse()), laws);
    });
    caught("only removes", || {
        let moves = |pairs: &mut Correspondences| {
            for pair in pairs.as_mut_slice() {
                pair.target.point.x += 0.001;
            }
        };
        check_filter(spoils(moves), laws);
    });
    caught("not negative", || {
        let negates = |pairs: &mut Correspondences| {
            for pair in pairs.as_mut_slice() {
                pair.weight = -pair.weight - 1.0;
            }
        };
        check_filter(spoils(negates), laws);
    });
    let halves = |pairs: &mut Correspondences| {
        for pair in pairs.as_mut_slice() {
            pair.weight *= 0.5;
        }
    };
    caught("idempotent", || {
        let idempotent = FilterLaws {
            idempotent: true,
            ..laws
        };
        check_filter(spoils(halves), idempotent);
    });
    caught("weights do not change", || {
        let keeps_weights = FilterLaws {
            keeps_weights: true,
            ..laws
        };
        check_filter(spoils(halves), keeps_weights);
    });
    caught("never panics", || {
        check_filter(spoils(|pairs| assert!(!pairs.as_slice().is_empty())), laws);
    });
}

/// A filter that keeps fewer pairs with each iteration, based on a memory of earlier iterations.
struct Remembers {
    iterations: usize,
    remember: fn(usize, usize) -> usize,
}

impl OutlierFilter for Remembers {
    fn filter(&mut self, iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        self.iterations = (self.remember)(self.iterations, iteration.index);
        let limit = 0.05 / (1.0 + self.iterations as f32);
        pairs.retain(|pair| pair.distance() < limit);
    }
}

#[test]
fn filters_that_remember_earlier_iterations_are_detected() {
    let remembers = |remember| {
        move || Remembers {
            iterations: 0,
            remember,
        }
    };
    let law = "pure given the iteration";
    caught(law, || {
        let counts = |iterations, _| iterations + 1;
        check_filter(remembers(counts), FilterLaws::default());
    });
    caught(law, || {
        let never_back = |iterations: usize, iteration| iterations.max(iteration);
        check_filter(remembers(never_back), FilterLaws::default());
    });
    // Without the memory, the same filter is a schedule, which is correct.
    check_filter(remembers(|_, iteration| iteration), FilterLaws::default());
}

/// A rule that counts iterations and does not reset the count.
struct Forgets(usize);

impl StopRule for Forgets {
    fn check(&mut self, _iteration: &Iteration<'_>, _progress: &Progress<'_>) -> Judgment {
        self.0 += 1;
        if self.0 > 4 {
            Judgment::Accept(Termination::Converged)
        } else {
            Judgment::Continue
        }
    }
}

#[test]
fn a_stop_rule_that_does_not_reset_is_detected() {
    caught("start forgets", || {
        check_stop_rule(|| Forgets(0), StopRuleLaws::default());
    });
}

/// A score that is NaN if nothing is observed, or that renders another pose.
struct Share {
    elsewhere: bool,
}

impl Score for Share {
    fn score(&mut self, context: &mut Context<'_>, pose: &Isometry3<f64>) -> f64 {
        let n = context
            .problem
            .observation()
            .map_or(0, Observation::n_surfels) as f64;
        if self.elsewhere {
            context.view(&(Isometry3::translation(0.0, 0.0, 1e-9) * pose));
            return 0.5;
        }
        0.0 / n
    }
}

impl Switcher for Share {
    fn regime(&mut self, context: &mut Context<'_>, pose: &Isometry3<f64>) -> RegimeEvent {
        RegimeEvent {
            regime: Regime(if self.elsewhere { 2 } else { 0 }),
            score: Some(self.score(context, pose)),
        }
    }
}

#[test]
fn broken_scores_and_switchers_are_detected() {
    let share = |elsewhere| move || Share { elsewhere };
    let laws = ScoreLaws::default();
    caught("never NaN", || check_score(share(false), laws));
    caught("shares the render", || check_score(share(true), laws));
    let laws = SwitcherLaws::default();
    caught("never NaN", || check_switcher(share(false), laws));
    caught("regime", || check_switcher(share(true), laws));
}

/// A stage that loses the initial pose if nothing is observed, or returns a pose without
/// evaluation.
struct Rash {
    kept: bool,
}

impl Stage for Rash {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        _: &mut Session<'_>,
    ) -> Outcome {
        let nothing = problem
            .observation()
            .is_none_or(|seen| seen.n_surfels() == 0);
        let pose = match (self.kept, nothing) {
            (true, true) => Isometry3::identity(),
            (false, false) => Isometry3::translation(0.0, 0.0, 1e-3) * init,
            _ => *init,
        };
        if self.kept {
            Outcome::kept(&pose, Termination::NoPairs)
        } else {
            Outcome::refined(pose, Termination::NoPairs)
        }
    }
}

#[test]
fn broken_stages_are_detected() {
    let laws = StageLaws::default();
    caught("a kept pose", || check_stage(|| Rash { kept: true }, laws));
    caught("accept after evaluation", || {
        check_stage(|| Rash { kept: false }, laws);
    });
}

/// A renderer that sets a triangle for pixels without depth.
#[derive(Default)]
struct NoTriangles(Rasterizer);

impl Renderer for NoTriangles {
    fn render(
        &mut self,
        mesh: &TriMesh,
        camera: &PinholeCamera,
        pose: &Isometry3<f64>,
        region: &PixelRegion,
        view: &mut RenderedView,
    ) {
        self.0.render(mesh, camera, pose, region, view);
        view.buffers_mut().1.fill(0);
    }
}

#[test]
fn broken_renderers_are_detected() {
    caught("if and only if it has a triangle", || {
        check_renderer(NoTriangles::default, RendererLaws::default());
    });
}

/// Checks that the helpers of this file pass without a fault, so the faults themselves are
/// detected.
#[test]
fn components_without_a_fault_pass() {
    check_association(|| Spoilt(|_, _| ()), AssociationLaws::default());
    check_filter(|| By(|_| ()), FilterLaws::default());
    check_metric(|| Unforwarded(PointToPlane), MetricLaws::default());
}
