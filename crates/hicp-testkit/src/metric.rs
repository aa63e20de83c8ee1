//! The laws of error metrics.

use hybrid_icp::core::{
    Correspondences, Isometry3, Iteration, Pair, Problem, RigidTransform, Surfel, Vector3, se3,
};
use hybrid_icp::metric::{ErrorMetric, Minimize, NO_ROWS, NormalEquations, Step};

use crate::law::{Subject, Trial};
use crate::pairs::{good_pairs, hard_pairs};

/// The laws that [`check_metric`] checks; all of them by default.
///
/// Some metrics cannot keep all laws:
///
/// - A metric with a fixed frame (a prior, a camera axis) does not keep `frame`.
/// - A metric with a fixed length (a known σ, a lower bound) does not keep `units`.
/// - A metric with ranks or medians does not keep `multiplicity`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MetricLaws {
    /// Pairs moved by a rigid motion A have the same loss, and the increment T becomes A·T·A⁻¹.
    pub frame: bool,
    /// The order of the pairs does not matter, up to rounding.
    pub order: bool,
    /// Lengths in another unit give the same motion in that unit, and a loss in its square.
    pub units: bool,
    /// A weight of two has the same effect as two pairs.
    pub multiplicity: bool,
    /// A tenth of the increment does not raise the mean loss.
    pub downhill: bool,
    /// `squared_error` is the sum of the squared rows of `linearize`, and `NO_ROWS` without rows.
    pub rows: bool,
}

impl Default for MetricLaws {
    fn default() -> Self {
        Self {
            frame: true,
            order: true,
            units: true,
            multiplicity: true,
            downhill: true,
            rows: true,
        }
    }
}

/// Checks an [`ErrorMetric`]; `make` creates a fresh one.
///
/// # Laws
///
/// The laws of [`check_minimize`], and `rows` of [`MetricLaws`].
///
/// # Panics
///
/// Panics if a law is broken, with the law, the input and the value found.
pub fn check_metric<T: ErrorMetric + 'static>(make: impl Fn() -> T, laws: MetricLaws) {
    if laws.rows {
        let subject = Subject::new::<T>(Some(make().name()));
        for set in good_pairs() {
            rows(&subject.on(&set.label), &make(), &set.pairs);
        }
    }
    check_minimize(make, laws);
}

/// Checks a [`Minimize`], for example a decorator around a metric; `make` creates a fresh one.
///
/// # Laws
///
/// - Pure: a fresh, a used and a boxed instance give the same bits in every method.
/// - Never panics, and never returns numbers that are not finite. Without pairs, with too few, and
///   with degenerate pairs or pairs that are not finite, `minimize`, `system` and `mean_loss`
///   return `None` or finite numbers.
/// - Losses are not negative. `minimize` reports the `mean_loss`.
/// - `system_and_loss` returns the bits of `system`, and `mean_loss` up to rounding.
/// - Keeps the laws of [`MetricLaws`] except `rows`.
///
/// # Panics
///
/// Panics if a law is broken, with the law, the input and the value found.
pub fn check_minimize<T: Minimize + 'static>(make: impl Fn() -> T, laws: MetricLaws) {
    let subject = Subject::new::<T>(Some(make().label()));
    let (mut used, mut boxed) = (make(), Box::new(make()) as Box<dyn Minimize>);
    let good = good_pairs().into_iter().map(|set| (set, true));
    for (set, good) in good.chain(hard_pairs().into_iter().map(|set| (set, false))) {
        let trial = subject.on(&set.label);
        let answer = |metric: &mut (dyn Minimize + 'static)| {
            Answers::of(metric, &Iteration::default(), &set.pairs)
        };
        let answers = trial.calm(|| answer(&mut make()));
        answers.are_finite(&trial);
        trial.pure::<dyn Minimize, _>(&answers, [&mut used, &mut boxed], answer);
        if let (Some(step), Some(loss)) = (&answers.step, answers.mean_loss) {
            trial.holds(
                "minimize reports the mean loss",
                close(step.mean_loss, loss, 1e-6),
                format_args!("{} from minimize, {loss} from mean_loss", step.mean_loss),
            );
        }
        if let Some((system, loss)) = trial.calm(|| {
            let pairs = &set.pairs;
            make().system_and_loss(&Iteration::default(), pairs)
        }) {
            trial.same(
                "system_and_loss returns the system",
                &answers.system,
                &Some(system),
            );
            let expected = answers.mean_loss;
            trial.holds(
                "system_and_loss returns the mean loss",
                expected.is_some_and(|expected| close(loss, expected, 1e-6)),
                format_args!("{loss} from system_and_loss, {expected:?} from mean_loss"),
            );
        }
        if good {
            let pairs = &set.pairs;
            Check { trial, pairs }.laws(&make, laws);
        }
    }
    subject.named([make().label(), used.label(), boxed.label()]);
}

/// Checks that a wrapper of a metric gives the same bits in every method, on all inputs of the kit.
///
/// Use it for wrappers that count, log or box. It detects provided methods that the wrapper does
/// not forward.
///
/// # Panics
///
/// Panics if a method is not forwarded, with the law, the input and the value found.
pub fn check_metric_forwards<A: Minimize, B: Minimize>(
    inner: impl Fn() -> A,
    wrapper: impl Fn() -> B,
) {
    let subject = Subject::new::<B>(Some(wrapper().label()));
    // A metric that depends on the initial pose shows whether it receives the iteration.
    let init = Isometry3::translation(0.01, 0.02, 0.5);
    let later = Iteration::new(1, &init, Problem::default());
    for set in good_pairs().into_iter().chain(hard_pairs()) {
        let trial = subject.on(&set.label);
        for iteration in [Iteration::default(), later] {
            let expected = Answers::of(&mut inner(), &iteration, &set.pairs);
            let found = trial.calm(|| Answers::of(&mut wrapper(), &iteration, &set.pairs));
            let law = "forwards every method to the wrapped metric";
            trial.same(law, &expected, &found);
        }
    }
}

/// The results of a metric for a set of pairs.
#[derive(Debug)]
struct Answers {
    step: Option<Step>,
    mean_loss: Option<f64>,
    system: Option<NormalEquations>,
    #[allow(dead_code)] // Compared by its text.
    squared_errors: Vec<f64>,
}

impl Answers {
    fn of(metric: &mut dyn Minimize, iteration: &Iteration<'_>, pairs: &Correspondences) -> Self {
        let mut squared_errors = vec![NO_ROWS; pairs.len()];
        metric.add_squared_errors(iteration, pairs, 1.0, &mut squared_errors);
        Self {
            squared_errors,
            step: metric.minimize(iteration, pairs),
            mean_loss: metric.mean_loss(iteration, pairs),
            system: metric.system(iteration, pairs),
        }
    }

    fn are_finite(&self, trial: &Trial<'_>) {
        if let Some(step) = &self.step {
            let law = "minimize returns None or a finite increment";
            let finite = se3::is_finite(&step.increment);
            trial.holds(law, finite, format_args!("{step:?}"));
        }
        let losses = [
            ("minimize", self.step.as_ref().map(|step| step.mean_loss)),
            ("mean_loss", self.mean_loss),
            ("system", self.system.as_ref().map(NormalEquations::loss)),
        ];
        for (method, loss) in losses {
            let valid = loss.is_none_or(|loss| loss.is_finite() && loss >= 0.0);
            let law = "the loss is finite and not negative";
            trial.holds(law, valid, format_args!("{loss:?} from {method}"));
        }
    }
}

/// A set of pairs that determine a step.
struct Check<'a> {
    trial: Trial<'a>,
    pairs: &'a Correspondences,
}

impl Check<'_> {
    fn laws<T: Minimize>(&self, make: &impl Fn() -> T, laws: MetricLaws) {
        let own = self.step(&mut make(), self.pairs);
        if laws.order {
            let reversed = self.with(self.pairs.as_slice().iter().rev().copied());
            let law = "the order of the pairs does not matter";
            self.equal(law, &own, &self.step(&mut make(), &reversed), 1e-6);
        }
        if laws.multiplicity {
            let third = |i: usize| i.is_multiple_of(3);
            let indexed = || self.pairs.as_slice().iter().copied().enumerate();
            let doubled = self.with(indexed().map(|(i, pair)| Pair {
                weight: pair.weight * if third(i) { 2.0 } else { 1.0 },
                ..pair
            }));
            let twice = self.with(
                indexed()
                    .flat_map(|(i, pair)| std::iter::repeat_n(pair, if third(i) { 2 } else { 1 })),
            );
            self.equal(
                "a weight of two has the same effect as two pairs",
                &self.step(&mut make(), &doubled),
                &self.step(&mut make(), &twice),
                1e-6,
            );
        }
        if laws.frame {
            let motion =
                Isometry3::new(Vector3::new(0.1, -0.2, 0.15), Vector3::new(0.4, -0.7, 0.9));
            let found = self.step(&mut make(), &self.moved(&motion, true));
            let expected = Step {
                increment: motion * own.increment * motion.inverse(),
                ..own
            };
            let law = "frame: moving all pairs by A keeps the loss and changes the increment T to A·T·A⁻¹";
            self.equal(law, &expected, &found, 1e-3);
        }
        if laws.units {
            // A power of two, so that the change of the unit is exact.
            let found = self.step(&mut make(), &self.scaled(1024.0));
            let mut expected = own;
            expected.mean_loss *= 1024.0 * 1024.0;
            expected.increment.translation.vector *= 1024.0;
            let law = "units: lengths times k give k times the translation, the same rotation and k² times the loss";
            self.equal(law, &expected, &found, 1e-6);
        }
        if laws.downhill {
            self.downhill(&mut make(), &own);
        }
    }

    fn step(&self, metric: &mut dyn Minimize, pairs: &Correspondences) -> Step {
        let minimize = || metric.minimize(&Iteration::default(), pairs);
        let step = self.trial.calm(minimize);
        let law = "well-determined pairs give a step";
        step.unwrap_or_else(|| self.trial.broken(law, "None"))
    }

    fn with(&self, pairs: impl Iterator<Item = Pair>) -> Correspondences {
        self.at(self.pairs.camera_from_object(), pairs)
    }

    fn at(&self, pose: &Isometry3<f64>, pairs: impl Iterator<Item = Pair>) -> Correspondences {
        let mut set = Correspondences::new();
        set.begin(pose, self.pairs.n_candidates());
        set.extend(pairs);
        set
    }

    /// Returns the pairs with the sources, and optionally the targets, moved in the camera frame.
    fn moved(&self, motion: &Isometry3<f64>, targets: bool) -> Correspondences {
        let mover = RigidTransform::new(motion);
        let pairs = self.pairs.as_slice().iter().map(|pair| Pair {
            source: mover.surfel(&pair.source),
            target: if targets {
                mover.surfel(&pair.target)
            } else {
                pair.target
            },
            ..*pair
        });
        self.at(&(motion * self.pairs.camera_from_object()), pairs)
    }

    fn scaled(&self, factor: f32) -> Correspondences {
        let surfel = |surfel: &Surfel| Surfel {
            point: surfel.point * factor,
            ..*surfel
        };
        let mut pose = *self.pairs.camera_from_object();
        pose.translation.vector *= f64::from(factor);
        let pairs = self.pairs.as_slice().iter().map(|pair| Pair {
            source: surfel(&pair.source),
            target: surfel(&pair.target),
            ..*pair
        });
        self.at(&pose, pairs)
    }

    /// Checks that two steps agree in loss and motion.
    ///
    /// Lengths are compared relative to the size of the motion.
    fn equal(&self, law: &str, expected: &Step, found: &Step, tolerance: f64) {
        let (angle, distance) = se3::pose_distance(&expected.increment, &found.increment);
        let scale = expected.increment.translation.vector.norm() + expected.mean_loss.sqrt();
        let agree = close(expected.mean_loss, found.mean_loss, tolerance)
            && angle <= tolerance
            && distance <= tolerance * (scale + f64::MIN_POSITIVE);
        let found = format_args!("{found:?}\n    not {expected:?}");
        self.trial.holds(law, agree, found);
    }

    fn downhill(&self, metric: &mut dyn Minimize, step: &Step) {
        let tenth = se3::exp(&(se3::log(&step.increment) * 0.1));
        let after = metric.mean_loss(&Iteration::default(), &self.moved(&tenth, false));
        let lower = after.is_some_and(|after| after <= step.mean_loss * (1.0 + 1e-4) + 1e-13);
        let law = "downhill: a tenth of the increment does not raise the mean loss";
        let found = format_args!("{after:?} after {}", step.mean_loss);
        self.trial.holds(law, lower, found);
    }
}

fn rows(trial: &Trial<'_>, metric: &dyn ErrorMetric, pairs: &Correspondences) {
    for pair in pairs.as_slice().iter().take(100) {
        let error = metric.squared_error(pair);
        for weight in [1.0, 2.0] {
            let mut rows = NormalEquations::new(pair.source.point.cast(), 1.0);
            metric.linearize(&Pair { weight, ..*pair }, &mut rows);
            trial.holds(
                "squared_error is NO_ROWS if and only if the pair adds no row",
                (error.to_bits() == NO_ROWS.to_bits()) == (rows.rows() == 0),
                format_args!(
                    "{} rows, a squared error of {error:?}, for {pair:?}",
                    rows.rows()
                ),
            );
            let rows = rows.loss();
            trial.holds(
                "squared_error is the sum of the squared rows, and rows carry the weight",
                close(rows, f64::from(weight) * error, 1e-6),
                format_args!(
                    "rows of {rows} at a weight of {weight}, a squared error of {error}, for {pair:?}"
                ),
            );
        }
    }
}

/// Returns whether two losses are equal up to rounding.
fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance * a.abs().max(b.abs()) + 1e-18
}
