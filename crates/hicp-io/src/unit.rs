//! Units of length in files.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// The unit of the lengths in a file. Mesh formats do not state it, so callers must.
///
/// ```
/// use hicp_io::LengthUnit;
/// assert_eq!("mm".parse(), Ok(LengthUnit::Millimeters));
/// assert_eq!(LengthUnit::Centimeters.to_string(), "cm");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum LengthUnit {
    /// m: scans and robot descriptions.
    #[serde(rename = "m")]
    Meters,
    /// mm: CAD files, BOP models.
    #[serde(rename = "mm")]
    Millimeters,
    /// cm: some modeling programs.
    #[serde(rename = "cm")]
    Centimeters,
}

impl LengthUnit {
    /// Returns the length of one unit, in meters.
    #[must_use]
    pub fn meters_per_unit(self) -> f64 {
        1.0 / self.units_per_meter()
    }

    /// Returns the number of units in one meter.
    ///
    /// It is a whole number for every unit, so a conversion rounds only once.
    pub(crate) fn units_per_meter(self) -> f64 {
        match self {
            Self::Meters => 1.0,
            Self::Millimeters => 1000.0,
            Self::Centimeters => 100.0,
        }
    }
}

impl fmt::Display for LengthUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Meters => "m",
            Self::Millimeters => "mm",
            Self::Centimeters => "cm",
        })
    }
}

impl FromStr for LengthUnit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut units = [Self::Meters, Self::Millimeters, Self::Centimeters].into_iter();
        let named = units.find(|unit| unit.to_string() == text);
        named.ok_or_else(|| format!("unit is {text:?}, expected m, mm or cm"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_factors_agree() {
        for unit in [
            LengthUnit::Meters,
            LengthUnit::Millimeters,
            LengthUnit::Centimeters,
        ] {
            assert_eq!(unit.to_string().parse(), Ok(unit));
            assert_eq!(unit.meters_per_unit() * unit.units_per_meter(), 1.0);
        }
        assert_eq!(LengthUnit::Millimeters.meters_per_unit(), 0.001);
        assert_eq!(LengthUnit::Centimeters.meters_per_unit(), 0.01);
        let error = "inch".parse::<LengthUnit>().unwrap_err();
        assert_eq!(error, r#"unit is "inch", expected m, mm or cm"#);
    }
}
