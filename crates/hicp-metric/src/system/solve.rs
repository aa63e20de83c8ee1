//! How the normal equations are solved.

use hicp_core::{Isometry3, Matrix6, Vector6, se3};
use nalgebra::SymmetricEigen;

use crate::system::degeneracy::Degeneracy;
use crate::system::freedom::reduce;
use crate::system::normal_equations::NormalEquations;

/// Damping relative to the mean diagonal of the scaled system: directions that the pairs do not constrain stay put.
const DAMPING: f64 = 1e-6;
/// Smallest diagonal entry that Levenberg's damping is relative to, as a share of the mean.
const DIAGONAL_FLOOR: f64 = 1e-6;
/// More than any 6×6 matrix needs; a bound because of what is not a number.
const EIGEN_ITERATIONS: usize = 1000;

/// A step, and how far it goes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solution {
    pub(crate) increment: Isometry3<f64>,
    /// Length of the scaled step relative to the length scale: without unit.
    pub(crate) size: f64,
}

impl NormalEquations {
    /// Says how [`NormalEquations::solve`] treats directions that the rows leave open. Initially [`Degeneracy::Damp`].
    ///
    /// `threshold` is the largest ratio to the largest eigenvalue at which a direction counts as degenerate.
    #[must_use]
    pub fn with_policy(mut self, policy: Degeneracy, threshold: f64) -> Self {
        (self.policy, self.threshold) = (policy, threshold);
        self
    }

    /// Returns the increment that minimises the linearised loss, as a motion of the camera frame.
    ///
    /// `None` with fewer rows than unknowns (six, less those held), without any information, or with numbers that are not
    /// finite. Directions that the rows leave free (a plane's own plane, a cylinder's axis) are treated by the system's policy,
    /// [`Degeneracy::Damp`] if none was set: they do not move.
    #[must_use]
    pub fn solve(&self) -> Option<Isometry3<f64>> {
        Some(self.solution(0.0)?.increment)
    }

    /// Solves with a policy other than the system's own.
    #[must_use]
    pub fn solve_with(&self, policy: Degeneracy, threshold: f64) -> Option<Isometry3<f64>> {
        self.with_policy(policy, threshold).solve()
    }

    /// Solves with Marquardt's damping `lambda` ≥ 0 (relative to each diagonal entry) on top of the policy.
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
        let y = match self.policy {
            Degeneracy::Damp => self.factored(DAMPING * mean_diagonal, lambda)?,
            Degeneracy::Freeze => self.remapped(lambda)?,
            Degeneracy::Refuse if self.is_degenerate()? => return None,
            Degeneracy::Refuse | Degeneracy::Ignore => self.factored(0.0, lambda)?,
        };
        let increment = self.increment(&y);
        se3::is_finite(&increment).then_some(Solution {
            increment,
            size: y.norm() / self.length,
        })
    }

    /// Returns the minimiser of the linearised loss as a twist about the pivot, its free directions damped but its others exact.
    ///
    /// Iterated Tikhonov: each pass leaves λ/(h + λ) of the error that it found, and nothing of a free direction moves.
    pub(crate) fn exact_twist(&self) -> Option<Vector6<f64>> {
        const PASSES: usize = 4;
        if self.rows < 6 {
            return None;
        }
        let mean_diagonal = self.damping_trace() / 6.0;
        let hessian = self.scaled_hessian();
        let damped = hessian + Matrix6::identity() * (DAMPING * mean_diagonal);
        // None where the rows say nothing or not in numbers.
        let factor = damped.cholesky()?;
        let mut z = Vector6::zeros();
        for _ in 0..PASSES {
            z -= factor.solve(&(self.scaled_gradient() + hessian * z));
        }
        let mut rotation = z.fixed_rows_mut::<3>(3);
        rotation /= self.length;
        z.iter().all(|x| x.is_finite()).then_some(z)
    }

    /// The unknowns from a Cholesky decomposition, damped absolutely and by Marquardt's λ.
    fn factored(&self, damping: f64, lambda: f64) -> Option<Vector6<f64>> {
        let mut hessian = self.scaled_hessian();
        self.damp(&mut hessian, lambda);
        hessian += Matrix6::identity() * damping;
        if self.freedom.is_none() {
            return Some(hessian.cholesky()?.solve(&-self.scaled_gradient()));
        }
        let (mut reduced, gradient) = reduce(&self.basis(), &hessian, &self.scaled_gradient());
        self.fill_held(&mut reduced);
        let mut y = reduced.cholesky()?.solve(&-gradient);
        self.clear_held(&mut y);
        Some(y)
    }

    /// The unknowns from an eigen-decomposition, degenerate directions left out.
    fn remapped(&self, lambda: f64) -> Option<Vector6<f64>> {
        let (hessian, gradient) = reduce(
            &self.basis(),
            &self.scaled_hessian(),
            &self.scaled_gradient(),
        );
        let eigen = eigen(hessian)?;
        let limit = self.threshold.max(0.0) * eigen.eigenvalues.max().max(0.0);
        let mut y = Vector6::zeros();
        for (value, direction) in eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter())
        {
            // Held unknowns have the eigenvalue zero.
            if *value > limit {
                y -= direction * (direction.dot(&gradient) / (value * (1.0 + lambda)));
            }
        }
        self.clear_held(&mut y);
        Some(y)
    }

    /// Whether a direction that is not held is degenerate.
    fn is_degenerate(&self) -> Option<bool> {
        let (hessian, _) = reduce(
            &self.basis(),
            &self.scaled_hessian(),
            &self.scaled_gradient(),
        );
        let eigen = eigen(hessian)?;
        let limit = self.threshold.max(0.0) * eigen.eigenvalues.max();
        let determined = eigen.eigenvalues.iter().filter(|v| **v > limit).count();
        Some(determined < self.n_free())
    }

    /// Marquardt's damping: relative to each diagonal entry, with a floor for directions without information.
    fn damp(&self, hessian: &mut Matrix6<f64>, lambda: f64) {
        let floor = DIAGONAL_FLOOR * self.damping_trace() / 6.0;
        for i in 0..6 {
            let diagonal = hessian[(i, i)];
            hessian[(i, i)] += lambda * diagonal.max(floor);
        }
    }

    /// Gives held unknowns, whose rows and columns are zero, an equation of their own.
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

/// Eigenvalues and vectors of a symmetric matrix; `None` where an entry is not finite.
pub(crate) fn eigen(matrix: Matrix6<f64>) -> Option<SymmetricEigen<f64, nalgebra::U6>> {
    // Not finite, and the iteration would not end.
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
    SymmetricEigen::try_new(matrix, f64::EPSILON, EIGEN_ITERATIONS)
}
