//! Refine 6D object poses in depth images.
//!
//! A detector gives a segmentation mask and a rough pose. [`Refiner`] returns a better pose and a score that says how well
//! it explains the image:
//!
//! ```
//! use hybrid_icp::prelude::*;
//! # fn one_call(model: Model, observation: Observation, init: Isometry3<f64>) {
//! let refined = Refiner::preset(Preset::Auto).refine(&model, &observation, &init);
//! if refined.mve < 0.3 && refined.warnings().is_empty() {
//!     println!("{}", refined.outcome.camera_from_object);
//! }
//! # }
//! ```
//!
//! **Should you use this crate?** Yes: its modules are the crates below it, so one dependency is enough. Depend on one of
//! those alone only if you write a component and want few dependencies. `hicp-io` reads files (meshes, PNGs, BOP datasets).
//!
//! | module | contents | custom component |
//! |---|---|---|
//! | [`core`] | poses, cameras, images, models, pairs; [`nalgebra`] is re-exported | `core::Renderer` |
//! | [`association`] | which points are paired, and which pairs are kept | `PointSelection`, `DataAssociation`, `OutlierFilter` |
//! | [`metric`] | what is minimized | `ErrorMetric`, `Minimize`, `RobustKernel` |
//! | [`icp`] | the loop, stop rules, stages made of stages | `Stage`, `StopRule`, `Observer` |
//! | [`score`] | how well a pose explains the image; BOP's errors | `Score` |
//! | [`switch`] | which stage runs | `Switcher` |
//! | [`fusion`] | estimates of a moving camera | `Fuser` |
//! | [`raster`] | the software renderer | |
//! | [`presets`] | the paper's pipelines and those beyond it | |
//! | `pipeline` | pipelines from TOML files (feature `pipeline`) | |
//!
//! Hybrid ICP (Dreczkowski & Johns), which chooses the registration from the image, is one configured pipeline:
//!
//! ```
//! use hybrid_icp::prelude::*;
//!
//! let stop = (Divergence::strict(), Convergence::default(), IterationLimit(50));
//! let visible = VisibleSurface::default();
//! let nearest = NearestNeighbor::default();
//! let hybrid = Repeat {
//!     times: 2,
//!     stage: Switch {
//!         switcher: Threshold { score: MeanVsd::default(), alpha: 0.4 },
//!         aligned: Cascade((
//!             Icp { selection: visible, association: Projective, filter: (), metric: PointToPoint, stop },
//!             Icp { selection: visible, association: Projective, filter: (), metric: PointToPlane, stop },
//!         )),
//!         misaligned: Icp { selection: AllSamples, association: nearest, filter: (), metric: PointToPoint, stop },
//!     },
//! };
//! let refiner = Refiner::new(hybrid);
//! # let _ = refiner;
//! ```
//!
//! Conventions: meters, radians; `camera_from_object` takes object coordinates to the camera's; cameras look along +z with x
//! right and y down; pixel centers are at integers.

mod calibration;
mod checks;
mod preset;
pub mod presets;
mod refiner;
mod sequential;
mod sequential_step;
mod trace;
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

pub use calibration::Calibration;
pub use checks::{
    EXPLAINS_NOTHING, warning_of_diameter, warning_of_distance, warnings, warnings_of_model,
    warnings_of_result,
};
pub use hicp_icp::BoxedStage;
pub use preset::{Preset, UnknownPreset};
pub use refiner::{Refinement, Refiner};
pub use sequential::SequentialEstimator;
pub use sequential_step::{SequentialConfig, SequentialEvent, SequentialStep};
pub use trace::{StageRecord, Trace};
pub use warning::Warning;

/// The names that most programs need: `use hybrid_icp::prelude::*;`.
///
/// Everything else is in the modules.
pub mod prelude {
    pub use crate::{Preset, Refinement, Refiner, presets};
    pub use hicp_association::{
        AllSamples, MaxDistance, MaxNormalAngle, NearestNeighbor, Projective, VisibleSurface,
    };
    pub use hicp_core::{
        DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Point3, Problem, TriMesh,
        Vector3,
    };
    pub use hicp_icp::{
        Cascade, Convergence, Divergence, Icp, IterationLimit, Repeat, SmallMotion, Stage,
        Termination, Verdict,
    };
    pub use hicp_metric::{ErrorMetric, Kernel, PointToPlane, PointToPoint, Robust};
    pub use hicp_score::{MeanVsd, Score};
    pub use hicp_switch::{Switch, Threshold};
}

/// Compiles the README's examples.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
