//! Parsers for the values of options, and names of files.

use std::path::Path;

/// Parses a finite number above 0.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    finite(text)
        .ok()
        .filter(|x| *x > 0.0)
        .ok_or_else(|| "expected a finite number above 0".to_owned())
}

/// Parses a finite number.
pub(crate) fn finite(text: &str) -> Result<f64, String> {
    let value: Option<f64> = text.parse().ok();
    value
        .filter(|x| x.is_finite())
        .ok_or_else(|| "expected a finite number".to_owned())
}

/// Returns the name of a file or a folder, for people.
pub(crate) fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}
