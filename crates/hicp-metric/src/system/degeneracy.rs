//! What happens in directions that the pairs leave open.

/// What to do with directions of the increment that the pairs do not determine: those whose eigenvalue of the scaled
/// JᵀWJ is at most a threshold times the largest (see [`crate::Observability`]).
///
/// A plane leaves three of the six open, a sphere three, a cylinder two. The plain solution of such a system slides along them
/// as noise and rounding will have it. Under `Freeze` and `Refuse` nothing slides. Under `Damp` nothing slides where the rows leave a
/// direction open exactly, as those of a plane do. In depth images of a cylinder and a sphere, noise-free, the pixels alone lift its
/// eigenvalues to 10⁻⁵ to 10⁻⁴, and the pose slid by 9 % and 32 % of the first step (`cargo test -p hicp-tests --test it degeneracy_scenes`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Degeneracy {
    /// Tikhonov's damping, 10⁻⁶ of the mean diagonal: free directions do not move, well-determined ones are shortened by some
    /// 10⁻⁶ to 10⁻⁵ of the step. Smooth and without a threshold; directions that only noise determines do move.
    #[default]
    Damp,
    /// No motion in degenerate directions, the undamped step in the others (solution remapping of Zhang, Kaess & Singh 2016).
    Freeze,
    /// No step at all where one direction is degenerate; the undamped step otherwise.
    Refuse,
    /// The undamped step whatever the threshold; none where the matrix is singular. Slides. For comparisons.
    Ignore,
}

impl Degeneracy {
    /// Default threshold: a direction counts as degenerate where a unit of it moves the residuals, in RMS, by no more than 3 %
    /// (√10⁻³) of what a unit of the best one does. That is about the noise of normals estimated from depth; boxes up to 40 times as
    /// long as wide stay above it.
    pub const THRESHOLD: f64 = 1e-3;
}
