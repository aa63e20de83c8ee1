//! Public meshes of mugs and pitchers.

use std::path::{Path, PathBuf};

use hicp_io::{IoError, LengthUnit, read_mesh};
use hybrid_icp::core::Model;

/// Reads two mugs and a pitcher, with their names.
///
/// They are in `meshes` in `HICP_DATA`, or in the shared data next to the project.
///
/// # Errors
///
/// If a file is missing or invalid.
pub fn public_mugs() -> Result<Vec<(&'static str, Model)>, IoError> {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let data = std::env::var_os("HICP_DATA").map_or(shared, PathBuf::from);
    let files = [
        ("public_small_20/coffeemug.ply", "coffeemug"),
        ("public_ycb_ccby4/025_mug.obj", "025_mug"),
        ("public_ycb_ccby4/019_pitcher_base.obj", "019_pitcher_base"),
    ];
    let read = |(file, name)| {
        let mesh = read_mesh(data.join("meshes").join(file), LengthUnit::Meters)?;
        Ok((name, Model::new(mesh)))
    };
    files.into_iter().map(read).collect()
}
