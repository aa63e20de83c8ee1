//! Color images of other programs (`tests/fixtures/make.py`).

use hicp_io::{IoErrorKind, read_color};

use crate::common::{Folder, assert_contains, fixture, limits, refused};

#[test]
fn jpeg_images_have_nearly_the_colors_of_the_png_image() {
    let png = read_color(fixture("picture.png")).unwrap();
    assert_eq!((png.width(), png.height()), (32, 24));
    assert_eq!(png.get(3, 2), Some([24, 20, 40]));
    for name in ["picture.jpg", "picture_progressive.jpg"] {
        let jpeg = read_color(fixture(name)).unwrap();
        assert_eq!((jpeg.width(), jpeg.height()), (32, 24), "{name}");
        let pairs = jpeg.pixels().as_flattened().iter();
        let pairs = pairs.zip(png.pixels().as_flattened());
        let most = pairs.map(|(a, b)| a.abs_diff(*b)).max();
        assert!(most.is_some_and(|most| most <= 12), "{name}: {most:?}");
    }
    let gray = read_color(fixture("photo.jpg")).unwrap();
    assert_eq!((gray.width(), gray.height()), (5, 4));
    assert!(gray.pixels().iter().all(|[r, g, b]| r == g && g == b));
}

#[test]
fn damaged_jpeg_images_and_images_beyond_the_limit_are_refused() {
    let folder = Folder::new();
    let content = std::fs::read(fixture("picture.jpg")).unwrap();
    for length in [4, 100, 300, content.len() - 40] {
        let path = folder.write("a.jpg", &content[..length]);
        let error = refused(read_color(path), &[]);
        assert_contains(&error.found, &["JPEG"]);
    }
    let limits = limits(|limits| limits.max_pixels = 32 * 24 - 1);
    let error = limits.read_color(fixture("picture.jpg")).unwrap_err();
    assert_eq!(error.kind, IoErrorKind::Limit);
    refused(read_color(fixture("mask_red.bmp")), &["PNG, JPEG or TIFF"]);
}

#[test]
fn tiff_images_have_the_colors_of_their_samples() {
    let read = |name| read_color(fixture(name)).unwrap();
    assert_eq!(read("mask_1_bit.tiff"), read("mask_1_bit.png"));
    let gray = read("mask_u8.tiff");
    let values = gray.pixels().as_flattened();
    assert!(values.contains(&0) && values.iter().all(|value| [0, 255].contains(value)));
    let white = read("mask_cut_out.tiff");
    assert!(white.pixels().iter().all(|pixel| *pixel == [255; 3]));
    refused(read_color(fixture("depth_f64.tiff")), &["floating-point"]);
}

#[test]
fn depth_images_are_not_color_images() {
    for name in [
        "depth_pillow_u16.png",
        "depth_u16.tiff",
        "depth_u16_big_endian.tiff",
    ] {
        let parts = [name, "16-bit gray pixels", "a color image"];
        refused(read_color(fixture(name)), &parts);
    }
}
