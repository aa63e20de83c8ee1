//! The objects that scenes are made of.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use hicp_io::{LengthUnit, read_mesh};
use hicp_sim::Household;
use hybrid_icp::Model;

use super::models;
use crate::limits::limits;

/// Models with their ids, ascending.
#[derive(Debug)]
pub(crate) struct Objects {
    pub(crate) models: Vec<(u32, Model)>,
}

/// Diameters that a scene can be made of, metres.
const DIAMETERS: std::ops::RangeInclusive<f64> = 0.01..=1.0;

impl Objects {
    /// The project's household objects, numbered from 1 in their order.
    pub(crate) fn household() -> anyhow::Result<Self> {
        let mut models = Vec::new();
        for (id, object) in (1..).zip(Household::ALL) {
            models.push((id, object.model()?));
        }
        Ok(Self { models })
    }

    /// Reads a folder: BOP models by their ids where it has a models_info.json, else its meshes numbered from 1 by name.
    pub(crate) fn read(dir: &Path, unit: LengthUnit) -> anyhow::Result<Self> {
        let info = dir.join("models_info.json");
        let models = if hicp_io::is_absent(&info) {
            let mut models = Vec::new();
            for (id, path) in (1..).zip(meshes(dir)?) {
                models.push((id, Model::new(read_mesh(path, unit)?)));
            }
            models
        } else {
            let ids: BTreeSet<u32> = limits().read_models_info(&info)?.into_keys().collect();
            let read = models::read(dir, &ids)?;
            if let Some(broken) = read.broken.values().next() {
                bail!("{broken}");
            }
            read.by_id.into_iter().collect()
        };
        if models.is_empty() {
            bail!(
                "--objects {}: found no mesh, expected PLY, OBJ or STL files",
                dir.display()
            );
        }
        for (id, model) in &models {
            if !DIAMETERS.contains(&model.diameter()) {
                bail!(
                    "--objects {}: object {id} has a diameter of {} m, expected {} to {} m: --objects-unit says what the files count in",
                    dir.display(),
                    model.diameter(),
                    DIAMETERS.start(),
                    DIAMETERS.end()
                );
            }
        }
        Ok(Self { models })
    }
}

/// The mesh files of a folder, by name.
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
