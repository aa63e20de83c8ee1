//! Refine 6D object poses in depth images.
//!
//! A detector gives a segmentation mask and a rough pose; [`Refiner`] makes it a better one and says how well it explains
//! the image. The default pipeline is Hybrid ICP (Dreczkowski & Johns), which looks at the image to decide how to register;
//! it and the eight classical variants it was compared with are [`Preset`]s, and every part they are made of is public.
//!
//! **Should you use this crate?** Yes: it re-exports the crates below it. Depend on one of those alone only if you write a
//! component and want few dependencies. Files (meshes, PNGs, BOP datasets) are read by `hicp-io`.
//!
//! Hybrid ICP is one configured pipeline:
//!
//! ```
//! use hybrid_icp::{
//!     AllSamples, Cascade, Convergence, Divergence, Icp, IterationLimit, MeanVsd, NearestNeighbor, PointToPlane,
//!     PointToPoint, Projective, Refiner, Repeat, Switch, Threshold, VisibleSurface,
//! };
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
//! Conventions: metres, radians; `camera_from_object` takes object coordinates to the camera's; cameras look along +z with x
//! right and y down; pixel centres are at integers.
//!
//! Start with [`presets`] (the pipelines), [`Refiner`] (one call), [`pipeline`] (files), [`fusion`] (a moving camera).

mod calibration;
mod checks;
mod preset;
pub mod presets;
mod refiner;
mod sequential;
mod sequential_step;
mod trace;
mod warning;

pub use calibration::Calibration;
pub use checks::{
    EXPLAINS_NOTHING, warning_of_diameter, warning_of_distance, warnings, warnings_of_model,
    warnings_of_result,
};
pub use hicp_association::{
    AllSamples, BoundaryTargets, ClosestPointOnMesh, ConstantWeight, DataAssociation,
    DistanceWeight, KNearest, Length, MadDistance, MaxDistance, MaxNormalAngle, MedianDistance,
    MinPairs, NearestNeighbor, NormalCompatible, NormalShooting, NormalSpace, NormalWeight,
    ObservationToModel, ObservedSurface, OneToOne, OutlierFilter, PointSelection, Projective,
    ProjectiveInterpolated, ProjectiveSearch, RandomSample, Reciprocal, Schedule, SearchIndex,
    SensorNoise, SensorNoiseWeight, StableSampling, Stride, Trimmed, UniformCount, VarTrimmed,
    VisibleSurface, VoxelGrid, WithoutBoundary,
};
#[doc(hidden)]
pub use hicp_core::internal;
pub use hicp_core::{
    CameraError, Context, Correspondences, DepthImage, Derived, DistanceImage, Facing, Id,
    ImageError, Isometry3, Iteration, MAX_SAMPLES, MAX_SYMMETRY_MOTIONS, Mask, Matrix3, Matrix6,
    MeshError, MeshSurvey, Model, ModelConfig, NO_TRIANGLE, Observation, Pair, PinholeCamera,
    PixelCenters, PixelRegion, Point2, Point3, Problem, RenderCache, RenderedView, Renderer,
    RigidTransform, RotationError, Surfel, Symmetries, SymmetryAxis, SymmetryError, Translation3,
    TriMesh, UnitQuaternion, UnitVector3, Vector3, Vector6, rotation_from_matrix, rotation_grid,
    se3, so3,
};
pub use hicp_fusion as fusion;
pub use hicp_icp::{
    AbsoluteLoss, Anderson, AtResolution, Bound, Cascade, Convergence, Deadline, Divergence,
    Evaluation, Guard, HypothesisSearch, Icp, IterationEvent, IterationLimit, Judgment, KeepBest,
    LossRule, Observer, Oscillation, Outcome, Progress, Quality, Regime, RegimeEvent, Repeat,
    Rotations, SearchOptions, Session, SmallMotion, Stage, StageEvent, StopRule, Termination,
    TimeLimit, Verdict, Workspace,
};
pub use hicp_metric::{
    Conditioned, Degeneracy, ErrorMetric, Frame, Frozen, GaussNewton, Generalized, Kernel,
    LevenbergMarquardt, MetricSchedule, Minimize, NormalEquations, Observability, PlaneToPoint,
    PointToPlane, PointToPoint, PosePrior, Prior, Robust, RobustKernel, Scale, Step, Symmetric,
    Terms, WeightedSum, sandwich_covariance,
};
#[cfg(feature = "pipeline")]
pub use hicp_pipeline::{self as pipeline, PipelineError, PipelineFile, PipelineLimits};
pub use hicp_raster::{Rasterizer, render_depth_image};
pub use hicp_score::{
    Flatness, LabeledScore, MeanVsd, ModelPoints, N_THRESHOLDS, N_TOLERANCES, Occlusion,
    PoseErrors, Recalls, ReliabilityBin, SampledMve, Score, ScoreError, TargetErrors,
    VISIBILITY_TOLERANCE_METERS, Vsd, add, adi, bop_vsd, match_instances, most_visible, mspd, mssd,
    reliability, roc_area, spheres_overlap, tolerances, top_estimates, visibility_masks, vsd,
};
pub use hicp_switch::{
    PAPER_ALPHA, Switch, SwitchAmong, SwitchUntilStall, Switcher, Threshold, Thresholds,
};
pub use preset::{BoxedStage, Preset, UnknownPreset};
pub use refiner::{Refinement, Refiner};
pub use sequential::SequentialEstimator;
pub use sequential_step::{SequentialConfig, SequentialEvent, SequentialStep};
pub use trace::{StageRecord, Trace};
pub use warning::Warning;

/// Compiles the README's examples.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
