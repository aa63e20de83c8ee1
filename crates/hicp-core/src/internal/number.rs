//! Numbers in messages.

/// Displays a number as people write it, with a power of ten instead of many digits.
pub(crate) struct Number(pub(crate) f64);

impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self(number) = self;
        match number.abs() {
            size if size != 0.0 && !(1e-9..1e15).contains(&size) => write!(f, "{number:e}"),
            _ => write!(f, "{number}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_exact() {
        for (number, written) in [
            (0.0, "0"),
            (-1066.778, "-1066.778"),
            (1e300, "1e300"),
            (1e15, "1e15"),
            (999_999_999_999_999.0, "999999999999999"),
            (5e-324, "5e-324"),
            (1e-9, "0.000000001"),
            (9.5e-10, "9.5e-10"),
            (f64::NAN, "NaN"),
            (f64::NEG_INFINITY, "-inf"),
        ] {
            assert_eq!(Number(number).to_string(), written);
        }
    }
}
