//! Association from the observation to the model.

use hicp_core::internal::{VectorLoop, vectorized};
use hicp_core::{
    Correspondences, Isometry3, Observation, Pair, Point3, RigidTransform, Surfel, UnitVector3, se3,
};

use crate::search::box_tree::Stack;
use crate::stride::Stride;

/// The surface of a model, indexed in the object frame.
pub(crate) trait IndexedSurface {
    /// Returns the surfel closest to `query` and its index, in the object frame.
    ///
    /// `eye` is the position of the camera.
    fn closest(
        &self,
        query: &Point3<f32>,
        eye: &Point3<f32>,
        stack: &mut Stack,
    ) -> Option<(u32, Surfel)>;
}

/// Pairs observed points with the closest surfels of a model.
///
/// All observed points of the stride are candidates. The index stays in the object frame: each
/// observed point is moved there, and its surfel back.
pub(crate) struct FromObservation<'a, S> {
    pub(crate) observation: &'a Observation,
    pub(crate) stride: Stride,
    pub(crate) surface: S,
    pub(crate) camera_from_object: &'a Isometry3<f64>,
    pub(crate) pairs: &'a mut Correspondences,
}

impl<S: IndexedSurface> FromObservation<'_, S> {
    /// Adds the pairs.
    pub(crate) fn associate(self) {
        vectorized(self);
    }
}

impl<S: IndexedSurface> VectorLoop for FromObservation<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let stride = self.stride.pixels(self.observation.n_surfels());
        let object_from_camera = self.camera_from_object.inverse();
        let finite = se3::is_finite(&object_from_camera);
        let eye = Point3::from(object_from_camera.translation.vector.cast::<f32>());
        let object_from_camera = RigidTransform::new(&object_from_camera);
        let camera_from_object = RigidTransform::new(self.camera_from_object);
        let (mut candidates, mut stack) = (0, Stack::default());
        for (target_index, target) in self.observation.surfels(stride) {
            candidates += 1;
            if !finite {
                continue;
            }
            let query = object_from_camera.point(&target.point);
            if let Some((source_index, source)) = self.surface.closest(&query, &eye, &mut stack) {
                let source = camera_from_object.surfel(&source);
                self.pairs
                    .push(Pair::new(source_index, source, target_index, *target));
            }
        }
        self.pairs.set_candidates(candidates);
    }
}

/// Returns whether a surface element faces `eye`.
#[inline(always)]
pub(crate) fn faces(normal: &UnitVector3<f32>, point: &Point3<f32>, eye: &Point3<f32>) -> bool {
    normal.dot(&(eye - point)) > 0.0
}
