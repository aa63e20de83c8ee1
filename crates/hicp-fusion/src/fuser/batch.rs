//! Fusers that fuse all estimates at once: `average` and `weighted-average`.

use hicp_core::Matrix6;

use crate::estimate::PoseEstimate;
use crate::fuser::config::FuserConfig;
use crate::fuser::fuser_trait::{Fuser, Update};
use crate::fusion::Fusion;
use crate::motion::{CameraMotion, Transport};
use crate::solution::Solution;

/// The source of the weights of estimates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Weights {
    /// Equal weights, from the unit covariance.
    Constant,
    /// The inverse covariances of the estimates.
    Own,
}

/// Keeps every estimate and fuses all of them again with every update (§V-A).
///
/// `average` weighs the estimates equally; `weighted-average` uses their own covariances. In both
/// methods, the covariance of the result follows from those of the estimates. The covariance of a
/// camera motion is added to every held estimate. Its errors are the same in all of them, which
/// [`RecursiveFuser`](crate::RecursiveFuser) accounts for and this fuser does not.
///
/// Cost of an update: about 1 µs per held estimate, see [`Fusion`]. Memory: about 700 bytes per
/// estimate, up to the window.
#[derive(Clone, Debug)]
pub struct BatchFuser {
    config: FuserConfig,
    weights: Weights,
    /// The held estimates, in the anchor's frame.
    held: Vec<Held>,
    /// The fused estimate, in the current camera frame.
    fused: Option<PoseEstimate>,
    /// Invariant: its terms are those of `held`.
    fusion: Fusion,
    /// The motion from the anchor, the camera frame of the held estimates, to the current frame.
    ///
    /// Fusing is equivariant, so held estimates need not move with the camera.
    camera_from_anchor: CameraMotion,
}

/// An estimate, and the covariance that weighs it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Held {
    pub(crate) estimate: PoseEstimate,
    pub(crate) weight: Matrix6<f64>,
}

impl Held {
    /// Moves the estimate to the next camera frame.
    pub(crate) fn propagate(&mut self, motion: &CameraMotion, transport: Transport, of: Weights) {
        self.estimate = motion.carry(&self.estimate, transport);
        self.weight = match of {
            Weights::Own => self.estimate.covariance,
            Weights::Constant => motion.carry_weight(&self.weight, transport),
        };
    }
}

impl BatchFuser {
    /// Creates `average`: all estimates have equal weights, regardless of their covariances.
    #[must_use]
    pub fn average(config: FuserConfig) -> Self {
        Self::new(config, Weights::Constant)
    }

    /// Creates `weighted-average`: the covariances of the estimates weigh them.
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
            camera_from_anchor: CameraMotion::none(),
        }
    }

    /// Returns the number of held estimates.
    #[must_use]
    pub fn len(&self) -> usize {
        self.held.len()
    }

    /// Returns whether no estimate is held.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.held.is_empty()
    }

    /// Returns the motion from the current camera frame to the anchor's.
    fn anchor_from_camera(&self) -> CameraMotion {
        CameraMotion::exact(self.camera_from_anchor.next_camera_from_camera().inverse())
    }

    /// Fuses the held estimates, starting from the last fused one.
    fn fuse(&mut self, start: &PoseEstimate) -> Solution {
        let to_anchor = self.anchor_from_camera();
        let start = to_anchor.next_camera_from_camera() * start.camera_from_object;
        let Some(mut fused) = self.fusion.solve(&start) else {
            unreachable!("estimates are held, and the start is one of them or was fused from them")
        };
        if self.weights == Weights::Constant {
            let own = self.held.iter().map(|held| &held.estimate.covariance);
            fused.estimate.covariance = self.fusion.covariance_from(&fused.estimate, own);
        }
        let carried = self
            .camera_from_anchor
            .carry(&fused.estimate, Transport::Adjoint);
        self.fused = Some(carried);
        fused.solution
    }

    /// Moves all held estimates to the current camera frame.
    fn rebase(&mut self) {
        let motion = std::mem::replace(&mut self.camera_from_anchor, CameraMotion::none());
        for held in &mut self.held {
            held.estimate = motion.carry(&held.estimate, Transport::Adjoint);
            held.weight = motion.carry_weight(&held.weight, Transport::Adjoint);
        }
    }
}

impl Fuser for BatchFuser {
    fn propagate(&mut self, motion: &CameraMotion) {
        let transport = self.config.transport;
        self.fused = self.fused.map(|fused| motion.carry(&fused, transport));
        if transport == Transport::Adjoint && motion.covariance().is_none() {
            let camera_from_anchor = self.camera_from_anchor.next_camera_from_camera();
            self.camera_from_anchor = CameraMotion::exact(motion.apply(camera_from_anchor));
            return;
        }
        self.rebase();
        self.fusion.clear();
        for held in &mut self.held {
            held.propagate(motion, transport, self.weights);
            self.fusion
                .push_weighted(&held.estimate.camera_from_object, &held.weight);
        }
        // With the adjoint, the moved result equals the result of the moved estimates. Kept
        // covariances weigh differently in the new frame.
        if let (Transport::Kept, Some(start), 2..) = (transport, self.fused, self.held.len()) {
            self.fuse(&start);
        }
    }

    fn update(&mut self, estimate: &PoseEstimate) -> Update {
        let window = self.config.window;
        if window.is_some_and(|n| self.held.len() >= n.max(1)) {
            self.held.remove(0);
            self.fusion.remove_first();
        }
        let mut anchored = *estimate;
        if self.held.is_empty() {
            self.camera_from_anchor = CameraMotion::none();
        } else {
            anchored = self
                .anchor_from_camera()
                .carry(estimate, Transport::Adjoint);
        }
        let weight = match self.weights {
            Weights::Own => anchored.covariance,
            Weights::Constant => self.anchor_from_camera().carry_weight(
                &self.config.unit.at(&estimate.camera_from_object),
                Transport::Adjoint,
            ),
        };
        self.fusion
            .push_weighted(&anchored.camera_from_object, &weight);
        self.held.push(Held {
            estimate: anchored,
            weight,
        });
        match self.fused {
            Some(start) if self.held.len() > 1 => Update::Accepted(self.fuse(&start)),
            _ => {
                self.fused = Some(*estimate);
                Update::Accepted(Solution::NONE)
            }
        }
    }

    fn estimate(&self) -> Option<PoseEstimate> {
        self.fused
    }

    fn reset(&mut self) {
        self.held.clear();
        self.fusion.clear();
        self.fused = None;
        self.camera_from_anchor = CameraMotion::none();
    }

    fn name(&self) -> &'static str {
        match self.weights {
            Weights::Constant => "average",
            Weights::Own => "weighted-average",
        }
    }
}
