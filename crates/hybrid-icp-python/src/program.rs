//! The program `hybrid-icp`, for `python -m hybrid_icp`.

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the program with the words of its command line, and returns the exit code.
#[pyfunction]
pub(crate) fn run_program(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| hybrid_icp_cli::run(words))
}
