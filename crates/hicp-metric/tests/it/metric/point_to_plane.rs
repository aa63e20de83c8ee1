//! Tests of point-to-plane: its definition, its invariances, and motions that it must not cause.

use crate::pairs::{ellipsoid, moved, pair, small_motion};
use crate::scenes::AtStart;
use crate::support::Numbers;
use hicp_core::{Correspondences, Matrix6, Pair, Point3, Vector3, Vector6, se3, so3};
use hicp_metric::PointToPlane;

/// Returns n · (exp(ξ) p − q) by its definition.
fn residual(pair: &Pair, xi: &Vector6<f64>) -> f64 {
    let (p, q) = (
        pair.source.point.cast::<f64>(),
        pair.target.point.cast::<f64>(),
    );
    pair.target
        .normal
        .cast::<f64>()
        .dot(&(se3::exp(xi) * p - q))
}

#[test]
fn the_step_is_that_of_gauss_newton_for_the_defined_residual() {
    let mut numbers = Numbers(121);
    for _ in 0..30 {
        let off = small_motion(&mut numbers, 5.0, 0.01);
        let mut pairs = ellipsoid(&mut numbers, 60, &off, &Vector3::new(0.1, -0.05, 0.3));
        for pair in pairs.as_mut_slice() {
            pair.weight = numbers.between(0.1, 3.0) as f32;
        }
        let (mut hessian, mut gradient, mut loss, mut weight) =
            (Matrix6::zeros(), Vector6::zeros(), 0.0, 0.0);
        for pair in pairs.as_slice() {
            let h = 1e-6;
            let row = Vector6::from_fn(|i, _| {
                let unit = Vector6::from_fn(|j, _| if i == j { h } else { 0.0 });
                (residual(pair, &unit) - residual(pair, &-unit)) / (2.0 * h)
            });
            let (w, r) = (f64::from(pair.weight), residual(pair, &Vector6::zeros()));
            hessian += row * row.transpose() * w;
            gradient += row * (w * r);
            loss += w * r * r;
            weight += w;
        }
        let expected = se3::exp(&-(hessian.try_inverse().unwrap() * gradient));
        let step = PointToPlane.step(&pairs).unwrap();
        let (angle, distance) = se3::pose_distance(&step.increment, &expected);
        // Damping with 1e-6 of the mean diagonal shortens a step by up to 1e-6 · mean/smallest
        // eigenvalue, about 2e-5 here, of 0.1 rad and 3 cm.
        assert!(angle < 5e-6 && distance < 2e-6, "{angle} {distance}");
        assert!((step.mean_loss - loss / weight).abs() <= 1e-12 * step.mean_loss);
    }
}

#[test]
fn pitfall_2_the_residual_is_a_projection_not_an_elementwise_product() {
    // n = (1, 1, 0)/√2 and an offset of (0.5, −0.5, 7) in the plane, so the residual is zero. The
    // element-wise sum would be 0.25.
    let normal = Vector3::new(1.0, 1.0, 0.0).normalize();
    let points = (0..10).map(|i| Point3::new(f64::from(i % 3), f64::from(i % 4), f64::from(i)));
    let pairs: Correspondences = points
        .map(|p| pair(p, p + Vector3::new(0.5, -0.5, 7.0), normal, 1.0))
        .collect();
    assert!(PointToPlane.step(&pairs).unwrap().mean_loss < 1e-12);
}

#[test]
fn pitfall_2_loss_and_step_do_not_depend_on_the_frame() {
    let mut numbers = Numbers(122);
    for _ in 0..50 {
        let off = small_motion(&mut numbers, 5.0, 0.01);
        let pairs = ellipsoid(&mut numbers, 80, &off, &Vector3::zeros());
        let frame = numbers.pose(0.5);
        let (here, there) = (
            PointToPlane.step(&pairs).unwrap(),
            PointToPlane.step(&moved(&pairs, &frame)).unwrap(),
        );
        // Points of up to 2 m round by 1e-7 m, and so do residuals of 5 mm. Levers are 4 cm.
        assert!((here.mean_loss - there.mean_loss).abs() < 4e-5 * here.mean_loss);
        let (angle, distance) = se3::pose_distance(
            &(frame * here.increment * frame.inverse()),
            &there.increment,
        );
        assert!(angle < 1e-5, "{angle}");
        // The frame's origin is meters away from the object.
        assert!(distance < 3e-5, "{distance}");
    }
}

/// A plane 5 cm away along its normal.
///
/// In every frame, the step is those 5 cm, without sliding or rotating.
#[test]
fn pitfall_12_a_plane_moves_only_along_its_normal() {
    let mut numbers = Numbers(123);
    for _ in 0..50 {
        let frame = numbers.pose(0.5);
        let normal = frame.rotation * Vector3::z();
        let pairs: Correspondences = (0..400)
            .map(|_| {
                let p = frame
                    * Point3::new(numbers.between(-1.0, 1.0), numbers.between(-1.0, 1.0), 0.0);
                pair(p, p + normal * 0.05, normal, 1.0)
            })
            .collect();
        let increment = PointToPlane.step(&pairs).unwrap().increment;
        let center = frame * Point3::origin();
        let shift = increment * center - center;
        // The roundings of the points (1e-7 m) make the residuals uneven over levers of 1 m.
        assert!(
            (shift.dot(&normal) - 0.05).abs() < 1e-6,
            "{}",
            shift.dot(&normal)
        );
        assert!((shift - normal * shift.dot(&normal)).norm() < 1e-7);
        assert!(so3::angle(&increment.rotation) < 1e-6);
        // No rotation around the normal either.
        assert!(so3::log(&increment.rotation).dot(&normal).abs() < 1e-9);
    }
}

#[test]
fn pitfall_12_a_sphere_does_not_rotate_and_a_cylinder_neither_slides_nor_spins() {
    let mut numbers = Numbers(124);
    for _ in 0..30 {
        let frame = numbers.pose(0.3);
        let shift = numbers.direction() * 0.002;
        // Opposite points in pairs, so that the centroid is the center, and only damping limits the
        // rotation around it.
        let sphere: Correspondences = (0..150)
            .map(|_| numbers.direction())
            .flat_map(|n| [n, -n])
            .map(|n| {
                let q = frame * Point3::from(n * 0.05);
                pair(q + shift, q, frame.rotation * n, 1.0)
            })
            .collect();
        let increment = PointToPlane.step(&sphere).unwrap().increment;
        let center = Point3::from(frame.translation.vector) + shift;
        assert!((increment * center - center + shift).norm() < 1e-6);
        // Rounded normals act on the free rotation with up to 1e-7 of the residuals (1 mm RMS),
        // together 1/√300 of that, against a damping of 1e-6/6: 4e-5 m at the rim, 8e-4 rad.
        // Without damping, the rotation would be arbitrary.
        assert!(
            so3::angle(&increment.rotation) < 1e-3,
            "{}",
            so3::angle(&increment.rotation)
        );

        let axis = frame.rotation * Vector3::z();
        let cylinder: Correspondences = (0..75)
            .map(|_| {
                (
                    numbers.between(0.0, std::f64::consts::TAU),
                    numbers.between(0.0, 0.05),
                )
            })
            .flat_map(|(a, z)| {
                let n = Vector3::new(a.cos(), a.sin(), 0.0);
                [(n, z), (-n, z), (n, -z), (-n, -z)]
            })
            .map(|(n, z)| {
                let q = frame * Point3::from(n * 0.03 + Vector3::z() * z);
                pair(q + shift, q, frame.rotation * n, 1.0)
            })
            .collect();
        let increment = PointToPlane.step(&cylinder).unwrap().increment;
        let center = Point3::from(frame.translation.vector) + shift;
        let step = increment * center - center;
        let across = shift - axis * shift.dot(&axis);
        assert!(step.dot(&axis).abs() < 4e-5, "slid by {}", step.dot(&axis));
        assert!((step - axis * step.dot(&axis) + across).norm() < 1e-6);
        assert!(so3::log(&increment.rotation).dot(&axis).abs() < 1e-3);
    }
}
