//! Normal equations and the quantities derived from them.

pub(crate) mod covariance;
pub(crate) mod degeneracy;
pub(crate) mod freedom;
mod held;
pub(crate) mod moments;
pub(crate) mod normal_equations;
pub(crate) mod observability;
pub(crate) mod pair_block;
pub(crate) mod point_blocks;
pub(crate) mod row_blocks;
pub(crate) mod row_sums;
pub(crate) mod solve;

pub use covariance::sandwich_covariance;
pub use degeneracy::Degeneracy;
pub use normal_equations::NormalEquations;
pub use observability::Observability;
