//! The shapes of the household objects, meters, z up.

pub(crate) mod boxes;
pub(crate) mod tools;
pub(crate) mod vessels;
