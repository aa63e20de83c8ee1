//! The objects of generated scenes.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use hicp_io::{IoError, LengthUnit, read_mesh};
use hicp_sim::Household;
use hybrid_icp::core::Model;

use crate::bop::models;
use crate::limits::limits;

/// Models with their ids in ascending order.
#[derive(Debug)]
pub(super) struct Objects {
    pub(super) ids: Vec<u32>,
    pub(super) models: Vec<Model>,
}

/// Diameters in meters of objects that fit into a scene.
const DIAMETERS: std::ops::RangeInclusive<f64> = 0.01..=1.0;

impl Objects {
    /// Returns the project's household objects, numbered from 1 in their order.
    pub(super) fn household() -> anyhow::Result<Self> {
        let models = Household::ALL.iter().map(|object| object.model());
        let models = models.collect::<Result<Vec<_>, _>>()?;
        let ids = (1..).zip(&models).map(|(id, _)| id).collect();
        Ok(Self { ids, models })
    }

    /// Reads the models of a folder.
    ///
    /// If it has a models_info.json, or all meshes have names such as obj_000005.ply, the models
    /// keep their BOP ids. Otherwise, the meshes are sorted by name and numbered from 1.
    pub(super) fn read(dir: &Path, unit: LengthUnit) -> anyhow::Result<Self> {
        let info = dir.join("models_info.json");
        let (ids, models): (Vec<u32>, Vec<Model>) = if hicp_io::is_absent(&info) {
            let paths = meshes(dir)?;
            let named = paths.iter().map(|path| Some((id_of(path)?, path)));
            let named: Option<BTreeMap<u32, &PathBuf>> = named.collect();
            let named = named.filter(|named| named.len() == paths.len());
            let numbered = named.unwrap_or_else(|| (1..).zip(&paths).collect());
            let read = |(id, path)| Ok((id, Model::new(read_mesh(path, unit)?)));
            let models = numbered.into_iter().map(read);
            models.collect::<Result<_, IoError>>()?
        } else {
            let ids: BTreeSet<u32> = limits().read_models_info(&info)?.into_keys().collect();
            let read = models::read(dir, &ids)?;
            if let Some(broken) = read.broken.values().next() {
                bail!("{broken}");
            }
            read.by_id.into_iter().unzip()
        };
        if models.is_empty() {
            bail!(
                "--objects {}: found no mesh, expected PLY, OBJ or STL files",
                dir.display()
            );
        }
        for (id, model) in ids.iter().zip(&models) {
            if !DIAMETERS.contains(&model.diameter()) {
                bail!(
                    "--objects {}: object {id} has a diameter of {} m, expected {} to {} m: check --objects-unit",
                    dir.display(),
                    model.diameter(),
                    DIAMETERS.start(),
                    DIAMETERS.end()
                );
            }
        }
        Ok(Self { ids, models })
    }
}

/// Returns the BOP id in the name of a mesh, as in obj_000005.ply.
fn id_of(path: &Path) -> Option<u32> {
    path.file_stem()?
        .to_str()?
        .strip_prefix("obj_")?
        .parse()
        .ok()
}

/// Returns the mesh files of a folder, sorted by name.
fn meshes(dir: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let cannot = || format!("cannot list --objects {}", dir.display());
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(dir).with_context(cannot)? {
        let path = entry.with_context(cannot)?.path();
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        if matches!(extension.as_deref(), Some("ply" | "obj" | "stl")) {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}
