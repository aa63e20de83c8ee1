//! Fusing each estimate with what was fused before: `filtering` and `filtering-constant`.

use hicp_core::Matrix6;

use crate::batch::Weights;
use crate::config::FuserConfig;
use crate::estimate::PoseEstimate;
use crate::fuser::{Fuser, Update};
use crate::fusion::{Fusion, Solution};
use crate::motion::{CameraMotion, Carrier};

/// Keeps one estimate, and fuses each new one with it (§V-A): `filtering-constant` gives every new one the unit covariance,
/// `filtering` its own. Starts from the first estimate.
///
/// The pose differs from that of all estimates fused at once by terms of second order in their spread. A camera motion's
/// covariance adds to what is held as a whole, as it should: older estimates lose weight against newer ones in `filtering`.
///
/// Cost of an update: that of fusing two; memory does not grow.
#[derive(Clone, Debug)]
pub struct RecursiveFuser {
    config: FuserConfig,
    weights: Weights,
    state: Option<State>,
    fusion: Fusion,
}

#[derive(Clone, Copy, Debug)]
struct State {
    estimate: PoseEstimate,
    weight: Matrix6<f64>,
}

impl RecursiveFuser {
    /// Makes `filtering-constant`: every new estimate has the unit covariance.
    #[must_use]
    pub fn filtering_constant(config: FuserConfig) -> Self {
        Self::new(config, Weights::Constant)
    }

    /// Makes `filtering`: every new estimate has its own covariance.
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
        let carrier = Carrier::new(motion, self.config.transport);
        if let Some(state) = &mut self.state {
            carrier.estimate(&mut state.estimate);
            state.weight = match self.weights {
                Weights::Own => state.estimate.covariance,
                Weights::Constant => carrier.carried(&state.weight),
            };
        }
    }

    fn update(&mut self, estimate: &PoseEstimate) -> Update {
        let weight = match self.weights {
            Weights::Own => estimate.covariance,
            Weights::Constant => self.config.unit.at(&estimate.camera_from_object),
        };
        let new = State {
            estimate: *estimate,
            weight,
        };
        let Some(held) = self.state else {
            self.state = Some(new);
            return Update::Accepted(Solution::NONE);
        };
        self.fusion.clear();
        for part in [&held, &new] {
            self.fusion
                .push_weighted(&part.estimate.camera_from_object, &part.weight);
        }
        let Some(fused) = self.fusion.solve(&held.estimate.camera_from_object) else {
            return Update::Accepted(Solution::NONE);
        };
        let own = [&held.estimate.covariance, &new.estimate.covariance];
        self.state = Some(State {
            estimate: PoseEstimate {
                camera_from_object: fused.camera_from_object,
                covariance: match self.weights {
                    Weights::Own => fused.covariance,
                    Weights::Constant => self.fusion.covariance_from(&fused, own.into_iter()),
                },
                mve: None,
            },
            weight: fused.covariance,
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
