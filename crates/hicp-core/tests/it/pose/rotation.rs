//! Tests of rotations from rounded matrices (pitfall 17).

use std::f64::consts::PI;

use crate::support::Numbers;
use hicp_core::{
    Isometry3, Matrix3, PoseMatrixError, RotationError, Vector3, pose_from_matrix,
    rotation_from_matrix, so3,
};

/// Largest deviation from a rotation that counts as rounding.
const TOLERANCE: f64 = 2e-3;

fn rounded(matrix: &Matrix3<f64>, digits: i32) -> Matrix3<f64> {
    let scale = 10_f64.powi(digits);
    matrix.map(|x| (x * scale).round() / scale)
}

#[test]
fn exact_rotations_are_returned() {
    let mut numbers = Numbers(21);
    for _ in 0..200 {
        let rotation = numbers.rotation();
        let found = rotation_from_matrix(rotation.to_rotation_matrix().matrix()).unwrap();
        assert!(so3::angle(&(found * rotation.inverse())) < 8.0 * f64::EPSILON);
    }
}

#[test]
fn rounding_to_nine_and_to_five_digits_is_accepted() {
    let mut numbers = Numbers(22);
    for digits in [5, 9] {
        for _ in 0..200 {
            let rotation = numbers.rotation();
            let matrix = rounded(rotation.to_rotation_matrix().matrix(), digits);
            let found = rotation_from_matrix(&matrix).unwrap();
            // Nine entries are off by at most half a digit: |ΔR|_F ≤ 1.5 · 10⁻ᵈ, and |ΔR|_F = √2 ·
            // angle for the nearest rotation.
            let angle = so3::angle(&(found * rotation.inverse()));
            assert!(angle <= 1.5 * 10_f64.powi(-digits), "{angle}");
            assert!((found.norm() - 1.0).abs() < 4.0 * f64::EPSILON);
        }
    }
}

#[test]
fn the_result_is_the_nearest_rotation() {
    let mut numbers = Numbers(23);
    for _ in 0..50 {
        let noise = Matrix3::from_fn(|_, _| numbers.between(-1e-4, 1e-4));
        let matrix = numbers.rotation().to_rotation_matrix().into_inner() + noise;
        let found = rotation_from_matrix(&matrix).unwrap();
        let distance = |r: &hicp_core::UnitQuaternion<f64>| {
            (r.to_rotation_matrix().into_inner() - matrix).norm_squared()
        };
        let best = distance(&found);
        for _ in 0..20 {
            // A rotation by h adds 2 h². With 1e-5 this is far above the rounding of `best` (1e-8 ·
            // ε).
            let nudged = so3::exp(&(numbers.direction() * 1e-5)) * found;
            assert!(distance(&nudged) > best);
        }
    }
}

#[test]
fn pitfall_17_half_turns_and_nearly_half_turns_are_exact() {
    let mut numbers = Numbers(24);
    let mut axes = vec![Vector3::x(), Vector3::y(), Vector3::z()];
    axes.extend((0..100).map(|_| numbers.direction()));
    for axis in axes {
        for angle in [PI, PI - 1e-9, PI - 1e-7, PI - 1e-4, PI - 0.01] {
            // Uses the definition R = I + sin a P + (1 − cos a) P² instead of a quaternion.
            let p = so3::hat(&axis);
            let matrix = Matrix3::identity() + p * angle.sin() + p * p * (1.0 - angle.cos());
            let found = rotation_from_matrix(&matrix).unwrap();
            let error = (found.to_rotation_matrix().into_inner() - matrix).amax();
            assert!(error < 8.0 * f64::EPSILON, "{axis} {angle}: {error}");
        }
    }
    // The case reported for nalgebra: an entry one rounding below −1.
    let matrix = Matrix3::from_diagonal(&Vector3::new(-1.0 - 2.3e-16, -1.0, 1.0));
    let found = rotation_from_matrix(&matrix).unwrap();
    assert!((so3::angle(&found) - PI).abs() < 1e-15);
}

#[test]
fn reflections_are_refused() {
    let mut numbers = Numbers(25);
    for _ in 0..50 {
        let matrix = -numbers.rotation().to_rotation_matrix().into_inner();
        assert!(matches!(
            rotation_from_matrix(&matrix),
            Err(RotationError::Determinant { determinant, tolerance })
                if (determinant + 1.0).abs() < 1e-12 && tolerance == TOLERANCE
        ));
    }
}

#[test]
fn pitfall_17_shears_of_determinant_one_and_scales_are_refused() {
    let shear: Matrix3<f64> = Matrix3::new(1.0, 0.01, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    assert!(f64::abs(shear.determinant() - 1.0) < 1e-15);
    for matrix in [
        shear,
        Matrix3::identity() * 0.118,
        Matrix3::identity() * 1000.0,
        Matrix3::zeros(),
        Matrix3::from_element(1e200),
        Matrix3::new(1e200, -1e200, 0.0, 1e200, 1e200, 0.0, 0.0, 0.0, 1.0),
    ] {
        assert!(
            matches!(
                rotation_from_matrix(&matrix),
                Err(RotationError::NotOrthogonal { .. })
            ),
            "{matrix}"
        );
    }
}

#[test]
fn a_deviation_equal_to_the_tolerance_is_accepted() {
    // Rows (1, s, 0) and (0, 1, 0) have the product s, to the bit.
    let shear = |s: f64| Matrix3::new(1.0, s, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    for sign in [-1.0, 1.0] {
        let found = rotation_from_matrix(&shear(sign * TOLERANCE)).unwrap();
        // The polar factor of a shear by s rotates by atan(s/2).
        let angle = so3::angle(&found) - (0.5 * TOLERANCE).atan();
        assert!(angle.abs() < 4.0 * f64::EPSILON, "{angle}");
        let beyond = TOLERANCE.next_up();
        assert!(matches!(
            rotation_from_matrix(&shear(sign * beyond)),
            Err(RotationError::NotOrthogonal { deviation, tolerance })
                if deviation == beyond && tolerance == TOLERANCE
        ));
    }
}

#[test]
fn errors_name_the_entry_that_is_not_finite() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for row in 0..3 {
            for column in 0..3 {
                let mut matrix = Matrix3::identity();
                matrix[(row, column)] = value;
                let Err(RotationError::NotFinite {
                    row: r,
                    column: c,
                    value: v,
                }) = rotation_from_matrix(&matrix)
                else {
                    panic!("accepted {value}");
                };
                assert_eq!((r, c, v.to_bits()), (row, column, value.to_bits()));
            }
        }
    }
}

#[test]
fn poses_are_read_from_matrices_and_transposed_ones_refused() {
    let mut numbers = Numbers(77);
    let pose = Isometry3::new(
        Vector3::new(numbers.unit(), numbers.unit(), 0.9),
        Vector3::new(0.3, -1.1, 0.4),
    );
    let matrix = pose.to_homogeneous();
    let found = pose_from_matrix(&matrix).unwrap();
    assert!((found.to_homogeneous() - matrix).amax() < 1e-12);
    assert!(matches!(
        pose_from_matrix(&matrix.transpose()),
        Err(PoseMatrixError::LastRow { column: 0, .. })
    ));
    let mut nowhere = matrix;
    nowhere[(1, 3)] = f64::NAN;
    assert!(matches!(
        pose_from_matrix(&nowhere),
        Err(PoseMatrixError::Translation { row: 1, .. })
    ));
    let mut sheared = matrix;
    sheared[(0, 1)] += 0.1;
    assert!(matches!(
        pose_from_matrix(&sheared),
        Err(PoseMatrixError::Rotation(_))
    ));
}
