//! Unusual and invalid PNG files: each is read correctly or refused with a clear error.

use std::io::Write;

use flate2::{Crc, write::ZlibEncoder};
use hicp_io::{IoErrorKind, read_color, read_depth_png, read_mask_png, write_depth_png};
use png::{BitDepth, ColorType, Compression, Encoder};

use crate::common::{Folder, limits, message, refused};

fn chunk(kind: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let body = [&kind[..], data].concat();
    let mut crc = Crc::new();
    crc.update(&body);
    let length = u32::try_from(data.len()).unwrap();
    [&length.to_be_bytes()[..], &body, &crc.sum().to_be_bytes()].concat()
}

/// Returns rows as stored blocks of a zlib stream.
fn stored(rows: &[u8]) -> Vec<u8> {
    let mut stream = ZlibEncoder::new(Vec::new(), flate2::Compression::none());
    stream.write_all(rows).unwrap();
    stream.finish().unwrap()
}

/// Returns a PNG file of 16-bit gray with a custom header.
fn gray16(width: u32, height: u32, interlaced: bool, rows: &[u8]) -> Vec<u8> {
    let mut header = [width.to_be_bytes(), height.to_be_bytes()].concat();
    header.extend([16, 0, 0, 0, u8::from(interlaced)]);
    let signature = b"\x89PNG\r\n\x1a\n".to_vec();
    [
        signature,
        chunk(b"IHDR", &header),
        chunk(b"IDAT", &stored(rows)),
        chunk(b"IEND", &[]),
    ]
    .concat()
}

#[test]
fn an_interlaced_depth_image_is_read_as_a_plain_one() {
    let folder = Folder::new();
    let (width, height) = (13_u32, 11_u32);
    let value = |u: u32, v: u32| u16::try_from(1 + 1000 * v + u).unwrap();
    // Adam7 passes: first column, first row, column step, row step.
    let passes = [
        (0, 0, 8, 8),
        (4, 0, 8, 8),
        (0, 4, 4, 8),
        (2, 0, 4, 4),
        (0, 2, 2, 4),
        (1, 0, 2, 2),
        (0, 1, 1, 2),
    ];
    let mut rows = Vec::new();
    for (first_u, first_v, step_u, step_v) in passes {
        for v in (first_v..height).step_by(step_v) {
            // The filter type "none".
            rows.push(0);
            rows.extend(
                (first_u..width)
                    .step_by(step_u)
                    .flat_map(|u| value(u, v).to_be_bytes()),
            );
        }
    }
    let path = folder.write("interlaced.png", gray16(width, height, true, &rows));
    let depth = read_depth_png(&path, 1.0).unwrap();
    assert_eq!((depth.width(), depth.height()), (width, height));
    for v in 0..height {
        for u in 0..width {
            let meters = depth.pixels()[(v * width + u) as usize];
            assert!(
                (f64::from(meters) * 1000.0 - f64::from(value(u, v))).abs() < 1e-3,
                "{u} {v}"
            );
        }
    }
    assert_eq!(read_mask_png(&path).unwrap().n_set(), 143);
    // A file truncated at any position gives an error, never an incomplete image.
    let whole = std::fs::read(&path).unwrap();
    // The last chunk and two checksums may be missing, because all pixels are present.
    for length in 0..whole.len() - 12 - 8 {
        let cut = folder.write("cut.png", &whole[..length]);
        let error = read_depth_png(&cut, 1.0).unwrap_err();
        assert_eq!(error.expected, "a PNG image", "{length}");
    }
}

#[test]
fn errors_name_every_other_pixel_type() {
    let folder = Folder::new();
    let path = folder.path("a.png");
    use BitDepth::{Eight, Four, One, Sixteen};
    use ColorType::{Grayscale, GrayscaleAlpha, Indexed, Rgb, Rgba};
    for (color, depth, bytes, named) in [
        (Grayscale, One, 1, "1-bit gray"),
        (Grayscale, Eight, 1, "8-bit gray"),
        (GrayscaleAlpha, Sixteen, 4, "16-bit gray + alpha"),
        (Rgb, Eight, 3, "8-bit RGB"),
        (Rgb, Sixteen, 6, "16-bit RGB"),
        (Rgba, Eight, 4, "8-bit RGBA"),
        (Indexed, Eight, 1, "8-bit palette"),
        (Indexed, Four, 1, "4-bit palette"),
    ] {
        let mut encoder = Encoder::new(std::fs::File::create(&path).unwrap(), 1, 1);
        encoder.set_color(color);
        encoder.set_depth(depth);
        if color == Indexed {
            encoder.set_palette(vec![9, 9, 9]);
        }
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(&vec![0; bytes]).unwrap();
        writer.finish().unwrap();
        let parts = ["a.png", named, "expected 16-bit gray"];
        refused(read_depth_png(&path, 1.0), &parts);
        // A mask may be of any type.
        assert_eq!(read_mask_png(&path).unwrap().pixels(), [color == Indexed]);
        assert_eq!(read_color(&path).unwrap().pixels().len(), 1);
    }
}

#[test]
fn decompression_bombs_are_refused_by_their_headers() {
    let folder = Folder::new();
    // Cases: above the limit; within the limit, but more than the file can hold. Below: complete,
    // but above a custom limit.
    for (width, height, parts) in [
        (
            32_768,
            32_768,
            &[
                "byte 16",
                "32768x32768",
                "at most 33554432 pixels",
                "--max-pixels",
            ][..],
        ),
        (100_000, 2, &["100000x2", "sides of 1 to"]),
        // The product does not fit 32 bits.
        (
            0x7fff_ffff,
            0x7fff_ffff,
            &["byte 16", "2147483647x2147483647"],
        ),
        (
            4096,
            8192,
            &["byte 16", "promises 33554432 pixels", "are left"],
        ),
    ] {
        let path = folder.write("a.png", gray16(width, height, false, &[0; 3]));
        refused(read_depth_png(&path, 1.0), parts);
        refused(read_mask_png(&path), parts);
        refused(read_color(&path), parts);
    }
    let path = folder.path("bomb.png");
    let mut encoder = Encoder::new(std::fs::File::create(&path).unwrap(), 4096, 4096);
    encoder.set_color(ColorType::Grayscale);
    encoder.set_depth(BitDepth::Sixteen);
    encoder.set_compression(Compression::High);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&vec![0; 4096 * 4096 * 2]).unwrap();
    writer.finish().unwrap();
    assert!(std::fs::metadata(&path).unwrap().len() < 200_000);
    let limits = limits(|limits| limits.max_pixels = 4096 * 4096 - 1);
    let depth = limits.read_depth_png(&path, 1.0).unwrap_err();
    let mask = limits.read_mask_png(&path).unwrap_err();
    assert_eq!([depth.kind, mask.kind], [IoErrorKind::Limit; 2]);
    assert_eq!(
        read_depth_png(&path, 1.0).unwrap().pixels().len(),
        4096 * 4096
    );
}

#[test]
fn data_that_do_not_fit_the_header_are_refused() {
    let folder = Folder::new();
    let row = |width: usize| [vec![0], vec![1; 2 * width]].concat();
    for (width, height, rows) in [
        (4, 4, row(4).repeat(3)),
        (4, 4, row(3).repeat(4)),
        (0, 4, Vec::new()),
        (4, 0, Vec::new()),
        // A filter type that does not exist.
        (1, 1, vec![9, 0, 1]),
    ] {
        let path = folder.write("a.png", gray16(width, height, false, &rows));
        let error = read_depth_png(&path, 1.0).unwrap_err();
        assert_eq!(error.expected, "a PNG image", "{width}x{height}");
    }
    let other = folder.write("a.png", b"P5 64 64 65535");
    let error = read_depth_png(other, 1.0).unwrap_err();
    assert_eq!(error.expected, "a PNG image");
    // A file with any one damaged byte gives an image or an error.
    let depth = hicp_core::DepthImage::from_meters(5, 4, vec![0.5; 20]).unwrap();
    let path = folder.path("a.png");
    write_depth_png(&path, &depth, 1.0).unwrap();
    let whole = std::fs::read(&path).unwrap();
    for at in 0..whole.len() {
        let mut damaged = whole.clone();
        damaged[at] ^= 0xff;
        match read_depth_png(folder.write("a.png", &damaged), 1.0) {
            Ok(image) => assert_eq!(
                image.pixels(),
                depth.pixels(),
                "byte {at}: the checksums do not detect the damage"
            ),
            Err(error) => assert!(message(&error).contains("a.png")),
        }
    }
}
