//! Fusers: the trait, those of the paper, and fusers around a fuser.

pub(crate) mod batch;
pub(crate) mod config;
pub(crate) mod fuser_trait;
pub(crate) mod gate;
pub(crate) mod method;
pub(crate) mod recursive;
pub(crate) mod shared_error;
pub(crate) mod single;
pub(crate) mod symmetry_aware;

pub use batch::BatchFuser;
pub use config::FuserConfig;
pub use fuser_trait::{Failure, Fuser, Update};
pub use gate::{Gate, Gated};
pub use method::{BoxedFuser, FusionMethod, IntoFuser};
pub use recursive::RecursiveFuser;
pub use shared_error::SharedError;
pub use single::{LastEstimate, MostConfident};
pub use symmetry_aware::SymmetryAware;
