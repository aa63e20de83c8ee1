//! Python environments below `target/`.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result};

use crate::process::{command, execute};
use crate::read;

/// Returns the Python of a virtual environment, which is set up again if the requirements files
/// change.
pub(crate) fn environment(venv: &Path, requirements: &[String]) -> Result<PathBuf> {
    let files = requirements.iter().map(read).collect::<Result<Vec<_>>>()?;
    let wanted = files.concat();
    let installed = venv.join("requirements.installed");
    if read(&installed).is_ok_and(|found| found == wanted) {
        return Ok(venv.join("bin/python"));
    }
    let python = fresh(venv)?;
    execute(pip(&python).args(requirements.iter().flat_map(|file| ["--requirement", file])))?;
    std::fs::write(&installed, wanted).with_context(|| installed.display().to_string())?;
    Ok(python)
}

/// Creates an empty virtual environment and returns its Python.
pub(crate) fn fresh(venv: &Path) -> Result<PathBuf> {
    execute(command("python3 -m venv --clear").arg(venv))?;
    Ok(venv.join("bin/python"))
}

/// A `pip install` that lacks what to install.
pub(crate) fn pip(python: &Path) -> Command {
    let mut pip = Command::new(python);
    pip.args("-m pip install --quiet --disable-pip-version-check".split(' '));
    pip
}
