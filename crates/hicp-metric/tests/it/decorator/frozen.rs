//! Tests that frozen components are exactly zero, and that the rest is the constrained minimum.

use crate::scenes::{AtStart, Numbers, at, center, difference, exact, posed, surfel};
use hicp_core::{Correspondences, Isometry3, Point3, Vector3, Vector6, se3, so3};
use hicp_metric::Minimize;
use hicp_metric::{
    Conditioned, Degeneracy, Frame, Frozen, GaussNewton, LevenbergMarquardt, PointToPlane,
    PointToPoint, Symmetric,
};

/// Returns the displacement of the object's origin and the rotation vector, in the axes of the
/// frame.
fn components(frame: Frame, pose: &Isometry3<f64>, increment: &Isometry3<f64>) -> [f64; 6] {
    let axes = match frame {
        Frame::Camera => Isometry3::identity().rotation,
        Frame::Object => pose.rotation,
    };
    let origin = Point3::from(pose.translation.vector);
    let shift = axes.inverse() * (increment * origin - origin);
    let turn = axes.inverse() * so3::log(&increment.rotation);
    [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z]
}

fn masks() -> impl Iterator<Item = ([bool; 3], [bool; 3])> {
    (0_u8..64).map(|bits| {
        let held = |i: u8| bits & (1 << i) != 0;
        ([held(0), held(1), held(2)], [held(3), held(4), held(5)])
    })
}

fn frozen<M>(
    metric: M,
    frame: Frame,
    (translation, rotation): ([bool; 3], [bool; 3]),
) -> Frozen<M> {
    Frozen {
        metric,
        frame,
        translation,
        rotation,
    }
}

#[test]
fn frozen_components_are_zero_and_the_others_move() {
    fn check<M: Minimize + Copy>(metric: M) {
        let mut numbers = Numbers(51);
        let pairs = posed(&mut numbers, 80);
        for frame in [Frame::Camera, Frame::Object] {
            for mask in masks() {
                let step = frozen(metric, frame, mask).step(&pairs).unwrap();
                let found = components(frame, pairs.camera_from_object(), &step.increment);
                let held = [mask.0, mask.1].concat();
                for (i, (x, held)) in found.iter().zip(held).enumerate() {
                    // Zero up to the rounding of c − R c in this test.
                    if held {
                        assert!(x.abs() < 1e-15, "{frame:?} {mask:?} {i}: {x}");
                    } else {
                        assert!(x.abs() > 1e-8, "{frame:?} {mask:?} {i}: {x}");
                    }
                }
            }
        }
    }
    check(PointToPlane);
    check(PointToPoint);
    check(Symmetric);
}

#[test]
fn frozen_components_are_zero_to_the_bit() {
    let mut numbers = Numbers(52);
    let pairs = posed(&mut numbers, 80);
    let all = [true; 3];
    let none = [false; 3];
    for frame in [Frame::Camera, Frame::Object] {
        let step = frozen(PointToPlane, frame, (all, all))
            .step(&pairs)
            .unwrap();
        assert_eq!(step.increment, Isometry3::identity());
        let step = frozen(PointToPlane, frame, (none, all))
            .step(&pairs)
            .unwrap();
        assert_eq!(step.increment.rotation, Isometry3::identity().rotation);
    }
    // With eigenvectors, too, although their algorithm mixes frozen and free components.
    for mask in masks() {
        let mut metric = Conditioned {
            metric: frozen(PointToPlane, Frame::Camera, mask),
            ..Conditioned::default()
        };
        let increment = metric.step(&pairs).unwrap().increment;
        let turn = increment.rotation.imag();
        for axis in 0..3 {
            assert!(!mask.1[axis] || turn[axis] == 0.0, "{mask:?} {turn}");
            let shift = increment.translation.vector[axis];
            assert!(mask.1 != all || !mask.0[axis] || shift == 0.0, "{mask:?}");
        }
    }
    let hold = ([false, false, true], all);
    let step = frozen(PointToPoint, Frame::Camera, hold)
        .step(&pairs)
        .unwrap();
    assert_eq!(step.increment.translation.z.to_bits(), 0.0_f64.to_bits());
}

#[test]
fn nothing_frozen_equals_the_inner_metric() {
    let mut numbers = Numbers(53);
    let pairs = posed(&mut numbers, 80);
    let none = ([false; 3], [false; 3]);
    for frame in [Frame::Camera, Frame::Object] {
        assert_eq!(
            frozen(PointToPoint, frame, none).step(&pairs),
            PointToPoint.step(&pairs)
        );
        assert_eq!(
            frozen(PointToPlane, frame, none).normal_equations(&pairs),
            PointToPlane.normal_equations(&pairs)
        );
    }
    assert_eq!(
        Frozen::<PointToPoint>::default().step(&pairs),
        PointToPoint.step(&pairs)
    );
}

/// The loss of the linearized problem has no slope in the free components. With translations only,
/// the step is the mean offset.
#[test]
fn the_free_components_are_at_the_constrained_minimum() {
    let mut numbers = Numbers(54);
    let pairs = posed(&mut numbers, 80);
    let (mut mean, mut weight) = (Vector3::zeros(), 0.0);
    for pair in pairs.as_slice() {
        let w = f64::from(pair.weight);
        mean += (pair.target.point - pair.source.point).cast::<f64>() * w;
        weight += w;
    }
    mean /= weight;
    let shift = frozen(
        PointToPoint,
        Frame::Camera,
        ([false, true, false], [true; 3]),
    )
    .step(&pairs)
    .unwrap()
    .increment
    .translation
    .vector;
    // The damping of 10⁻⁶.
    assert!((shift - Vector3::new(mean.x, 0.0, mean.z)).norm() < 3e-6 * mean.norm());

    let loss = |motion: &Isometry3<f64>| -> f64 {
        let terms = pairs.as_slice().iter().map(|pair| {
            let p = motion * pair.source.point.cast::<f64>();
            f64::from(pair.weight) * (p - pair.target.point.cast::<f64>()).norm_squared()
        });
        terms.sum()
    };
    for frame in [Frame::Camera, Frame::Object] {
        for mask in masks() {
            let mut solved = GaussNewton::new(frozen(PointToPoint, frame, mask));
            (solved.max_iterations, solved.tolerance) = (30, 0.0);
            let end = solved.step(&pairs).unwrap().increment;
            let held = [mask.0, mask.1].concat();
            for component in (0..6).filter(|i| !held[*i]) {
                // Along one component, from the position of the object after a motion.
                let slope = |motion: &Isometry3<f64>| {
                    let pose = motion * pairs.camera_from_object();
                    let axes = match frame {
                        Frame::Camera => Isometry3::identity(),
                        Frame::Object => {
                            Isometry3::from_parts(Vector3::zeros().into(), pose.rotation)
                        }
                    };
                    let place = Isometry3::from_parts(pose.translation, axes.rotation);
                    let nudged = |h: f64| {
                        let mut twist = Vector6::zeros();
                        twist[component] = h;
                        loss(&(place * se3::exp(&twist) * place.inverse() * motion))
                    };
                    (nudged(1e-5) - nudged(-1e-5)) / 2e-5
                };
                let (start, rest) = (slope(&Isometry3::identity()), slope(&end));
                // Sources are rounded to f32 in between: 3e-8 m of offsets of a centimeter. Slopes
                // may be small at the start by chance.
                assert!(
                    rest.abs() < 1e-4 * start.abs().max(0.01),
                    "{frame:?} {mask:?} {component}: {start} {rest}"
                );
            }
        }
    }
}

/// A motion within the free components is found although the others are frozen.
#[test]
fn exact_pairs_are_aligned_by_a_rotation_around_the_objects_axis() {
    let mut numbers = Numbers(55);
    for _ in 0..10 {
        let pose = Isometry3::translation(0.02, -0.03, 0.58)
            * numbers.motion(&Point3::origin(), 80.0, 0.0);
        let turn = Isometry3::new(Vector3::zeros(), Vector3::z() * 0.2);
        let motion = pose * turn * pose.inverse();
        let source = crate::scenes::ellipsoid(&mut numbers, 100);
        let pairs = at(&pose, &exact(&source, &motion));
        let only_z = ([true; 3], [true, true, false]);
        let mut metric = GaussNewton::new(frozen(PointToPoint, Frame::Object, only_z));
        let step = metric.step(&pairs).unwrap();
        let (angle, distance) = difference(&step.increment, &motion);
        assert!(angle < 1e-6 && distance < 1e-7, "{angle} {distance}");
        // If the rotation is frozen, the object does not rotate.
        let mut held = frozen(
            PointToPoint,
            Frame::Object,
            ([false; 3], [false, false, true]),
        );
        let found = components(Frame::Object, &pose, &held.step(&pairs).unwrap().increment);
        assert!(found[5].abs() < 1e-15);
    }
}

#[test]
fn as_many_rows_as_unknowns_are_enough() {
    let mut numbers = Numbers(56);
    let pairs = posed(&mut numbers, 3);
    assert_eq!(PointToPlane.step(&pairs), None);
    let mut shift = frozen(PointToPlane, Frame::Camera, ([false; 3], [true; 3]));
    assert!(shift.step(&pairs).is_some());
    let one: Correspondences = pairs.as_slice()[..1].iter().copied().collect();
    assert_eq!(shift.step(&one), None);
    assert_eq!(shift.step(&Correspondences::new()), None);
}

#[test]
fn solvers_and_policies_respect_frozen_components() {
    let mut numbers = Numbers(57);
    let pairs = posed(&mut numbers, 80);
    let pose = *pairs.camera_from_object();
    let mask = ([true, false, true], [true; 3]);
    let frozen = frozen(PointToPlane, Frame::Object, mask);
    let conditioned = Conditioned {
        metric: frozen,
        ..Conditioned::default()
    };
    let metrics: [Box<dyn Minimize>; 5] = [
        Box::new(frozen),
        Box::new(conditioned),
        Box::new(GaussNewton::new(frozen)),
        Box::new(GaussNewton::new(conditioned)),
        Box::new(LevenbergMarquardt::new(frozen)),
    ];
    for mut metric in metrics {
        let step = metric.step(&pairs).unwrap();
        let found = components(Frame::Object, &pose, &step.increment);
        for (i, x) in found.iter().enumerate() {
            assert!(i == 1 || x.abs() < 1e-14, "{}: {i} {x}", metric.label());
        }
        assert!(found[1].abs() > 1e-6, "{}", metric.label());
    }
    // The covariance is that of the free components.
    let covariance = frozen
        .clone()
        .normal_equations(&pairs)
        .unwrap()
        .covariance()
        .unwrap();
    let direction = pose.rotation * Vector3::y();
    let block = covariance.fixed_view::<3, 3>(0, 0);
    let variance = direction.dot(&(block * direction));
    assert!(variance > 0.0);
    assert!((block - direction * direction.transpose() * variance).amax() < 1e-12 * variance);
    assert!(covariance.fixed_view::<3, 3>(3, 3).amax() < 1e-30);
}

/// Returns pairs of a box at the center of the scene, half a meter from the camera, and their
/// images under a rotation by an angle and a shift as large at 10 cm.
fn boxed(angle: f64) -> Correspondences {
    let mut numbers = Numbers(58);
    let sides = Vector3::new(0.05, 0.03, 0.04);
    let source: Vec<_> = (0..300)
        .map(|i| {
            let mut normal = Vector3::zeros();
            normal[i % 3] = if i % 2 == 0 { 1.0 } else { -1.0 };
            let mut offset = numbers.signs().component_mul(&sides);
            offset[i % 3] = normal[i % 3] * sides[i % 3];
            surfel(center() + offset, normal)
        })
        .collect();
    let motion = Isometry3::translation(0.04 * angle, -0.03 * angle, 0.02 * angle)
        * Isometry3::rotation_wrt_point(so3::exp(&(Vector3::new(0.8, 0.5, 0.3) * angle)), center());
    exact(&source, &motion)
}

const POLICIES: [Degeneracy; 4] = [
    Degeneracy::Damp,
    Degeneracy::Freeze,
    Degeneracy::FreezeRotations,
    Degeneracy::Refuse,
];

/// Checks that steps and covariances are the same for origins of the object along an axis.
fn same_for_all_origins(mask: ([bool; 3], [bool; 3]), pairs: &Correspondences, tolerance: f64) {
    let origins = [0.0, 0.36, 10.0].map(|meters| center().coords + Vector3::x() * meters);
    for policy in POLICIES {
        let found = origins.map(|origin| {
            let pose = Isometry3::translation(origin.x, origin.y, origin.z);
            let pairs = at(&pose, pairs);
            let metric = Conditioned {
                metric: PointToPlane,
                policy,
                ..Conditioned::default()
            };
            let system = frozen(metric, Frame::Camera, mask)
                .normal_equations(&pairs)
                .unwrap();
            (system.solve().unwrap(), system.covariance().unwrap())
        });
        for (step, covariance) in &found[1..] {
            let (angle, _) = difference(step, &found[0].0);
            let distance = (step * center() - found[0].0 * center()).norm();
            let size = found[0].0.rotation.angle();
            assert!(size > 0.0);
            assert!(
                angle < 1e-6 * size && distance < tolerance,
                "{mask:?} {policy:?}: {angle} and {distance} m of {size}"
            );
            assert!((covariance - found[0].1).amax() < 1e-6 * covariance.amax());
        }
    }
}

/// A frozen rotation around a parallel axis is the same constraint.
#[test]
fn a_frozen_rotation_does_not_depend_on_the_objects_origin() {
    for rotation in [[false, false, true], [true, false, true]] {
        same_for_all_origins(([false; 3], rotation), &boxed(0.02), 1e-9);
    }
}

/// To first order, a displacement along an axis is the same for all points of a line along it.
#[test]
fn a_frozen_translation_does_not_depend_on_the_place_along_its_axis() {
    for rotation in [[false; 3], [true, false, false], [false, false, true]] {
        // The square of the rotation times 10 m, where points move by 1e-7 m.
        same_for_all_origins(([true, false, false], rotation), &boxed(1e-6), 1e-11);
    }
}
