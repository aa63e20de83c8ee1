//! Refines the 6D pose of a known object in a depth image, and scores the result.
//!
//! A detector gives a segmentation mask and a rough pose. One call returns a better pose and the
//! probability that it is right.
//!
//! ```
//! use hybrid_icp::prelude::*;
//!
//! fn better(model: &Model, observation: &Observation, rough: &Isometry3<f64>) -> Option<Isometry3<f64>> {
//!     let refined = Refiner::preset(Preset::Auto).refine(model, observation, rough);
//!     let trusted = refined.confidence >= 0.95;
//!     trusted.then_some(refined.outcome.camera_from_object)
//! }
//! ```
//!
//! **Should you use this crate?** Yes: its modules are the crates below it, so one dependency is
//! enough. Depend on one of those alone if you write a component and want few dependencies.
//! `hicp-io` reads files (meshes, point clouds, images, BOP datasets).
//!
//! # Compose your own
//!
//! [`Preset`] lists the pipelines that ship. All of them are made of public parts. This is Hybrid
//! ICP (Dreczkowski & Johns), which selects the registration from the image:
//!
//! ```
//! use hybrid_icp::prelude::*;
//!
//! let stop = (Divergence::strict(), Convergence::default(), IterationLimit(50));
//! let visible = VisibleSurface::default();
//! let nearest = NearestNeighbor::default();
//! let far = Icp { selection: AllSamples, association: nearest, filter: (), metric: PointToPoint, stop };
//! let near = Cascade((
//!     Icp { selection: visible, association: Projective, filter: (), metric: PointToPoint, stop },
//!     Icp { selection: visible, association: Projective, filter: (), metric: PointToPlane, stop },
//! ));
//! let switcher = Threshold { score: MeanVsd::default(), alpha: 0.4 };
//! let hybrid = Repeat { times: 2, stage: Switch { switcher, aligned: near, misaligned: far } };
//! let refiner = Refiner::new(hybrid);
//! # let _ = refiner;
//! ```
//!
//! Components with scratch memory have private fields, so `..Default::default()` does not complete
//! them. Create them with `new` or `default` and set their public fields.
//!
//! # Components by role
//!
//! Every role is a trait. The last column names the example to copy for a custom component, in the
//! folder `examples` of this crate.
//!
//! | role | trait | what ships | example |
//! |---|---|---|---|
//! | points to register | [`PointSelection`](association::PointSelection) | [`AllSamples`](association::AllSamples), [`VisibleSurface`](association::VisibleSurface), [`VisibleSide`](association::VisibleSide), [`StableSampling`](association::StableSampling), … | `09_own_selection` |
//! | which points belong together | [`DataAssociation`](association::DataAssociation) | [`NearestNeighbor`](association::NearestNeighbor), [`Projective`](association::Projective), [`ObservationToModel`](association::ObservationToModel), [`RenderedSurface`](association::RenderedSurface), [`Contour`](association::Contour), … | `05_own_association` |
//! | which pairs count | [`OutlierFilter`](association::OutlierFilter) | [`MaxDistance`](association::MaxDistance), [`MaxNormalAngle`](association::MaxNormalAngle), [`Trimmed`](association::Trimmed), … | `10_own_filter` |
//! | error of a pair | [`ErrorMetric`](metric::ErrorMetric) | [`PointToPoint`](metric::PointToPoint), [`PointToPlane`](metric::PointToPlane), [`Symmetric`](metric::Symmetric), [`Generalized`](metric::Generalized), … | `06_own_metric` |
//! | step over all pairs | [`Minimize`](metric::Minimize) | [`Robust`](metric::Robust), [`PosePrior`](metric::PosePrior), [`LevenbergMarquardt`](metric::LevenbergMarquardt), … | |
//! | when a stage ends | [`StopRule`](icp::StopRule) | [`Divergence`](icp::Divergence), [`Convergence`](icp::Convergence), [`SmallMotion`](icp::SmallMotion), … | `07_own_stop_rule` |
//! | pose to better pose | [`Stage`](icp::Stage) | [`Icp`](icp::Icp), [`Cascade`](icp::Cascade), [`Repeat`](icp::Repeat), [`Guard`](icp::Guard), … | `12_own_stage` |
//! | how badly a pose fits (0 is perfect) | [`Score`](score::Score) | [`MeanVsd`](score::MeanVsd), [`SampledMve`](score::SampledMve), [`Vsd`](score::Vsd) | `11_own_score` |
//! | which stage runs | [`Switcher`](switch::Switcher) | [`Threshold`](switch::Threshold), [`Thresholds`](switch::Thresholds) | `08_own_switcher` |
//! | fusion of estimates | [`Fuser`](fusion::Fuser) | the paper's six methods ([`FusionMethod`](fusion::FusionMethod)), [`Gated`](fusion::Gated), … | `14_own_fuser` |
//! | depth of a model | [`Renderer`](core::Renderer) | [`Rasterizer`](raster::Rasterizer) | `13_own_renderer` |
//! | observes a run | [`Observer`](icp::Observer) | [`Trace`] | `04_observer` |
//!
//! With the feature `pipeline`, which is on by default, the module `pipeline` reads the same
//! compositions from TOML files. `hicp-testkit` checks custom components against the laws of their
//! trait.
//!
//! # Conventions
//!
//! Meters and radians. `camera_from_object` takes object coordinates to those of the camera.
//! Cameras look along +z with x right and y down. Pixel centers are at integers. [`nalgebra`] is
//! re-exported.

mod align;
mod batch;
mod calibration;
pub mod checks;
mod diagnosis;
mod extent;
mod preset;
pub mod presets;
mod refiner;
mod registered;
mod sequential;
mod trace;
mod tracker;
mod warning;

pub use hicp_association as association;
pub use hicp_core as core;
pub use hicp_core::nalgebra;
pub use hicp_fusion as fusion;
pub use hicp_icp as icp;
pub use hicp_metric as metric;
#[cfg(feature = "pipeline")]
pub use hicp_pipeline as pipeline;
pub use hicp_raster as raster;
pub use hicp_score as score;
pub use hicp_switch as switch;

pub use align::{
    Alignment, CloudOptions, CloudSide, CloudWarning, NormalCount, Registration, align, align_in,
};
pub use batch::refine_batch;
pub use calibration::Calibration;
pub use checks::{ACCEPTED, warnings};
pub use diagnosis::{Diagnosis, Fault, Finding};
pub use hicp_icp::BoxedStage;
pub use preset::Preset;
pub use refiner::{Refinement, Refiner};
pub use sequential::{
    MotionCheck, SequentialConfig, SequentialEstimator, SequentialEvent, SequentialStep,
    WithoutPairs,
};
pub use trace::{StageRecord, Trace};
pub use tracker::{TrackError, TrackState, Tracked, Tracker, TrackerConfig};
pub use warning::{CenterFault, Warning};

/// The names that refine a pose and compose the paper's pipeline: `use hybrid_icp::prelude::*;`.
///
/// Everything else is in the modules. Traits of custom components are in the modules of [their
/// roles](crate#components-by-role).
pub mod prelude {
    pub use crate::{Preset, Refinement, Refiner, presets};
    pub use hicp_association::{
        AllSamples, MaxDistance, NearestNeighbor, Projective, VisibleSurface,
    };
    pub use hicp_core::{
        DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Point3, TriMesh, Vector3,
    };
    pub use hicp_icp::{
        Cascade, Convergence, Divergence, Icp, IterationLimit, Repeat, SmallMotion,
    };
    pub use hicp_metric::{PointToPlane, PointToPoint};
    pub use hicp_score::MeanVsd;
    pub use hicp_switch::{Switch, Threshold};
}
