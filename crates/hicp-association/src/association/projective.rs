//! Projective data association.

use hicp_core::internal::{VectorLoop, vectorized, whole};
use hicp_core::{
    Context, Correspondences, Isometry3, Observation, Pair, Point3, Problem, RigidTransform,
    Surfel, UnitVector3, Vector3,
};

use crate::association::data_association::DataAssociation;
use crate::association::pixel_projection::PixelProjection;

/// Pairs a model point with the observed point at the pixel that it projects to.
///
/// Sources: §III-A.1; Blais & Levine 1995. The model point is moved by the current estimate and
/// projected with the observation's camera. The target belongs to the pixel whose square contains
/// the projection, if it is masked and has a surfel. Points at or behind the camera plane have no
/// pair.
///
/// Cost: O(1) per point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Projective;

impl DataAssociation for Projective {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        let Some(observation) = context.problem.observation() else {
            return;
        };
        pairs.reserve(source.len());
        vectorized(Project {
            observation,
            projection: PixelProjection::new(observation.camera()),
            mover: RigidTransform::new(camera_from_object),
            source,
            pairs,
        });
    }

    fn name(&self) -> &'static str {
        "projective"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_image(self.name())
    }
}

/// Number of points projected at once.
const LANES: usize = 64;

struct Project<'a> {
    observation: &'a Observation,
    projection: PixelProjection,
    mover: RigidTransform,
    source: &'a [Surfel],
    pairs: &'a mut Correspondences,
}

impl VectorLoop for Project<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let grid = PixelGrid::new(self.observation);
        let observed = self.observation.surfel_map();
        for (block, first) in self.source.chunks(LANES).zip((0_u32..).step_by(LANES)) {
            // Lanes beyond the last point lie in the camera plane and have no pixel.
            let (mut points, mut normals) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
            for (lane, surfel) in block.iter().enumerate() {
                for axis in 0..3 {
                    points[axis][lane] = surfel.point[axis];
                    normals[axis][lane] = surfel.normal[axis];
                }
            }
            let points = self.mover.points(&points);
            let normals = self.mover.vectors(&normals);
            let pixels = grid.pixels(&self.projection, &points);
            for lane in 0..block.len().min(LANES) {
                let target = observed.get(pixels[lane] as usize);
                let Some(target) = target.filter(|target| target.point.z > 0.0) else {
                    continue;
                };
                #[allow(clippy::cast_possible_truncation)] // Below LANES.
                let source_index = first + lane as u32;
                let source = Surfel {
                    point: Point3::new(points[0][lane], points[1][lane], points[2][lane]),
                    normal: UnitVector3::new_unchecked(Vector3::new(
                        normals[0][lane],
                        normals[1][lane],
                        normals[2][lane],
                    )),
                };
                self.pairs
                    .push(Pair::new(source_index, source, pixels[lane], *target));
            }
        }
    }
}

/// The pixels of an observation's region, as in [`Observation::index_near`].
struct PixelGrid {
    u_min: f32,
    v_min: f32,
    width: f32,
    height: f32,
    stride: u32,
}

impl PixelGrid {
    fn new(observation: &Observation) -> Self {
        let region = observation.region();
        let (width, height) = (region.width(), region.height());
        Self {
            u_min: region.u_min as f32,
            v_min: region.v_min as f32,
            width: width as f32,
            height: height as f32,
            stride: region.u_max - region.u_min,
        }
    }

    /// Returns the pixel index of each point, `u32::MAX` if it has none.
    #[inline(always)]
    fn pixels(&self, projection: &PixelProjection, points: &[[f32; LANES]; 3]) -> [u32; LANES] {
        let (us, vs) = projection.project_all(points);
        let mut pixels = [u32::MAX; LANES];
        for lane in 0..LANES {
            let column = us[lane] - self.u_min + 0.5;
            let row = vs[lane] - self.v_min + 0.5;
            let z = points[2][lane];
            // False for NaN.
            let inside = (z > 0.0)
                & (z < f32::INFINITY)
                & (column >= 0.0)
                & (row >= 0.0)
                & (column < self.width)
                & (row < self.height);
            // Outside, any number is valid.
            let pixel = whole(row)
                .wrapping_mul(self.stride)
                .wrapping_add(whole(column));
            pixels[lane] = if inside { pixel } else { u32::MAX };
        }
        pixels
    }
}
