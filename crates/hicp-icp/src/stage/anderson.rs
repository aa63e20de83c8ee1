//! Anderson acceleration of a stage.

use std::time::Duration;

use hicp_core::{Isometry3, Problem, Vector6, se3};
use nalgebra::{Matrix5, Matrix6x5, Vector5};

use crate::outcome::{Outcome, Termination, Verdict};
use crate::session::Session;
use crate::stage::stage_trait::Stage;
use crate::stop::motion::object_motion;

/// Number of previous steps that determine an extrapolation.
const MEMORY: usize = 5;

/// Extrapolates the poses of a repeated stage (Anderson acceleration).
///
/// Sources: Anderson 1965; for ICP, Pavlov et al. 2018 and Zhang, Yao & Deng 2021. The stage is one
/// step of a fixed-point iteration T ↦ G(T): an ICP stage that ends after one increment, such as
/// one with `IterationLimit(2)`. Iterates u are twists ln(T T₀⁻¹) relative to the initial pose, and
/// f = G(u) − u are their residuals. The next start is the combination of the last six results G(u)
/// with the smallest residual. If the stage's mean loss is not lower after an extrapolation, the
/// plain iterate replaces it and the memory is cleared, so the loss never rises.
///
/// A step with `IterationLimit(2)` evaluates two poses and selects its points again. Plain
/// [`Icp`](crate::Icp) evaluates one pose per increment. Only an acceleration that halves the
/// number of steps therefore saves time. Point-to-point over nearest neighbors of all samples took
/// 120 steps instead of 132 to the same loss over six starts (`tests/tests/it/stages.rs`), but 240
/// evaluations instead of 138. Over the 19 instances of the YCB-Video excerpt, it took 496
/// evaluations instead of 372. If every step selects other points, the map is not smooth, and the
/// fallbacks cost more than the extrapolations gain.
///
/// Each step is a run of the stage. Its first iteration has index 0, its initial pose is that of
/// the step, and its clock starts again. This concerns `Schedule`, `MetricSchedule`,
/// `Prior::AboutInitial`, [`Bound`](crate::Bound) and [`TimeLimit`](crate::TimeLimit).
///
/// Cost: steps × the stage, and a 5×5 system per step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anderson<S> {
    /// One step: a stage that applies one increment.
    pub stage: S,
    /// Maximum number of steps.
    pub max_steps: usize,
    /// The iteration has converged if a step moves the object's center by less than this, meters …
    pub translation_meters: f64,
    /// … and rotates the object by less than this, degrees.
    pub rotation_degrees: f64,
}

impl<S> Anderson<S> {
    /// Creates the decorator with at most 50 steps and a tolerance of 10 µm and 0.001°.
    #[must_use]
    pub fn new(stage: S) -> Self {
        Self {
            stage,
            max_steps: 50,
            translation_meters: 1e-5,
            rotation_degrees: 1e-3,
        }
    }
}

impl<S: Stage> Stage for Anderson<S> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        let object_from_init = init.inverse();
        let twist = |pose: &Isometry3<f64>| se3::log(&(pose * object_from_init));
        let mut memory = Memory::default();
        // The last accepted plain iterate, and its loss.
        let mut best: Option<(Outcome, f64)> = None;
        let mut start = *init;
        let mut extrapolated = false;
        let mut iterations = 0;
        let mut termination = Termination::IterationLimit;
        for _ in 0..self.max_steps {
            let step = self.stage.run(problem, &start, session);
            iterations += step.iterations;
            let stopped = step.termination == Termination::Stopped;
            let ended = if stopped {
                Termination::Stopped
            } else {
                Termination::Converged
            };
            let loss = step.evaluation.map(|e| e.mean_loss);
            let improves = match (&best, loss) {
                (Some((_, before)), Some(now)) => now < *before,
                (None, _) => true,
                (Some(_), None) => false,
            };
            if !improves {
                let Some((plain, _)) = &best else { break };
                if stopped || !extrapolated {
                    termination = ended;
                    break;
                }
                // The extrapolation did not help: continue from the plain iterate, and clear the
                // memory that led to it.
                start = plain.camera_from_object;
                extrapolated = false;
                memory = Memory::default();
                continue;
            }
            let Some(loss) = loss.filter(|_| step.verdict == Verdict::Refined) else {
                termination = step.termination;
                best.get_or_insert((step, f64::INFINITY));
                break;
            };
            let (degrees, meters) = object_motion(problem, &step.camera_from_object, &start);
            let still = meters < self.translation_meters && degrees < self.rotation_degrees;
            let next = memory.extrapolate(&twist(&start), &twist(&step.camera_from_object));
            best = Some((step, loss));
            if stopped || still {
                termination = ended;
                break;
            }
            let next = se3::exp(&next) * init;
            extrapolated = se3::is_finite(&next);
            start = if extrapolated {
                next
            } else {
                step.camera_from_object
            };
        }
        match best {
            Some((outcome, _)) => Outcome {
                iterations,
                termination,
                verdict: if outcome.camera_from_object == *init {
                    Verdict::KeptInitial(termination)
                } else {
                    Verdict::Refined
                },
                ..outcome
            },
            None => Outcome::kept(init, termination),
        }
    }

    fn time_limit(&self) -> Option<Duration> {
        self.stage.time_limit()
    }

    fn name(&self) -> &'static str {
        "anderson"
    }
}

/// Differences of the last residuals and iterates; the newest overwrites the oldest.
#[derive(Default)]
struct Memory {
    last: Option<(Vector6<f64>, Vector6<f64>)>,
    residual_differences: Matrix6x5<f64>,
    iterate_differences: Matrix6x5<f64>,
    written: usize,
}

impl Memory {
    /// Stores u and g = G(u), and returns g − ΔG θ with θ = argmin ‖f − ΔF θ‖.
    fn extrapolate(&mut self, u: &Vector6<f64>, g: &Vector6<f64>) -> Vector6<f64> {
        let f = g - u;
        if let Some((last_f, last_g)) = self.last.replace((f, *g)) {
            let column = self.written % MEMORY;
            self.residual_differences.set_column(column, &(f - last_f));
            self.iterate_differences.set_column(column, &(g - last_g));
            self.written += 1;
        }
        let transposed = self.residual_differences.transpose();
        let normal = transposed * self.residual_differences;
        // Columns that were not written yet are zero; the ridge sets their coefficient to zero.
        let ridge = 1e-12 * normal.trace() + f64::MIN_POSITIVE;
        let theta: Option<Vector5<f64>> = (normal + Matrix5::identity() * ridge)
            .cholesky()
            .map(|c| c.solve(&(transposed * f)));
        theta.map_or(*g, |theta| g - self.iterate_differences * theta)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_iteration_is_solved_once_its_directions_are_observed() {
        // u ↦ A u + b in two directions: two differences determine the fixed point exactly.
        let step =
            |u: &Vector6<f64>| Vector6::new(0.9 * u[0] + 0.1, 0.5 * u[1] - 0.2, 0.0, 0.0, 0.0, 0.0);
        let mut memory = Memory::default();
        let mut u = Vector6::zeros();
        for _ in 0..3 {
            let g = step(&u);
            u = memory.extrapolate(&u, &g);
        }
        let fixed = Vector6::new(1.0, -0.4, 0.0, 0.0, 0.0, 0.0);
        assert!((u - fixed).norm() < 1e-6, "{u}");
    }
}
