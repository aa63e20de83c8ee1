//! Association from the observation to the model's triangles.

use std::sync::Arc;

use hicp_core::{
    Context, Correspondences, Facing, Isometry3, Model, Point3, Problem, Surfel, UnitVector3,
};

use crate::association::data_association::DataAssociation;
use crate::association::from_observation::{FromObservation, IndexedSurface, faces};
use crate::search::box_tree::{Bounds, BoxTree, Element, Stack};
use crate::search::triangle::closest_point;
use crate::stride::Stride;

/// Pairs every observed point with the exact closest point on the model's triangles.
///
/// It implements the search of Besl & McKay 1992, §III, from the observation to the model; see
/// [`ObservationToModel`](crate::ObservationToModel). It avoids the error of a sampled surface,
/// half the spacing of the samples, and the noise that this adds to the direction.
///
/// Each observed point is moved into the object frame. Branch and bound over a tree of boxes finds
/// the closest point. The tree is built once per model and shared by all threads. The source of the
/// pair is the closest point with the normal of its triangle, moved by the current estimate. If the
/// mesh is closed, normals point out of the object. If the winding determines nothing, they face
/// the camera. Triangles without area are never found. Of equally close triangles (a shared edge),
/// the first is found.
///
/// `source` is ignored. `source_index` is the index of the triangle. All observed points of the
/// stride are candidates.
///
/// Cost: O(n log n) once per model, then about O(log n) per observed point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClosestPointOnMesh {
    /// The observed pixels to pair.
    pub stride: Stride,
    /// If `true`, skips triangles of a closed mesh that face away from the camera.
    ///
    /// The camera cannot have measured them.
    pub visible_only: bool,
}

impl Default for ClosestPointOnMesh {
    /// About 2,000 observed points, to triangles that face the camera.
    fn default() -> Self {
        Self {
            stride: Stride::AboutPoints(2000),
            visible_only: true,
        }
    }
}

impl DataAssociation for ClosestPointOnMesh {
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
        let faces = MeshFaces::of(model);
        FromObservation {
            observation,
            stride: self.stride,
            surface: ClosestFace {
                mesh: &faces,
                visible_only: self.visible_only && faces.oriented,
            },
            camera_from_object,
            pairs,
        }
        .associate();
    }

    fn name(&self) -> &'static str {
        "closest-point-on-mesh"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_mesh_or_image(self.name())
    }
}

/// Triangles per leaf: fewer than points, because the distance to a triangle costs more.
const LEAF_SIZE: usize = 4;

/// The triangles of a mesh in the order of the tree's leaves.
struct MeshFaces {
    tree: BoxTree<LEAF_SIZE>,
    faces: Vec<Face>,
    /// `true` if normals are certain to point out of the object.
    oriented: bool,
}

#[derive(Clone, Copy)]
struct Face {
    corners: [Point3<f32>; 3],
    normal: UnitVector3<f32>,
    triangle: u32,
}

impl Element for Face {
    fn bounds(&self) -> Bounds {
        let [a, b, c] = &self.corners;
        Bounds {
            min: a.inf(b).inf(c),
            max: a.sup(b).sup(c),
        }
    }

    fn center(&self) -> Point3<f32> {
        let Bounds { min, max } = self.bounds();
        Point3::from((min.coords + max.coords) * 0.5)
    }
}

impl Face {
    /// Returns the closest point of the triangle and its squared distance.
    #[inline(always)]
    fn closest(&self, query: &Point3<f32>) -> (Point3<f32>, f32) {
        let query = query.cast::<f64>();
        let closest = closest_point(&query, &self.corners.map(|corner| corner.cast::<f64>()));
        #[allow(clippy::cast_possible_truncation)] // The tree compares in `f32`.
        let distance_squared = (closest - query).norm_squared() as f32;
        (closest.cast::<f32>(), distance_squared)
    }
}

impl MeshFaces {
    fn of(model: &Model) -> Arc<Self> {
        model.derived().get_or_build(0, || Self::build(model))
    }

    fn build(model: &Model) -> Self {
        let mesh = model.mesh();
        let sign = if mesh.facing() == Facing::Inward {
            -1.0
        } else {
            1.0
        };
        let faces: Vec<Face> = (0_u32..)
            .zip(0..mesh.triangles().len())
            .filter_map(|(triangle, index)| {
                mesh.normal(index).map(|normal| Face {
                    corners: mesh.corners(index),
                    normal: UnitVector3::new_unchecked(normal.into_inner() * sign),
                    triangle,
                })
            })
            .collect();
        let mut tree = BoxTree::default();
        tree.rebuild(&faces);
        let in_order = tree.order().iter().map(|i| faces[*i as usize]);
        Self {
            faces: in_order.collect(),
            tree,
            oriented: mesh.is_closed(),
        }
    }
}

struct ClosestFace<'a> {
    mesh: &'a MeshFaces,
    visible_only: bool,
}

impl IndexedSurface for ClosestFace<'_> {
    #[inline(always)]
    fn closest(
        &self,
        query: &Point3<f32>,
        eye: &Point3<f32>,
        stack: &mut Stack,
    ) -> Option<(u32, Surfel)> {
        let mut best: Option<(&Face, Point3<f32>)> = None;
        let mut bound = f32::MAX;
        let mut leaves = self.mesh.tree.leaves_near(query, stack);
        while let Some(slots) = leaves.next(bound) {
            for face in &self.mesh.faces[slots] {
                if self.visible_only && !faces(&face.normal, &face.corners[0], eye) {
                    continue;
                }
                let (point, distance) = face.closest(query);
                let earlier = best.is_none_or(|(best, _)| face.triangle < best.triangle);
                if distance < bound || (distance == bound && earlier) {
                    bound = distance;
                    best = Some((face, point));
                }
            }
        }
        let (face, point) = best?;
        let normal = if self.mesh.oriented || faces(&face.normal, &point, eye) {
            face.normal
        } else {
            -face.normal
        };
        Some((face.triangle, Surfel { point, normal }))
    }
}
