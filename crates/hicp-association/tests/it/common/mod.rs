//! Scenes for the tests of this crate: small meshes, a ray-casting renderer, and observations.

use crate::support::{Numbers, RayCaster, render_depth};
use hicp_association::{DataAssociation, OutlierFilter, PointSelection};
use hicp_core::Iteration;
use hicp_core::{
    Context, Correspondences, DepthImage, Isometry3, Mask, Model, ModelConfig, Observation, Pair,
    PinholeCamera, Point3, Problem, RenderCache, Surfel, Translation3, TriMesh, UnitQuaternion,
    UnitVector3,
};

impl Numbers {
    pub fn within(&mut self, half: f32) -> f32 {
        self.between(-1.0, 1.0) as f32 * half
    }

    pub fn point(&mut self, half: f32) -> Point3<f32> {
        Point3::new(self.within(half), self.within(half), self.within(half))
    }

    pub fn surfel(&mut self, half: f32) -> Surfel {
        Surfel {
            point: self.point(half),
            normal: UnitVector3::new_unchecked(self.direction().cast()),
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
        let offset = Numbers(seed).motion(0.1, 0.01);
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
    let mut numbers = Numbers(seed);
    let truth = Isometry3::translation(0.01, -0.02, 0.5) * numbers.motion(1.5, 0.0);
    let config = ModelConfig {
        samples: 400,
        ..ModelConfig::default()
    };
    let model = Model::with_config(mesh, config);
    let exact = render_depth(&model, &camera(), &truth);
    let noisy = exact.pixels().iter().map(|z| {
        if *z > 0.0 {
            z + numbers.within(noise)
        } else {
            0.9
        }
    });
    let noisy = DepthImage::collect(64, 48, noisy).unwrap();
    Scene {
        observation: Observation::new(noisy, Mask::measured(&exact), camera()).unwrap(),
        model,
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
