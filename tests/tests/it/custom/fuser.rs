//! A custom fuser: covariance intersection, for estimates that share errors.

use hicp_sim::{Household, rng};
use hicp_testkit::{FuserLaws, check_fuser};
use hicp_tests::{camera, perturbed_scene, render};
use hybrid_icp::core::{Isometry3, Matrix6, Observation, Vector6, se3};
use hybrid_icp::fusion::{
    CameraMotion, Failure, Fuser, FuserConfig, Fusion, PoseEstimate, RecursiveFuser, Solution,
    Transport, Update,
};
use hybrid_icp::{Preset, SequentialConfig, SequentialEstimator, SequentialEvent};

// --- The component ---

/// Covariance intersection (Julier and Uhlmann 1997): correct for any correlation of the errors.
///
/// Errors of images along a path are correlated by the model, the calibration and the start of ICP.
///
/// The information is ω Σ_held⁻¹ + (1 − ω) Σ_new⁻¹ with the ω of five that gives the smallest det
/// Σ.
#[derive(Default)]
struct CovarianceIntersection {
    held: Option<PoseEstimate>,
    fusion: Fusion,
}

impl CovarianceIntersection {
    /// Returns both estimates fused, the held one with the share ω of the weight.
    fn mixed(
        &mut self,
        held: &PoseEstimate,
        new: &PoseEstimate,
        share: f64,
    ) -> Option<(PoseEstimate, Solution)> {
        self.fusion.clear();
        for (estimate, share) in [(held, share), (new, 1.0 - share)] {
            let weighted = estimate.covariance() / share;
            let weighted = PoseEstimate::new(*estimate.camera_from_object(), weighted);
            self.fusion.push(&weighted.ok()?);
        }
        let fused = self.fusion.solve(held.camera_from_object())?;
        Some((fused.estimate, fused.solution))
    }
}

impl Fuser for CovarianceIntersection {
    fn propagate(&mut self, motion: &CameraMotion) {
        self.held = self
            .held
            .map(|held| motion.carry(&held, Transport::Adjoint));
    }

    fn update(&mut self, estimate: &PoseEstimate) -> Update {
        let Some(held) = self.held else {
            self.held = Some(*estimate);
            return Update::Accepted(Solution::NONE);
        };
        let size = |estimate: &PoseEstimate| estimate.covariance().determinant();
        let mut best = (size(&held), None);
        let mixtures = [0.25, 0.5, 0.75].map(|share| self.mixed(&held, estimate, share));
        for candidate in [Some((*estimate, Solution::NONE))]
            .into_iter()
            .chain(mixtures)
            .flatten()
        {
            // The margin exceeds rounding, so that equal estimates leave the held one unchanged.
            if size(&candidate.0) < best.0 * (1.0 - 1e-9) {
                best = (size(&candidate.0), Some(candidate));
            }
        }
        match best.1 {
            Some((fused, solution)) => {
                self.held = Some(fused);
                Update::Accepted(solution)
            }
            None => Update::Rejected(Failure::Custom("adds nothing to the held estimate")),
        }
    }

    fn estimate(&self) -> Option<PoseEstimate> {
        self.held
    }

    fn reset(&mut self) {
        self.held = None;
    }

    fn name(&self) -> &'static str {
        "covariance-intersection"
    }
}

// --- Its tests ---

/// An estimate of a pose 0.5 m away with variances along x, along y, and of the rest.
fn seen(x: f64, y: f64, rest: f64) -> PoseEstimate {
    let variances = Vector6::new(x, y, rest, rest, rest, rest);
    let pose = Isometry3::translation(0.0, 0.0, 0.5);
    PoseEstimate::new(pose, Matrix6::from_diagonal(&variances)).unwrap()
}

#[test]
fn it_keeps_the_laws() {
    check_fuser(CovarianceIntersection::default, FuserLaws::default());
}

#[test]
fn two_certain_directions_become_one_estimate_with_twice_the_variance() {
    let mut fuser = CovarianceIntersection::default();
    fuser.update(&seen(1e-6, 1e-2, 1e-4));
    let update = fuser.update(&seen(1e-2, 1e-6, 1e-4));
    assert!(matches!(update, Update::Accepted(solution) if solution.converged));
    let fused = fuser.estimate().unwrap();
    for axis in 0..2 {
        let variance = fused.covariance()[(axis, axis)];
        assert!((variance / 2e-6 - 1.0).abs() < 1e-3, "{variance}");
    }
}

#[test]
fn the_same_estimate_again_is_no_new_evidence() {
    let estimate = seen(1e-4, 1e-4, 1e-4);
    let mut fuser = CovarianceIntersection::default();
    let mut filter = RecursiveFuser::filtering(FuserConfig::default());
    for image in 0..10 {
        filter.update(&estimate);
        let update = fuser.update(&estimate);
        assert_eq!(update.is_taken(), image == 0);
        if let Some(failure) = update.failure() {
            assert_eq!(failure.to_string(), "adds nothing to the held estimate");
        }
    }
    assert_eq!(fuser.estimate(), Some(estimate));
    // The filter treats the ten estimates as independent.
    let filtered = filter.estimate().unwrap().covariance()[(0, 0)];
    assert!((filtered / 1e-5 - 1.0).abs() < 1e-6, "{filtered}");
}

#[test]
fn the_sequential_estimator_runs_with_it() {
    let (scene, init) = perturbed_scene(Household::Iron, 0.5, &mut rng(5), (0.01, 0.1));
    let mut estimator = SequentialEstimator::new(
        Preset::Hybrid.build(),
        CovarianceIntersection::default(),
        SequentialConfig::default(),
        &init,
    )
    .unwrap();
    let motion =
        CameraMotion::new(se3::exp(&Vector6::new(0.01, 0.0, -0.01, 0.0, 0.02, 0.0))).unwrap();
    let mut truth = scene.truth;
    for image in 0..4 {
        let (depth, mask) = render(&scene.model, &camera(), &truth);
        let observation = Observation::new(depth, mask, camera()).unwrap();
        let moved = if image == 0 {
            CameraMotion::none()
        } else {
            motion
        };
        let step = estimator.step(&scene.model, &observation, &moved);
        assert!(matches!(step.event, SequentialEvent::Estimated(_)));
        let (angle, distance) = se3::pose_distance(&step.camera_from_object, &truth);
        assert!(
            angle < 0.01 && distance < 0.001,
            "{angle} rad, {distance} m"
        );
        truth = motion.apply(&truth);
    }
}
