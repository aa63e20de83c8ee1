//! Helpers shared by the tests of several crates: a renderer by definition, analytic images,
//! shapes, and seeded numbers.

#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "helpers that other crates' tests share"
)]

use hicp_core::{
    DepthImage, Isometry3, Mask, Matrix3, Model, Observation, PinholeCamera, PixelRegion, Point3,
    RenderCache, RenderedView, Renderer, Translation3, TriMesh, UnitQuaternion, Vector3,
};

/// A renderer that intersects the ray of every pixel with every triangle, by the definition of the
/// contract.
#[derive(Clone, Copy, Debug, Default)]
pub struct RayCaster;

impl Renderer for RayCaster {
    fn render(
        &mut self,
        mesh: &TriMesh,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
        region: &PixelRegion,
        view: &mut RenderedView,
    ) {
        let corners: Vec<[Vector3<f64>; 3]> = (0..mesh.triangles().len())
            .map(|t| {
                mesh.corners(t)
                    .map(|p| (camera_from_object * p.cast::<f64>()).coords)
            })
            .collect();
        let visible = corners
            .iter()
            .any(|c| c.iter().all(|p| p.z > 0.0 && p.norm().is_finite()));
        view.reset(if visible {
            *region
        } else {
            PixelRegion::default()
        });
        let region = view.region();
        let (depth, triangles) = view.buffers_mut();
        for (u, v) in region.pixels() {
            let ray = camera.unproject(f64::from(u), f64::from(v), 1.0).coords;
            let index = region.index(u, v).unwrap();
            for (t, triangle) in (0_u32..).zip(&corners) {
                let Some(z) = intersect(&ray, triangle) else {
                    continue;
                };
                if depth[index] == 0.0 || (z as f32) < depth[index] {
                    depth[index] = z as f32;
                    triangles[index] = t;
                }
            }
        }
    }
}

/// Returns the depth of a triangle along a ray (x, y, 1) from the origin, if it is in front.
fn intersect(ray: &Vector3<f64>, [a, b, c]: &[Vector3<f64>; 3]) -> Option<f64> {
    if a.z <= 0.0 || b.z <= 0.0 || c.z <= 0.0 {
        return None;
    }
    // z ray = a + s (b − a) + t (c − a)
    let matrix = Matrix3::from_columns(&[*ray, a - b, a - c]);
    let solution = matrix.try_inverse()? * a;
    let (z, s, t) = (solution.x, solution.y, solution.z);
    let slack = 1e-9;
    (s >= -slack && t >= -slack && s + t <= 1.0 + slack && z > 0.0).then_some(z)
}

/// A reproducible stream of numbers (SplitMix64).
#[derive(Clone, Debug)]
pub struct Numbers(pub u64);

impl Numbers {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Returns a number, uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Returns an integer, uniform in 0..n.
    pub fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.bits() % n as u64).unwrap()
    }

    /// Returns a standard normal number (Box–Muller).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.unit()).cos()
    }

    pub fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.normal(), self.normal(), self.normal())
    }

    pub fn direction(&mut self) -> Vector3<f64> {
        self.vector().normalize()
    }

    pub fn rotation(&mut self) -> UnitQuaternion<f64> {
        let axis = self.direction();
        UnitQuaternion::new(axis * self.between(0.0, std::f64::consts::PI))
    }

    /// Returns any rotation, with a translation of `size` meters per axis.
    pub fn pose(&mut self, size: f64) -> Isometry3<f64> {
        Isometry3::from_parts(Translation3::from(self.vector() * size), self.rotation())
    }
}

pub fn pose(x: f64, y: f64, z: f64, rx: f64, ry: f64, rz: f64) -> Isometry3<f64> {
    Isometry3::new(Vector3::new(x, y, z), Vector3::new(rx, ry, rz))
}

/// Returns the seven numbers of a pose, for comparison bit by bit.
pub fn bits(pose: &Isometry3<f64>) -> [u64; 7] {
    let (t, q) = (&pose.translation.vector, &pose.rotation.coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(f64::to_bits)
}

/// A box centered at the origin, wound counter-clockwise as seen from outside.
pub fn cuboid(x: f32, y: f32, z: f32) -> TriMesh {
    let corner = |i: u32| {
        let side = |bit: u32, s: f32| if i >> bit & 1 == 1 { s / 2.0 } else { -s / 2.0 };
        Point3::new(side(0, x), side(1, y), side(2, z))
    };
    TriMesh::new((0..8).map(corner).collect(), cuboid_triangles()).unwrap()
}

pub fn cuboid_triangles() -> Vec<[u32; 3]> {
    vec![
        [0, 4, 6],
        [0, 6, 2], // x low
        [1, 3, 7],
        [1, 7, 5], // x high
        [0, 1, 5],
        [0, 5, 4], // y low
        [2, 6, 7],
        [2, 7, 3], // y high
        [0, 2, 3],
        [0, 3, 1], // z low
        [4, 5, 7],
        [4, 7, 6], // z high
    ]
}

/// A wedge without symmetry: every face has another direction.
pub fn wedge() -> TriMesh {
    let p = |x: f32, y: f32, z: f32| Point3::new(x, y, z);
    let vertices = vec![
        p(-0.05, -0.04, -0.03),
        p(0.06, -0.035, -0.025),
        p(0.01, 0.055, -0.02),
        p(-0.045, -0.03, 0.035),
        p(0.04, -0.025, 0.045),
        p(0.0, 0.03, 0.025),
    ];
    let triangles = vec![
        [0, 2, 1],
        [3, 4, 5],
        [0, 1, 4],
        [0, 4, 3],
        [1, 2, 5],
        [1, 5, 4],
        [2, 0, 3],
        [2, 3, 5],
    ];
    TriMesh::new(vertices, triangles).unwrap()
}

/// A camera of 64 × 48 pixels that are not square, with a center between pixels.
pub fn camera() -> PinholeCamera {
    PinholeCamera::new(80.3, 84.1, 31.3, 23.9, 64, 48).unwrap()
}

/// Renders an image of a model alone, masked by its silhouette.
pub fn observe(model: &Model, camera: &PinholeCamera, pose: &Isometry3<f64>) -> Observation {
    let depth = render_depth(model, camera, pose);
    let mask = Mask::measured(&depth);
    Observation::new(depth, mask, *camera).unwrap()
}

/// Renders the model's depth over the whole image, in meters.
pub fn render_depth(model: &Model, camera: &PinholeCamera, pose: &Isometry3<f64>) -> DepthImage {
    let mut cache = RenderCache::new(RayCaster);
    let view = cache.view(model, camera, pose);
    let depth = camera.region().pixels();
    let depth = depth.map(|(u, v)| view.depth_at(u, v));
    DepthImage::collect(camera.width(), camera.height(), depth).unwrap()
}

/// Creates a depth image from a function of the ray (x, y, 1).
pub fn depth_image(camera: &PinholeCamera, mut z: impl FnMut(Vector3<f64>) -> f64) -> DepthImage {
    let pixels = camera.region().pixels();
    let ray = |(u, v)| camera.unproject(f64::from(u), f64::from(v), 1.0).coords;
    let depth = pixels.map(|pixel| z(ray(pixel)) as f32);
    DepthImage::collect(camera.width(), camera.height(), depth).unwrap()
}

/// Returns the depth of the plane n · X = d along a ray (x, y, 1).
pub fn plane_depth(normal: &Vector3<f64>, d: f64, ray: &Vector3<f64>) -> f64 {
    d / normal.dot(ray)
}

/// Returns the depth of the near side of a sphere along a ray (x, y, 1).
///
/// If the ray misses, returns 0.
pub fn sphere_depth(center: &Vector3<f64>, radius: f64, ray: &Vector3<f64>) -> f64 {
    let (a, b) = (ray.norm_squared(), ray.dot(center));
    let discriminant = b * b - a * (center.norm_squared() - radius * radius);
    if discriminant <= 0.0 {
        0.0
    } else {
        (b - discriminant.sqrt()) / a
    }
}

/// Creates an observation of the whole image, masked where depth is present.
pub fn observe_depth(depth: DepthImage, camera: &PinholeCamera) -> Observation {
    let mask = Mask::measured(&depth);
    Observation::new(depth, mask, *camera).unwrap()
}

/// Returns the angle between two directions in degrees, without the cancellation of acos.
pub fn degrees_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b)).to_degrees()
}

pub fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
