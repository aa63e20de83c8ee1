//! The 6×6 normal equations of a rigid increment.

use hicp_core::internal::small::blocks;
use hicp_core::{Matrix3, Matrix6, Point3, Vector3, Vector6, so3::hat};

use crate::system::degeneracy::Degeneracy;
use crate::system::freedom::Freedom;
use crate::system::moments::Moments;
use crate::system::row_sums::RowSums;

/// The sums JᵀWJ and JᵀWr of weighted residual rows over a twist ξ = [ρ; φ], centered and scaled.
///
/// Rotations are around a pivot (the centroid of the points) and in units of 1/L radians (L the RMS
/// radius), so that all six unknowns are lengths of similar size. For a 10 cm object at 0.5 m, the
/// condition number falls from 2·10⁴ to about 40 (Low 2004 for the rows).
/// [`NormalEquations::solve`] converts back.
///
/// A system also stores how to solve it, so that decorators compose. This is the treatment of
/// undetermined directions ([`NormalEquations::with_policy`]) and the frozen components of the
/// increment ([`NormalEquations::freeze`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalEquations {
    pub(crate) pivot: Point3<f64>,
    pub(crate) length: f64,
    inverse_length: f64,
    /// Σ w over the pairs with rows, if
    /// [`ErrorMetric::linearize_all`](crate::ErrorMetric::linearize_all) summed the system.
    pub(crate) weight: Option<f64>,
    /// Variance of a residual of weight 1, if it is known instead of estimated.
    pub(crate) variance: Option<f64>,
    sums: RowSums,
    pub(crate) rows: usize,
    /// Trace of the rows alone, if a prior was added: its stiffness must not raise the damping.
    row_trace: Option<f64>,
    pub(crate) freedom: Option<Freedom>,
    pub(crate) policy: Degeneracy,
    pub(crate) threshold: f64,
    /// Rows add to the loss only.
    loss_only: bool,
}

impl NormalEquations {
    /// Creates an empty system with a pivot (camera frame, meters) and a length scale (meters,
    /// above 0).
    #[must_use]
    pub fn new(pivot: Point3<f64>, length: f64) -> Self {
        Self {
            pivot,
            length,
            inverse_length: 1.0 / length,
            weight: None,
            variance: None,
            sums: RowSums::zeros(),
            rows: 0,
            row_trace: None,
            freedom: None,
            policy: Degeneracy::default(),
            threshold: Degeneracy::THRESHOLD,
            loss_only: false,
        }
    }

    /// Creates an empty system in which rows add to the loss only, to the same bits.
    pub(crate) fn of_loss(pivot: Point3<f64>) -> Self {
        Self {
            loss_only: true,
            ..Self::new(pivot, 1.0)
        }
    }

    /// Creates a system from sums over `rows` rows relative to a pivot, with lengths in meters.
    pub(crate) fn from_sums(pivot: Point3<f64>, sums: RowSums, rows: usize) -> Self {
        Self {
            sums,
            rows,
            ..Self::new(pivot, 1.0)
        }
    }

    /// Returns this system around the centroid of the points, with their RMS radius as the length.
    ///
    /// Without weight, or with numbers that are not finite, returns `None`.
    pub(crate) fn centered(&self, moments: &Moments) -> Option<Self> {
        let (pivot, length) = moments.pivot_and_length()?;
        let mut centered = Self::new(pivot, length);
        centered.merge(self, 1.0);
        centered.weight = Some(moments.weight());
        // Sources were checked with the centroid. This check covers targets and normals.
        centered.loss().is_finite().then_some(centered)
    }

    /// Adds a scalar residual r of weight w that changes by `direction` · (displacement of
    /// `point`).
    ///
    /// Its row is J = [dᵀ, ((p − pivot) × d)ᵀ]. `point` is in the camera frame. The residual and
    /// d·(displacement) have the same unit, meters for distances.
    #[inline(always)]
    pub fn add_row(
        &mut self,
        point: &Point3<f64>,
        direction: &Vector3<f64>,
        residual: f64,
        weight: f64,
    ) {
        if self.loss_only {
            self.rows += usize::from(weight > 0.0);
            return self.sums.add_loss(residual, weight);
        }
        let lever = (point - self.pivot).cross(direction) * self.inverse_length;
        let jacobian = [
            direction.x,
            direction.y,
            direction.z,
            lever.x,
            lever.y,
            lever.z,
        ];
        self.sums.add_row(jacobian, residual, weight);
        self.rows += usize::from(weight > 0.0);
    }

    /// Number of rows added with a positive weight.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Sets the variance of a residual of weight 1, which scales [`NormalEquations::covariance`].
    ///
    /// Without it, the residuals estimate the variance. A prior needs it: its share of the system
    /// is right for one variance only.
    #[must_use]
    pub fn with_variance(mut self, variance: f64) -> Self {
        self.variance = Some(variance);
        self
    }

    /// Returns Σ w r², the weighted sum of squared residuals at the identity increment.
    #[must_use]
    pub fn loss(&self) -> f64 {
        self.sums.loss()
    }

    /// Returns the loss divided by the weight of the pairs, or another mean if that is not known.
    ///
    /// If it is not finite, returns `None`.
    pub(crate) fn mean_loss_or(&self, other: impl FnOnce() -> Option<f64>) -> Option<f64> {
        let mean = match self.weight {
            Some(weight) => self.loss() / weight,
            None => other()?,
        };
        mean.is_finite().then_some(mean)
    }

    /// Center of rotations, camera frame, meters.
    #[must_use]
    pub fn pivot(&self) -> Point3<f64> {
        self.pivot
    }

    /// Scale of rotations, meters.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Adds eᵀΛe for e(ξ) = `residual` + `jacobian` ξ.
    ///
    /// ξ is the twist around the *camera origin* in meters and radians. Λ (`information`) is
    /// symmetric and positive semi-definite, and eᵀΛe has the unit of the loss. Each component with
    /// information counts as a row. Add it after the rows, because they alone determine the damping
    /// of [`NormalEquations::solve`]. If Λ is σ² times the information of a prior, also set the
    /// variance σ² ([`NormalEquations::with_variance`]).
    pub fn add_twist(
        &mut self,
        residual: &Vector6<f64>,
        jacobian: &Matrix6<f64>,
        information: &Matrix6<f64>,
    ) {
        self.weight = None;
        self.row_trace.get_or_insert(self.sums.trace());
        let jacobian = jacobian * self.camera_from_scaled();
        let weighted = jacobian.transpose() * information;
        self.sums.add(
            &(weighted * jacobian),
            &(weighted * residual),
            residual.dot(&(information * residual)),
        );
        self.rows += (0..6).filter(|&i| information[(i, i)] > 0.0).count();
    }

    /// Adds `factor` times another system, whose pivot and length may differ.
    ///
    /// Policy and frozen components stay those of `self`, and so does a known variance. If only the
    /// other variance is known, it is multiplied by the factor.
    pub fn merge(&mut self, other: &Self, factor: f64) {
        // The same twist in the other system's unknowns: ρ' = ρ + φ × (pivot' − pivot), θ' = θ
        // L'/L.
        let shift = hat(&(other.pivot - self.pivot)) / -self.length;
        let scale = Matrix3::identity() * (other.length / self.length);
        let change = blocks(&Matrix3::identity(), &shift, &scale);
        self.weight = None;
        let trace = self.damping_trace() + factor * other.damping_trace();
        if self.row_trace.is_some() || other.row_trace.is_some() {
            self.row_trace = Some(trace);
        }
        self.sums.add(
            &(change.transpose() * other.scaled_hessian() * change * factor),
            &(change.transpose() * other.scaled_gradient() * factor),
            factor * other.loss(),
        );
        self.rows += other.rows;
        let variance = other.variance.map(|variance| variance * factor);
        self.variance = self.variance.or(variance);
    }

    /// Returns the system with another JᵀWr in scaled unknowns.
    pub(crate) fn with_gradient(mut self, gradient: &Vector6<f64>) -> Self {
        let change = gradient - self.scaled_gradient();
        self.sums.add(&Matrix6::zeros(), &change, 0.0);
        self
    }

    /// Multiplies every weight, and with them a known variance of the residuals, by a factor.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        self.sums.scale(factor);
        self.weight = None;
        self.variance = self.variance.map(|variance| variance * factor);
        self.row_trace = self.row_trace.map(|trace| trace * factor);
        self
    }

    /// Returns the trace that damping is relative to: that of the rows, or of all if the rows have
    /// none.
    pub(crate) fn damping_trace(&self) -> f64 {
        self.row_trace
            .filter(|trace| *trace > 0.0)
            .unwrap_or_else(|| self.sums.trace())
    }

    /// Returns JᵀWJ in scaled unknowns, both triangles.
    pub(crate) fn scaled_hessian(&self) -> Matrix6<f64> {
        self.sums.hessian()
    }

    /// Returns JᵀWr in scaled unknowns.
    pub(crate) fn scaled_gradient(&self) -> Vector6<f64> {
        self.sums.gradient()
    }

    /// Returns the matrix S of ξ = S z.
    ///
    /// z is the scaled twist around the pivot, and ξ the plain one around the camera origin.
    pub(crate) fn camera_from_scaled(&self) -> Matrix6<f64> {
        blocks(
            &Matrix3::identity(),
            &(hat(&self.pivot.coords) / self.length),
            &(Matrix3::identity() / self.length),
        )
    }

    /// Returns the inverse of [`NormalEquations::camera_from_scaled`].
    pub(crate) fn scaled_from_camera(&self) -> Matrix6<f64> {
        blocks(
            &Matrix3::identity(),
            &-hat(&self.pivot.coords),
            &(Matrix3::identity() * self.length),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hicp_core::se3;

    /// Rows with the loss ½ Σ w (d · (exp(ξ) p) + r₀)².
    ///
    /// ξ is around the pivot, with rotations in units of 1/L.
    struct Rows {
        pivot: Point3<f64>,
        length: f64,
        rows: Vec<(Point3<f64>, Vector3<f64>, f64, f64)>,
    }

    impl Rows {
        fn half_loss(&self, x: &Vector6<f64>) -> f64 {
            let l = self.length;
            let motion = se3::exp(&Vector6::new(
                x[0],
                x[1],
                x[2],
                x[3] / l,
                x[4] / l,
                x[5] / l,
            ));
            let terms = self.rows.iter().map(|(p, d, r, w)| {
                let moved = self.pivot
                    + motion * Point3::from(p - self.pivot).coords
                    + motion.translation.vector;
                0.5 * w * (r + d.dot(&(moved - p))).powi(2)
            });
            terms.sum()
        }
    }

    #[test]
    fn gradient_and_hessian_equal_those_of_the_linearized_loss() {
        // Rows without symmetry, and zero residuals, for which the Gauss–Newton Hessian is the
        // Hessian.
        let rows = Rows {
            pivot: Point3::new(0.1, -0.2, 0.7),
            length: 0.037,
            rows: (0..12)
                .map(|i| {
                    let a = f64::from(i);
                    let point = Point3::new((1.3 * a).sin(), (2.1 * a).cos(), (0.7 * a).sin());
                    let direction = Vector3::new((3.1 * a).cos(), (1.7 * a).sin(), 0.4 - 0.1 * a);
                    (point, direction, 0.0, 0.3 + 0.1 * a)
                })
                .collect(),
        };
        let build = |residual: f64| {
            let mut system = NormalEquations::new(rows.pivot, rows.length);
            for (p, d, _, w) in &rows.rows {
                system.add_row(p, d, residual, *w);
            }
            system
        };
        let unit = |i: usize| Vector6::from_fn(|j, _| f64::from(u8::from(i == j)));
        let h = 1e-5;
        let at_zero = build(0.0);
        for i in 0..6 {
            for j in 0..=i {
                let f = |a: f64, b: f64| rows.half_loss(&(unit(i) * (a * h) + unit(j) * (b * h)));
                let second =
                    (f(1.0, 1.0) - f(1.0, -1.0) - f(-1.0, 1.0) + f(-1.0, -1.0)) / (4.0 * h * h);
                let found = at_zero.scaled_hessian()[(i, j)];
                // Differences cancel to ε/h². Their error is h² times the fourth derivative, which
                // levers of 1/L increase.
                let scale = at_zero.scaled_hessian().diagonal().amax();
                assert!(
                    (found - second).abs() < 1e-5 * scale,
                    "{i} {j}: {found} {second}"
                );
            }
        }

        let residual = 0.021;
        let with_residual = Rows {
            rows: rows
                .rows
                .iter()
                .map(|(p, d, _, w)| (*p, *d, residual, *w))
                .collect(),
            ..rows
        };
        let mut system = NormalEquations::new(with_residual.pivot, with_residual.length);
        for (p, d, r, w) in &with_residual.rows {
            system.add_row(p, d, *r, *w);
        }
        for i in 0..6 {
            let h = 1e-7;
            let f = |a: f64| with_residual.half_loss(&(unit(i) * (a * h)));
            let slope = (f(1.0) - f(-1.0)) / (2.0 * h);
            assert!(
                (system.scaled_gradient()[i] - slope).abs() < 1e-6,
                "{i}: {} {slope}",
                system.scaled_gradient()[i]
            );
        }
        let loss = 2.0 * with_residual.half_loss(&Vector6::zeros());
        assert!((system.loss() - loss).abs() < 1e-15);
        assert_eq!(system.rows(), 12);
    }

    #[test]
    fn pivot_and_length_do_not_change_the_increment() {
        let solve = |pivot: Point3<f64>, length: f64| {
            let mut system = NormalEquations::new(pivot, length);
            for i in 0..20 {
                let a = f64::from(i);
                let point = Point3::new((1.3 * a).sin(), (2.1 * a).cos(), (0.7 * a).sin());
                let direction = Vector3::new((3.1 * a).cos(), (1.7 * a).sin(), (5.3 * a).sin());
                system.add_row(&point, &direction, 0.01 * (2.9 * a).cos(), 1.0);
            }
            system.solve().unwrap()
        };
        let reference = solve(Point3::origin(), 1.0);
        for (pivot, length) in [(Point3::new(0.3, -0.2, 0.4), 1.0), (Point3::origin(), 0.5)] {
            let (angle, distance) = se3::pose_distance(&solve(pivot, length), &reference);
            // Both damp by 1e-6 of a step of 1e-2, each in its own coordinates.
            assert!(angle < 1e-6 && distance < 1e-6, "{angle} {distance}");
        }
    }
}
