//! Clouds with estimated, averaged and absent normals.

use hicp_sim::Household;
use hybrid_icp::association::{estimate_normals, voxel_downsample};
use hybrid_icp::core::{Cloud, Isometry3, Point3, Surfel, UnitVector3, Vector3, se3};
use hybrid_icp::icp::Termination;
use hybrid_icp::{CloudOptions, CloudSide, CloudWarning, Registration, align};

use super::{cloud, moved, open, points, pose, view};

#[test]
fn estimated_normals_are_those_of_the_surface() {
    let sphere: Vec<_> = (0..4000)
        .map(|i| {
            let (z, turn) = (1.0 - (i as f32 + 0.5) / 2000.0, i as f32 * 2.399_963_2);
            let radius = (1.0 - z * z).sqrt();
            Point3::new(radius * turn.cos(), radius * turn.sin(), z)
        })
        .collect();
    for (point, normal) in sphere.iter().zip(estimate_normals(&sphere, 10)) {
        // The origin is the center, and normals face it.
        assert!(normal.unwrap().dot(&point.coords) < -0.999, "{point}");
    }
    assert!(estimate_normals(&sphere, 2).iter().all(Option::is_none));
    assert!(estimate_normals(&sphere, 0).iter().all(Option::is_none));
}

#[test]
fn voxels_hold_the_mean_of_their_points() {
    let points = [
        [0.0, 0.0, 0.0],
        [0.3, 0.0, 0.0],
        [5.2, 0.1, 0.0],
        [f32::NAN, 0.0, 0.0],
    ];
    let points = points.map(Point3::from);
    let (means, _) = voxel_downsample(&points, None, 1.0);
    assert_eq!(means, [Point3::new(0.15, 0.0, 0.0), points[2]]);
    for edge in [0.0, -1.0, f64::NAN, 1e-9] {
        assert_eq!(voxel_downsample(&points, None, edge).0.len(), 4);
    }
    assert_eq!(voxel_downsample(&[], None, 1.0).0, []);
    let up = Vector3::z_axis();
    let unknown = UnitVector3::new_unchecked(Vector3::repeat(f32::NAN));
    let normals = |given: [_; 4]| voxel_downsample(&points, Some(&given), 1.0).1.unwrap();
    // A point without a normal leaves its cell those of the others.
    assert_eq!(normals([up, up, up, -up]), [up, up]);
    assert_eq!(normals([unknown, up, up, -up]), [up, up]);
    let options = CloudOptions {
        voxel_meters: Some(1.0),
        neighbors: 3,
    };
    for [a, b] in [[unknown, unknown], [up, -up]] {
        let given = [a, b, up, up];
        assert!(normals(given)[0].x.is_nan());
        let raised = points.map(|point| point + up.into_inner());
        let target = |kind| options.target_of(kind, &raised, Some(&given)).unwrap();
        let counts = |cloud: Cloud| (cloud.surfels().len(), cloud.n_skipped());
        // One point has no place, and one of the two cells no normal.
        assert_eq!(counts(target(Registration::PointToPoint)), (2, 1));
        assert_eq!(counts(target(Registration::PointToPlane)), (1, 2));
    }
    let surfel = |point| Surfel { point, normal: up };
    let given = Cloud::new(points.map(surfel));
    assert_eq!((given.n_skipped(), given.normals_from()), (1, None));
    let error = CloudOptions::default().cloud(&points, Some(&[up]));
    assert!(
        error
            .unwrap_err()
            .to_string()
            .contains("1 normals for 4 points")
    );
}

/// Sources without normals register as they do with them, if the error does not need them.
/// Otherwise the initial pose is kept.
#[test]
fn absent_normals_of_the_source_are_never_used() {
    let options = CloudOptions::default();
    let target = cloud(&points(4000));
    let init = Isometry3::translation(0.002, -0.001, 0.003);
    for kind in Registration::ALL {
        let full = options.cloud(&points(2000), None).unwrap();
        let bare = options
            .for_source_of(kind)
            .cloud(&points(2000), None)
            .unwrap();
        let found = |source| align(source, &target, &init, &mut *kind.build(None));
        assert_eq!(found(&full).outcome, found(&bare).outcome);
        let without = Cloud::without_normals(points(2000));
        if kind == Registration::Generalized {
            assert_eq!(found(&without).target_from_source(), init);
            let side = CloudSide::Source;
            let last = found(&without).warnings.pop();
            assert_eq!(last, Some(CloudWarning::NoNormals { side }));
        } else {
            assert_eq!(found(&full).outcome, found(&without).outcome);
        }
    }
}

/// Sources without normals are not at fault if the clouds touch in too few points.
#[test]
fn few_pairs_are_not_absent_normals() {
    let row = |i: u16| Point3::new(0.01 * f32::from(i), 0.1 * f32::from(i % 7), 0.5);
    let near: Vec<_> = (0..50).map(row).collect();
    let touching: Vec<_> = (49..90).map(row).collect();
    for kind in [Registration::PointToPoint, Registration::PointToPlane] {
        let options = CloudOptions::default();
        let source = options.for_source_of(kind).cloud(&near, None).unwrap();
        let target = options.target_of(kind, &touching, None).unwrap();
        let init = Isometry3::identity();
        let found = align(&source, &target, &init, &mut *kind.build(Some(0.005)));
        assert_eq!(found.outcome.termination, Termination::Degenerate);
        let little = CloudWarning::LittleOverlap { fitness: 0.0 };
        assert_eq!(found.warnings.last(), Some(&little), "{kind:?}");
    }
}

/// A scan of four walls in one plane, as of a laser scanner, determines no normals.
#[test]
fn point_to_point_keeps_target_points_without_a_normal() {
    let wall = |i: u16| (f32::from(i % 100) - 50.0) / 25.0;
    let walls: Vec<_> = (0..400)
        .map(|i| match i / 100 {
            0 => Point3::new(wall(i), 2.0, 1.0),
            1 => Point3::new(wall(i), -1.5, 1.0),
            2 => Point3::new(2.0, wall(i), 1.0),
            _ => Point3::new(-2.0, wall(i), 1.0),
        })
        .collect();
    let truth = pose([0.0, 0.0, 0.004], [0.004, -0.003, 0.0]);
    let (options, moved) = (CloudOptions::default(), moved(&walls, &truth));
    let register = |kind: Registration| {
        let source = options.for_source_of(kind).cloud(&walls, None).unwrap();
        let target = options.target_of(kind, &moved, None).unwrap();
        align(
            &source,
            &target,
            &Isometry3::identity(),
            &mut kind.build(None),
        )
    };
    let found = register(Registration::PointToPoint);
    let (angle, distance) = se3::pose_distance(&found.target_from_source(), &truth);
    assert!(angle < 1e-4 && distance < 1e-4, "{angle} {distance}");
    let estimated = CloudWarning::NormalsEstimated {
        side: CloudSide::Target,
        neighbors: 20,
    };
    assert_eq!((found.fitness(), found.warnings), (1.0, vec![estimated]));
    // The other errors need normals, so they skip points, with a warning.
    for kind in [Registration::PointToPlane, Registration::Generalized] {
        let skipped = |w: &CloudWarning| matches!(w, CloudWarning::PointsSkipped { .. });
        assert!(register(kind).warnings.iter().any(skipped), "{kind:?}");
    }
}

/// The other points of such a target keep their normals, for the warnings.
#[test]
fn points_without_a_normal_hide_no_open_direction() {
    let source = view(Household::Can, 12_000, 0.0, 1e-3);
    let mut target = view(Household::Can, 13_000, 1.0, 1e-3);
    let cable = (0..30_u8).map(|i| Point3::new(0.5, 0.0, 0.01 * f32::from(i)));
    let kind = Registration::PointToPoint;
    let options = CloudOptions::default();
    let source = options.for_source_of(kind).cloud(&source, None).unwrap();
    let align = |points: &[Point3<f32>]| {
        let target = options.target_of(kind, points, None).unwrap();
        assert_eq!(target.n_skipped(), 0);
        align(
            &source,
            &target,
            &Isometry3::identity(),
            &mut kind.build(None),
        )
    };
    let alone = align(&target);
    target.extend(cable);
    let found = align(&target);
    assert!(matches!(open(&alone), Some((1, Some(_)))), "{alone:?}");
    assert_eq!(open(&found), open(&alone));
    assert_eq!(found.outcome.quality, alone.outcome.quality);
}
