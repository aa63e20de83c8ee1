//! Registration of point clouds: recovery, equivariance, hostile input, parts that need an image.

mod normals;
mod sizes;

use hicp_sim::{Household, rng, rotation};
use hybrid_icp::association::{
    AllSamples, BoundaryTargets, Length, MaxDistance, NearestNeighbor, Projective, Reciprocal,
    VisibleSurface, VoxelGrid,
};
use hybrid_icp::core::{
    Cloud, Isometry3, Model, Point3, Problem, Surfel, Vector3, sample_surface, se3,
};
use hybrid_icp::icp::{
    Guard, Icp, IterationLimit, Session, SmallMotion, Stage, Termination, Workspace,
};
use hybrid_icp::metric::PointToPlane;
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::MeanVsd;
use hybrid_icp::{
    Alignment, CloudOptions, CloudSide, CloudWarning, Preset, Registration, Trace, align, align_in,
};
use proptest::prelude::*;
use rand::RngExt;

fn mug() -> Model {
    Household::Mug.model().unwrap()
}

/// Registers two clouds without an initial pose.
fn aligned(kind: Registration, source: &Cloud, target: &Cloud) -> Alignment {
    align(
        source,
        target,
        &Isometry3::identity(),
        &mut *kind.build(None),
    )
}

/// Returns points of the mug's surface without normals.
fn points(count: usize) -> Vec<Point3<f32>> {
    let surfels = sample_surface(mug().mesh(), count);
    surfels.iter().map(|surfel| surfel.point).collect()
}

fn moved(points: &[Point3<f32>], pose: &Isometry3<f64>) -> Vec<Point3<f32>> {
    let point = |p: &Point3<f32>| (pose * p.cast::<f64>()).cast();
    points.iter().map(point).collect()
}

fn cloud(points: &[Point3<f32>]) -> Cloud {
    CloudOptions::default().cloud(points, None).unwrap()
}

fn registered(source: &Cloud, target: &Cloud, init: &Isometry3<f64>) -> [Alignment; 3] {
    Registration::ALL.map(|kind| align(source, target, init, &mut *kind.build(None)))
}

fn pose(angles: [f64; 3], shift: [f64; 3]) -> Isometry3<f64> {
    Isometry3::new(Vector3::from(shift), Vector3::from(angles))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// The same points, moved by up to 10° and 10 mm.
    #[test]
    fn a_known_transform_is_recovered(
        angles in prop::array::uniform3(-0.1..0.1), shift in prop::array::uniform3(-0.006..0.006),
    ) {
        let (points, truth) = (points(2000), pose(angles, shift));
        let (source, target) = (cloud(&points), cloud(&moved(&points, &truth)));
        for found in registered(&source, &target, &Isometry3::identity()) {
            let (angle, distance) = se3::pose_distance(&found.target_from_source(), &truth);
            prop_assert!(angle.to_degrees() < 0.02 && distance < 2e-5, "{angle} {distance}");
            prop_assert!(found.fitness() > 0.999 && found.rmse().unwrap() < 1e-4);
            prop_assert!(found.covariance().is_some());
        }
    }

    /// A motion of the target and of the initial pose moves the result.
    #[test]
    fn results_move_with_the_target(
        angles in prop::array::uniform3(-3.0..3.0), shift in prop::array::uniform3(-1.0..1.0),
    ) {
        let target = moved(&points(1500), &pose([0.05, -0.04, 0.06], [0.004, 0.003, -0.005]));
        let motion = pose(angles, shift);
        let source = cloud(&points(1200));
        let still = registered(&source, &cloud(&target), &Isometry3::identity());
        let carried = registered(&source, &cloud(&moved(&target, &motion)), &motion);
        for (still, carried) in still.iter().zip(carried) {
            let expected = motion * still.target_from_source();
            let (angle, distance) = se3::pose_distance(&carried.target_from_source(), &expected);
            prop_assert!(angle.to_degrees() < 0.05 && distance < 1e-4, "{angle} {distance}");
        }
    }
}

#[test]
fn a_reused_workspace_changes_nothing_and_the_observer_sees_every_stage() {
    let target = cloud(&points(500));
    let (mut workspace, mut trace) = (Workspace::new(Rasterizer::default()), Trace::new());
    let mut pipeline = Registration::PointToPlane.build(None);
    for count in [900, 400] {
        let (source, init) = (
            cloud(&points(count)),
            pose([0.03, 0.0, 0.0], [0.002, 0.0, 0.0]),
        );
        let mut session = Session::new(&mut workspace, &mut trace);
        let found = align_in(&source, &target, &init, &mut *pipeline, &mut session);
        assert_eq!(found, align(&source, &target, &init, &mut *pipeline));
    }
    assert_eq!(trace.stages.len(), 4);
}

/// Every pose stays finite, and every result says what is wrong.
#[test]
fn hostile_clouds_end_in_an_honest_outcome() {
    let good = cloud(&points(1000));
    let repeated = |point: Point3<f32>| cloud(&vec![point; 50]);
    let line: Vec<_> = (0..50)
        .map(|i| Point3::new(0.01 * i as f32, 0.0, 0.5))
        .collect();
    let nan = [f32::NAN, f32::INFINITY, 1e30].map(|x| Point3::new(x, 0.0, 0.0));
    for bad in [
        cloud(&[]),
        cloud(&[Point3::origin()]),
        repeated(Point3::new(0.1, 0.2, 0.3)),
        cloud(&line),
        cloud(&nan),
    ] {
        for (source, target) in [(&bad, &good), (&good, &bad), (&bad, &bad)] {
            for found in registered(source, target, &Isometry3::identity()) {
                assert_eq!(found.target_from_source(), Isometry3::identity());
                assert_eq!(found.outcome.termination, Termination::NoPairs);
                assert_eq!((found.fitness(), found.rmse()), (0.0, None));
                let little = CloudWarning::LittleOverlap { fitness: 0.0 };
                assert!(found.warnings.contains(&little));
            }
        }
    }
    let mut with_nan = points(1000);
    with_nan.extend(nan);
    let cloud = cloud(&with_nan);
    assert_eq!((cloud.surfels().len(), cloud.n_skipped()), (1000, 3));
}

/// Two spheres determine no rotation. Noise makes it look as if they did.
#[test]
fn spheres_have_no_covariance() {
    let sphere = |seed: u64| {
        let mut random = rng(seed);
        let point = |_| {
            let radius = 0.1 + 0.0005 * (random.random::<f64>() - 0.5);
            let direction = rotation(&mut random) * Vector3::z();
            Point3::from((direction * radius).cast::<f32>())
        };
        cloud(&(0..3000).map(point).collect::<Vec<_>>())
    };
    let (source, target) = (sphere(1), sphere(2));
    for kind in [Registration::PointToPlane, Registration::Generalized] {
        let found = aligned(kind, &source, &target);
        assert!(found.covariance().is_none(), "{kind:?}");
        // Rotations around every axis.
        assert!(matches!(open(&found), Some((3.., None))), "{found:?}");
    }
}

#[test]
fn a_cloud_of_a_few_points_is_named() {
    let few = cloud(
        &(0..5)
            .map(|i| Point3::new(i as f32, 0.0, 1.0))
            .collect::<Vec<_>>(),
    );
    let many = cloud(&view(Household::Mug, 500, 0.0, 0.0));
    let found = aligned(Registration::PointToPlane, &few, &many);
    let text: Vec<_> = found.warnings.iter().map(ToString::to_string).collect();
    let expected = "usable points, expected 6 or more: do not trust the pose";
    assert!(
        text.iter()
            .any(|w| w.starts_with("source: ") && w.ends_with(expected)),
        "{text:?}"
    );
}

/// Returns the number of directions that a warning calls open, and the axis of their rotations.
fn open(found: &Alignment) -> Option<(usize, Option<[f64; 3]>)> {
    found.warnings.iter().find_map(|warning| match warning {
        CloudWarning::Undetermined { directions, axis } => Some((*directions, *axis)),
        _ => None,
    })
}

/// Returns noisy points of an upright object that are visible from one side.
fn view(object: Household, count: usize, azimuth: f64, noise: f64) -> Vec<Point3<f32>> {
    let mut random = rng(count as u64);
    let model = object.model().unwrap();
    let viewer = Vector3::new(azimuth.cos(), azimuth.sin(), 0.4);
    let seen = sample_surface(model.mesh(), count).into_iter();
    let seen = seen.filter(|surfel| surfel.normal.cast::<f64>().dot(&viewer) > 0.15);
    let mut offset = || (0..12).map(|_| random.random::<f64>() - 0.5).sum::<f64>() * noise;
    let point = |surfel: Surfel| {
        let error = Vector3::new(offset(), offset(), offset());
        (surfel.point.cast::<f64>() + error).cast::<f32>()
    };
    seen.map(point).collect()
}

/// Two views of a roll of tape: its borders pull it around its axis, to where the views overlap
/// most.
#[test]
fn an_undetermined_rotation_stays_as_it_is() {
    let [source, target] = [(12_000, 0.0), (13_000, 1.0)]
        .map(|(n, azimuth)| cloud(&view(Household::Tape, n, azimuth, 1e-4)));
    let start = Isometry3::identity();
    let mut pipeline = Registration::PointToPlane.build(None);
    let found = align(&source, &target, &start, &mut pipeline);
    let (angle, distance) = se3::pose_distance(&found.target_from_source(), &start);
    assert!(
        angle.to_degrees() < 0.2 && distance < 1e-3,
        "{angle} {distance}"
    );
    assert!(matches!(open(&found), Some((1, Some(_)))), "{found:?}");
}

/// Noise of normals gives the pairs of a can more information about its axis than the limit.
#[test]
fn noise_does_not_determine_a_rotation() {
    let objects = [(Household::Can, true), (Household::Mug, false)];
    for ((object, is_open), noise) in objects.into_iter().flat_map(|o| [(o, 1e-3), (o, 2.5e-3)]) {
        let [source, target] = [(12_000, 0.0), (13_000, 1.0)]
            .map(|(n, azimuth)| cloud(&view(object, n, azimuth, noise)));
        for kind in [Registration::PointToPlane, Registration::Generalized] {
            let found = aligned(kind, &source, &target);
            let pairs = found.outcome.quality.unwrap().observability().unwrap();
            assert!(pairs.eigenvalues[0] > 0.01, "{object:?} {kind:?} {pairs:?}");
            assert_eq!(found.covariance().is_none(), is_open, "{object:?} {kind:?}");
            match open(&found) {
                Some((1, Some([_, _, z]))) if is_open => {
                    assert!(z.abs() > 0.99, "{found:?}");
                    let text = found.warnings.last().unwrap().to_string();
                    assert!(
                        text.contains("1 of the 6 directions of the pose, among them"),
                        "{text}"
                    );
                }
                other => assert!(other.is_none() && !is_open, "{object:?} {kind:?} {other:?}"),
            }
        }
    }
}

/// Sensors write (0, 0, 0) where nothing was measured.
#[test]
fn points_at_zero_are_skipped_and_counted() {
    let mut with_zeros = points(1000);
    with_zeros.splice(0..0, [Point3::origin(); 300]);
    with_zeros.push(Point3::new(f32::NAN, 0.0, 0.0));
    let up = vec![Vector3::z_axis(); with_zeros.len()];
    for voxel_meters in [None, Some(0.004), Some(1e-9)] {
        let options = CloudOptions {
            voxel_meters,
            ..CloudOptions::default()
        };
        for normals in [None, Some(&up[..])] {
            let cloud = options.cloud(&with_zeros, normals).unwrap();
            assert_eq!(cloud.n_skipped(), 301, "{voxel_meters:?}");
            let at_zero = |surfel: &Surfel| surfel.point == Point3::origin();
            assert!(!cloud.surfels().iter().any(at_zero) && cloud.surfels().len() > 500);
        }
    }
}

#[test]
fn lengths_beyond_the_extent_are_named() {
    // Zeros do not count, far from which this cloud is.
    let far = moved(&points(500), &Isometry3::translation(30.0, 0.0, 0.0));
    let far = [&far[..], &[Point3::origin()]].concat();
    let warned = |meters| CloudWarning::of_length("voxel", Some(meters), CloudSide::Target, &far);
    assert_eq!((warned(0.05), warned(f64::NAN)), (None, None));
    let text = warned(2.0).unwrap().to_string();
    assert!(
        text.starts_with("voxel is 2.0000 m, more than the extent of the target, 0."),
        "{text}"
    );
    assert_eq!(
        CloudWarning::of_length("voxel", None, CloudSide::Target, &far),
        None
    );
    assert_eq!(
        CloudWarning::of_length("voxel", Some(2.0), CloudSide::Target, &[]),
        None
    );
}

#[test]
fn clouds_without_overlap_are_not_trusted() {
    let far = moved(&points(1000), &Isometry3::translation(1.0, 0.0, 0.0));
    for found in registered(&cloud(&points(1000)), &cloud(&far), &Isometry3::identity()) {
        assert_eq!(found.outcome.termination, Termination::NoPairs);
        assert_eq!(found.fitness(), 0.0);
    }
    let nan = Isometry3::translation(f64::NAN, 0.0, 0.0);
    let found = &registered(&cloud(&far), &cloud(&far), &nan)[0];
    assert_eq!(found.outcome.termination, Termination::NoPairs);
}

/// A plane leaves three directions open. They must not move, and the covariance must not exist.
#[test]
fn a_coplanar_cloud_does_not_slide() {
    let plate: Vec<_> = (0..1600)
        .map(|i| Point3::new((i % 40) as f32 * 0.01, (i / 40) as f32 * 0.01, 0.5))
        .collect();
    let (source, target) = (
        cloud(&plate),
        cloud(&moved(&plate, &Isometry3::translation(0.0, 0.0, 0.004))),
    );
    let mut pipeline = Registration::PointToPlane.build(None);
    let found = align(&source, &target, &Isometry3::identity(), &mut pipeline);
    let shift = found.target_from_source().translation.vector;
    assert!(
        (shift - Vector3::new(0.0, 0.0, 0.004)).norm() < 1e-4,
        "{shift}"
    );
    assert!(found.covariance().is_none());
    // Two shifts, and the rotation around the normal.
    let Some((3, Some([_, _, z]))) = open(&found) else {
        panic!("{found:?}")
    };
    assert!(z.abs() > 0.999, "{z}");
}

#[test]
fn lengths_in_diameters_measure_the_source_cloud() {
    let (source, target) = (cloud(&points(500)), cloud(&points(10)));
    let problem = Problem::new(&source, &target);
    let expected = hybrid_icp::core::diameter(&points(500)) as f32;
    assert_eq!(Length::Diameters(0.5).meters(&problem), 0.5 * expected);
}

fn stop() -> (SmallMotion, IterationLimit) {
    (SmallMotion::default(), IterationLimit(20))
}

/// Each part names itself, also inside of other parts, and the initial pose is kept.
#[test]
fn parts_that_need_an_image_are_named() {
    let source = cloud(&points(500));
    let nearest = || Icp {
        selection: AllSamples,
        association: NearestNeighbor::default(),
        filter: (),
        metric: PointToPlane,
        stop: stop(),
    };
    let projective = Icp {
        selection: AllSamples,
        association: Reciprocal::new(Projective),
        filter: (),
        metric: PointToPlane,
        stop: stop(),
    };
    let visible = Icp {
        selection: VoxelGrid::new(VisibleSurface::default(), Length::Meters(0.01)),
        association: NearestNeighbor::default(),
        filter: (),
        metric: PointToPlane,
        stop: stop(),
    };
    let boundary = Icp {
        selection: AllSamples,
        association: NearestNeighbor::default(),
        filter: (
            MaxDistance::meters(0.1),
            vec![Some(BoundaryTargets::default())],
        ),
        metric: PointToPlane,
        stop: stop(),
    };
    let guard = Guard {
        stage: nearest(),
        score: MeanVsd::default(),
    };
    let stages: [(Box<dyn Stage>, _); 7] = [
        (Box::new(projective), "projective"),
        (Box::new(visible), "visible-surface"),
        (Box::new(boundary), "boundary-targets"),
        (Box::new(guard), "mve"),
        (Preset::Hybrid.build(), "mve"),
        (Preset::Local.build(), "doubt"),
        (Preset::Auto.build(), "mve"),
    ];
    for (mut stage, part) in stages {
        let init = Isometry3::translation(0.001, 0.0, 0.0);
        let found = align(&source, &source, &init, &mut *stage);
        assert_eq!(found.outcome.termination, Termination::Unsupported(part));
        assert_eq!(found.target_from_source(), init);
        assert!(found.warnings.contains(&CloudWarning::Unsupported { part }));
    }
    let found = align(&source, &source, &Isometry3::identity(), &mut nearest());
    assert_eq!(found.outcome.termination, Termination::Converged);
    assert_eq!(found.fitness(), 1.0);
}

/// A model registers with a cloud, too.
#[test]
fn a_model_is_a_source_for_a_cloud() {
    let (model, truth) = (mug(), pose([0.03, 0.02, -0.04], [0.002, -0.003, 0.002]));
    let target = cloud(&moved(&points(5000), &truth));
    let mut pipeline = Registration::PointToPlane.build(None);
    let found = align(&model, &target, &Isometry3::identity(), &mut pipeline);
    let (angle, distance) = se3::pose_distance(&found.target_from_source(), &truth);
    assert!(
        angle.to_degrees() < 0.5 && distance < 1e-3,
        "{angle} {distance}"
    );
}

/// Point-to-point with half of an overlap slides for longer than the limit.
#[test]
fn the_limit_of_iterations_is_a_warning() {
    let half = |low: f32, n: usize| -> Vec<_> {
        let of_half = points(n).into_iter();
        of_half
            .filter(|p| (low..low + 0.07).contains(&p.z))
            .collect()
    };
    let init = Isometry3::translation(0.0, 0.0, 0.004);
    let mut pipeline = Icp {
        selection: AllSamples,
        association: NearestNeighbor::default(),
        filter: (),
        metric: hybrid_icp::metric::PointToPoint,
        stop: (SmallMotion::default(), IterationLimit(5)),
    };
    let found = align(
        &cloud(&half(-0.05, 2000)),
        &cloud(&half(-0.03, 3000)),
        &init,
        &mut pipeline,
    );
    assert_eq!(found.outcome.termination, Termination::IterationLimit);
    let unsettled = CloudWarning::Unsettled { iterations: 5 };
    assert!(found.warnings.contains(&unsettled), "{:?}", found.warnings);
}
