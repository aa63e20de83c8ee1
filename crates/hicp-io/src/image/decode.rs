//! Decoding of images, recognized by their first bytes.

use std::path::Path;

use png::Transformations;

use super::raster::Raster;
use super::{bmp, netpbm, pixels};
use crate::error::IoError;
use crate::format::{self, Format};
use crate::limits::ReadLimits;
use crate::source::read_head;

/// Reads an image of any supported format.
///
/// `name` is "depth" or "mask", and `formats` lists the formats for an error.
pub(super) fn read(
    limits: &ReadLimits,
    path: &Path,
    name: &str,
    formats: &str,
) -> Result<Raster, IoError> {
    let (head, _) = read_head(path)?;
    let content = || limits.read_bytes(path);
    match Format::of(&head) {
        Some(Format::Png) => pixels::read(limits, path, Transformations::IDENTITY).map(Into::into),
        Some(Format::Netpbm) => netpbm::decode(limits, path, &content()?),
        Some(Format::Bmp) => bmp::decode(limits, path, &content()?),
        #[cfg(feature = "exr")]
        Some(Format::Exr) => super::exr::decode(limits, path, &content()?),
        #[cfg(feature = "tiff")]
        Some(Format::Tiff) => super::tiff::decode(limits, path, &content()?),
        #[cfg(feature = "npy")]
        Some(Format::Npy | Format::Npz) => super::npy::decode(limits, path, &content()?, name),
        #[cfg(not(feature = "exr"))]
        Some(Format::Exr) => Err(format::without_feature(path, Format::Exr, "exr")),
        #[cfg(not(feature = "tiff"))]
        Some(Format::Tiff) => Err(format::without_feature(path, Format::Tiff, "tiff")),
        #[cfg(not(feature = "npy"))]
        Some(found @ (Format::Npy | Format::Npz)) => {
            Err(format::without_feature(path, found, "npy"))
        }
        _ => {
            let expected = format!("a {name} image as {formats}");
            Err(format::refuse(path, &head, &expected))
        }
    }
}
