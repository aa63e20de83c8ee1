//! Text for people, on streams that may close at any time.

use std::fmt::Display;
use std::io::{ErrorKind, Write};

use anyhow::Context as _;

/// Prints a line to standard output. A reader that went away (`| head -1`) has what it wanted: that is no error.
pub(crate) fn say(text: impl Display) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(error).context("cannot write to standard output")
        }
        _ => Ok(()),
    }
}

/// Prints a warning to standard error; there is nowhere to report that this failed.
pub(crate) fn warn(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "warning: {text}");
}

/// Prints an error to standard error.
pub(crate) fn complain(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "error: {text}");
}
