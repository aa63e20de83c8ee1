//! Recognition of file formats by their first bytes.

use std::path::Path;

use crate::error::IoError;

/// A format that the first bytes of a file show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Bmp,
    Exr,
    Gif,
    Glb,
    Gzip,
    Hdf5,
    Jpeg,
    Json,
    Matlab,
    /// PGM and PFM.
    Netpbm,
    Npy,
    /// Zip, which NPZ files are.
    Npz,
    Pcd,
    Pclzf,
    Pickle,
    Ply,
    Png,
    RosBag,
    Tiff,
    WebP,
    Xml,
    Yaml,
}

use Format::*;

/// The first bytes of each format, and its name with an article. The first entry that fits counts.
const FORMATS: [(Format, &[&[u8]], &str); 22] = [
    (Png, &[b"\x89PNG\r\n\x1a\n"], "a PNG image"),
    (Tiff, &TIFF, "a TIFF image"),
    (Npy, &[b"\x93NUMPY"], "a NumPy array (NPY)"),
    (
        Npz,
        &[b"PK\x03\x04", b"PK\x05\x06"],
        "a zip archive, such as NPZ",
    ),
    (Exr, &[b"\x76\x2f\x31\x01"], "an EXR image"),
    (Jpeg, &[b"\xff\xd8\xff"], "a JPEG image"),
    (Netpbm, &[b"Pf", b"PF", b"P5"], "a PGM or PFM image"),
    (Bmp, &[b"BM"], "a BMP image"),
    (Gif, &[b"GIF8"], "a GIF image"),
    (WebP, &[b"RIFF"], "a WebP image"),
    (Glb, &[b"glTF"], "a binary glTF file"),
    (Hdf5, &[b"\x89HDF\r\n\x1a\n"], "an HDF5 file"),
    (Pclzf, &[b"PCLZF"], "a PCLZF image of PCL"),
    (Matlab, &[b"MATLAB"], "a MATLAB file"),
    (RosBag, &[b"#ROSBAG", b"\x89MCAP"], "a ROS bag"),
    (Gzip, &[b"\x1f\x8b"], "a file compressed by gzip"),
    (Pickle, &PICKLE, "a Python pickle"),
    (Ply, &[b"ply"], "a PLY file"),
    (Pcd, &[b"# .PCD", b"VERSION"], "a PCD point cloud"),
    (Xml, &[b"<?xml"], "XML"),
    (Yaml, &[b"%YAML"], "YAML"),
    // Its start varies.
    (Json, &[], "JSON"),
];
const TIFF: [&[u8]; 4] = [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"];
const PICKLE: [&[u8]; 4] = [b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05"];

impl Format {
    /// Returns the format that the start of a file shows, if any.
    pub(crate) fn of(head: &[u8]) -> Option<Self> {
        let fits = |starts: &[&[u8]]| starts.iter().any(|start| head.starts_with(start));
        let known = FORMATS.iter().find(|(_, starts, _)| fits(starts));
        let json = || {
            let first = head.trim_ascii_start().first();
            first
                .is_some_and(|byte| b"{[".contains(byte))
                .then_some(Json)
        };
        known.map(|(format, ..)| *format).or_else(json)
    }

    /// Returns the name of the format with an article.
    pub(crate) fn name(self) -> &'static str {
        let row = FORMATS.iter().find(|(format, ..)| *format == self);
        let Some((.., name)) = row else {
            unreachable!("every format has a row");
        };
        name
    }

    /// Returns how to convert a file of a format that no reader supports.
    fn conversion(self) -> Option<&'static str> {
        Some(match self {
            Gif | Jpeg | WebP => {
                "JPEG, WebP and GIF change values; save the original as PNG: \
                 imageio.imwrite(\"image.png\", array)"
            }
            Gzip => "decompress it first with `gunzip FILE`",
            Hdf5 => "np.save(\"array.npy\", h5py.File(FILE)[KEY][()]) in Python converts it",
            Json => {
                "a polygon or a run-length code of COCO is a mask by \
                 np.save(\"mask.npy\", coco.annToMask(annotation)) in Python"
            }
            Matlab => "np.save(\"array.npy\", scipy.io.loadmat(FILE)[KEY]) in Python converts it",
            Pclzf => {
                "save PNG, for example with PCL's pcl_convert_pcd_ascii_binary after a grab as PCD"
            }
            Pickle => {
                "reading a pickle runs its code; save its numbers in Python: \
                 np.save(\"array.npy\", array)"
            }
            RosBag => "extract the messages first, for example with `rosbags` in Python",
            _ => return None,
        })
    }
}

/// Returns the error for a file of another format than expected, with what to do about it.
///
/// `expected` names what the file is for and the supported formats.
pub(crate) fn refuse(path: &Path, head: &[u8], expected: &str) -> IoError {
    let format = Format::of(head);
    let found = format.map_or("data of an unknown format", Format::name);
    let advice = match format {
        None if head.is_empty() => return IoError::new(path, None, "an empty file", expected),
        Some(format) => format.conversion().map(str::to_owned),
        None => Some(
            "raw numbers need their shape; np.save(\"array.npy\", \
             np.fromfile(FILE, \"float32\").reshape(480, 640)) in Python adds it"
                .to_owned(),
        ),
    };
    let advice = advice.map_or(String::new(), |advice| format!(": {advice}"));
    IoError::new(path, None, found, format!("{expected}{advice}"))
}

/// Returns the error for a format whose cargo feature is off.
#[allow(dead_code, reason = "not called if all features are on")]
pub(crate) fn without_feature(path: &Path, format: Format, feature: &str) -> IoError {
    let expected = format!("a format of this build: build `hicp-io` with the feature `{feature}`");
    IoError::new(path, None, format.name(), expected)
}
