//! Depth images and masks that other programs wrote (`tests/fixtures/make.py`).

use hicp_core::Mask;
use hicp_io::bop::Scene;
use hicp_io::{MaskRule, read_depth, read_mask};

use crate::common::{Folder, assert_contains, fixture, refused};

/// The depth at every pixel, meters.
fn expected(index: usize) -> f32 {
    match index {
        0 => 0.0,
        _ => 1.0 + 0.1 * (index / 5) as f32 + 0.01 * (index % 5) as f32,
    }
}

fn check_depth(name: &str, millimeters_per_unit: Option<f64>, tolerance: f32) {
    let depth = read_depth(fixture(name), millimeters_per_unit).unwrap();
    assert_eq!((depth.width(), depth.height()), (5, 4), "{name}");
    for (index, meters) in depth.pixels().iter().enumerate() {
        let error = (meters - expected(index)).abs();
        assert!(error <= tolerance, "{name}, pixel {index}: {meters}");
    }
}

#[test]
fn integers_of_every_format_have_a_unit() {
    for name in [
        "depth_pillow_u16.png",
        "depth_pillow_u16.pgm",
        "depth_u16.tiff",
        "depth_u16_big_endian.tiff",
        "depth_u16_big.tiff",
        "depth_opencv_u16.tiff",
        "depth_u16_big_endian.npy",
        "depth_i64.npy",
    ] {
        check_depth(name, Some(1.0), 1e-6);
        let without_unit = read_depth(fixture(name), None);
        refused(without_unit, &["found integers", "--depth-scale"]);
    }
}

#[test]
fn floating_point_is_in_meters() {
    for name in [
        "depth_f32_tiled.tiff",
        "depth_f32_lzw.tiff",
        "depth_f64.tiff",
        "depth_f32.npy",
        "depth_f64_fortran.npy",
        "depth_single.npz",
        "depth_named.npz",
        "depth_and_mask.npz",
        "depth_opencv.pfm",
        "depth_zip.exr",
        "depth_zips.exr",
        "depth_rle.exr",
        "depth_piz.exr",
    ] {
        check_depth(name, None, 1e-6);
    }
    for name in ["depth_f16.tiff", "depth_f16.npy", "depth_none.exr"] {
        check_depth(name, None, 1e-3);
    }
    let millimeters = read_depth(fixture("depth_f32.npy"), Some(1.0)).unwrap();
    assert!((millimeters.pixels()[1] - 0.001_01).abs() < 1e-8);
}

#[test]
fn files_that_cannot_be_depth_are_refused_with_advice() {
    for (name, found, advice) in [
        (
            "depth_pickled.npy",
            "pickled array of Python objects",
            "np.save",
        ),
        (
            "depth_unnamed.npz",
            "2 arrays: \"a\", \"b\"",
            "one named depth",
        ),
        ("photo.jpg", "a JPEG image", "PNG"),
        ("mask_u8.tiff", "8-bit gray pixels", "16-bit gray"),
        (
            "mask_cut_out.png",
            "8-bit RGBA pixels",
            "one floating-point number",
        ),
        ("mask_bool.npy", "1-bit gray pixels", "16-bit gray"),
        ("make.py", "data of an unknown format", "np.fromfile"),
    ] {
        refused(read_depth(fixture(name), Some(1.0)), &[name, found, advice]);
    }
    let folder = Folder::new();
    let mut damaged = std::fs::read(fixture("depth_single.npz")).unwrap();
    // The last byte of the array is the one before the directory.
    let directory = damaged.windows(4).position(|bytes| bytes == b"PK\x01\x02");
    damaged[directory.unwrap() - 1] ^= 1;
    let damaged = read_depth(folder.write("depth.npz", damaged), None);
    refused(damaged, &["the damaged array \"arr_0\""]);
    let empty = read_depth(folder.write("depth.png", ""), Some(1.0));
    refused(empty, &["depth.png: found an empty file"]);
}

/// Returns the content of a little-endian TIFF file with one entry of its tags replaced.
fn with_tag(name: &str, tag: u16, other: u16, value: u8) -> Vec<u8> {
    let mut content = std::fs::read(fixture(name)).unwrap();
    let first = u32::from_le_bytes(*content[4..].first_chunk().unwrap()) as usize + 2;
    let entries = content[first..].chunks(12);
    let index = entries.take_while(|entry| !entry.starts_with(&tag.to_le_bytes()));
    let at = first + 12 * index.count();
    content[at..at + 2].copy_from_slice(&other.to_le_bytes());
    content[at + 8] = value;
    content
}

#[test]
fn variants_of_a_format_that_change_the_meaning_are_refused() {
    let folder = Folder::new();
    let mut os2 = std::fs::read(fixture("mask_red.bmp")).unwrap();
    os2[14] = 12;
    for (content, parts) in [
        (
            with_tag("depth_u16.tiff", 296, 274, 6),
            ["the Orientation 6", "upright"],
        ),
        (
            with_tag("depth_u16.tiff", 262, 262, 0),
            ["the PhotometricInterpretation 0", "black"],
        ),
        (
            std::fs::read(fixture("mask_planar.tiff")).unwrap(),
            ["the PlanarConfiguration 2", "together"],
        ),
        (os2, ["a header of 12 bytes", "at least 40"]),
        (
            b"Pf\n1 1\n-0.5\n\0\0\0\0".to_vec(),
            ["the scale -0.5", "multiply"],
        ),
    ] {
        let path = folder.write("image", content);
        refused(read_depth(&path, Some(1.0)), &parts);
        refused(read_mask(&path, MaskRule::NotZero), &parts);
    }
    let upright = folder.write("image", with_tag("depth_u16.tiff", 296, 274, 1));
    read_depth(upright, Some(1.0)).unwrap();
}

/// Asserts that a mask selects the object, without a warning.
fn check_mask(name: &str, rule: MaskRule) {
    let file = read_mask(fixture(name), rule).unwrap();
    let expected = (0..20).map(|index| index % 5 >= 2).collect();
    assert_eq!(file.mask, Mask::new(5, 4, expected).unwrap(), "{name}");
    assert_eq!(file.warning, None, "{name}");
}

#[test]
fn masks_of_two_values_need_no_option() {
    for name in [
        "mask_1_bit.png",
        "mask_1_bit.tiff",
        "mask_1_bit.bmp",
        "mask_8_bit.bmp",
        "mask_red.bmp",
        "mask_red.png",
        "mask_cut_out.png",
        "mask_cut_out.tiff",
        "mask_opaque.png",
        "mask_transparent.bmp",
        "mask_u8.tiff",
        "mask_bool.npy",
        "mask_u8_channel.npy",
        "depth_and_mask.npz",
    ] {
        check_mask(name, MaskRule::NotZero);
    }
}

#[test]
fn masks_of_more_values_are_read_with_a_warning_that_names_the_options() {
    for (name, values, threshold) in [
        (
            "mask_soft.png",
            "the values 0, 42, 127, 212 and 255, and",
            128.0,
        ),
        ("mask_labels.png", "the values 0, 1 and 3, and", 2.0),
        ("mask_palette.png", "the values 0, 1 and 3, and", 2.0),
        (
            "mask_colors.png",
            "the values 0, #3c0000 and #b40000, and",
            1.0,
        ),
        ("mask_probabilities.npy", "the values 0.025, 0.275", 0.5),
        ("mask_logits.npy", "the values -4.5, -1.5", 0.0),
        ("picture.png", "#f8e628, as in a photo, and all", 1.0),
    ] {
        let file = read_mask(fixture(name), MaskRule::NotZero).unwrap();
        let warning = file.warning.unwrap_or_else(|| panic!("{name}: no warning"));
        let option = format!("--mask-threshold {threshold} ");
        assert_contains(&warning, &[values, &option, "--mask-value"]);
        assert_eq!(file.threshold, threshold, "{name}");
    }
}

#[test]
fn a_threshold_or_a_value_selects_the_object() {
    for (name, rule) in [
        ("mask_soft.png", MaskRule::AtLeast(127.0)),
        ("mask_probabilities.npy", MaskRule::AtLeast(0.5)),
        ("mask_logits.npy", MaskRule::AtLeast(0.0)),
        ("mask_labels.png", MaskRule::Equal(3.0)),
        ("mask_palette.png", MaskRule::Equal(3.0)),
    ] {
        check_mask(name, rule);
    }
    let other = read_mask(fixture("mask_labels.png"), MaskRule::Equal(7.0));
    refused(other, &["a value 7,", "the values 0, 1 and 3"]);
}

/// A truncated file, and a file with one changed byte, gives an image or an error.
#[test]
fn damaged_files_never_panic() {
    let folder = Folder::new();
    let fixtures = std::fs::read_dir(fixture("")).unwrap();
    for entry in fixtures.flatten().map(|entry| entry.path()) {
        let whole = std::fs::read(&entry).unwrap();
        let name = entry.file_name().unwrap().to_string_lossy().into_owned();
        // Other tests damage every byte of PNG files.
        if !(name.starts_with("depth") || name.starts_with("mask")) || name.ends_with("png") {
            continue;
        }
        let read = |content: &[u8]| {
            let path = folder.write(&name, content);
            let depth = read_depth(&path, Some(1.0)).err();
            let mask = read_mask(&path, MaskRule::NotZero).err();
            for error in depth.iter().chain(&mask) {
                assert!(error.to_string().len() < 1000, "{error}");
            }
        };
        for end in (0..whole.len()).step_by(11) {
            read(&whole[..end]);
        }
        for (at, flip) in (0..whole.len())
            .step_by(4)
            .zip([1, 0x80, 0xff].into_iter().cycle())
        {
            let mut content = whole.clone();
            content[at] ^= flip;
            read(&content);
        }
    }
}

/// The real frame of the data folder in every format.
#[test]
fn a_real_frame_is_the_same_in_every_format() {
    let Some(folder) = crate::common::data("depth_formats") else {
        return;
    };
    let count = |name: &str, scale: Option<f64>| {
        let depth = read_depth(folder.join(name), scale).unwrap();
        assert_eq!((depth.width(), depth.height()), (640, 480), "{name}");
        let at = f64::from(depth.get(320, 240).unwrap());
        assert!((at - 0.933).abs() < 1e-3, "{name}: {at}");
        let measured = depth.pixels().iter().filter(|z| **z > 0.0).count();
        let sum: f64 = depth.pixels().iter().map(|z| f64::from(*z)).sum();
        assert_eq!(measured, 224_197, "{name}");
        assert!((sum / 260_306.249 - 1.0).abs() < 1e-4, "{name}: {sum}");
    };
    for name in [
        "ycbv50_1.pfm",
        "ycbv50_1_compressed.npz",
        "ycbv50_1_f16_metres.npy",
        "ycbv50_1_f32_deflate_tiled.tiff",
        "ycbv50_1_f32_metres.npy",
        "ycbv50_1_f32_metres_nan.tiff",
        "ycbv50_1_none_f16_Z.exr",
        "ycbv50_1_zip_f32_Z.exr",
    ] {
        count(name, None);
    }
    for name in [
        "ycbv50_1_stored.npz",
        "ycbv50_1_u16_bigendian.npy",
        "ycbv50_1_u16_bigendian.tiff",
        "ycbv50_1_u16_raw.tiff",
    ] {
        count(name, Some(0.1));
    }
    for (name, found) in [
        ("ycbv50_1_f32_metres.raw", "an unknown format"),
        ("graspnet6dof_cheezit.npy", "a pickled array"),
        ("kinect_frame_20121214T142255.814212_depth.pclzf", "PCLZF"),
    ] {
        refused(read_depth(folder.join(name), Some(1.0)), &[found]);
    }
}

#[test]
fn scenes_of_bop_may_have_depth_as_tiff() {
    let folder = Folder::new();
    let camera = r#"{"1": {"cam_K": [600,0,2,0,600,2,0,0,1], "depth_scale": 1.0}}"#;
    folder.write("scene_camera.json", camera);
    let content = std::fs::read(fixture("depth_u16_big_endian.tiff")).unwrap();
    let expected = read_depth(fixture("depth_u16.tiff"), Some(1.0)).unwrap();
    for name in ["depth/000001.tif", "depth/000001.tiff"] {
        let path = folder.write(name, &content);
        let scene = Scene::open(folder.root()).unwrap();
        assert_eq!(scene.read_depth(1).unwrap(), expected);
        std::fs::remove_file(path).unwrap();
    }
}
