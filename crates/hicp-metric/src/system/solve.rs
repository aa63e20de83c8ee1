//! Solutions of the normal equations.

use hicp_core::internal::small::{cholesky6, eigen3, eigen6, solve6};
use hicp_core::{Isometry3, Matrix3, Matrix6, Vector3, Vector6, se3};
use nalgebra::SymmetricEigen;

use crate::system::degeneracy::Degeneracy;
use crate::system::normal_equations::NormalEquations;

/// Damping relative to the mean diagonal of the scaled system. Undetermined directions do not move.
// Open: damping of point-to-plane: §III-A.2. Surfaces may slide in directions without normals. This
// share of the mean diagonal keeps such directions in place, and changes no others.
const DAMPING: f64 = 1e-6;
/// Smallest diagonal entry for Marquardt's damping, as a share of the mean.
const DIAGONAL_FLOOR: f64 = 1e-6;
/// Share of the largest eigenvalue at which [`Degeneracy::FreezeRotations`] freezes a translation.
const LEAST_SHIFT: f64 = 1e-4;
/// Share of the threshold at which [`Degeneracy::FreezeUnexplained`] freezes every rotation.
const LEAST_TURN: f64 = 0.1;
/// Share of the loss that a rotation between the two thresholds must remove.
///
/// Noise alone gives about one part in the number of rows. The systematic errors of real images
/// often give 1 to 3 % for the rotation of a can around its axis.
const EXPLAINED: f64 = 0.03;

/// A step and its length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solution {
    pub(crate) increment: Isometry3<f64>,
    /// Length of the scaled step relative to the length scale, without unit.
    pub(crate) size: f64,
}

impl NormalEquations {
    /// Sets the treatment of undetermined directions; by default [`Degeneracy::Damp`].
    ///
    /// `threshold` is the largest ratio to the largest eigenvalue at which a direction is
    /// degenerate.
    #[must_use]
    pub fn with_policy(mut self, policy: Degeneracy, threshold: f64) -> Self {
        (self.policy, self.threshold) = (policy, threshold);
        self
    }

    /// Returns the increment that minimizes the linearized loss, as a motion of the camera frame.
    ///
    /// Returns `None` with fewer rows than unknowns (six minus the frozen ones), without
    /// information, or with numbers that are not finite. The system's policy defines the treatment
    /// of undetermined directions, such as translations along a plane. With the default,
    /// [`Degeneracy::Damp`], they do not move.
    #[must_use]
    pub fn solve(&self) -> Option<Isometry3<f64>> {
        Some(self.solution(0.0)?.increment)
    }

    /// Solves with Marquardt's damping `lambda` ≥ 0, in addition to the policy.
    ///
    /// The damping is relative to each diagonal entry.
    pub(crate) fn solution(&self, lambda: f64) -> Option<Solution> {
        let n_free = self.n_free();
        if n_free == 0 {
            let increment = Isometry3::identity();
            return Some(Solution {
                increment,
                size: 0.0,
            });
        }
        let mean_diagonal = self.damping_trace() / 6.0;
        let finite = self.scaled_hessian().trace().is_finite();
        if self.rows < n_free || !finite || mean_diagonal <= 0.0 {
            return None;
        }
        let y = self.unknowns(lambda)?;
        let increment = self.increment(&y);
        se3::is_finite(&increment).then_some(Solution {
            increment,
            size: y.norm() / self.length,
        })
    }

    /// Returns the unknowns of the policy, with Marquardt's damping.
    fn unknowns(&self, lambda: f64) -> Option<Vector6<f64>> {
        match self.policy {
            Degeneracy::Damp => self.factored(DAMPING * self.damping_trace() / 6.0, lambda),
            Degeneracy::Freeze => self.remapped(lambda),
            Degeneracy::FreezeRotations => self.marginalized(lambda, f64::INFINITY),
            Degeneracy::FreezeUnexplained => self.marginalized(lambda, EXPLAINED),
            Degeneracy::Refuse if self.is_degenerate()? => None,
            Degeneracy::Refuse | Degeneracy::Ignore => self.factored(0.0, lambda),
        }
    }

    /// Returns whether the policy freezes a free direction, or refuses a step because of it.
    ///
    /// If not, the step to the minimum reaches any displacement of it.
    pub(crate) fn freezes(&self) -> bool {
        if matches!(self.policy, Degeneracy::Damp | Degeneracy::Ignore) {
            return false;
        }
        if self.policy == Degeneracy::FreezeUnexplained {
            // A rotation between the two thresholds stays until it explains enough.
            let strict = self.with_policy(Degeneracy::FreezeRotations, self.threshold);
            return strict.freezes();
        }
        let hessian = self.scaled_hessian() * self.basis();
        (0..6).filter(|&i| !self.held(i)).any(|i| {
            let displaced = self.with_gradient(&-hessian.column(i));
            let mut missed = displaced.unknowns(0.0).unwrap_or_default();
            missed[i] -= 1.0;
            // Rounding is far below, and a frozen direction misses a sixth or more for some i.
            missed.amax() > 1e-2
        })
    }

    /// Returns the minimizer of the linearized loss as a twist around the pivot.
    ///
    /// Undetermined directions are damped, and the others are exact. It is iterated Tikhonov: each
    /// pass leaves λ/(h + λ) of the remaining error, and undetermined directions do not move.
    pub(crate) fn exact_twist(&self) -> Option<Vector6<f64>> {
        const PASSES: usize = 4;
        if self.rows < 6 {
            return None;
        }
        let mean_diagonal = self.damping_trace() / 6.0;
        let hessian = self.scaled_hessian();
        let damped = hessian + Matrix6::identity() * (DAMPING * mean_diagonal);
        // Fails if the rows have no information or are not finite.
        let factor = cholesky6(&damped)?;
        let mut z = Vector6::zeros();
        for _ in 0..PASSES {
            z -= solve6(&factor, &(self.scaled_gradient() + hessian * z));
        }
        let mut rotation = z.fixed_rows_mut::<3>(3);
        rotation /= self.length;
        z.iter().all(|x| x.is_finite()).then_some(z)
    }

    /// Returns the unknowns from a Cholesky decomposition, with absolute damping and Marquardt's λ.
    fn factored(&self, damping: f64, lambda: f64) -> Option<Vector6<f64>> {
        let mut hessian = self.scaled_hessian();
        self.damp(&mut hessian, lambda);
        hessian += Matrix6::identity() * damping;
        if self.freedom.is_none() {
            return Some(solve6(&cholesky6(&hessian)?, &-self.scaled_gradient()));
        }
        let (mut reduced, gradient) = self.reduced(&hessian);
        self.fill_held(&mut reduced);
        let mut y = solve6(&cholesky6(&reduced)?, &-gradient);
        self.clear_held(&mut y);
        Some(y)
    }

    /// Returns the unknowns from an eigendecomposition without the degenerate directions.
    fn remapped(&self, lambda: f64) -> Option<Vector6<f64>> {
        let (hessian, gradient) = self.reduced(&self.scaled_hessian());
        let eigen = eigen(hessian)?;
        let limit = self.threshold.max(0.0) * eigen.eigenvalues.max().max(0.0);
        let mut y = Vector6::zeros();
        for (value, direction) in eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter())
        {
            // Frozen unknowns have the eigenvalue zero.
            if *value > limit {
                y -= direction * (direction.dot(&gradient) / (value * (1.0 + lambda)));
            }
        }
        self.clear_held(&mut y);
        Some(y)
    }

    /// Returns the unknowns without degenerate rotations, with the translations that they leave.
    ///
    /// A rotation that removes more than the share `explained` of the loss has a lower threshold.
    fn marginalized(&self, lambda: f64, explained: f64) -> Option<Vector6<f64>> {
        let (hessian, gradient) = self.reduced(&self.scaled_hessian());
        let largest = eigen(hessian)?.eigenvalues.max().max(0.0);
        let limit = self.threshold.max(0.0) * largest;
        let both = hessian.fixed_view::<3, 3>(0, 3);
        let (of_shift, of_turn) = (gradient.fixed_rows::<3>(0), gradient.fixed_rows::<3>(3));
        let least_shift = limit.min(LEAST_SHIFT * largest);
        let shifts = hessian.fixed_view::<3, 3>(0, 0).into_owned();
        let shifts = inverse_where(shifts, |value, _| value > least_shift)?;
        let marginal = hessian.fixed_view::<3, 3>(3, 3) - both.transpose() * shifts * both;
        let of_turn = of_turn - both.transpose() * shifts * of_shift;
        let turns = inverse_where(marginal, |value, axis| {
            let removed = axis.dot(&of_turn).powi(2) / value;
            value > limit || value > LEAST_TURN * limit && removed > explained * self.loss()
        })?;
        let turn = -turns * of_turn;
        let shift = -shifts * (of_shift + both * turn);
        let mut y = Vector6::zeros();
        y.fixed_rows_mut::<3>(0).copy_from(&shift);
        y.fixed_rows_mut::<3>(3).copy_from(&turn);
        y /= 1.0 + lambda;
        self.clear_held(&mut y);
        Some(y)
    }

    /// Returns whether a direction that is not frozen is degenerate.
    fn is_degenerate(&self) -> Option<bool> {
        let (hessian, _) = self.reduced(&self.scaled_hessian());
        let eigen = eigen(hessian)?;
        let limit = self.threshold.max(0.0) * eigen.eigenvalues.max();
        let determined = eigen.eigenvalues.iter().filter(|v| **v > limit).count();
        Some(determined < self.n_free())
    }

    /// Returns BᵀHB and Bᵀg: the equations of y, with zero rows and columns for frozen unknowns.
    pub(crate) fn reduced(&self, hessian: &Matrix6<f64>) -> (Matrix6<f64>, Vector6<f64>) {
        let basis = self.basis();
        (
            basis.transpose() * hessian * basis,
            basis.transpose() * self.scaled_gradient(),
        )
    }

    /// Applies Marquardt's damping relative to each diagonal entry.
    ///
    /// A floor covers directions without information.
    fn damp(&self, hessian: &mut Matrix6<f64>, lambda: f64) {
        let floor = DIAGONAL_FLOOR * self.damping_trace() / 6.0;
        for i in 0..6 {
            let diagonal = hessian[(i, i)];
            hessian[(i, i)] += lambda * diagonal.max(floor);
        }
    }

    /// Adds an equation for frozen unknowns, whose rows and columns are zero.
    pub(crate) fn fill_held(&self, reduced: &mut Matrix6<f64>) {
        let diagonal = reduced.trace();
        for i in (0..6).filter(|&i| self.held(i)) {
            reduced[(i, i)] = diagonal;
        }
    }

    fn clear_held(&self, y: &mut Vector6<f64>) {
        for i in (0..6).filter(|&i| self.held(i)) {
            y[i] = 0.0;
        }
    }
}

/// Returns eigenvalues and eigenvectors of a symmetric matrix, or `None` if an entry is not finite.
pub(crate) fn eigen(matrix: Matrix6<f64>) -> Option<SymmetricEigen<f64, nalgebra::U6>> {
    // If an entry is not finite, the iteration would not end.
    let scale = matrix.amax();
    if !matrix.iter().all(|x| x.is_finite()) {
        return None;
    }
    if scale == 0.0 {
        return Some(SymmetricEigen {
            eigenvectors: Matrix6::identity(),
            eigenvalues: Vector6::zeros(),
        });
    }
    eigen6(&matrix)
}

/// Returns the inverse of a symmetric matrix in the directions to keep, by eigenvalue and
/// eigenvector.
fn inverse_where(
    matrix: Matrix3<f64>,
    is_kept: impl Fn(f64, &Vector3<f64>) -> bool,
) -> Option<Matrix3<f64>> {
    let mut eigen = eigen3(&matrix)?;
    for (value, direction) in eigen
        .eigenvalues
        .iter_mut()
        .zip(eigen.eigenvectors.column_iter())
    {
        *value = match is_kept(*value, &direction.into_owned()) {
            true => 1.0 / *value,
            false => 0.0,
        };
    }
    Some(eigen.recompose())
}
