//! The files of the object: its mesh and its symmetries.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::Args;
use clap::error::ErrorKind;
use hicp_bop::chain;
use hicp_io::bop::ModelInfo;
use hicp_io::{LengthUnit, MeshFile};
use hybrid_icp::Warning;
use hybrid_icp::checks::warning_of_diameter;
use hybrid_icp::core::{Model, ModelConfig};
use serde::{Deserialize, Serialize};

use crate::limits::limits;

/// The files of the object.
#[derive(Clone, Debug, Args, Serialize, Deserialize)]
pub(crate) struct ObjectFiles {
    /// The object's mesh: GLB, glTF, OBJ, OFF, PLY or STL.
    #[arg(long = "model", value_name = "FILE")]
    pub(crate) mesh: PathBuf,
    /// Unit of the mesh's coordinates: m, mm or cm. Required unless the mesh is glTF, which is in
    /// m.
    #[arg(long, value_name = "UNIT")]
    model_unit: Option<LengthUnit>,
    /// The symmetries of the object: a models_info.json of BOP. If it describes several objects,
    /// the name of the mesh states the id, as obj_000005.ply does.
    #[arg(long, value_name = "FILE")]
    pub(crate) symmetries: Option<PathBuf>,
}

impl ObjectFiles {
    /// Returns the unit of the mesh.
    ///
    /// Fails with a `clap::Error` if it is neither stated nor part of the format.
    pub(crate) fn unit(&self) -> anyhow::Result<LengthUnit> {
        let is_gltf = ["glb", "gltf"].iter().any(|name| {
            (self.mesh.extension()).is_some_and(|found| found.eq_ignore_ascii_case(name))
        });
        match self.model_unit {
            Some(unit) => Ok(unit),
            None if is_gltf => Ok(LengthUnit::Meters),
            None => {
                let text =
                    "--model-unit <UNIT> is missing, expected the unit of the mesh: m, mm or cm\n";
                Err(clap::Error::raw(ErrorKind::MissingRequiredArgument, text).into())
            }
        }
    }

    /// Reads the model, and returns warnings about its files.
    ///
    /// The colors of the mesh are read only if there is a color image, which is named in a warning
    /// if there are none.
    pub(crate) fn read(&self, rgb: Option<&Path>) -> anyhow::Result<(Model, Vec<String>)> {
        let (unit, info) = (self.unit()?, self.read_symmetries()?);
        let (diameter, symmetries) = match info {
            Some(info) => (Some(info.diameter_m), info.symmetries),
            None => Default::default(),
        };
        let (mesh, mut warnings) = match rgb {
            None => (limits().read_mesh_geometry(&self.mesh, unit)?, Vec::new()),
            Some(rgb) => {
                let MeshFile { mesh, color_fault } = limits().read_mesh_file(&self.mesh, unit)?;
                let warning = mesh.color().is_none().then(|| {
                    let (model, rgb) = (self.mesh.display(), rgb.display());
                    let fault =
                        color_fault.map_or(String::new(), |fault| format!(" ({})", chain(&fault)));
                    format!(
                        "{model} has no colors that can be used{fault}, so --rgb {rgb} is ignored"
                    )
                });
                (mesh, warning.into_iter().collect())
            }
        };
        if let Some(path) = &self.symmetries {
            let stated = ModelConfig {
                diameter,
                ..ModelConfig::default()
            };
            let warning = warning_of_diameter(&Model::with_config(mesh.clone(), stated));
            let text = |warning| format!("{}: {warning}: check both units", path.display());
            warnings.extend(warning.map(text));
        }
        let config = ModelConfig {
            symmetries,
            ..ModelConfig::default()
        };
        Ok((Model::with_config(mesh, config), warnings))
    }

    /// Returns a warning about the model with the file and the option to check.
    pub(crate) fn describe(&self, warning: &Warning) -> String {
        let mesh = self.mesh.display();
        match (warning, &self.symmetries, self.unit()) {
            (Warning::Diameter { .. }, _, Ok(unit)) => {
                format!("{mesh}: {warning}, check --model-unit {unit}")
            }
            (Warning::Symmetry { .. }, Some(path), _) => format!("{}: {warning}", path.display()),
            _ => format!("{mesh}: {warning}"),
        }
    }

    /// Reads the declared symmetries of the mesh, and the diameter next to them.
    fn read_symmetries(&self) -> anyhow::Result<Option<ModelInfo>> {
        let Some(path) = &self.symmetries else {
            return Ok(None);
        };
        let mut objects = limits().read_models_info(path)?;
        let name = self.mesh.file_stem().and_then(OsStr::to_str);
        let id = name.and_then(|name| name.strip_prefix("obj_")?.parse().ok());
        let (file, mesh, count) = (path.display(), self.mesh.display(), objects.len());
        if let Some(id) = id {
            let object = objects.remove(&id);
            let absent = || format!("{file}: no object {id}, expected that of {mesh}");
            return object.map(Some).with_context(absent);
        }
        match objects.pop_first() {
            Some((_, object)) if objects.is_empty() => Ok(Some(object)),
            _ => bail!(
                "{file}: found {count} objects, expected one, or a mesh with an id in its name, such as obj_000005.ply, instead of {mesh}"
            ),
        }
    }
}
