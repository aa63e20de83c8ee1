//! Tests of the undetermined motions of shapes, and that nothing moves along them.

use crate::scenes::{
    AtStart, Numbers, advanced, carried, center, ellipsoid, exact, messy, resized, surfel,
};
use hicp_core::{Correspondences, Isometry3, Matrix6, Pair, Point3, Surfel, Vector3, Vector6};
use hicp_metric::Minimize;
use hicp_metric::{Conditioned, Degeneracy, NormalEquations, PointToPlane, PointToPoint};

fn at_rest(source: &[Surfel]) -> Correspondences {
    exact(source, &Isometry3::identity())
}

fn plane(numbers: &mut Numbers) -> Vec<Surfel> {
    let mut point = || center() + Vector3::new(numbers.sign(), numbers.sign(), 0.0) * 0.1;
    (0..200).map(|_| surfel(point(), -Vector3::z())).collect()
}

fn cylinder(numbers: &mut Numbers) -> Vec<Surfel> {
    let mut one = || {
        let angle = numbers.unit() * std::f64::consts::TAU;
        let normal = Vector3::new(angle.cos(), 0.0, angle.sin());
        surfel(
            center() + normal * 0.05 + Vector3::y() * (0.1 * numbers.sign()),
            normal,
        )
    };
    (0..300).map(|_| one()).collect()
}

fn sphere(numbers: &mut Numbers) -> Vec<Surfel> {
    let mut one = || {
        let normal = numbers.direction();
        surfel(center() + normal * 0.05, normal)
    };
    (0..300).map(|_| one()).collect()
}

fn line(numbers: &mut Numbers) -> Vec<Surfel> {
    let mut one = || {
        surfel(
            center() + Vector3::x() * (0.1 * numbers.sign()),
            numbers.direction(),
        )
    };
    (0..100).map(|_| one()).collect()
}

fn degenerate(metric: &mut dyn Minimize, pairs: &Correspondences) -> usize {
    let system = metric.normal_equations(pairs).unwrap();
    let found = system.observability().unwrap();
    found.n_degenerate(Degeneracy::THRESHOLD)
}

/// Holds in every frame, at every size and for any number of pairs.
#[test]
fn shapes_have_their_known_undetermined_motions() {
    let mut numbers = Numbers(81);
    let (plane, cylinder) = (plane(&mut numbers), cylinder(&mut numbers));
    let (sphere, line) = (sphere(&mut numbers), line(&mut numbers));
    let ellipsoid = ellipsoid(&mut numbers, 300);
    for _ in 0..10 {
        let motion = numbers.motion(&center(), 100.0, 0.2);
        for factor in [1.0, 1000.0] {
            let count = |metric: &mut dyn Minimize, source: &[Surfel]| {
                degenerate(
                    metric,
                    &resized(&carried(&at_rest(source), &motion), factor),
                )
            };
            assert_eq!(count(&mut PointToPlane, &plane), 3);
            assert_eq!(count(&mut PointToPlane, &cylinder), 2);
            assert_eq!(count(&mut PointToPlane, &sphere), 3);
            assert_eq!(count(&mut PointToPlane, &ellipsoid), 0);
            assert_eq!(count(&mut PointToPlane, &ellipsoid[..5]), 1);
            assert_eq!(count(&mut PointToPlane, &ellipsoid[..1]), 5);
            // Points on a line determine all but the rotation around it. Planes through them do not
            // determine more.
            assert_eq!(count(&mut PointToPoint, &line), 1);
            assert_eq!(count(&mut PointToPlane, &line), 1);
            assert_eq!(count(&mut PointToPoint, &plane), 0);
            assert_eq!(count(&mut PointToPoint, &plane[..1]), 3);
        }
    }
}

#[test]
fn directions_are_orthonormal_and_keep_the_residuals() {
    let mut numbers = Numbers(82);
    for source in [
        plane(&mut numbers),
        cylinder(&mut numbers),
        sphere(&mut numbers),
    ] {
        let motion = numbers.motion(&center(), 100.0, 0.2);
        let pairs = carried(&at_rest(&source), &motion);
        let system = PointToPlane.normal_equations(&pairs).unwrap();
        let found = system.observability().unwrap();
        assert!(found.eigenvalues.is_sorted());
        assert!((found.eigenvalues[5] - 1.0).abs() < 1e-15);
        let columns = Matrix6::from_columns(&found.directions);
        assert!((columns.transpose() * columns - Matrix6::identity()).amax() < 1e-12);
        let n = found.n_degenerate(Degeneracy::THRESHOLD);
        for (i, direction) in found.directions.iter().enumerate() {
            let along = found.motion(direction, 1e-3);
            let moved = advanced(&pairs, &along);
            let rms = PointToPlane.loss(&moved).unwrap().sqrt();
            // A millimeter along an undetermined direction changes residuals only by roundings and
            // by the curvature.
            assert_eq!(rms < 2e-5, i < n, "{i} of {n}: {rms}");
        }
    }
}

fn conditioned<M>(metric: M, policy: Degeneracy) -> Conditioned<M> {
    Conditioned {
        metric,
        policy,
        threshold: Degeneracy::THRESHOLD,
    }
}

/// A plane at a small distance, with its counterparts elsewhere on the same plane.
fn lifted(numbers: &mut Numbers, motion: &Isometry3<f64>) -> (Correspondences, Vector3<f64>) {
    let lift = Isometry3::translation(0.03, 0.01, 0.004);
    let pairs = carried(&exact(&plane(numbers), &lift), motion);
    (pairs, motion.rotation * Vector3::z())
}

#[test]
fn nothing_slides_along_a_plane() {
    let mut numbers = Numbers(83);
    for _ in 0..20 {
        let motion = numbers.motion(&center(), 100.0, 0.2);
        let (pairs, normal) = lifted(&mut numbers, &motion);
        let middle = motion * center();
        let freezing = [
            Degeneracy::Freeze,
            Degeneracy::FreezeRotations,
            Degeneracy::FreezeUnexplained,
        ];
        for policy in [Degeneracy::Damp].into_iter().chain(freezing) {
            let step = conditioned(PointToPlane, policy).step(&pairs).unwrap();
            let shift = step.increment * middle - middle;
            let slide = shift - normal * shift.dot(&normal);
            assert!((shift.dot(&normal) - 0.004).abs() < 1e-6, "{policy:?}");
            assert!(slide.norm() < 1e-6, "{policy:?}: {}", slide.norm());
            let turn = step.increment.rotation.scaled_axis().dot(&normal);
            assert!(turn.abs() < 1e-5, "{policy:?}: {turn}");
        }
        assert_eq!(
            conditioned(PointToPlane, Degeneracy::Refuse).step(&pairs),
            None
        );
    }
}

/// If noise alone determines a direction, damping moves along it and freezing does not.
#[test]
fn noisy_normals_do_not_let_a_plane_slide_under_freeze() {
    let mut numbers = Numbers(84);
    let (mut worst, mut worst_damped) = (0.0_f64, 0.0_f64);
    for _ in 0..20 {
        let (mut pairs, normal) = lifted(&mut numbers, &Isometry3::identity());
        for pair in pairs.as_mut_slice() {
            // Normals off by a degree, points by a millimeter.
            let tilted = -normal + Vector3::new(numbers.normal(), numbers.normal(), 0.0) * 0.017;
            pair.target = surfel(pair.target.point.cast(), tilted);
            pair.target.point += (normal * (numbers.normal() * 0.001)).cast::<f32>();
        }
        let slide = |policy| {
            let step = conditioned(PointToPlane, policy).step(&pairs).unwrap();
            let shift = step.increment * center() - center();
            (shift - normal * shift.dot(&normal)).norm()
        };
        worst = worst.max(slide(Degeneracy::Freeze));
        worst_damped = worst_damped.max(slide(Degeneracy::Damp));
    }
    // Eigenvectors are tilted by at most about a degree over √200. The lift is 4 mm.
    assert!(worst < 1e-3, "{worst}");
    assert!(worst_damped > 3.0 * worst, "{worst_damped} {worst}");
}

#[test]
fn well_determined_pairs_give_the_same_step_under_every_policy() {
    let mut numbers = Numbers(85);
    let pairs = messy(&mut numbers, 200);
    let expected = conditioned(PointToPlane, Degeneracy::Ignore)
        .step(&pairs)
        .unwrap();
    for policy in [
        Degeneracy::Damp,
        Degeneracy::Freeze,
        Degeneracy::FreezeRotations,
        Degeneracy::FreezeUnexplained,
        Degeneracy::Refuse,
    ] {
        let step = conditioned(PointToPlane, policy).step(&pairs).unwrap();
        let (angle, distance) = crate::scenes::difference(&step.increment, &expected.increment);
        assert!(
            angle < 1e-5 && distance < 1e-6,
            "{policy:?}: {angle} {distance}"
        );
        assert_eq!(step.mean_loss.to_bits(), expected.mean_loss.to_bits());
    }
    // Damping is the default of the metric.
    let damped = conditioned(PointToPlane, Degeneracy::Damp)
        .step(&pairs)
        .unwrap();
    assert_eq!(
        damped.increment,
        PointToPlane.step(&pairs).unwrap().increment
    );
    let system = PointToPlane.normal_equations(&pairs).unwrap();
    assert_eq!(
        system.solve(),
        system.with_policy(Degeneracy::Damp, 0.5).solve()
    );
}

/// Little information moves a plate sideways, but does not turn it.
#[test]
fn weak_translations_are_solved_without_weak_rotations() {
    let mut numbers = Numbers(87);
    let plate = at_rest(&plane(&mut numbers));
    let mut system = PointToPlane.normal_equations(&plate).unwrap();
    // A thousandth of the information of the 200 points about their distance.
    let edge = 0.2_f64.sqrt();
    // Two edges across x on one side of the center, and one across y.
    for (x, y, normal) in [
        (0.1, 0.08, Vector3::x()),
        (0.1, 0.02, Vector3::x()),
        (0.0, 0.1, Vector3::y()),
    ] {
        let point = center() + Vector3::new(x, y, 0.0);
        system.add_row(&point, &(normal * edge), 0.003 * edge, 1.0);
    }
    let step = |policy| system.with_policy(policy, 5e-3).solve().unwrap();
    let (shift, still) = (step(Degeneracy::FreezeRotations), step(Degeneracy::Freeze));
    assert!(crate::scenes::difference(&still, &Isometry3::identity()).1 < 1e-9);
    let moved = shift * center() - center();
    assert!(
        (moved.x.abs() - 0.003).abs() < 1e-9 && (moved.y.abs() - 0.003).abs() < 1e-9,
        "{moved}"
    );
    assert!(shift.rotation.angle() < 1e-9, "{}", shift.rotation.angle());
    // Below the information of the rotation, nothing stays.
    let pulled = Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.01);
    system.add_twist(&pulled, &Matrix6::identity(), &(Matrix6::identity() * 1e-2));
    let all = system
        .with_policy(Degeneracy::FreezeRotations, 1e-6)
        .solve()
        .unwrap();
    let same = system.with_policy(Degeneracy::Ignore, 0.0).solve().unwrap();
    let (angle, distance) = crate::scenes::difference(&all, &same);
    assert!(angle < 1e-9 && distance < 1e-9, "{angle} {distance}");
    assert!(all.rotation.angle() > 1e-4, "{}", all.rotation.angle());
}

/// A weak rotation is solved if it removes enough of the loss, but not a very weak one.
#[test]
fn weak_rotations_that_explain_the_loss_are_solved() {
    let mut numbers = Numbers(88);
    let plate = at_rest(&plane(&mut numbers));
    let mut system = PointToPlane.normal_equations(&plate).unwrap();
    let edge = 0.2_f64.sqrt();
    // Two edges, both of which a rotation of 0.03 around z moves to their place.
    for side in [0.1, -0.1] {
        let (point, normal) = (center() + Vector3::x() * side, Vector3::y() * edge * side);
        system.add_row(&point, &(normal / 0.1), 0.003 * edge, 1.0);
    }
    let angle = |system: &NormalEquations, threshold| {
        let step = system
            .with_policy(Degeneracy::FreezeUnexplained, threshold)
            .solve();
        step.unwrap().rotation.angle()
    };
    assert!((angle(&system, 5e-3) - 0.03).abs() < 1e-4);
    assert!(angle(&system, 0.1) < 1e-9);
    let still = system
        .with_policy(Degeneracy::FreezeRotations, 5e-3)
        .solve();
    assert!(still.unwrap().rotation.angle() < 1e-9);
    // An error that no motion explains.
    for error in [0.01, -0.01] {
        system.add_row(&center(), &Vector3::z(), error, 1.0);
    }
    assert!(angle(&system, 5e-3) < 1e-9);
}

/// The threshold is a share of the largest eigenvalue. Above 1 all directions are degenerate; at 0,
/// only those without information.
#[test]
fn thresholds_separate_degenerate_directions() {
    let mut numbers = Numbers(86);
    let pairs = messy(&mut numbers, 200);
    let system = PointToPlane.normal_equations(&pairs).unwrap();
    let still = system.with_policy(Degeneracy::Freeze, 2.0).solve().unwrap();
    assert!(crate::scenes::difference(&still, &Isometry3::identity()).1 < 1e-15);
    assert_eq!(system.with_policy(Degeneracy::Refuse, 2.0).solve(), None);
    assert!(
        system
            .with_policy(Degeneracy::Refuse, 0.0)
            .solve()
            .is_some()
    );
    // A ratio equal to the threshold is degenerate, and that of the best direction is 1.
    let still = system.with_policy(Degeneracy::Freeze, 1.0).solve().unwrap();
    assert_eq!(
        crate::scenes::difference(&still, &Isometry3::identity()).1,
        0.0
    );
    assert_eq!(system.with_policy(Degeneracy::Refuse, 1.0).solve(), None);
    assert_eq!(system.observability().unwrap().n_degenerate(1.0), 6);
    // Six directions with exactly the same information: below 1 the threshold keeps all of them, at
    // 1 none.
    let mut alike = NormalEquations::new(Point3::origin(), 1.0);
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    for (lever, direction) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (axes[i], axes[j])) {
        alike.add_row(&Point3::from(lever), &direction, 0.1, 1.0);
        alike.add_row(&Point3::from(-lever), &-direction, 0.1, 1.0);
    }
    assert_eq!(alike.information(), Matrix6::identity() * 2.0);
    assert!(
        alike
            .with_policy(Degeneracy::Refuse, 0.999)
            .solve()
            .is_some()
    );
    assert_eq!(alike.with_policy(Degeneracy::Refuse, 1.0).solve(), None);
    // A negative threshold counts as 0.
    let (zero, below) = (
        system.with_policy(Degeneracy::Freeze, 0.0).solve(),
        system.with_policy(Degeneracy::Freeze, -1.0).solve(),
    );
    assert_eq!(zero, below);
}

#[test]
fn numbers_that_are_not_finite_give_none() {
    let mut empty = NormalEquations::new(center(), 0.1);
    let found = empty.observability().unwrap();
    assert_eq!(found.n_degenerate(0.0), 6);
    assert_eq!(empty.solve(), None);
    let mut silent = NormalEquations::new(center(), 0.1);
    for _ in 0..6 {
        silent.add_row(&center(), &Vector3::zeros(), 0.1, 1.0);
    }
    for bad in [f64::NAN, f64::INFINITY] {
        empty.add_row(&Point3::new(bad, 0.0, 1.0), &Vector3::z(), 0.1, 1.0);
        assert!(empty.observability().is_none());
        assert_eq!(empty.covariance(), None);
    }
    for policy in [
        Degeneracy::Damp,
        Degeneracy::Freeze,
        Degeneracy::FreezeRotations,
        Degeneracy::FreezeUnexplained,
        Degeneracy::Refuse,
        Degeneracy::Ignore,
    ] {
        assert_eq!(empty.with_policy(policy, 1e-3).solve(), None);
        assert_eq!(silent.with_policy(policy, 1e-3).solve(), None, "{policy:?}");
        let mut metric = conditioned(PointToPlane, policy);
        assert_eq!(metric.step(&Correspondences::new()), None);
        let one: Correspondences = [Pair::new(
            0,
            surfel(center(), Vector3::z()),
            0,
            surfel(center(), Vector3::z()),
        )]
        .into_iter()
        .collect();
        assert_eq!(metric.step(&one), None);
    }
}
