//! Surfaces that leave motions open.
//!
//! The tests check the reported open directions, and that nothing moves along them.
//!
//! A plane, a cylinder and a sphere fill the image and the mask. Their depth and normals are
//! analytic in the rays, so the observation is exact up to `f32`. The initial pose is off by a
//! motion that the surface determines and one that it does not. A line and five points are tested
//! as pairs.

use std::f64::consts::PI;

use hybrid_icp::association::{DataAssociation, PointSelection, Projective};
use hybrid_icp::core::Iteration;
use hybrid_icp::core::{
    Context, Correspondences, DepthImage, Isometry3, Mask, Model, Observation, Pair, PinholeCamera,
    Point3, Problem, Surfel, TriMesh, UnitVector3, Vector3, Vector6, se3,
};
use hybrid_icp::icp::Workspace;
use hybrid_icp::metric::Minimize;
use hybrid_icp::metric::{
    Conditioned, Degeneracy, Observability, PointToPlane, PointToPoint, Step,
};
use hybrid_icp::raster::Rasterizer;

/// Distance of the surfaces' origin from the camera, meters.
const DISTANCE: f64 = 0.5;
/// Radius of the cylinder and the sphere, meters.
const RADIUS: f64 = 0.2;

fn camera() -> PinholeCamera {
    PinholeCamera::new(300.0, 300.0, 79.5, 59.5, 160, 120).unwrap()
}

/// Returns an observation of the depth that a function gives for the slopes (x/z, y/z) of a ray.
fn observe(depth: impl Fn(f64, f64) -> f64) -> Observation {
    let camera = camera();
    let meters = camera.region().pixels().map(|(u, v)| {
        let ray = camera.unproject(f64::from(u), f64::from(v), 1.0);
        depth(ray.x, ray.y) as f32
    });
    let image = DepthImage::collect(camera.width(), camera.height(), meters).unwrap();
    let mask = Mask::full(camera.width(), camera.height());
    Observation::new(image, mask, camera).unwrap()
}

/// Returns the depth of the near side of a cylinder along the camera's y axis.
fn cylinder_depth(x: f64, _: f64) -> f64 {
    let (a, c) = (x * x + 1.0, (DISTANCE + RADIUS).powi(2) - RADIUS * RADIUS);
    let b = DISTANCE + RADIUS;
    (b - (b * b - a * c).sqrt()) / a
}

/// Returns the depth of the near side of a sphere.
fn sphere_depth(x: f64, y: f64) -> f64 {
    cylinder_depth(x.hypot(y), 0.0)
}

/// Selects surfels of the exact surface that the camera sees, on a grid.
#[derive(Clone)]
struct Exact(Vec<Surfel>);

impl PointSelection for Exact {
    fn select(&mut self, _: &mut Context<'_>, _: &Isometry3<f64>, source: &mut Vec<Surfel>) {
        source.extend_from_slice(&self.0);
    }
}

/// Returns points of a surface with its normals, from its depth and its normal at a point.
fn surface(
    depth: impl Fn(f64, f64) -> f64,
    normal: impl Fn(&Point3<f64>) -> Vector3<f64>,
) -> Exact {
    let grid = |n: i32| (-n..=n).map(move |i| f64::from(i) / f64::from(n));
    let points = grid(16).flat_map(|x| grid(12).map(move |y| (0.2 * x, 0.15 * y)));
    Exact(
        points
            .map(|(x, y)| {
                let z = depth(x, y);
                let point = Point3::new(x * z, y * z, z);
                Surfel {
                    point: point.cast(),
                    normal: UnitVector3::new_normalize(normal(&point).cast()),
                }
            })
            .collect(),
    )
}

/// The results of a run on a scene.
struct Run {
    /// Observability at the first iteration.
    observability: Observability,
    /// Largest component of an increment along an open direction, relative to the first increment.
    slide: f64,
    /// Root mean square distance from the observed tangent planes before and after, meters.
    rms: (f64, f64),
}

/// Runs the ICP loop step by step and records every increment.
fn run(
    exact: &Exact,
    observation: &Observation,
    start: &Isometry3<f64>,
    policy: Degeneracy,
) -> Run {
    let triangle = vec![
        Point3::origin(),
        Point3::new(0.1, 0.0, 0.0),
        Point3::new(0.0, 0.1, 0.0),
    ];
    let model = Model::new(TriMesh::new(triangle, vec![[0, 1, 2]]).unwrap());
    let problem = Problem::new(&model, observation);
    let mut workspace = Workspace::new(Rasterizer::default());
    let mut context = workspace.context(&problem);
    let mut metric = Conditioned {
        metric: PointToPlane,
        policy,
        threshold: Degeneracy::THRESHOLD,
    };
    let mut pose = *start;
    let mut pairs = Correspondences::new();
    let (mut first, mut slide, mut before) = (None, 0.0_f64, None);
    for _ in 0..12 {
        pairs.begin(&pose, exact.0.len());
        Projective.associate(&mut context, &exact.0, &pose, &mut pairs);
        let seen = observability(&mut metric, &pairs);
        let next = step(&mut metric, &pairs).unwrap();
        let (pivot, length) = (seen.pivot.coords, seen.length);
        let shift = |by: Vector3<f64>| Isometry3::translation(by.x, by.y, by.z);
        let twist = se3::log(&(shift(-pivot) * next.increment * shift(pivot)));
        let scaled = Vector6::from_fn(|i, _| if i < 3 { twist[i] } else { twist[i] * length });
        let (seen, size) = *first.get_or_insert((seen, scaled.norm()));
        let n = seen.n_degenerate(Degeneracy::THRESHOLD);
        let open = observability(&mut metric, &pairs);
        for direction in &open.directions[..n] {
            slide = slide.max(direction.dot(&scaled).abs() / size);
        }
        before.get_or_insert(next.mean_loss.sqrt());
        pose = next.increment * pose;
    }
    pairs.begin(&pose, exact.0.len());
    Projective.associate(&mut context, &exact.0, &pose, &mut pairs);
    let after = metric
        .mean_loss(&Iteration::default(), &pairs)
        .unwrap()
        .sqrt();
    Run {
        observability: first.unwrap().0,
        slide,
        rms: (before.unwrap(), after),
    }
}

fn step(metric: &mut impl Minimize, pairs: &Correspondences) -> Option<Step> {
    metric.minimize(&Iteration::default(), pairs)
}

fn observability(metric: &mut impl Minimize, pairs: &Correspondences) -> Observability {
    let system = metric.system(&Iteration::default(), pairs).unwrap();
    system.observability().unwrap()
}

/// Returns the length of a scaled twist's part in the space of orthonormal others.
fn part_within(direction: &Vector6<f64>, space: &[Vector6<f64>]) -> f64 {
    let squares = space.iter().map(|other| direction.dot(other).powi(2));
    squares.sum::<f64>().sqrt()
}

/// Returns the unit scaled twist of a rotation around an axis through a point, or of a translation.
fn unit_twist(
    observability: &Observability,
    rho: Vector3<f64>,
    turn: Vector3<f64>,
    about: Point3<f64>,
) -> Vector6<f64> {
    // A rotation around the point moves the pivot by φ × (pivot − point).
    let moved = rho + turn.cross(&(observability.pivot - about));
    let mut twist = Vector6::zeros();
    twist.fixed_rows_mut::<3>(0).copy_from(&moved);
    twist
        .fixed_rows_mut::<3>(3)
        .copy_from(&(turn * observability.length));
    twist.normalize()
}

/// Checks that the degenerate directions are these, nothing moves along them, and the rest is
/// solved.
///
/// Damping stops only exactly open directions. On curved surfaces, pixels and estimated normals
/// raise the eigenvalues above the damping. `slide_of_damping` limits the motion there.
fn check(
    name: &str,
    exact: &Exact,
    observation: &Observation,
    open: &[(Vector3<f64>, Vector3<f64>, Point3<f64>)],
    slide_of_damping: f64,
) {
    // 3 mm toward the camera, about 1° of tilt, 2 mm sideways, and 2° in the image plane.
    let start = Isometry3::new(
        Vector3::new(0.002, 0.001, -0.003),
        Vector3::new(1.0, 0.5, 2.0) * (PI / 180.0),
    );
    for policy in [Degeneracy::Freeze, Degeneracy::Damp] {
        let run = run(exact, observation, &start, policy);
        let found = &run.observability;
        let values = found.eigenvalues;
        assert_eq!(
            found.n_degenerate(Degeneracy::THRESHOLD),
            open.len(),
            "{name}: {values:?}"
        );
        for (rho, turn, about) in open {
            let expected = unit_twist(found, *rho, *turn, *about);
            let within = part_within(&expected, &found.directions[..open.len()]);
            assert!(within > 0.999, "{name}: {within} of {expected:?}");
        }
        let limit = if policy == Degeneracy::Freeze {
            1e-6
        } else {
            slide_of_damping
        };
        assert!(
            run.slide < limit,
            "{name} {policy:?}: slid by {}",
            run.slide
        );
        assert!(
            run.rms.1 < 0.02 * run.rms.0,
            "{name} {policy:?}: {:?}",
            run.rms
        );
    }
}

#[test]
fn a_plane_leaves_two_translations_and_a_rotation_open() {
    let o = Vector3::zeros();
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let at = Point3::new(0.0, 0.0, DISTANCE);
    let exact = surface(|_, _| DISTANCE, |_| -Vector3::z());
    check(
        "plane",
        &exact,
        &observe(|_, _| DISTANCE),
        &[(x, o, at), (y, o, at), (o, z, at)],
        1e-6,
    );
}

#[test]
fn a_cylinder_leaves_translation_and_rotation_open_at_its_axis() {
    let (o, y) = (Vector3::zeros(), Vector3::y());
    let center = Point3::new(0.0, 0.0, DISTANCE + RADIUS);
    let exact = surface(cylinder_depth, |p| Vector3::new(p.x, 0.0, p.z - center.z));
    check(
        "cylinder",
        &exact,
        &observe(cylinder_depth),
        &[(y, o, center), (o, y, center)],
        0.2,
    );
}

#[test]
fn a_sphere_leaves_every_rotation_around_its_center_open() {
    let o = Vector3::zeros();
    let center = Point3::new(0.0, 0.0, DISTANCE + RADIUS);
    let exact = surface(sphere_depth, |p| p - center);
    let turns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| (o, axis, center));
    check("sphere", &exact, &observe(sphere_depth), &turns, 0.5);
}

/// Returns pairs of points that differ by a motion, all with the same normal.
fn moved_pairs(points: &[Point3<f64>], motion: &Isometry3<f64>) -> Correspondences {
    let normal = UnitVector3::new_normalize(Vector3::new(0.2, -0.1, -1.0));
    let surfel = |point: Point3<f64>| Surfel {
        point: point.cast(),
        normal,
    };
    (0..)
        .zip(points)
        .map(|(i, point)| Pair::new(i, surfel(*point), i, surfel(motion * point)))
        .collect()
}

#[test]
fn a_line_of_points_leaves_the_rotation_around_it_open() {
    let along = Vector3::new(1.0, 2.0, 0.5).normalize();
    let middle = Point3::new(0.05, -0.02, 0.6);
    let points: Vec<_> = (-10..=10)
        .map(|i| middle + along * (0.01 * f64::from(i)))
        .collect();
    let motion = Isometry3::new(Vector3::new(0.002, -0.001, 0.003), Vector3::zeros());
    let pairs = moved_pairs(&points, &motion);
    for policy in [Degeneracy::Freeze, Degeneracy::Damp] {
        let mut metric = Conditioned {
            metric: PointToPoint,
            policy,
            threshold: Degeneracy::THRESHOLD,
        };
        let found = observability(&mut metric, &pairs);
        assert_eq!(found.n_degenerate(Degeneracy::THRESHOLD), 1, "{found:?}");
        let turn = unit_twist(&found, Vector3::zeros(), along, middle);
        assert!(turn.dot(&found.directions[0]).abs() > 0.999, "{found:?}");
        // The full translation between the pairs is found, and there is no rotation around the
        // line.
        let increment = step(&mut metric, &pairs).unwrap().increment;
        let left = (motion.inverse() * increment).translation.vector.norm();
        assert!(left < 1e-6, "{policy:?}: {increment}");
        assert!(increment.rotation.scaled_axis().dot(&along).abs() < 1e-6 * 0.0037 / 0.06);
    }
}

#[test]
fn five_points_determine_a_step_by_distances_but_not_by_planes() {
    let points = [
        (0.0, 0.0, 0.5),
        (0.05, 0.01, 0.52),
        (-0.03, 0.04, 0.49),
        (0.02, -0.05, 0.55),
        (-0.04, -0.02, 0.51),
    ]
    .map(|(x, y, z)| Point3::new(x, y, z));
    let motion = Isometry3::new(
        Vector3::new(0.002, -0.001, 0.003),
        Vector3::new(1e-3, 2e-3, -1e-3),
    );
    let pairs = moved_pairs(&points, &motion);
    for policy in [Degeneracy::Freeze, Degeneracy::Damp] {
        let threshold = Degeneracy::THRESHOLD;
        // There are five residuals along one normal: fewer rows than unknowns.
        let mut planes = Conditioned {
            metric: PointToPlane,
            policy,
            threshold,
        };
        assert_eq!(step(&mut planes, &pairs), None);
        let open = observability(&mut planes, &pairs);
        assert_eq!(open.n_degenerate(threshold), 3, "{open:?}");
        let mut distances = Conditioned {
            metric: PointToPoint,
            policy,
            threshold,
        };
        let open = observability(&mut distances, &pairs);
        assert_eq!(open.n_degenerate(threshold), 0, "{open:?}");
        // The error of a Gauss–Newton step of 2·10⁻³ rad is its square.
        let increment = step(&mut distances, &pairs).unwrap().increment;
        let (angle, distance) = se3::pose_distance(&increment, &motion);
        assert!(
            angle < 1e-5 && distance < 1e-5,
            "{policy:?}: {angle} {distance}"
        );
    }
}
