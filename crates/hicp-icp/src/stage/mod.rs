//! Stages: generic ICP, and stages composed of stages.

pub(crate) mod anderson;
pub(crate) mod color;
pub(crate) mod compose;
pub(crate) mod descent;
pub(crate) mod guard;
pub(crate) mod icp;
pub(crate) mod ray_shift;
pub(crate) mod resolution;
pub(crate) mod search;
pub(crate) mod stage_trait;

pub use anderson::Anderson;
pub use color::choice::ColorChoice;
pub use compose::{Cascade, Repeat};
pub use descent::Descent;
pub use guard::{Guard, KeepBest};
pub use icp::{Icp, MAX_ITERATIONS};
pub use ray_shift::RayShift;
pub use resolution::AtResolution;
pub use search::distinct::is_near;
pub use search::hypotheses::Rotations;
pub use search::hypothesis_search::HypothesisSearch;
pub use search::look_alikes::LookAlikeCount;
pub use search::options::{SearchOptions, Start};
pub use stage_trait::{BoxedStage, Stage};
