//! Parsers for the values of options.

/// Parses a finite number above 0.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    let value: Option<f64> = text.parse().ok();
    value
        .filter(|x| x.is_finite() && *x > 0.0)
        .ok_or_else(|| "expected a finite number above 0".to_owned())
}

/// Parses a finite number.
pub(crate) fn finite(text: &str) -> Result<f64, String> {
    let value: Option<f64> = text.parse().ok();
    value
        .filter(|x| x.is_finite())
        .ok_or_else(|| "expected a finite number".to_owned())
}
