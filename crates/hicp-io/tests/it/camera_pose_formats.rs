//! Cameras and poses that other programs wrote (`tests/fixtures/make.py`).

use hicp_core::{DepthImage, Isometry3, Mask, PinholeCamera, UnitQuaternion, UnitVector3, Vector3};
use hicp_io::{
    CameraFile, Distortion, IoErrorKind, LengthUnit, read_camera, read_pose, register_depth,
};

use crate::common::{Folder, assert_contains, fixture, refused};

fn camera() -> PinholeCamera {
    PinholeCamera::new(600.0, 610.0, 320.5, 240.25, 640, 480).unwrap()
}

fn read(name: &str) -> CameraFile {
    read_camera(fixture(name), (640, 480)).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn cameras_of_every_form_are_the_same() {
    for name in [
        "camera_k.txt",
        "camera_k.npy",
        "camera_bop.npz",
        "camera_open3d.json",
        "camera_realsense.json",
        "camera_ros_topic.yaml",
        "camera_rows.json",
    ] {
        let file = read(name);
        assert_eq!((file.camera, file.distortion), (camera(), None), "{name}");
    }
    assert_eq!(read("camera_rows.json").depth_scale, Some(0.1));
    assert_eq!(read("camera_bop.npz").depth_scale, Some(0.1));
}

#[test]
fn distortions_are_read_with_their_models() {
    let five = [-0.36, 0.11, 0.001, 0.0005, -0.02, 0.0, 0.0, 0.0];
    let eight = [-0.3, 0.1, 0.001, 0.0005, -0.02, 0.05, -0.01, 0.002];
    let fisheye = Distortion::KannalaBrandt([0.05, -0.01, 0.003, -0.001]);
    for (name, distortion) in [
        ("camera_opencv.yml", Distortion::BrownConrady(five)),
        ("camera_opencv.xml", Distortion::BrownConrady(five)),
        ("camera_opencv.npz", Distortion::BrownConrady(five)),
        ("camera_ros_plumb_bob.yaml", Distortion::BrownConrady(five)),
        ("camera_ros_rational.yaml", Distortion::BrownConrady(eight)),
        ("camera_ros_equidistant.yaml", fisheye),
    ] {
        let file = read(name);
        assert_eq!(
            (file.camera, file.distortion),
            (camera(), Some(distortion)),
            "{name}"
        );
    }
    let other = read_camera(fixture("depth_unnamed.npz"), (640, 480));
    refused(other, &["no camera", "`camera_matrix`"]);
    let other = read_camera(fixture("camera_ros_thin_prism.yaml"), (640, 480));
    refused(other, &["\"thin_prism\" of 12 numbers", "undistort"]);
}

#[test]
fn a_distortion_is_read_next_to_every_form_of_a_camera() {
    let folder = Folder::new();
    let read = |text: &str| read_camera(folder.write("camera.json", text), (640, 480));
    let matrix = "[600, 0, 320.5, 0, 610, 240.25, 0, 0, 1]";
    let flat = r#""fx": 600, "fy": 610, "cx": 320.5, "cy": 240.25, "width": 640, "height": 480"#;
    let cameras = [
        format!(r#""cam_K": {matrix}, "depth_scale": 0.1"#),
        format!(r#""cameraMatrix": {matrix}"#),
        flat.to_owned(),
    ];
    let expected = Distortion::BrownConrady([0.1, -0.2, 0.001, 0.002, 0.0, 0.0, 0.0, 0.0]);
    for camera in &cameras {
        for key in [
            "D",
            "dist_coeffs",
            "distCoeffs",
            "distortion_coeffs",
            "dist",
            "kc",
        ] {
            let file = read(&format!(
                r#"{{{camera}, "{key}": [0.1, -0.2, 0.001, 0.002]}}"#
            ));
            assert_eq!(file.unwrap().distortion, Some(expected), "{camera} {key}");
        }
        for distortion in [
            r#""k1": 0.1, "k2": -0.2, "p1": 0.001, "p2": 0.002"#,
            r#""distortion": {"k1": 0.1, "k2": -0.2, "p1": 0.001, "p2": 0.002}"#,
        ] {
            let file = read(&format!("{{{camera}, {distortion}}}")).unwrap();
            assert_eq!(file.distortion, Some(expected), "{camera} {distortion}");
        }
        for none in [
            r#""D": null"#,
            r#""D": []"#,
            r#""D": [0, 0, 0, 0, 0]"#,
            r#""k1": null"#,
        ] {
            let file = read(&format!("{{{camera}, {none}}}")).unwrap();
            assert_eq!(file.distortion, None, "{camera} {none}");
        }
        for (wrong, place) in [
            (r#""D": [0.3, "x", 0, 0, 0]"#, "$.D:"),
            (r#""distortion": {"model": "radtan"}"#, "$.distortion:"),
            (r#""distortion": {"k1": "0.3"}"#, "$.distortion.k1:"),
            (r#""k1": "0.3""#, "$.k1:"),
        ] {
            refused(
                read(&format!("{{{camera}, {wrong}}}")),
                &[place, "finite number"],
            );
        }
    }
    let file = read(&format!(
        r#"{{"7": {{{}, "D": [0.1, -0.2, 0.001, 0.002]}}}}"#,
        cameras[0]
    ));
    let file = file.unwrap();
    assert_eq!(
        (file.distortion, file.depth_scale),
        (Some(expected), Some(0.1))
    );
}

#[test]
fn distortions_of_realsense_may_be_numbers() {
    let folder = Folder::new();
    let camera = r#""fx": 600, "fy": 610, "ppx": 320.5, "ppy": 240.25"#;
    let read = |model: &str, first: f64| {
        let text = format!(r#"{{{camera}, "model": {model}, "coeffs": [{first}, 0.2, 0, 0, 0]}}"#);
        read_camera(
            folder.write("camera.json", text.replace("0, 0.2", "0, 0")),
            (640, 480),
        )
    };
    let brown = Distortion::BrownConrady([0.1, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(read("4", 0.1).unwrap().distortion, Some(brown));
    let fisheye = Distortion::KannalaBrandt([0.1, 0.2, 0.0, 0.0]);
    assert_eq!(read("5", 0.1).unwrap().distortion, Some(fisheye));
    for (model, name) in [
        ("0", "\"none\" of 5 numbers"),
        ("1", "\"modified Brown-Conrady\""),
        ("2", "\"inverse Brown-Conrady\""),
        ("3", "\"ftheta\""),
        ("6", "\"6\""),
        ("-1", "\"-1\""),
        ("[4]", "\"[4]\""),
    ] {
        refused(read(model, 0.1), &[name, "undistort"]);
        assert_eq!(read(model, 0.0).unwrap().distortion, None);
    }
}

#[test]
fn distorted_points_agree_with_opencv() {
    let text = std::fs::read_to_string(fixture("distorted.json")).unwrap();
    let rows: std::collections::BTreeMap<String, Vec<[f64; 2]>> =
        serde_json::from_str(&text).unwrap();
    for name in ["plumb_bob", "rational", "equidistant"] {
        let distortion = read(&format!("camera_ros_{name}.yaml")).distortion.unwrap();
        for (point, expected) in rows["points"].iter().zip(&rows[name]) {
            let found = distortion.distort(*point);
            let error = (found[0] - expected[0]).hypot(found[1] - expected[1]);
            assert!(
                error < 1e-9,
                "{name}: {point:?} becomes {found:?}, in OpenCV {expected:?}"
            );
        }
    }
}

/// A plane has the same depth everywhere, and a straight edge of a mask becomes straight again.
#[test]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "inside of the image"
)]
fn undistorted_images_show_straight_edges() {
    let distortion = read("camera_ros_plumb_bob.yaml").distortion.unwrap();
    let camera = camera();
    // The scene: everything right of x = 0.2 on the plane z = 1. The real image is distorted.
    let mut real = vec![false; 640 * 480];
    for (v, u) in (0..4800).flat_map(|v| (0..6400).map(move |u| (v, u))) {
        let ideal = [
            (u as f64 / 10.0 - 320.5) / 600.0,
            (v as f64 / 10.0 - 240.25) / 610.0,
        ];
        let [x, y] = distortion.distort(ideal);
        let (u, v) = ((x * 600.0 + 320.5).round(), (y * 610.0 + 240.25).round());
        if ideal[0] > 0.2 && (0.0..640.0).contains(&u) && (0.0..480.0).contains(&v) {
            real[v as usize * 640 + u as usize] = true;
        }
    }
    let mask = Mask::new(640, 480, real).unwrap();
    let straight = distortion.undistort_mask(&camera, &mask);
    let column = |mask: &Mask, v: u32| (0..640).find(|u| mask.get(*u, v) == Some(true)).unwrap();
    let (middle, top) = (column(&mask, 240), column(&mask, 20));
    assert!(
        middle.abs_diff(top) > 5,
        "the edge is bent: {middle}, {top}"
    );
    for v in [20, 130, 240, 460] {
        assert!(
            column(&straight, v).abs_diff(441) <= 1,
            "row {v}: {}",
            column(&straight, v)
        );
    }
    let depth = DepthImage::from_meters(640, 480, vec![1.0; 640 * 480]).unwrap();
    let depth = distortion.undistort_depth(&camera, &depth);
    assert_eq!(depth.get(320, 240), Some(1.0));
}

#[test]
fn a_number_that_is_missing_or_wrong_is_named() {
    let folder = Folder::new();
    for (text, parts) in [
        (
            r#"{"fx": 600, "cx": 320, "cy": 240}"#,
            ["camera.json, $:", "no `fy`"],
        ),
        (
            r#"{"fx": 600, "fy": "a", "ppx": 320, "ppy": 240}"#,
            ["$.fy:", "finite number"],
        ),
        (
            r#"{"color": {"fx": 0, "fy": 600, "ppx": 320, "ppy": 240}}"#,
            ["$.color.fx:", "fx is 0"],
        ),
        (
            r#"{"fx": 600, "fy": 600, "ppx": 1e12, "ppy": 240}"#,
            ["$.ppx:", "cx is 1000000000000"],
        ),
        (
            r#"{"fx": 600, "fy": 600, "cx": 320, "cy": 240, "fx": 300}"#,
            ["the key `fx` twice", "expected it once"],
        ),
        (" \n", ["found no text", "a camera as JSON"]),
    ] {
        let path = folder.write("camera.json", text);
        let error = read_camera(&path, (640, 480)).unwrap_err();
        let cause = std::error::Error::source(&error).map(ToString::to_string);
        assert_contains(&format!("{error}: {}", cause.unwrap_or_default()), &parts);
    }
}

#[test]
fn a_camera_for_other_images_is_refused() {
    for name in [
        "camera_opencv.yml",
        "camera_realsense.json",
        "camera_open3d.json",
    ] {
        let error = refused(read_camera(fixture(name), (320, 240)), &[name]);
        assert_eq!(error.kind, IoErrorKind::CameraSize, "{error}");
    }
}

#[test]
fn poses_of_every_form_are_the_same() {
    let axis = UnitVector3::new_normalize(Vector3::new(1.0, 2.0, 3.0));
    let turned = UnitQuaternion::from_axis_angle(&axis, 40_f64.to_radians());
    let check = |name: &str, unit: Option<LengthUnit>, scale: f64| {
        let pose = read_pose(fixture(name), unit).unwrap_or_else(|error| panic!("{error}"));
        let pose = pose.camera_from_object;
        assert!(pose.rotation.angle_to(&turned) < 1e-7, "{name}");
        let at = Vector3::new(0.1, -0.2, 0.8) * scale;
        assert!(
            (pose.translation.vector - at).norm() < 1e-9,
            "{name}: {pose}"
        );
    };
    for name in [
        "pose_matrix.txt",
        "pose_3x4.txt",
        "pose_matrix.npy",
        "pose_matrix.json",
        "pose_flat.json",
        "pose_r_t.json",
        "pose_tum.txt",
        "pose_wxyz.json",
        "pose_xyzw.json",
        "pose_rvec.json",
        "pose_ros.yaml",
        "pose_tf.json",
    ] {
        check(name, None, 1.0);
        check(name, Some(LengthUnit::Millimeters), 0.001);
    }
    check("pose_bop_rows.json", None, 1.0);
    check("pose_bop.npz", None, 1.0);
    check("pose_bop_rows.json", Some(LengthUnit::Meters), 1000.0);

    // A result of Python as JSON.
    let matrix = "[[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.8], [0, 0, 0, 1]]";
    let text = format!(r#"{{"T_co": {matrix}, "mve": 0.1}}"#);
    let file = read_pose(Folder::new().write("pose.json", text), None).unwrap();
    assert_eq!(file.translation_mm, [100.0, 200.0, 800.0]);
}

#[test]
fn a_quaternion_of_unknown_order_and_other_files_are_refused() {
    for (name, found) in [
        ("pose_unordered.json", "quaternion of stated order"),
        ("pose_two_tfs.json", "the keys \"transforms\""),
        (
            "pose_list.json",
            "a list of 2 objects, of which a file has one",
        ),
        ("camera_k.txt", "9 numbers"),
        ("camera_rows.json", "the keys \"K\""),
        ("photo.jpg", "a JPEG image"),
    ] {
        refused(read_pose(fixture(name), None), &[name, found]);
    }
    let folder = Folder::new();
    for (text, found) in [
        ("nan 0 0 0\n0 1 0 0\n0 0 1 1\n", r#"[[\"nan\",0.0"#),
        (
            r#"{"rvec": [90, 0, 0], "tvec": [0, 0, 1]}"#,
            "must be in radians",
        ),
    ] {
        refused(
            read_pose(folder.write("T.txt", text), None),
            &["T.txt", found],
        );
    }
}

/// The files of other people in the data folder.
#[test]
fn real_camera_files_are_read() {
    let Some(folder) = crate::common::data("intrinsics") else {
        return;
    };
    for (name, size, fx, scale) in [
        ("m3t_color_camera.yaml", (960, 540), 698.128, None),
        ("m3t_depth_camera.yaml", (848, 480), 425.773, Some(1.0)),
        ("open3d_default_intrinsics.json", (640, 480), 525.0, None),
        ("opencv_ycbv.xml", (640, 480), 1066.778, Some(0.1)),
        ("opencv_ycbv.yml", (640, 480), 1066.778, Some(0.1)),
        (
            "realsense_0707yiliu.json",
            (640, 480),
            610.040_161,
            Some(1.0),
        ),
        ("realsense_two_streams.json", (640, 480), 384.688_323, None),
        (
            "ros_usb_cam_camera_info.yaml",
            (640, 480),
            438.783_367,
            None,
        ),
        ("tsdf_fusion_camera-intrinsics.txt", (640, 480), 585.0, None),
    ] {
        let file = read_camera(folder.join(name), size).unwrap_or_else(|error| panic!("{error}"));
        assert!(
            (file.camera.fx() - fx).abs() < 1e-5,
            "{name}: {}",
            file.camera.fx()
        );
        let same = match (file.depth_scale, scale) {
            (Some(found), Some(scale)) => (found - scale).abs() < 1e-6,
            (found, scale) => found == scale,
        };
        assert!(same, "{name}: {:?}", file.depth_scale);
        assert_eq!(file.distortion.is_some(), name.starts_with("ros"), "{name}");
    }
}

/// A depth camera 5 cm left of a color camera of twice the resolution sees a square in front of a
/// wall.
#[test]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "inside of the image"
)]
fn registered_depth_is_that_of_the_other_camera() {
    let from = PinholeCamera::new(100.0, 100.0, 31.5, 23.5, 64, 48).unwrap();
    let to = PinholeCamera::new(200.0, 200.0, 63.5, 47.5, 128, 96).unwrap();
    let square = |u: u32, v: u32| (20..40).contains(&u) && (10..30).contains(&v);
    let depths = (0..48).flat_map(|v| (0..64).map(move |u| if square(u, v) { 0.5 } else { 1.0 }));
    let depth = DepthImage::collect(64, 48, depths).unwrap();
    let moved = Isometry3::translation(-0.05, 0.0, 0.1);
    let seen = register_depth(&depth, &from, &to, &moved);
    assert_eq!((seen.width(), seen.height()), (128, 96));
    // Points of the depth camera's frame, as the other camera sees them.
    let at = |x: f64, y: f64, z: f64| {
        let (u, v) = (
            (x - 0.05) / (z + 0.1) * 200.0 + 63.5,
            y / (z + 0.1) * 200.0 + 47.5,
        );
        seen.get(u.round() as u32, v.round() as u32).unwrap()
    };
    for (x, y) in [(-0.05, -0.06), (0.03, 0.02), (0.0, 0.0)] {
        assert_eq!(at(x, y, 0.5), 0.6);
    }
    assert_eq!(at(-0.2, 0.2, 1.0), 1.1);
    // The wall has no holes where both cameras see it, though it has four times the pixels.
    assert!((80..96).all(|v| (10..100).all(|u| v > 90 || seen.get(u, v) == Some(1.1))));
    // Behind the right edge of the square, the depth camera saw nothing.
    assert_eq!(at(0.065, 0.0, 0.75), 0.0);
    // A flat wall has no holes if the cameras are rolled against each other.
    let flat = DepthImage::collect(64, 48, vec![1.0; 64 * 48]).unwrap();
    for degrees in [3.0_f64, 30.0, 45.0] {
        let rolled = Isometry3::rotation(Vector3::z() * degrees.to_radians());
        let seen = register_depth(&flat, &from, &to, &rolled);
        assert!((40..56).all(|v| (50..80).all(|u| seen.get(u, v) == Some(1.0))));
    }
    let behind = register_depth(&depth, &from, &to, &Isometry3::translation(0.0, 0.0, -2.0));
    assert!(behind.pixels().iter().all(|z| *z == 0.0));
    let moved = Isometry3::translation(0.0, 0.0, -0.999_999);
    let odd = register_depth(&depth, &from, &to, &moved);
    assert!(odd.pixels().iter().all(|z| z.is_finite()));
}
