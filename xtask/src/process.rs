//! Programs that the commands run. All of them run in the workspace's root.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, bail, ensure};

/// Creates a command from its program and arguments, none of which contains a space.
pub(crate) fn command(words: &str) -> Command {
    let mut words = words.split_whitespace();
    let mut command = Command::new(words.next().unwrap_or_default());
    command.args(words);
    command
}

/// Creates a command of the cargo that runs this program.
pub(crate) fn cargo(words: &str) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or("cargo".into()));
    command.args(words.split_whitespace());
    command
}

/// Runs a command whose output goes to the terminal.
pub(crate) fn execute(command: &mut Command) -> Result<()> {
    let status = command.status().with_context(|| shown(command))?;
    ensure!(status.success(), "{}: {status}", shown(command));
    Ok(())
}

/// Runs a command and returns its standard output.
pub(crate) fn output(command: &mut Command) -> Result<String> {
    let output = command.stderr(Stdio::inherit()).output();
    let output = output.with_context(|| shown(command))?;
    ensure!(
        output.status.success(),
        "{}: {}",
        shown(command),
        output.status
    );
    String::from_utf8(output.stdout).with_context(|| shown(command))
}

/// Returns whether a command succeeds, without showing its output.
pub(crate) fn succeeds(mut command: Command) -> bool {
    let quiet = command.stdout(Stdio::null()).stderr(Stdio::null());
    quiet.status().is_ok_and(|status| status.success())
}

/// Returns an error with the command that installs a tool, unless the tool runs.
pub(crate) fn require(tool: Command, install: &str) -> Result<()> {
    let name = shown(&tool);
    if !succeeds(tool) {
        bail!("`{name}` fails: install the tool with `{install}`");
    }
    Ok(())
}

/// The folder of build artifacts. A relative `CARGO_TARGET_DIR` is relative to the root.
pub(crate) fn target() -> PathBuf {
    let folder = std::env::var_os("CARGO_TARGET_DIR").unwrap_or("target".into());
    crate::root().join(folder)
}

/// Returns a command as a user would type it.
fn shown(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    let words: Vec<_> = words.map(|word| word.to_string_lossy()).collect();
    words.join(" ")
}
