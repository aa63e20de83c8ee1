//! Numbers for parallel arithmetic.

use std::ops::{Add, Mul, Sub};

/// Several numbers; each operation applies to all of them, a pattern that compilers vectorize.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lanes<const N: usize>(pub(super) [f64; N]);

impl<const N: usize> Lanes<N> {
    #[inline(always)]
    pub(super) fn all(number: f64) -> Self {
        Self([number; N])
    }

    /// Converts integers.
    #[inline(always)]
    pub(super) fn of(integers: [i32; N]) -> Self {
        let mut lanes = [0.0; N];
        for (lane, integer) in lanes.iter_mut().zip(integers) {
            *lane = f64::from(integer);
        }
        Self(lanes)
    }

    #[inline(always)]
    pub(super) fn map(mut self, operation: impl Fn(f64) -> f64) -> Self {
        for lane in &mut self.0 {
            *lane = operation(*lane);
        }
        self
    }

    /// Converts to single precision.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)]
    pub(super) fn single(self) -> [f32; N] {
        let mut lanes = [0.0; N];
        for (lane, number) in lanes.iter_mut().zip(self.0) {
            *lane = number as f32;
        }
        lanes
    }

    #[inline(always)]
    fn with(mut self, other: Self, operation: impl Fn(f64, f64) -> f64) -> Self {
        for (lane, other) in self.0.iter_mut().zip(other.0) {
            *lane = operation(*lane, other);
        }
        self
    }
}

impl<const N: usize> Add for Lanes<N> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(other, |a, b| a + b)
    }
}

impl<const N: usize> Sub for Lanes<N> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(other, |a, b| a - b)
    }
}

impl<const N: usize> Mul for Lanes<N> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(other, |a, b| a * b)
    }
}
