//! The trait of data associations.

use hicp_core::internal::{for_tuples, type_label};
use hicp_core::{Context, Correspondences, Isometry3, Problem, Surfel};

/// Pairs model points with observed points: Algorithm 1, line 1 (and the transform of line 2).
///
/// # Contract
///
/// - `source` holds the selected surfels in the object frame.
/// - The caller calls [`Correspondences::begin`] first, which removes all pairs and stores the pose
///   and the number of source points. An association only adds pairs. It does not change those that
///   are already there, such as the pairs of an earlier member of a tuple.
/// - Every pair holds the source *moved by* `camera_from_object` and its target. Both are in the
///   camera frame in meters, with finite coordinates.
/// - The weight of a pair is finite and not negative: 1, unless the association has a better value.
/// - `source_index` is the index of the point in `source`, and `target_index` that of the observed
///   surfel, or [`Pair::UNLISTED`](hicp_core::Pair::UNLISTED). A point may have any number of
///   pairs.
/// - An association that does not start from `source` sets the number of its candidates
///   ([`Correspondences::set_candidates`]).
/// - Pure: equal inputs give equal pairs in equal order. `&mut self` is scratch. Values that depend
///   only on the observation or the model belong into their `derived()` caches, where all threads
///   share them.
///
/// It is called once per iteration on the whole batch, so a boxed association costs one virtual
/// call per iteration.
///
/// ```
/// use hicp_association::DataAssociation;
/// use hicp_core::{Context, Correspondences, Isometry3, RigidTransform, Pair, Surfel};
///
/// /// Pairs every model point with the observed point at the pixel that it projects to.
/// #[derive(Debug)]
/// struct SamePixel;
///
/// impl DataAssociation for SamePixel {
///     fn associate(
///         &mut self,
///         context: &mut Context<'_>,
///         source: &[Surfel],
///         camera_from_object: &Isometry3<f64>,
///         pairs: &mut Correspondences,
///     ) {
///         let Some(observation) = context.problem.observation() else { return };
///         let mover = RigidTransform::new(camera_from_object);
///         for (source_index, surfel) in (0..).zip(source) {
///             let source = mover.surfel(surfel);
///             // Infinite coordinates must not enter a pair.
///             if !source.point.iter().all(|x| x.is_finite()) { continue }
///             let Some(pixel) = observation.camera().project(&source.point.cast()) else { continue };
///             let Some(target_index) = observation.index_near(pixel.x as f32, pixel.y as f32) else { continue };
///             if let Some(target) = observation.surfel(target_index) {
///                 pairs.push(Pair::new(source_index, source, target_index, *target));
///             }
///         }
///     }
/// }
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a data association",
    label = "this must implement `DataAssociation`",
    note = "`Icp::association` accepts a `DataAssociation`, such as `Projective`, a tuple of two to eight, or a `Vec`"
)]
pub trait DataAssociation {
    /// Adds the pairs at the candidate pose `camera_from_object` to `pairs`.
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    );

    /// Returns the name in traces.
    fn name(&self) -> &'static str {
        type_label::<Self>()
    }

    /// Returns the name of the component that does not support a problem, or `None`.
    ///
    /// For example, a projection needs a depth image and does not support two point clouds. A stage
    /// ends with `Termination::Unsupported` and this name before its first iteration. A component
    /// around another one forwards the call. The provided method returns `None`.
    fn unsupported(&self, _problem: &Problem<'_>) -> Option<&'static str> {
        None
    }
}

macro_rules! forward {
    ($($pointer:ty),+) => {$(
        impl<T: DataAssociation + ?Sized> DataAssociation for $pointer {
            fn associate(
                &mut self,
                context: &mut Context<'_>,
                source: &[Surfel],
                camera_from_object: &Isometry3<f64>,
                pairs: &mut Correspondences,
            ) {
                (**self).associate(context, source, camera_from_object, pairs);
            }

            fn name(&self) -> &'static str {
                (**self).name()
            }

            fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
                (**self).unsupported(problem)
            }
        }
    )+};
}
forward!(Box<T>, &mut T);

/// Joins the pairs of all members, in order. The number of candidates is the sum of theirs.
impl<T: DataAssociation> DataAssociation for Vec<T> {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        let selected = pairs.n_candidates();
        let mut candidates = 0;
        for association in self.iter_mut() {
            pairs.set_candidates(selected);
            association.associate(context, source, camera_from_object, pairs);
            candidates += pairs.n_candidates();
        }
        pairs.set_candidates(candidates);
    }

    fn name(&self) -> &'static str {
        "joined"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        self.iter().find_map(|member| member.unsupported(problem))
    }
}

macro_rules! joined {
    ($($member:ident),+) => {
        /// Joins the pairs of all members, in order. The number of candidates is the sum of theirs.
        #[allow(non_snake_case)]
        impl<$($member: DataAssociation),+> DataAssociation for ($($member,)+) {
            fn associate(
                &mut self,
                context: &mut Context<'_>,
                source: &[Surfel],
                camera_from_object: &Isometry3<f64>,
                pairs: &mut Correspondences,
            ) {
                let ($($member,)+) = self;
                let selected = pairs.n_candidates();
                let mut candidates = 0;
                $(
                    pairs.set_candidates(selected);
                    $member.associate(context, source, camera_from_object, pairs);
                    candidates += pairs.n_candidates();
                )+
                pairs.set_candidates(candidates);
            }

            fn name(&self) -> &'static str {
                "joined"
            }

            fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
                let ($($member,)+) = self;
                None$(.or_else(|| $member.unsupported(problem)))+
            }
        }
    };
}
for_tuples!(joined);
