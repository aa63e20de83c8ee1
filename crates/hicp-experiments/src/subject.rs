//! The objects of a study.

use std::path::{Path, PathBuf};

use hicp_core::{Model, TriMesh};
use hicp_io::{LengthUnit, read_mesh};
use hicp_sim::Household;

use crate::error::ExperimentError;

/// An object of a study.
#[derive(Clone, Debug)]
pub struct Subject {
    /// Name in tables; random numbers follow from it.
    pub name: String,
    /// Where it comes from: `household`, or a file's name.
    pub source: String,
    /// The model, metres.
    pub model: Model,
}

impl Subject {
    /// Makes household objects in their nominal proportions, with their symmetries.
    ///
    /// # Errors
    ///
    /// None for the objects that ship.
    pub fn household(objects: &[Household]) -> Result<Vec<Self>, ExperimentError> {
        let made = objects.iter().map(|object| {
            Ok(Self {
                name: object.name().to_owned(),
                source: "household".to_owned(),
                model: object.model()?,
            })
        });
        made.collect()
    }

    /// Reads every OBJ, PLY and STL file of a folder, in metres, in the order of their names. Symmetries are not known.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when the folder or a file cannot be read, there is no mesh, or two files have the same stem.
    pub fn read_folder(folder: &Path) -> Result<Vec<Self>, ExperimentError> {
        let entries = std::fs::read_dir(folder).map_err(ExperimentError::file(folder))?;
        let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        files.retain(|path| {
            let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
            ["obj", "off", "ply", "stl"].iter().any(|e| extension == *e)
        });
        files.sort();
        if files.is_empty() {
            return Err(ExperimentError::NoMeshes {
                path: folder.to_owned(),
            });
        }
        let read = files.iter().map(|path| {
            let text = |part: Option<&std::ffi::OsStr>| {
                part.unwrap_or_default().to_string_lossy().into_owned()
            };
            Ok(Self {
                name: text(path.file_stem()),
                source: text(path.file_name()),
                model: Model::new(read_mesh(path, LengthUnit::Meters)?),
            })
        });
        read.collect()
    }
}

/// Returns a number that tells meshes apart: FNV-1a of the coordinates' bits and the indices.
pub(crate) fn fingerprint(mesh: &TriMesh) -> u64 {
    let coordinates = mesh
        .vertices()
        .iter()
        .flat_map(|p| [p.x, p.y, p.z])
        .map(f32::to_bits);
    let indices = mesh.triangles().iter().flatten().copied();
    coordinates
        .chain(indices)
        .flat_map(u32::to_le_bytes)
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
}
