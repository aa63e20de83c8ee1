//! Scenes for the tests of this crate: small meshes, a ray-casting renderer, and observations.

use hicp_association::{DataAssociation, OutlierFilter, PointSelection};
use hicp_core::Iteration;
use hicp_core::{
    Context, Correspondences, DepthImage, Isometry3, Mask, Model, ModelConfig, Observation, Pair,
    PinholeCamera, PixelRegion, Point3, Problem, RenderCache, RenderedView, Renderer, Surfel,
    Translation3, TriMesh, UnitQuaternion, UnitVector3, Vector3,
};

/// A seeded generator (xorshift64*), so that a failing case can be repeated.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(2).wrapping_add(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// Returns a number in 0 … 1.
    pub fn unit(&mut self) -> f32 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 40) as f32 / (1_u64 << 24) as f32
    }

    pub fn within(&mut self, half: f32) -> f32 {
        (2.0 * self.unit() - 1.0) * half
    }

    pub fn below(&mut self, n: usize) -> usize {
        ((self.unit() * n as f32) as usize).min(n - 1)
    }

    pub fn point(&mut self, half: f32) -> Point3<f32> {
        Point3::new(self.within(half), self.within(half), self.within(half))
    }

    pub fn direction(&mut self) -> UnitVector3<f32> {
        loop {
            if let Some(unit) = UnitVector3::try_new(self.point(1.0).coords, 0.1) {
                return unit;
            }
        }
    }

    pub fn surfel(&mut self, half: f32) -> Surfel {
        Surfel {
            point: self.point(half),
            normal: self.direction(),
        }
    }

    pub fn surfels(&mut self, count: usize, half: f32) -> Vec<Surfel> {
        (0..count).map(|_| self.surfel(half)).collect()
    }

    pub fn shuffle<T>(&mut self, list: &mut [T]) {
        for i in (1..list.len()).rev() {
            list.swap(i, self.below(i + 1));
        }
    }

    /// Returns a motion of up to `angle` radians around each axis and `shift` meters along each.
    pub fn motion(&mut self, angle: f32, shift: f32) -> Isometry3<f64> {
        let (turn, shift) = (self.point(angle).coords, self.point(shift).coords);
        Isometry3::from_parts(
            Translation3::from(shift.cast::<f64>()),
            UnitQuaternion::new(turn.cast::<f64>()),
        )
    }
}

pub fn camera() -> PinholeCamera {
    PinholeCamera::new(90.0, 95.0, 31.2, 23.9, 64, 48).unwrap()
}

/// A box with the given half sides in meters, wound outward.
pub fn box_mesh(x: f32, y: f32, z: f32) -> TriMesh {
    let vertices = (0..8)
        .map(|i| {
            let side = |bit: u32, half: f32| if i >> bit & 1 == 1 { half } else { -half };
            Point3::new(side(0, x), side(1, y), side(2, z))
        })
        .collect();
    let quads = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let triangles = quads
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]])
        .collect();
    TriMesh::new(vertices, triangles).unwrap()
}

/// A bumpy ball of about 400 triangles, wound outward, in meters.
pub fn bumpy_ball(radius: f32) -> TriMesh {
    let (rows, columns) = (12_u32, 18_u32);
    let mut vertices = vec![Point3::new(0.0, 0.0, radius)];
    for row in 1..rows {
        for column in 0..columns {
            let polar = row as f32 / rows as f32 * std::f32::consts::PI;
            let around = column as f32 / columns as f32 * std::f32::consts::TAU;
            let r = radius * (1.0 + 0.15 * (3.0 * around).sin() * (2.0 * polar).sin());
            vertices.push(Point3::new(
                r * polar.sin() * around.cos(),
                r * polar.sin() * around.sin(),
                r * polar.cos(),
            ));
        }
    }
    let last = vertices.len() as u32;
    vertices.push(Point3::new(0.0, 0.0, -radius));
    let at = |row: u32, column: u32| 1 + (row - 1) * columns + column % columns;
    let mut triangles = Vec::new();
    for column in 0..columns {
        triangles.push([0, at(1, column), at(1, column + 1)]);
        triangles.push([last, at(rows - 1, column + 1), at(rows - 1, column)]);
        for row in 1..rows - 1 {
            let (a, b) = (at(row, column), at(row, column + 1));
            let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
            triangles.push([a, c, b]);
            triangles.push([b, c, d]);
        }
    }
    TriMesh::new(vertices, triangles).unwrap()
}

/// A renderer that intersects the ray of every pixel with every triangle.
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
        view.reset(*region);
        let corners: Vec<[Vector3<f64>; 3]> = (0..mesh.triangles().len())
            .map(|t| {
                mesh.corners(t)
                    .map(|p| (camera_from_object * p.cast()).coords)
            })
            .collect();
        let width = region.width();
        let (depth, triangles) = view.buffers_mut();
        for index in 0..depth.len() {
            let (u, v) = (index % width, index / width);
            let ray = camera.unproject(u as f64, v as f64, 1.0).coords;
            for (triangle, [a, b, c]) in (0_u32..).zip(&corners) {
                let (ab, ac) = (b - a, c - a);
                let normal = ab.cross(&ac);
                let z = normal.dot(a) / normal.dot(&ray);
                let hit = ray * z - a;
                let s = hit.cross(&ac).dot(&normal) / normal.norm_squared();
                let t = ab.cross(&hit).dot(&normal) / normal.norm_squared();
                let nearer = depth[index] == 0.0 || (z as f32) < depth[index];
                if z > 0.01 && s >= 0.0 && t >= 0.0 && s + t <= 1.0 && nearer {
                    depth[index] = z as f32;
                    triangles[index] = triangle;
                }
            }
        }
    }
}

/// A model, its observation, and its true pose.
pub struct Scene {
    pub model: Model,
    pub observation: Observation,
    pub truth: Isometry3<f64>,
}

impl Scene {
    pub fn problem(&self) -> Problem<'_> {
        Problem::new(&self.model, &self.observation)
    }

    /// Returns a pose near the true one.
    pub fn nearby(&self, seed: u64) -> Isometry3<f64> {
        let offset = Random::new(seed).motion(0.1, 0.01);
        self.truth * offset
    }

    pub fn select(
        &self,
        selection: &mut impl PointSelection,
        pose: &Isometry3<f64>,
    ) -> Vec<Surfel> {
        let mut renders = RenderCache::new(RayCaster);
        let mut source = Vec::new();
        selection.select(
            &mut Context::new(self.problem(), &mut renders),
            pose,
            &mut source,
        );
        source
    }

    pub fn associate(
        &self,
        association: &mut impl DataAssociation,
        source: &[Surfel],
        pose: &Isometry3<f64>,
    ) -> Correspondences {
        let mut renders = RenderCache::new(RayCaster);
        let mut pairs = Correspondences::new();
        pairs.begin(pose, source.len());
        association.associate(
            &mut Context::new(self.problem(), &mut renders),
            source,
            pose,
            &mut pairs,
        );
        pairs
    }

    pub fn filter(&self, filter: &mut impl OutlierFilter, pairs: &[Pair]) -> Vec<Pair> {
        let mut pairs: Correspondences = pairs.iter().copied().collect();
        let iteration = Iteration::new(0, &Isometry3::identity(), self.problem());
        filter.filter(&iteration, &mut pairs);
        pairs.as_slice().to_vec()
    }

    /// Returns the observed surfels of a stride with their indices.
    pub fn targets(&self, stride: u32) -> Vec<(u32, Surfel)> {
        self.observation
            .surfels(stride)
            .map(|(i, s)| (i, *s))
            .collect()
    }
}

/// A mesh at a distance of 0.5 m, observed by the ray caster with some depth noise.
pub fn scene_of(mesh: TriMesh, noise: f32, seed: u64) -> Scene {
    let mut random = Random::new(seed);
    let truth = Isometry3::translation(0.01, -0.02, 0.5) * random.motion(1.5, 0.0);
    let camera = camera();
    let mut view = RenderedView::default();
    RayCaster.render(&mesh, &camera, &truth, &camera.region(), &mut view);
    let mask = view.depth().iter().map(|z| *z > 0.0).collect();
    let depth = view
        .depth()
        .iter()
        .map(|z| {
            if *z > 0.0 {
                z + random.within(noise)
            } else {
                0.9
            }
        })
        .collect();
    let config = ModelConfig {
        samples: 400,
        ..ModelConfig::default()
    };
    Scene {
        model: Model::with_config(mesh, config),
        observation: Observation::new(
            DepthImage::from_meters(64, 48, depth).unwrap(),
            Mask::new(64, 48, mask).unwrap(),
            camera,
        )
        .unwrap(),
        truth,
    }
}

pub fn ball_scene() -> Scene {
    scene_of(bumpy_ball(0.08), 0.001, 5)
}

/// The ball, with an empty image.
pub fn blind_scene() -> Scene {
    let mut scene = ball_scene();
    scene.observation = Observation::new(
        DepthImage::from_meters(64, 48, vec![0.0; 64 * 48]).unwrap(),
        Mask::full(64, 48),
        camera(),
    )
    .unwrap();
    scene
}

/// A selection of given points.
#[derive(Clone)]
pub struct Fixed(pub Vec<Surfel>);

impl PointSelection for Fixed {
    fn select(
        &mut self,
        _context: &mut Context<'_>,
        _camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        source.extend_from_slice(&self.0);
    }
}

pub fn squared(a: &Point3<f32>, b: &Point3<f32>) -> f32 {
    let d = a - b;
    d.x * d.x + d.y * d.y + d.z * d.z
}
