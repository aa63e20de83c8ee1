//! Python environments below `target/`.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::process;

/// The name under which Python 3 is started.
pub(crate) const PYTHON: &str = "python3";

/// Makes a virtual environment, once per content of the requirements files, and returns its Python.
pub(crate) fn environment(
    root: &Path,
    venv: &Path,
    requirements: &[&str],
) -> Result<PathBuf, Vec<String>> {
    let mut wanted = String::new();
    for file in requirements {
        let text = std::fs::read_to_string(root.join(file));
        wanted.push_str(&text.map_err(|e| vec![format!("{file}: {e}")])?);
    }
    let installed = venv.join("requirements.installed");
    if std::fs::read_to_string(&installed).is_ok_and(|found| found == wanted) {
        return Ok(python_of(venv));
    }
    let python = fresh(venv)?;
    let mut install = pip(&python);
    for file in requirements {
        install.arg("--requirement").arg(root.join(file));
    }
    process::run(&mut install)?;
    std::fs::write(&installed, wanted)
        .map_err(|e| vec![format!("{}: {e}", installed.display())])?;
    Ok(python)
}

/// Makes an empty virtual environment, whatever was there before, and returns its Python.
pub(crate) fn fresh(venv: &Path) -> Result<PathBuf, Vec<String>> {
    process::run(
        Command::new(PYTHON)
            .args(["-m", "venv", "--clear"])
            .arg(venv),
    )?;
    Ok(python_of(venv))
}

/// `pip install`, to be told what.
pub(crate) fn pip(python: &Path) -> Command {
    let mut command = Command::new(python);
    command.args([
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
    ]);
    command
}

fn python_of(venv: &Path) -> PathBuf {
    venv.join("bin/python")
}
