//! The trait of fusers.

use hicp_core::internal::type_label;
use thiserror::Error;

use crate::estimate::PoseEstimate;
use crate::motion::CameraMotion;
use crate::solution::Solution;

/// Fuses the estimates from a moving camera into one, in the current camera frame (§V).
///
/// A custom fuser moves what it holds with [`CameraMotion::carry`], and fuses with
/// [`Fusion`](crate::Fusion) or a custom method. It returns [`Solution::NONE`] if it solves
/// nothing, and [`Failure::Custom`] if it rejects an estimate. `hicp-testkit` checks the contract.
///
/// # Contract
///
/// - [`Fuser::propagate`] moves all held estimates to the next frame. [`Fuser::update`] accepts an
///   estimate in the current frame. [`Fuser::estimate`] returns the fused one there, or `None`
///   before the first update.
/// - After one accepted update, the fused estimate is that of the update, including its covariance
///   and MVE. Only a fuser that adds to covariances, such as [`SharedError`](crate::SharedError),
///   may differ.
/// - A fuser never panics and never returns numbers that are not finite. Estimates and motions are
///   checked on creation.
/// - Pure: equal calls since the last [`Fuser::reset`] give equal bits.
/// - A warm update (with as many estimates held before, and then reset) allocates nothing on the
///   heap.
///
/// ```
/// use hicp_fusion::{CameraMotion, Failure, Fuser, PoseEstimate, Solution, Transport, Update};
///
/// /// Keeps the estimate with the lowest MVE.
/// #[derive(Default)]
/// struct LowestMve(Option<PoseEstimate>);
///
/// impl Fuser for LowestMve {
///     fn propagate(&mut self, motion: &CameraMotion) {
///         self.0 = self.0.map(|held| motion.carry(&held, Transport::Adjoint));
///     }
///
///     fn update(&mut self, estimate: &PoseEstimate) -> Update {
///         let mve = |estimate: &PoseEstimate| estimate.mve().unwrap_or(1.0);
///         if self.0.is_some_and(|held| mve(&held) < mve(estimate)) {
///             return Update::Rejected(Failure::Custom("the held estimate has a lower MVE"));
///         }
///         self.0 = Some(*estimate);
///         Update::Accepted(Solution::NONE)
///     }
///
///     fn estimate(&self) -> Option<PoseEstimate> {
///         self.0
///     }
///
///     fn reset(&mut self) {
///         self.0 = None;
///     }
/// }
/// # let pose = hicp_core::Isometry3::translation(0.0, 0.0, 0.5);
/// # let seen = |mve| PoseEstimate::new(pose, hicp_core::Matrix6::identity())?.with_mve(mve);
/// # let mut fuser = LowestMve::default();
/// # assert!(fuser.update(&seen(0.1)?).is_taken());
/// # assert_eq!(fuser.update(&seen(0.2)?).failure().unwrap().to_string(), "the held estimate has a lower MVE");
/// # Ok::<(), hicp_fusion::FusionError>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a fuser",
    label = "this must implement `Fuser`",
    note = "`Fuser` is implemented by `BatchFuser`, `RecursiveFuser`, `LastEstimate`, `MostConfident`, by `Gated`, \
            `SymmetryAware` and `SharedError` around a fuser, and by the boxes that `FusionMethod::build` returns"
)]
pub trait Fuser {
    /// Moves all held estimates to the next camera frame.
    fn propagate(&mut self, motion: &CameraMotion);

    /// Fuses or rejects an estimate in the current camera frame.
    fn update(&mut self, estimate: &PoseEstimate) -> Update;

    /// Returns the fused estimate in the current camera frame.
    fn estimate(&self) -> Option<PoseEstimate>;

    /// Removes everything held and keeps the memory.
    fn reset(&mut self);

    /// Returns the name in traces and on the command line.
    fn name(&self) -> &'static str {
        type_label::<Self>()
    }
}

macro_rules! forward {
    ($($pointer:ty),*) => {$(
        impl<T: Fuser + ?Sized> Fuser for $pointer {
            fn propagate(&mut self, motion: &CameraMotion) {
                (**self).propagate(motion);
            }

            fn update(&mut self, estimate: &PoseEstimate) -> Update {
                (**self).update(estimate)
            }

            fn estimate(&self) -> Option<PoseEstimate> {
                (**self).estimate()
            }

            fn reset(&mut self) {
                (**self).reset();
            }

            fn name(&self) -> &'static str {
                (**self).name()
            }
        }
    )*};
}

forward!(Box<T>, &mut T);

/// The decision of a [`Fuser`] about an estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum Update {
    /// The estimate was fused.
    Accepted(Solution),
    /// The estimate failed a gate. It is kept until a better one arrives, because nothing else is
    /// held.
    Provisional(Failure, Solution),
    /// The estimate was not fused.
    Rejected(Failure),
    /// The estimate contradicts the held ones, as those before it did, which agree with it.
    ///
    /// Everything held was removed, and the estimate is the new start.
    Restarted(Failure, Solution),
}

impl Update {
    /// Returns the solution of the fusion, or `None` if the estimate was rejected.
    #[must_use]
    pub fn solution(&self) -> Option<&Solution> {
        match self {
            Self::Accepted(solution)
            | Self::Provisional(_, solution)
            | Self::Restarted(_, solution) => Some(solution),
            Self::Rejected(_) => None,
        }
    }

    /// Returns the reason of a failure, or `None` if the estimate was accepted.
    #[must_use]
    pub fn failure(&self) -> Option<&Failure> {
        match self {
            Self::Provisional(failure, _)
            | Self::Rejected(failure)
            | Self::Restarted(failure, _) => Some(failure),
            Self::Accepted(_) => None,
        }
    }

    /// Returns whether the estimate is held now.
    #[must_use]
    pub fn is_taken(&self) -> bool {
        self.solution().is_some()
    }

    /// Returns one word for reports: "accepted", "provisional", "rejected" or "restarted".
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Accepted(_) => "accepted",
            Self::Provisional(..) => "provisional",
            Self::Rejected(_) => "rejected",
            Self::Restarted(..) => "restarted",
        }
    }
}

/// The reason why an estimate failed.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum Failure {
    /// The pose does not explain its image: the MVE is too large.
    #[error("MVE {found:.3} above {limit}")]
    Mve {
        /// The MVE.
        found: f64,
        /// The largest MVE that passes.
        limit: f64,
    },
    /// The pose is too far from the held estimate, relative to both covariances.
    #[error("squared Mahalanobis distance {found:.1} above {limit:.1}")]
    Mahalanobis {
        /// The squared distance.
        found: f64,
        /// The largest squared distance that passes.
        limit: f64,
    },
    /// The reason of a custom fuser, in a few words for reports.
    #[error("{0}")]
    Custom(&'static str),
}
