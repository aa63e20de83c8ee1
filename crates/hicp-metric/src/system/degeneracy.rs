//! The treatment of directions that the pairs do not determine.

/// The treatment of directions of the increment that the pairs do not determine.
///
/// These are the directions whose eigenvalue of the scaled JᵀWJ is at most a threshold times the
/// largest (see [`Observability`](crate::Observability)). A plane and a sphere leave three of six
/// undetermined, and a cylinder leaves two. The plain solution of such a system slides along them,
/// driven by noise and rounding.
///
/// With `Freeze` and `Refuse`, nothing slides. With `Damp`, nothing slides along directions that
/// are exactly undetermined, such as those of a plane. In noise-free depth images of a cylinder and
/// a sphere, the pixels alone raise the eigenvalues to 10⁻⁵ to 10⁻⁴. The pose then slid by 9 % and
/// 32 % of the first step (`cargo test -p hicp-tests --test it degeneracy_scenes`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Degeneracy {
    /// Tikhonov damping with 10⁻⁶ of the mean diagonal.
    ///
    /// Undetermined directions do not move, and well-determined ones are shortened by 10⁻⁶ to 10⁻⁵
    /// of the step. It is smooth and has no threshold. Directions that only noise determines do
    /// move.
    #[default]
    Damp,
    /// No motion in degenerate directions, and the undamped step in the others.
    ///
    /// It is the solution remapping of Zhang, Kaess & Singh 2016.
    Freeze,
    /// No rotation around degenerate axes, and the translations that minimize the loss without it.
    ///
    /// An axis is degenerate if the information about its rotation is at most the threshold times
    /// the largest eigenvalue. The translations that best compensate the rotation are eliminated
    /// first. A translation is frozen only if its information is at most 10⁻⁴ of the largest
    /// eigenvalue, or the threshold if that is lower.
    ///
    /// It suits pairs of a surface and its silhouette. Noise and facets give some information about
    /// rotations that nothing determines, such as that of a can around its axis. The silhouette of
    /// a flat side gives as little information about a translation, but it does determine it.
    FreezeRotations,
    /// [`Self::FreezeRotations`] with a tenth of the threshold for rotations that lower the loss.
    ///
    /// The lower threshold applies to rotations that would remove more than 3 % of the loss. In an
    /// image with little noise, a small part of the surface or the silhouette can determine a
    /// rotation that has little information.
    FreezeUnexplained,
    /// No step if a direction is degenerate, otherwise the undamped step.
    Refuse,
    /// The undamped step for every threshold; no step if the matrix is singular.
    ///
    /// It slides and is meant for comparisons.
    Ignore,
}

impl Degeneracy {
    /// Default threshold, 10⁻³.
    ///
    /// A direction is degenerate if the RMS residual changes by at most 3 % (√10⁻³) of its change
    /// in the best direction. That is about the noise of normals estimated from depth. Boxes up to
    /// 40 times as long as wide stay above it.
    pub const THRESHOLD: f64 = 1e-3;
}
