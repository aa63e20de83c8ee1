//! Association from the observation to points of the model.

use std::sync::Arc;

use hicp_core::{Context, Correspondences, Isometry3, Model, Pair, Point3, Surfel, sample_surface};

use crate::association::closest_point_on_mesh::{ObjectView, faces};
use crate::association::data_association::DataAssociation;
use crate::search::point_tree::PointTree;
use crate::stride::Stride;

/// Pairs every observed point with the closest of many points of the model: the search of Besl & McKay (1992) from the
/// measured data to the model.
///
/// What was observed belongs to the object, whereas much of the model was not observed: in this direction no model point is
/// dragged to a place that has nothing to do with it. The search tree lies in the object frame over a dense area-uniform
/// sampling of the model ([`hicp_core::sample_surface`]); it stands still while the estimate moves, so it is built once per
/// model and shared by all threads, images and hypotheses. [`crate::ClosestPointOnMesh`] is exact; it costs some three
/// times as much with every element allowed, and half where many hidden samples must be passed over (thin walls: a mug,
/// 1,800 observed points: 0.8 and 5.6 ms here, 2.7 ms there).
///
/// A pair still holds the model's point as its source, moved by the current estimate, and the observed point as its target.
/// `source` is ignored; `source_index` is the index of the sample, and all observed points tried are candidates. Of equally
/// close samples the first is taken. Normals point out of the object where the mesh is closed, and toward the camera where
/// nothing may be concluded from the winding. Select something cheap that is never empty, such as [`crate::AllSamples`].
///
/// Cost: O(n log n) once per model and number of samples n, then O(log n) per observed point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObservationToModel {
    /// Which observed pixels are paired.
    pub stride: Stride,
    /// Number of points of the model; 0 pairs nothing.
    pub samples: usize,
    /// Whether samples of a closed mesh that face away from the camera are passed over: the camera cannot have seen them.
    pub visible_only: bool,
}

impl Default for ObservationToModel {
    /// About 2,000 observed points to 20,000 points of the model (1.3 % of the diameter apart on a ball), those that face
    /// the camera.
    fn default() -> Self {
        Self {
            stride: Stride::AboutPoints(2000),
            samples: 20_000,
            visible_only: true,
        }
    }
}

impl DataAssociation for ObservationToModel {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        _source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        let Some((model, observation)) = context.problem.sides() else {
            return;
        };
        let model = ModelPoints::of(model, self.samples);
        let view = ObjectView::new(camera_from_object);
        let stride = self.stride.pixels(observation.n_surfels());
        let mut candidates = 0;
        for (target_index, target) in observation.surfels(stride) {
            candidates += 1;
            let Some(view) = &view else {
                continue;
            };
            let query = view.object_from_camera.point(&target.point);
            if let Some((sample, source)) = model.closest(&query, &view.eye, self.visible_only) {
                let source = view.camera_from_object.surfel(&source);
                pairs.push(Pair::new(sample, source, target_index, *target));
            }
        }
        pairs.set_candidates(candidates);
    }

    fn name(&self) -> &'static str {
        "observation-to-model"
    }
}

/// A dense sampling of a model and the tree over it.
struct ModelPoints {
    surfels: Vec<Surfel>,
    tree: PointTree,
    /// Whether normals are known to point out of the object.
    oriented: bool,
}

impl ModelPoints {
    fn of(model: &Model, samples: usize) -> Arc<Self> {
        model.derived().get_or_build(samples as u64, || {
            let surfels = sample_surface(model.mesh(), samples);
            let mut tree = PointTree::default();
            tree.rebuild(surfels.len(), |i| surfels[i].point);
            Self {
                surfels,
                tree,
                oriented: model.mesh().is_closed(),
            }
        })
    }

    /// Returns the closest sample, in the object frame, and its index.
    fn closest(
        &self,
        query: &Point3<f32>,
        eye: &Point3<f32>,
        visible_only: bool,
    ) -> Option<(u32, Surfel)> {
        let found = if visible_only && self.oriented {
            self.tree.nearest_where(query, |i| {
                faces(&self.surfels[i].normal, &self.surfels[i].point, eye)
            })
        } else {
            self.tree.nearest(query)
        }?;
        let mut surfel = self.surfels[found.element as usize];
        if !self.oriented && !faces(&surfel.normal, &surfel.point, eye) {
            surfel.normal = -surfel.normal;
        }
        Some((found.element, surfel))
    }
}
