//! The files of textures and materials that a mesh file names.

use std::path::{Path, PathBuf};

use hicp_core::ColorImage;

use super::raw::Reading;
use crate::error::{IoError, quote};
use crate::image::color;
use crate::source::is_absent;

/// Returns whether a name is of a file in the folder of the file that states it.
///
/// A file from elsewhere must not read the other files of its user.
pub(super) fn is_inside(name: &str) -> bool {
    !name.contains("..") && !name.contains(':') && Path::new(name).is_relative()
}

/// Returns the path of a file that the mesh file names: in its folder, or below it.
///
/// Programs also write paths of the computer they ran on. Of these, only the name counts.
pub(super) fn find(reading: &Reading<'_>, name: &str) -> PathBuf {
    let name = name.trim().trim_matches('"').replace('\\', "/");
    let folder = reading.path.parent().unwrap_or(Path::new(""));
    let last = name.rsplit('/').next().unwrap_or_default();
    // A part before a colon is a drive.
    let last = folder.join(last.rsplit(':').next().unwrap_or_default());
    let stated = Some(name).filter(|name| is_inside(name));
    let stated = stated.map(|name| folder.join(name));
    stated
        .filter(|path| !is_absent(path) || is_absent(&last))
        .unwrap_or(last)
}

/// Reads a texture that the mesh file names.
pub(super) fn read(reading: &Reading<'_>, name: &str) -> Result<ColorImage, IoError> {
    let path = find(reading, name);
    let image = reading.limits.read_bytes(&path);
    let image = image.and_then(|content| color::decode(reading.limits, &path, &content));
    image.map_err(|error| {
        let found = format!("the texture {}, which cannot be read", quote(name));
        let expected = "a PNG or JPEG image next to this file";
        IoError::new(reading.path, None, found, expected).with_source(error)
    })
}
