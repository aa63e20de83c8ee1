//! The centroid and the spread of the sources of some pairs.

use hicp_core::{Pair, Point3, Vector3};

/// Weighted sums of the source points and their squares.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moments {
    /// The first point with weight, so that an object far from the origin loses no digits.
    pub(crate) origin: Point3<f64>,
    /// Σ w (x, y, z, 1).
    sums: [f64; 4],
    /// Σ w (x², y², z², 1).
    squares: [f64; 4],
}

impl Moments {
    /// Returns empty sums, or `None` without a pair that has weight.
    #[inline(always)]
    pub(crate) fn about_first(pairs: &[Pair]) -> Option<Self> {
        let first = pairs.iter().find(|pair| pair.weight > 0.0)?;
        Some(Self {
            origin: first.source.point.cast(),
            sums: [0.0; 4],
            squares: [0.0; 4],
        })
    }

    /// Sets Σ w (x, y, z, 1) and Σ w (x², y², z²), relative to the same origin.
    pub(crate) fn with_sums(&self, sums: [f64; 4], squares: [f64; 3]) -> Self {
        let [x, y, z] = squares;
        Self {
            sums,
            squares: [x, y, z, sums[3]],
            ..*self
        }
    }

    pub(crate) fn weight(&self) -> f64 {
        self.sums[3]
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, pair: &Pair) {
        let offset = pair.source.point.cast::<f64>() - self.origin;
        let weight = f64::from(pair.weight);
        let values = [offset.x, offset.y, offset.z, 1.0];
        for ((value, sum), square) in values.iter().zip(&mut self.sums).zip(&mut self.squares) {
            let weighted = weight * value;
            *sum += weighted;
            *square += weighted * value;
        }
    }

    /// Returns the centroid and the RMS radius.
    ///
    /// Without weight, or with numbers that are not finite, returns `None`.
    pub(crate) fn pivot_and_length(&self) -> Option<(Point3<f64>, f64)> {
        let [x, y, z, weight] = self.sums;
        let squares = self.squares[0] + self.squares[1] + self.squares[2];
        if !(weight > 0.0 && squares.is_finite()) {
            return None;
        }
        let mean = Vector3::new(x, y, z) / weight;
        let variance = squares / weight - mean.norm_squared();
        Some((self.origin + mean, length_of(variance)))
    }
}

/// Returns the RMS radius of points with a variance.
///
/// If all points are at one place, any length is valid: the rotation is undetermined and stays
/// damped.
pub(crate) fn length_of(variance: f64) -> f64 {
    if variance > 1e-12 {
        variance.sqrt()
    } else {
        1.0
    }
}
