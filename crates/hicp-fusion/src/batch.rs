//! Fusing all estimates at once: `average` and `weighted-average`.

use hicp_core::Matrix6;

use crate::config::FuserConfig;
use crate::estimate::PoseEstimate;
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
    held: Vec<Held>,
    fused: Option<PoseEstimate>,
    fusion: Fusion,
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
        let Some(last) = self.held.last().map(|held| held.estimate) else {
            return Solution::NONE;
        };
        if self.held.len() == 1 {
            self.fused = Some(last);
            return Solution::NONE;
        }
        self.fusion.clear();
        for held in &self.held {
            self.fusion
                .push_weighted(&held.estimate.camera_from_object, &held.weight);
        }
        let start = self.fused.unwrap_or(last).camera_from_object;
        let Some(fused) = self.fusion.solve(&start) else {
            return Solution::NONE;
        };
        self.fused = Some(PoseEstimate {
            camera_from_object: fused.camera_from_object,
            covariance: self.covariance(&fused),
            mve: None,
        });
        fused.solution
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
        for held in &mut self.held {
            carrier.estimate(&mut held.estimate);
            held.weight = match self.weights {
                Weights::Own => held.estimate.covariance,
                Weights::Constant => carrier.carried(&held.weight),
            };
        }
        if let Some(fused) = &mut self.fused {
            carrier.estimate(fused);
        }
        // Carried by the adjoint, what was fused is what would be; kept as they are, the covariances weigh otherwise here.
        if self.config.transport == Transport::Kept {
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
        }
        self.held.push(Held {
            estimate: *estimate,
            weight: match self.weights {
                Weights::Own => estimate.covariance,
                Weights::Constant => self.config.unit.at(&estimate.camera_from_object),
            },
        });
        Update::Accepted(self.fuse())
    }

    fn estimate(&self) -> Option<PoseEstimate> {
        self.fused
    }

    fn reset(&mut self) {
        self.held.clear();
        self.fused = None;
    }

    fn name(&self) -> &'static str {
        match self.weights {
            Weights::Constant => "average",
            Weights::Own => "weighted-average",
        }
    }
}
