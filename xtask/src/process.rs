//! Programs that the commands run.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::Findings;

/// The cargo that runs this.
fn cargo_program() -> String {
    std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned())
}

/// A cargo command in the workspace.
pub(crate) fn cargo(root: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(cargo_program());
    command.args(arguments).current_dir(root);
    command
}

/// Runs a command whose output goes to the terminal.
pub(crate) fn run(command: &mut Command) -> Findings {
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(vec![format!("{command:?}: {status}")]),
        Err(error) => Err(vec![format!("{command:?}: {error}")]),
    }
}

/// Runs cargo and returns what it wrote to its standard output.
pub(crate) fn cargo_output(root: &Path, arguments: &[&str]) -> Result<String, Vec<String>> {
    let mut command = cargo(root, arguments);
    let output = command.stderr(Stdio::inherit()).output();
    match output {
        Ok(output) if output.status.success() => {
            String::from_utf8(output.stdout).map_err(|e| vec![format!("{command:?}: {e}")])
        }
        Ok(output) => Err(vec![format!("{command:?}: {}", output.status)]),
        Err(error) => Err(vec![format!("{command:?}: {error}")]),
    }
}

/// Returns whether a program is there: it can be started with `--version`.
pub(crate) fn is_there(program: &str) -> bool {
    Command::new(program)
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Returns whether cargo has a subcommand: it can be started with `--version`.
pub(crate) fn has_subcommand(root: &Path, name: &str) -> bool {
    cargo(root, &[name, "--version"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// The folder of build artifacts.
pub(crate) fn target(root: &Path) -> PathBuf {
    // A relative one is relative to where cargo was called, which may not be here; the root is the usual place.
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), |dir| root.join(dir))
}
