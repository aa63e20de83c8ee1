//! Checks of the code: its style, dependencies, memory and tests.

mod cycles;
pub(crate) mod fuzz;
pub(crate) mod licenses;
pub(crate) mod marks;
pub(crate) mod miri;
pub(crate) mod mutants;
mod prose;
pub(crate) mod tidy;
pub(crate) mod valgrind;
