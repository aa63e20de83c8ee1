//! Tests of the pinhole camera, and of the distances of its pixels.

use hicp_core::{
    CameraError, DepthImage, ImageError, Isometry3, MAX_FOCAL_LENGTH, MAX_IMAGE_SIDE,
    MIN_FOCAL_LENGTH, Matrix3, PinholeCamera, PixelCenters, Point3, Vector3,
};

fn camera() -> PinholeCamera {
    PinholeCamera::new(572.4114, 573.57043, 325.2611, 242.04899, 640, 480).unwrap()
}

#[test]
fn pitfall_22_every_pixel_unprojects_and_projects_to_itself() {
    let camera = camera();
    for depth in [1e-3, 0.37, 1000.0] {
        for (u, v) in camera.region().pixels() {
            let (u, v) = (f64::from(u), f64::from(v));
            let point = camera.unproject(u, v, depth);
            assert_eq!(point.z, depth);
            let pixel = camera.project(&point).unwrap();
            // Four roundings of numbers up to 640.
            assert!((pixel.x - u).abs() < 4.0 * 640.0 * f64::EPSILON);
            assert!((pixel.y - v).abs() < 4.0 * 640.0 * f64::EPSILON);
        }
    }
}

#[test]
fn pitfall_22_points_not_in_front_of_the_camera_have_no_image() {
    let camera = camera();
    for z in [0.0, -0.0, -1e-9, -1.0, f64::NEG_INFINITY, f64::NAN] {
        assert_eq!(camera.project(&Point3::new(0.1, 0.2, z)), None, "{z}");
    }
    // A position outside the image is still an image position.
    let outside = camera.project(&Point3::new(-10.0, 0.0, 1.0)).unwrap();
    assert!(outside.x < 0.0);
}

#[test]
fn u_goes_with_x_and_v_with_y() {
    let camera = PinholeCamera::new(100.0, 200.0, 10.0, 20.0, 64, 48).unwrap();
    let pixel = camera.project(&Point3::new(0.5, 0.25, 2.0)).unwrap();
    assert_eq!((pixel.x, pixel.y), (35.0, 45.0));
    assert_eq!(
        camera.unproject(35.0, 45.0, 2.0),
        Point3::new(0.5, 0.25, 2.0)
    );
    assert_eq!(
        (camera.fx(), camera.fy(), camera.cx(), camera.cy()),
        (100.0, 200.0, 10.0, 20.0)
    );
    assert_eq!((camera.region().u_max, camera.region().v_max), (64, 48));
}

#[test]
fn centers_at_halves_shift_the_principal_point_by_half_a_pixel() {
    let integers = |cx, cy| PinholeCamera::new(600.0, 610.0, cx, cy, 640, 480).unwrap();
    let with = |centers| {
        PinholeCamera::with_pixel_centers(centers, 600.0, 610.0, 320.0, 240.0, 640, 480).unwrap()
    };
    assert_eq!(with(PixelCenters::AtIntegers), integers(320.0, 240.0));
    assert_eq!(with(PixelCenters::AtHalves), integers(319.5, 239.5));
    // With centers at halves and cx = W/2, the ray through the middle of the image (between pixels
    // 319 and 320) is the optical axis.
    let middle = with(PixelCenters::AtHalves).unproject(319.5, 239.5, 1.0);
    assert_eq!(middle, Point3::new(0.0, 0.0, 1.0));
}

#[test]
fn errors_name_the_invalid_focal_length_or_center() {
    let beyond = MAX_FOCAL_LENGTH * (1.0 + f64::EPSILON);
    let below = MIN_FOCAL_LENGTH * (1.0 - f64::EPSILON);
    for value in [
        0.0,
        -0.0,
        -1.0,
        1e-200,
        below,
        beyond,
        f64::MAX,
        f64::NAN,
        f64::INFINITY,
    ] {
        for name in ["fx", "fy"] {
            let (fx, fy) = if name == "fx" {
                (value, 1.0)
            } else {
                (1.0, value)
            };
            let Err(CameraError::FocalLength { name: n, value: v }) =
                PinholeCamera::new(fx, fy, 0.0, 0.0, 1, 1)
            else {
                panic!("accepted {name} = {value}");
            };
            assert_eq!((n, v.to_bits()), (name, value.to_bits()));
        }
    }
    for value in [beyond, -beyond, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for name in ["cx", "cy"] {
            let (cx, cy) = if name == "cx" {
                (value, 1.0)
            } else {
                (1.0, value)
            };
            let Err(CameraError::PrincipalPoint { name: n, value: v }) =
                PinholeCamera::new(1.0, 1.0, cx, cy, 1, 1)
            else {
                panic!("accepted {name} = {value}");
            };
            assert_eq!((n, v.to_bits()), (name, value.to_bits()));
        }
    }
}

#[test]
fn the_longest_focal_length_is_accepted_and_stated_in_errors() {
    let far = MAX_FOCAL_LENGTH;
    for (cx, cy) in [(far, -far), (-far, far)] {
        assert!(PinholeCamera::new(far, far, cx, cy, 1, 1).is_ok());
    }
    let near = MIN_FOCAL_LENGTH;
    let camera = PinholeCamera::new(near, near, 0.0, 0.0, 2, 2).unwrap();
    let distances = DepthImage::from_meters(2, 2, vec![0.0, 1.0, 0.0, 1.0])
        .unwrap()
        .to_distance(&camera)
        .unwrap();
    assert!(distances.pixels().iter().all(|d| d.is_finite()));
    let told = |fx, cx| {
        let refused = PinholeCamera::new(fx, 1.0, cx, 0.0, 1, 1);
        refused.unwrap_err().to_string()
    };
    assert_eq!(
        told(2e9, 0.0),
        "focal length fx is 2000000000, expected 0.001 to 1000000000 pixels"
    );
    assert_eq!(
        told(1.0, -2e9),
        "principal point cx is -2000000000, expected a number of pixels between -1000000000 and 1000000000"
    );
}

#[test]
fn errors_name_the_invalid_side_and_the_largest_is_accepted() {
    for value in [0, MAX_IMAGE_SIDE + 1, u32::MAX] {
        let width = PinholeCamera::new(1.0, 1.0, 0.0, 0.0, value, 1);
        assert_eq!(
            width,
            Err(CameraError::ImageSide {
                name: "width",
                value
            })
        );
        let height = PinholeCamera::new(1.0, 1.0, 0.0, 0.0, 1, value);
        assert_eq!(
            height,
            Err(CameraError::ImageSide {
                name: "height",
                value
            })
        );
    }
    assert!(PinholeCamera::new(1.0, 1.0, 0.0, 0.0, MAX_IMAGE_SIDE, MAX_IMAGE_SIDE).is_ok());
}

#[test]
fn calibration_matrices_are_accepted_and_others_refused() {
    let k = Matrix3::new(572.4, 0.0, 325.3, 0.0, 573.6, 242.0, 0.0, 0.0, 1.0);
    let camera = PinholeCamera::from_matrix(&k, 640, 480).unwrap();
    assert_eq!(
        camera,
        PinholeCamera::new(572.4, 573.6, 325.3, 242.0, 640, 480).unwrap()
    );
    for (row, column, value) in [
        (0, 1, 0.1),
        (1, 0, -0.1),
        (2, 0, 1e-3),
        (2, 1, f64::NAN),
        (2, 2, 0.0),
        (2, 2, f64::INFINITY),
    ] {
        let mut wrong = k;
        wrong[(row, column)] = value;
        let Err(CameraError::MatrixEntry {
            row: r,
            column: c,
            found,
            expected,
        }) = PinholeCamera::from_matrix(&wrong, 640, 480)
        else {
            panic!("accepted {value} at {row}, {column}");
        };
        assert_eq!((r, c, found.to_bits()), (row, column, value.to_bits()));
        assert_eq!(expected, if row == 2 && column == 2 { 1.0 } else { 0.0 });
    }
    // Rounding up to 1e-6 passes: a printed calibration has no more digits.
    let mut rounded = k;
    rounded[(0, 1)] = 1e-6;
    assert_eq!(PinholeCamera::from_matrix(&rounded, 640, 480), Ok(camera));
    rounded[(0, 1)] = 1e-6_f64.next_up();
    assert!(PinholeCamera::from_matrix(&rounded, 640, 480).is_err());
    // A transposed matrix, the most common mistake, is refused.
    assert!(PinholeCamera::from_matrix(&k.transpose(), 640, 480).is_err());
}

/// Values of BOP's reference code; the unit is that of the depth.
#[test]
fn distances_equal_those_of_the_reference() {
    let camera = PinholeCamera::new(10.0, 12.0, 3.0, 2.5, 7, 6).unwrap();
    let mut depth = vec![0.0; 42];
    depth[2 * 7 + 4] = 480.0;
    depth[3 * 7 + 2] = 505.0;
    let distance = DepthImage::from_meters(7, 6, depth)
        .unwrap()
        .to_distance(&camera)
        .unwrap();
    assert!((distance.get(4, 2).unwrap() - 482.808_450_630_268_06).abs() < 1e-12);
    assert_eq!(distance.get(0, 0), Some(0.0));
    assert_eq!(distance.get(7, 0), None);
    assert!((distance.get(2, 3).unwrap() - 507.954_724_100_594_55).abs() < 1e-12);
    // By definition, the distance is the norm of the point at that pixel.
    let norm = camera.unproject(2.0, 3.0, 505.0).coords.norm();
    assert!((distance.get(2, 3).unwrap() - norm).abs() < 1e-12);
}

#[test]
fn a_camera_of_another_size_is_refused() {
    let depth = DepthImage::from_meters(3, 2, vec![1.0; 6]).unwrap();
    let camera = PinholeCamera::new(1.0, 1.0, 0.0, 0.0, 2, 3).unwrap();
    assert!(matches!(
        depth.to_distance(&camera),
        Err(ImageError::SizeMismatch {
            first_width: 3,
            first_height: 2,
            second_width: 2,
            second_height: 3,
            ..
        })
    ));
}

#[test]
fn a_scaled_down_camera_keeps_the_rays_of_every_nth_pixel() {
    let camera = PinholeCamera::new(500.0, 510.0, 321.5, 238.25, 641, 480).unwrap();
    assert_eq!(camera.scaled_down(0), camera);
    assert_eq!(camera.scaled_down(1), camera);
    let coarse = camera.scaled_down(4);
    assert_eq!((coarse.width(), coarse.height()), (161, 120));
    for (u, v) in [(0.0, 0.0), (17.0, 93.0), (160.0, 119.0)] {
        let (a, b) = (
            coarse.unproject(u, v, 0.7),
            camera.unproject(4.0 * u, 4.0 * v, 0.7),
        );
        assert!((a - b).norm() < 1e-15, "{a} {b}");
    }
}

/// The points of all pixels, moved, make the same image again. Nearer points hide others.
#[test]
fn the_points_of_a_depth_image_project_to_the_same_image() {
    let camera = camera();
    let depth = |i: u32| {
        if i.is_multiple_of(3) {
            0.0
        } else {
            0.5 + (i % 97) as f32 * 0.01
        }
    };
    let image = DepthImage::collect(640, 480, (0..640 * 480).map(depth)).unwrap();
    let moved = Isometry3::new(Vector3::new(0.1, -2.0, 0.7), Vector3::new(0.3, -0.2, 1.0));
    let mut points = Vec::new();
    for (index, z) in (0_u32..).zip(image.pixels()) {
        let pixel = (f64::from(index % 640), f64::from(index / 640));
        let point = |depth| (moved * camera.unproject(pixel.0, pixel.1, depth)).cast::<f32>();
        if *z > 0.0 {
            points.extend([f64::from(*z), 3.0, -1.0].map(point));
        }
    }
    for x in [f32::NAN, f32::INFINITY, f32::MAX] {
        points.extend([Point3::new(x, 0.0, 0.0), Point3::new(0.0, 0.0, x)]);
    }
    let found = DepthImage::from_points(points, &camera, &moved.inverse());
    for (found, expected) in found.pixels().iter().zip(image.pixels()) {
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
    }
}
