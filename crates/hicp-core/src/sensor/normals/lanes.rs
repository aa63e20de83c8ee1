//! Numbers for parallel arithmetic.

use std::ops::{Add, Mul, Sub};

/// Number of pixels that are computed at once.
pub(super) const LANES: usize = 8;

/// Several numbers; each operation applies to all of them, a pattern that compilers vectorize.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lanes<T>(pub(super) [T; LANES]);

impl<T: Copy> Lanes<T> {
    #[inline(always)]
    pub(super) fn all(number: T) -> Self {
        Self([number; LANES])
    }

    #[inline(always)]
    pub(super) fn map(mut self, operation: impl Fn(T) -> T) -> Self {
        for lane in &mut self.0 {
            *lane = operation(*lane);
        }
        self
    }

    #[inline(always)]
    fn with(mut self, other: Self, operation: impl Fn(T, T) -> T) -> Self {
        for (lane, other) in self.0.iter_mut().zip(other.0) {
            *lane = operation(*lane, other);
        }
        self
    }
}

impl Lanes<f64> {
    /// Converts to single precision.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)]
    pub(super) fn single(self) -> Lanes<f32> {
        let mut lanes = [0.0; LANES];
        for (lane, number) in lanes.iter_mut().zip(self.0) {
            *lane = number as f32;
        }
        Lanes(lanes)
    }
}

impl Lanes<f32> {
    /// Converts to double precision.
    #[inline(always)]
    pub(super) fn double(self) -> Lanes<f64> {
        let mut lanes = [0.0; LANES];
        for (lane, number) in lanes.iter_mut().zip(self.0) {
            *lane = f64::from(number);
        }
        Lanes(lanes)
    }
}

impl<T: Copy + Add<Output = T>> Add for Lanes<T> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(other, |a, b| a + b)
    }
}

impl<T: Copy + Sub<Output = T>> Sub for Lanes<T> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(other, |a, b| a - b)
    }
}

impl<T: Copy + Mul<Output = T>> Mul for Lanes<T> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(other, |a, b| a * b)
    }
}

/// Returns the numbers from an index on, a block of them.
#[inline(always)]
pub(super) fn lanes<T: Copy>(numbers: &[T], from: usize) -> Lanes<T> {
    let Some(lanes) = numbers[from..].first_chunk() else {
        unreachable!("depths, columns and rays are padded by {LANES}")
    };
    Lanes(*lanes)
}
