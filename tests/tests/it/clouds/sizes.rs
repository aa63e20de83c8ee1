//! Clouds in other units, far from their origin, and of other sizes.

use hicp_sim::rng;
use hybrid_icp::core::{Isometry3, Point3, Vector3, se3};
use hybrid_icp::icp::Termination;
use hybrid_icp::{CloudWarning, Registration};
use rand::RngExt;

use super::{aligned, cloud, moved, points, pose, registered};

#[test]
fn clouds_in_two_units_cause_a_warning() {
    let target = points(1000);
    let millimeters: Vec<_> = target.iter().map(|point| point * 1000.0).collect();
    let ratio = |source: &[Point3<f32>], init: &Isometry3<f64>| {
        let found = &registered(&cloud(source), &cloud(&target), init)[0];
        found.warnings.iter().find_map(|warning| match warning {
            CloudWarning::Extents {
                source_meters,
                target_meters,
            } => Some((source_meters / target_meters).round()),
            _ => None,
        })
    };
    assert_eq!(ratio(&millimeters, &Isometry3::identity()), Some(1000.0));
    // No overlap alone is not a reason.
    assert_eq!(
        ratio(&target, &Isometry3::translation(50.0, 0.0, 0.0)),
        None
    );
}

/// Two scans in coordinates of a map, of which one is moved by less than `f32` resolves there.
#[test]
fn clouds_far_from_their_origin_cause_a_warning() {
    let offset = Isometry3::translation(500_000.0, 5_000_000.0, 0.0);
    // As large as a house.
    let near: Vec<_> = points(1000).iter().map(|point| point * 100.0).collect();
    let far = moved(&near, &offset);
    let coarse = |points: &[Point3<f32>]| {
        let found = &registered(&cloud(points), &cloud(points), &Isometry3::identity())[0];
        let coarse = |w: &&CloudWarning| matches!(w, CloudWarning::CoarseCoordinates { .. });
        found.warnings.iter().filter(coarse).count()
    };
    assert_eq!((coarse(&near), coarse(&far)), (0, 2));
    // As large as a town: the step of 0.5 m is less than a thousandth of it, but not of the points.
    let town: Vec<_> = near.iter().map(|point| point * 50.0).collect();
    assert_eq!((coarse(&town), coarse(&moved(&town, &offset))), (0, 2));
}

/// A rotation of a cloud moves an origin far from it by much more than the stop rule allows.
#[test]
fn the_number_of_iterations_does_not_depend_on_the_origin() {
    let truth = pose([0.05, -0.04, 0.06], [0.004, 0.003, -0.005]);
    for kind in Registration::ALL {
        let [near, far @ ..] = [0.0, 10.0, 100.0].map(|meters| {
            let shift = Isometry3::translation(meters, -0.7 * meters, 0.3 * meters);
            let [source, target] = [(1200, shift), (1500, shift * truth)]
                .map(|(n, pose)| cloud(&moved(&points(n), &pose)));
            let found = aligned(kind, &source, &target);
            assert_eq!(found.outcome.termination, Termination::Converged);
            found.outcome.iterations
        });
        // The coordinates are rounded to `f32`, in steps of up to 8 µm.
        assert!(
            far.iter().all(|n| *n <= near + 5),
            "{kind:?}: {near} {far:?}"
        );
    }
}

/// Places of a hilly square of 2 m.
fn hills(places: impl Iterator<Item = [f32; 2]>, scale: f32) -> Vec<Point3<f32>> {
    let height = |x: f32, y: f32| 1.0 + 0.15 * (3.0 * x).sin() * (2.3 * y).cos();
    let place = |[x, y]: [f32; 2]| Point3::new(x, y, height(x, y)) * scale;
    places.map(place).collect()
}

/// A shift of a small cloud is an error, even if it is less than a tenth of a millimeter.
#[test]
fn small_clouds_move_by_small_shifts() {
    let scale = 0.003;
    let grid = (0..1600).map(|i| [(i % 40) as f32 * 0.05, (i / 40) as f32 * 0.05]);
    let source = hills(grid, scale);
    let truth = Isometry3::translation(0.02 * f64::from(scale), 0.0, 0.0);
    let target = moved(&source, &truth);
    for found in registered(&cloud(&source), &cloud(&target), &Isometry3::identity()) {
        let (_, distance) = se3::pose_distance(&found.target_from_source(), &truth);
        assert!(distance < 1e-3 * f64::from(scale), "{distance}");
    }
}

/// Pairs of a large cloud flip back and forth, which moves it by more than a tenth of a millimeter.
#[test]
fn large_clouds_settle() {
    for seed in 0..4 {
        let mut random = rng(seed);
        let mut scan = || {
            let places = [(); 3000].map(|()| [(); 2].map(|()| 2.0 * random.random::<f32>()));
            let exact = hills(places.into_iter(), 500.0).into_iter();
            let noisy = exact.map(|p| p + Vector3::z() * (5.0 * random.random::<f32>()));
            cloud(&noisy.collect::<Vec<_>>())
        };
        let (source, target) = (scan(), scan());
        for kind in [Registration::PointToPlane, Registration::Generalized] {
            let found = aligned(kind, &source, &target);
            assert_eq!(
                found.outcome.termination,
                Termination::Converged,
                "{kind:?}"
            );
        }
    }
}
