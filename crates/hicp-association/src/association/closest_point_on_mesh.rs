//! Association from the observation to the model's triangles.

use std::sync::Arc;

use hicp_core::{
    Context, Correspondences, Facing, Isometry3, Model, Pair, Point3, RigidTransform, Surfel,
    UnitVector3, se3,
};

use crate::association::data_association::DataAssociation;
use crate::search::box_tree::{Bounds, BoxTree};
use crate::search::triangle::closest_point;
use crate::stride::Stride;

/// Pairs every observed point with the exact closest point on the model's triangles (Besl & McKay 1992, §III).
///
/// From the observation to the model, see [`crate::ObservationToModel`], without the error of a sampled surface: half the
/// spacing of the samples, and the noise that it puts on the direction. The observed point is brought into the object
/// frame; the closest point comes from a tree of boxes over the triangles by branch and bound, built once per model and
/// shared by all threads; the pair's source is that point and the normal of its triangle, moved by the current estimate.
/// Normals point out of the object where the mesh is closed, and toward the camera where nothing may be concluded from the
/// winding. Triangles of no area are never found; of equally close triangles (a shared edge) the first is.
///
/// `source` is ignored; `source_index` is the index of the triangle, and all observed points tried are candidates.
/// Cost: O(n log n) once per model, then about O(log n) per observed point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClosestPointOnMesh {
    /// Which observed pixels are paired.
    pub stride: Stride,
    /// Whether triangles of a closed mesh that face away from the camera are passed over: the camera cannot have seen them.
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
        let view = ObjectView::new(camera_from_object);
        let stride = self.stride.pixels(observation.n_surfels());
        let mut candidates = 0;
        for (target_index, target) in observation.surfels(stride) {
            candidates += 1;
            let Some(view) = &view else {
                continue;
            };
            let query = view.object_from_camera.point(&target.point);
            if let Some((triangle, source)) = faces.closest(&query, &view.eye, self.visible_only) {
                let source = view.camera_from_object.surfel(&source);
                pairs.push(Pair::new(triangle, source, target_index, *target));
            }
        }
        pairs.set_candidates(candidates);
    }

    fn name(&self) -> &'static str {
        "closest-point-on-mesh"
    }
}

/// A pose as an association from the observation needs it.
pub(crate) struct ObjectView {
    pub(crate) camera_from_object: RigidTransform,
    pub(crate) object_from_camera: RigidTransform,
    /// The camera's centre in the object frame.
    pub(crate) eye: Point3<f32>,
}

impl ObjectView {
    /// Returns `None` for a pose that is not finite.
    pub(crate) fn new(camera_from_object: &Isometry3<f64>) -> Option<Self> {
        let object_from_camera = camera_from_object.inverse();
        se3::is_finite(&object_from_camera).then(|| Self {
            camera_from_object: RigidTransform::new(camera_from_object),
            object_from_camera: RigidTransform::new(&object_from_camera),
            eye: Point3::from(object_from_camera.translation.vector.cast::<f32>()),
        })
    }
}

/// Returns whether a surface element can be seen from `eye`, as far as its own orientation says.
#[inline]
pub(crate) fn faces(normal: &UnitVector3<f32>, point: &Point3<f32>, eye: &Point3<f32>) -> bool {
    normal.dot(&(eye - point)) > 0.0
}

/// The triangles of a mesh in the order of the tree's leaves.
struct MeshFaces {
    tree: BoxTree,
    faces: Vec<Face>,
    /// Whether normals are known to point out of the object.
    oriented: bool,
}

#[derive(Clone, Copy)]
struct Face {
    corners: [Point3<f32>; 3],
    normal: UnitVector3<f32>,
    triangle: u32,
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
        tree.rebuild(faces.len(), |element| {
            let [a, b, c] = faces[element as usize].corners;
            Bounds {
                min: a.inf(&b).inf(&c),
                max: a.sup(&b).sup(&c),
            }
        });
        // Leaf order: a leaf is then one stretch of memory.
        let faces = tree
            .order()
            .iter()
            .map(|element| faces[*element as usize])
            .collect();
        Self {
            tree,
            faces,
            oriented: mesh.is_closed(),
        }
    }

    /// Returns the closest triangle and the surfel there, in the object frame.
    fn closest(
        &self,
        query: &Point3<f32>,
        eye: &Point3<f32>,
        visible_only: bool,
    ) -> Option<(u32, Surfel)> {
        let exact = query.cast::<f64>();
        let on_face =
            |face: &Face| closest_point(&exact, &face.corners.map(|corner| corner.cast::<f64>()));
        let found = self.tree.nearest(query, |slot| {
            let face = &self.faces[slot];
            let hidden =
                visible_only && self.oriented && !faces(&face.normal, &face.corners[0], eye);
            #[allow(clippy::cast_possible_truncation)] // f32 is the precision of the tree.
            (!hidden).then(|| (on_face(face) - exact).norm_squared() as f32)
        })?;
        let face = &self.faces[found.slot];
        let point = on_face(face).cast::<f32>();
        let normal = if self.oriented || faces(&face.normal, &point, eye) {
            face.normal
        } else {
            -face.normal
        };
        Some((face.triangle, Surfel { point, normal }))
    }
}
