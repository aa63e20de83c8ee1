//! The exceptions of `hybrid_icp._errors`, created from the errors of the libraries.

// The macro creates public types in a private module.
#![allow(missing_docs, unreachable_pub)]

use std::error::Error;
use std::ffi::CString;

use hicp_bop::chain;
use pyo3::prelude::*;
use pyo3::types::PyType;

pyo3::import_exception!(hybrid_icp._errors, InputError);
pyo3::import_exception!(hybrid_icp._errors, FileError);
pyo3::import_exception!(hybrid_icp._errors, InputWarning);

/// Creates an error about an argument.
pub(crate) fn input(error: impl Error) -> PyErr {
    InputError::new_err(chain(&error))
}

/// Creates an error about a file.
pub(crate) fn file(error: impl Error) -> PyErr {
    FileError::new_err(chain(&error))
}

/// Warns about input that is well-formed but implausible.
pub(crate) fn warn(py: Python<'_>, message: &str) -> PyResult<()> {
    let category = PyType::new::<InputWarning>(py);
    PyErr::warn(py, &category, &CString::new(message)?, 1)
}
