//! Ranges of numbers, with their units.

/// The numbers that a parameter accepts, both ends included, and their unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest number.
    pub min: f64,
    /// Largest number.
    pub max: f64,
    /// Unit for the catalog; empty for none.
    pub unit: &'static str,
}

impl Range {
    /// Creates a range from its ends and its unit.
    #[must_use]
    pub const fn new(min: f64, max: f64, unit: &'static str) -> Self {
        Self { min, max, unit }
    }

    /// Creates the range of the numbers from 0 to infinity, in a unit.
    #[must_use]
    pub const fn positive(unit: &'static str) -> Self {
        Self::new(0.0, f64::INFINITY, unit)
    }
}

/// Lengths from 0 to infinity, meters.
pub const METERS: Range = Range::positive("m");
/// Angles from 0 to infinity, degrees.
pub const DEGREES: Range = Range::positive("degrees");
/// Numbers without a unit, from 0 to infinity.
pub const FACTOR: Range = Range::positive("");
/// Shares from 0 to 1.
pub const SHARE: Range = Range::new(0.0, 1.0, "share");
