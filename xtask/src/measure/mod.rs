//! Times, counts, instructions and studies.

pub(crate) mod bench;
pub(crate) mod counts;
pub(crate) mod instructions;
pub(crate) mod peers;
pub(crate) mod repro;
pub(crate) mod scale;
