//! What is raised: the classes of `hybrid_icp._errors`, and the way there from the libraries' errors.

// The macro makes public types, in a module that is private.
#![allow(missing_docs, unreachable_pub)]

use std::error::Error;
use std::ffi::CString;

use pyo3::prelude::*;
use pyo3::types::PyType;

pyo3::import_exception!(hybrid_icp._errors, InputError);
pyo3::import_exception!(hybrid_icp._errors, FileError);
pyo3::import_exception!(hybrid_icp._errors, InputWarning);

/// An error about what was passed.
pub(crate) fn input(error: impl Error) -> PyErr {
    InputError::new_err(chain(&error))
}

/// An error about a file.
pub(crate) fn file(error: impl Error) -> PyErr {
    FileError::new_err(chain(&error))
}

/// Warns of what is well-formed but implausible.
pub(crate) fn warn(py: Python<'_>, message: &str) -> PyResult<()> {
    let category = PyType::new::<InputWarning>(py);
    // A message without a NUL, which these are, always makes a C string.
    let message = CString::new(message).unwrap_or_default();
    PyErr::warn(py, &category, &message, 1)
}

/// An error's message with those of its sources.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(error) = source {
        text.push_str(": ");
        text.push_str(&error.to_string());
        source = error.source();
    }
    text
}
