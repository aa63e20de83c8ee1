//! Fusing all estimates at once: `average` and `weighted-average`.

use hicp_core::{Isometry3, Matrix6, se3};

use crate::config::FuserConfig;
use crate::estimate::{PoseEstimate, symmetrized};
use crate::fuser::{Fuser, Update};
use crate::fusion::{Fused, Fusion, Solution};
use crate::motion::{CameraMotion, Carrier, Transport};

/// By what estimates are weighed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Weights {
    /// All alike, by the unit covariance.
    Constant,
    /// By their own covariances.
    Own,
}

/// Keeps every estimate and fuses all of them anew with every update (§V-A): `average` with equal covariances,
/// `weighted-average` with those of the estimates.
///
/// The pose weighs by the method; the covariance that it reports follows from the estimates' own, in both methods. Those of a
/// camera motion are added to every estimate held; that they are the same errors is not accounted for ([`crate::RecursiveFuser`] does).
///
/// Cost of an update: about 1 µs per estimate held, see [`Fusion`]. Memory grows by some 700 bytes per estimate, up to the window.
#[derive(Clone, Debug)]
pub struct BatchFuser {
    config: FuserConfig,
    weights: Weights,
    /// In the anchor's frame.
    held: Vec<Held>,
    /// In the current camera frame.
    fused: Option<PoseEstimate>,
    /// Invariant: its terms are those of `held`.
    fusion: Fusion,
    /// From the camera frame in which the estimates are held: fusing is equivariant, so they need not move with the camera.
    camera_from_anchor: Isometry3<f64>,
}

#[derive(Clone, Copy, Debug)]
struct Held {
    estimate: PoseEstimate,
    weight: Matrix6<f64>,
}

impl BatchFuser {
    /// Makes `average`: estimates weigh alike, whatever their covariances.
    #[must_use]
    pub fn average(config: FuserConfig) -> Self {
        Self::new(config, Weights::Constant)
    }

    /// Makes `weighted-average`: estimates weigh by their covariances.
    #[must_use]
    pub fn weighted_average(config: FuserConfig) -> Self {
        Self::new(config, Weights::Own)
    }

    fn new(config: FuserConfig, weights: Weights) -> Self {
        Self {
            config,
            weights,
            held: Vec::new(),
            fused: None,
            fusion: Fusion::new(config.limits),
            camera_from_anchor: Isometry3::identity(),
        }
    }

    /// Number of estimates held.
    #[must_use]
    pub fn len(&self) -> usize {
        self.held.len()
    }

    /// Returns whether no estimate is held.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.held.is_empty()
    }

    /// Fuses what is held, from what was fused before.
    fn fuse(&mut self) -> Solution {
        let anchor_from_camera = self.camera_from_anchor.inverse();
        let Some(start) = self.fused.map(|fused| fused.camera_from_object) else {
            return Solution::NONE;
        };
        let Some(fused) = self.fusion.solve(&(anchor_from_camera * start)) else {
            return Solution::NONE;
        };
        let mut estimate = PoseEstimate {
            camera_from_object: fused.camera_from_object,
            covariance: self.covariance(&fused),
            mve: None,
        };
        carry(&mut estimate, &self.camera_from_anchor);
        self.fused = Some(estimate);
        fused.solution
    }

    fn push(&mut self, held: Held) {
        self.fusion
            .push_weighted(&held.estimate.camera_from_object, &held.weight);
        self.held.push(held);
    }

    /// Takes all that is held to the current camera frame.
    fn rebase(&mut self) {
        let motion = std::mem::replace(&mut self.camera_from_anchor, Isometry3::identity());
        let adjoint = se3::adjoint(&motion);
        for held in &mut self.held {
            carry(&mut held.estimate, &motion);
            held.weight = symmetrized(&(adjoint * held.weight * adjoint.transpose()));
        }
    }

    fn covariance(&self, fused: &Fused) -> Matrix6<f64> {
        match self.weights {
            Weights::Own => fused.covariance,
            Weights::Constant => {
                let own = self.held.iter().map(|held| &held.estimate.covariance);
                self.fusion.covariance_from(fused, own)
            }
        }
    }
}

impl Fuser for BatchFuser {
    fn propagate(&mut self, motion: &CameraMotion) {
        let carrier = Carrier::new(motion, self.config.transport);
        if let Some(fused) = &mut self.fused {
            carrier.estimate(fused);
        }
        if self.config.transport == Transport::Adjoint && motion.covariance().is_none() {
            self.camera_from_anchor = motion.apply(&self.camera_from_anchor);
            return;
        }
        self.rebase();
        self.fusion.clear();
        for held in &mut self.held {
            carrier.estimate(&mut held.estimate);
            held.weight = match self.weights {
                Weights::Own => held.estimate.covariance,
                Weights::Constant => carrier.carried(&held.weight),
            };
            self.fusion
                .push_weighted(&held.estimate.camera_from_object, &held.weight);
        }
        // Carried by the adjoint, what was fused is what would be; kept as they are, the covariances weigh otherwise here.
        if self.config.transport == Transport::Kept && self.held.len() > 1 {
            self.fuse();
        }
    }

    fn update(&mut self, estimate: &PoseEstimate) -> Update {
        if self
            .config
            .window
            .is_some_and(|n| self.held.len() >= n.max(1))
        {
            self.held.remove(0);
            self.fusion.remove_first();
        }
        let mut anchored = *estimate;
        if self.held.is_empty() {
            self.camera_from_anchor = Isometry3::identity();
        } else {
            carry(&mut anchored, &self.camera_from_anchor.inverse());
        }
        let weight = match self.weights {
            Weights::Own => anchored.covariance,
            Weights::Constant => {
                let weight = self.config.unit.at(&estimate.camera_from_object);
                let adjoint = se3::adjoint(&self.camera_from_anchor.inverse());
                symmetrized(&(adjoint * weight * adjoint.transpose()))
            }
        };
        self.push(Held {
            estimate: anchored,
            weight,
        });
        if self.held.len() == 1 {
            self.fused = Some(*estimate);
            return Update::Accepted(Solution::NONE);
        }
        Update::Accepted(self.fuse())
    }

    fn estimate(&self) -> Option<PoseEstimate> {
        self.fused
    }

    fn reset(&mut self) {
        self.held.clear();
        self.fusion.clear();
        self.fused = None;
        self.camera_from_anchor = Isometry3::identity();
    }

    fn name(&self) -> &'static str {
        match self.weights {
            Weights::Constant => "average",
            Weights::Own => "weighted-average",
        }
    }
}

/// Writes an estimate in the next frame.
fn carry(estimate: &mut PoseEstimate, next_from_this: &Isometry3<f64>) {
    let adjoint = se3::adjoint(next_from_this);
    estimate.camera_from_object = next_from_this * estimate.camera_from_object;
    estimate.camera_from_object.rotation.renormalize();
    estimate.covariance = symmetrized(&(adjoint * estimate.covariance * adjoint.transpose()));
}
