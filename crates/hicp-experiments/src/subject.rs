//! The objects of a study.

use std::path::{Path, PathBuf};

use hicp_core::{Isometry3, Model, Point3};
use hicp_io::{IoError, LengthUnit, read_mesh};
use hicp_score::{add, adi};
use hicp_sim::Household;

use crate::error::ExperimentError;

/// An object of a study.
#[derive(Clone, Debug)]
pub struct Subject {
    /// Name in tables. It also seeds the random numbers.
    pub name: String,
    /// The origin of the model: `household`, or the name of a file.
    pub source: String,
    /// The model, meters.
    pub model: Model,
}

impl Subject {
    /// Creates household objects in their nominal proportions, with their symmetries.
    ///
    /// # Errors
    ///
    /// Never for the objects that ship with `hicp-sim`.
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

    /// Reads the OBJ, OFF, PLY and STL files of a folder, in meters, in alphabetical order.
    ///
    /// Other files, also GLB and glTF, are skipped. The objects have no symmetries.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when the folder or a file cannot be read, or there is no mesh.
    pub fn read_folder(folder: &Path) -> Result<Vec<Self>, ExperimentError> {
        let entries = std::fs::read_dir(folder).map_err(ExperimentError::folder(folder))?;
        let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        files.retain(|path| {
            let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
            ["obj", "off", "ply", "stl"].iter().any(|e| extension == *e)
        });
        files.sort();
        if files.is_empty() {
            let expected = "files that end in .obj, .off, .ply or .stl";
            return Err(IoError::new(folder, None, "no mesh", expected).into());
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

    /// Returns whether symmetries are declared.
    pub(crate) fn is_symmetric(&self) -> bool {
        let symmetries = self.model.symmetries();
        !(symmetries.discrete.is_empty() && symmetries.continuous.is_empty())
    }

    /// Returns ADD over the model's samples, or ADI if symmetries are declared, millimeters.
    pub(crate) fn add_or_adi_mm(&self, estimate: &Isometry3<f64>, truth: &Isometry3<f64>) -> f64 {
        let points: Vec<Point3<f32>> = self.model.samples().iter().map(|s| s.point).collect();
        1e3 * match self.is_symmetric() {
            false => add(estimate, truth, &points),
            true => adi(estimate, truth, &points),
        }
    }

    /// Returns a hash of the mesh: FNV-1a of the coordinates' bits and the indices.
    pub(crate) fn fingerprint(&self) -> u64 {
        let mesh = self.model.mesh();
        let coordinates = mesh.vertices().iter().flat_map(|p| [p.x, p.y, p.z]);
        let indices = mesh.triangles().iter().flatten().copied();
        let words = coordinates.map(f32::to_bits).chain(indices);
        let bytes = words.flat_map(u32::to_le_bytes);
        bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
    }
}
