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

/// The first bytes of each format. The first entry that fits counts.
const STARTS: [(&[u8], Format); 32] = [
    (b"\x89PNG\r\n\x1a\n", Png),
    (b"II*\0", Tiff),
    (b"MM\0*", Tiff),
    (b"II+\0", Tiff),
    (b"MM\0+", Tiff),
    (b"\x93NUMPY", Npy),
    (b"PK\x03\x04", Npz),
    (b"PK\x05\x06", Npz),
    (b"\x76\x2f\x31\x01", Exr),
    (b"\xff\xd8\xff", Jpeg),
    (b"Pf", Netpbm),
    (b"PF", Netpbm),
    (b"P5", Netpbm),
    (b"BM", Bmp),
    (b"GIF8", Gif),
    (b"RIFF", WebP),
    (b"glTF", Glb),
    (b"\x89HDF\r\n\x1a\n", Hdf5),
    (b"PCLZF", Pclzf),
    (b"MATLAB", Matlab),
    (b"#ROSBAG", RosBag),
    (b"\x89MCAP", RosBag),
    (b"\x1f\x8b", Gzip),
    (b"\x80\x02", Pickle),
    (b"\x80\x03", Pickle),
    (b"\x80\x04", Pickle),
    (b"\x80\x05", Pickle),
    (b"ply", Ply),
    (b"# .PCD", Pcd),
    (b"VERSION", Pcd),
    (b"<?xml", Xml),
    (b"%YAML", Yaml),
];

impl Format {
    /// Returns the format that the start of a file shows, if any.
    pub(crate) fn of(head: &[u8]) -> Option<Self> {
        let known = STARTS.iter().find(|(start, _)| head.starts_with(start));
        let json = || {
            let first = head.trim_ascii_start().first();
            first
                .is_some_and(|byte| b"{[".contains(byte))
                .then_some(Json)
        };
        known.map(|(_, format)| *format).or_else(json)
    }

    /// Returns the name of the format with an article.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Bmp => "a BMP image",
            Exr => "an EXR image",
            Gif => "a GIF image",
            Glb => "a binary glTF file",
            Gzip => "a file compressed by gzip",
            Hdf5 => "an HDF5 file",
            Jpeg => "a JPEG image",
            Json => "JSON",
            Matlab => "a MATLAB file",
            Netpbm => "a PGM or PFM image",
            Npy => "a NumPy array (NPY)",
            Npz => "a zip archive, such as NPZ",
            Pcd => "a PCD point cloud",
            Pclzf => "a PCLZF image of PCL",
            Pickle => "a Python pickle",
            Ply => "a PLY file",
            Png => "a PNG image",
            RosBag => "a ROS bag",
            Tiff => "a TIFF image",
            WebP => "a WebP image",
            Xml => "XML",
            Yaml => "YAML",
        }
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
