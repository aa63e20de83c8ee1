//! Fusers that fuse each estimate with the previous result: `filtering` and `filtering-constant`.

use crate::estimate::PoseEstimate;
use crate::fuser::batch::{Held, Weights};
use crate::fuser::config::FuserConfig;
use crate::fuser::fuser_trait::{Fuser, Update};
use crate::fusion::Fusion;
use crate::motion::CameraMotion;
use crate::solution::Solution;

/// Keeps one estimate and fuses each new one with it (§V-A).
///
/// `filtering-constant` gives every new estimate the unit covariance; `filtering` uses its own. The
/// pose differs from that of all estimates fused at once by terms of second order in their spread.
/// The covariance of a camera motion is added to the held estimate, so in `filtering` older
/// estimates lose weight relative to newer ones.
///
/// Cost of an update: that of fusing two estimates. Memory does not grow.
#[derive(Clone, Debug)]
pub struct RecursiveFuser {
    config: FuserConfig,
    weights: Weights,
    state: Option<Held>,
    fusion: Fusion,
}

impl RecursiveFuser {
    /// Creates `filtering-constant`: every new estimate has the unit covariance.
    #[must_use]
    pub fn filtering_constant(config: FuserConfig) -> Self {
        Self::new(config, Weights::Constant)
    }

    /// Creates `filtering`: every new estimate has its own covariance.
    #[must_use]
    pub fn filtering(config: FuserConfig) -> Self {
        Self::new(config, Weights::Own)
    }

    fn new(config: FuserConfig, weights: Weights) -> Self {
        Self {
            config,
            weights,
            state: None,
            fusion: Fusion::new(config.limits),
        }
    }
}

impl Fuser for RecursiveFuser {
    fn propagate(&mut self, motion: &CameraMotion) {
        if let Some(state) = &mut self.state {
            state.propagate(motion, self.config.transport, self.weights);
        }
    }

    fn update(&mut self, estimate: &PoseEstimate) -> Update {
        let weight = match self.weights {
            Weights::Own => estimate.covariance,
            Weights::Constant => self.config.unit.at(&estimate.camera_from_object),
        };
        let new = Held {
            estimate: *estimate,
            weight,
        };
        let Some(held) = self.state else {
            // Open: start of filtering: §V-A. The first estimate and its covariance are the first
            // state.
            self.state = Some(new);
            return Update::Accepted(Solution::NONE);
        };
        self.fusion.clear();
        for part in [&held, &new] {
            self.fusion
                .push_weighted(&part.estimate.camera_from_object, &part.weight);
        }
        let Some(mut fused) = self.fusion.solve(&held.estimate.camera_from_object) else {
            unreachable!("there are two estimates, and the held pose is finite")
        };
        let weight = fused.estimate.covariance;
        if self.weights == Weights::Constant {
            let own = [&held.estimate.covariance, &new.estimate.covariance];
            fused.estimate.covariance = self
                .fusion
                .covariance_from(&fused.estimate, own.into_iter());
        }
        self.state = Some(Held {
            estimate: fused.estimate,
            weight,
        });
        Update::Accepted(fused.solution)
    }

    fn estimate(&self) -> Option<PoseEstimate> {
        self.state.map(|state| state.estimate)
    }

    fn reset(&mut self) {
        self.state = None;
    }

    fn name(&self) -> &'static str {
        match self.weights {
            Weights::Constant => "filtering-constant",
            Weights::Own => "filtering",
        }
    }
}
