//! Random estimates, the same in every run.

pub(crate) use crate::support::Numbers as Random;

use hicp_core::{Isometry3, Matrix6, Point3, Vector6, se3};
use hicp_fusion::{Fused, Fuser, FuserConfig, Fusion, FusionLimits, PoseEstimate, UnitCovariance};

impl Random {
    /// Returns a number, uniform in −1…1.
    pub(crate) fn uniform(&mut self) -> f64 {
        self.between(-1.0, 1.0)
    }

    pub(crate) fn twist(&mut self, size: f64) -> Vector6<f64> {
        Vector6::from_fn(|_, _| size * self.uniform())
    }

    pub(crate) fn motion(&mut self, size: f64) -> Isometry3<f64> {
        se3::exp(&self.twist(size))
    }

    /// Returns a full covariance with standard deviations of about `size`.
    pub(crate) fn covariance(&mut self, size: f64) -> Matrix6<f64> {
        let root = Matrix6::from_fn(|_, _| self.uniform());
        (root * root.transpose() + Matrix6::identity() * 0.1) * (size * size)
    }

    /// Returns estimates scattered around a pose.
    pub(crate) fn estimates(&mut self, count: usize, spread: f64) -> Vec<PoseEstimate> {
        let center = self.motion(1.0);
        (0..count)
            .map(|_| {
                let pose = se3::exp(&self.twist(spread)) * center;
                estimate(pose, self.covariance(spread))
            })
            .collect()
    }
}

pub(crate) fn estimate(pose: Isometry3<f64>, covariance: Matrix6<f64>) -> PoseEstimate {
    PoseEstimate::new(pose, covariance).expect("valid")
}

/// Limits at which the iteration reaches its last digits.
pub(crate) const EXACT: FusionLimits = FusionLimits {
    max_iterations: 100,
    tolerance: 1e-14,
};

pub(crate) fn fusion(estimates: &[PoseEstimate], limits: FusionLimits) -> Fusion {
    let mut fusion = Fusion::new(limits);
    for estimate in estimates {
        fusion.push(estimate);
    }
    fusion
}

pub(crate) fn fused(estimates: &[PoseEstimate]) -> Fused {
    let fusion = fusion(estimates, EXACT);
    let fused = fusion
        .solve(estimates[0].camera_from_object())
        .expect("not empty");
    assert!(fused.solution.converged, "{fused:?}");
    fused
}

/// Returns |ln(A B⁻¹)|.
pub(crate) fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    se3::log(&(a * b.inverse())).norm()
}

/// Returns the largest difference of two matrices, relative to the largest entry.
pub(crate) fn relative(found: &Matrix6<f64>, expected: &Matrix6<f64>) -> f64 {
    (found - expected).amax() / expected.amax()
}

/// Returns a configuration whose solutions are exact to rounding, for an object of 8 cm.
pub(crate) fn exact() -> FuserConfig {
    FuserConfig {
        limits: EXACT,
        unit: UnitCovariance::about_object(Point3::new(0.01, 0.0, -0.02), 0.08).unwrap(),
        ..FuserConfig::default()
    }
}

/// Passes estimates to a fuser and returns its estimate. Every update must converge.
pub(crate) fn run(fuser: &mut dyn Fuser, estimates: &[PoseEstimate]) -> PoseEstimate {
    for estimate in estimates {
        let update = fuser.update(estimate);
        assert!(update.solution().unwrap().converged, "{update:?}");
    }
    fuser.estimate().unwrap()
}
