//! Text for people, on streams that may close at any time.

use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::path::Path;

use anyhow::{Context as _, bail};
use indicatif::{ProgressBar, ProgressStyle};

/// Prints a line to standard output.
///
/// A closed pipe (`| head -1`) is not an error, because the reader needs no more lines.
pub(crate) fn say(text: impl Display) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(error).context("cannot write to standard output")
        }
        _ => Ok(()),
    }
}

/// Prints a summary, to standard error if one of the outputs is standard output.
pub(crate) fn say_beside(outputs: &[Option<&Path>], text: impl Display) -> anyhow::Result<()> {
    if !outputs.contains(&Some(Path::new("-"))) {
        return say(text);
    }
    let _ = writeln!(std::io::stderr().lock(), "{text}");
    Ok(())
}

/// Prints a warning to standard error. Ignores failures, because they cannot be reported.
pub(crate) fn warn(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "warning: {}", printable(text));
}

/// Prints an error to standard error.
pub(crate) fn complain(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "error: {}", printable(text));
}

/// Returns a message whose control characters are escaped, except for line breaks.
///
/// A file name may have them, and a terminal would obey them.
fn printable(text: impl Display) -> String {
    let text = text.to_string();
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match c.is_control() && c != '\n' && c != '\t' {
            true => shown.extend(c.escape_default()),
            false => shown.push(c),
        }
    }
    shown
}

/// Returns a number with its noun, in the plural unless the number is 1.
pub(crate) fn counted(number: usize, noun: &str) -> String {
    match number {
        1 => format!("1 {noun}"),
        _ => format!("{number} {noun}s"),
    }
}

/// Returns an error if the shell closed standard output (`>&-`), where a result would be lost.
///
/// Rust replaces a closed stream by `/dev/null`, open for reading and writing. Redirected output is
/// open for writing only.
pub(crate) fn check_stdout() -> anyhow::Result<()> {
    let link = std::fs::read_link("/proc/self/fd/1").unwrap_or_default();
    let info = std::fs::read_to_string("/proc/self/fdinfo/1").unwrap_or_default();
    let flags = info
        .lines()
        .find_map(|line| line.strip_prefix("flags:")?.trim().chars().last());
    if link.as_os_str() == "/dev/null" && flags == Some('2') {
        bail!(
            "standard output is closed, so that the result would be lost: expected --output FILE"
        );
    }
    Ok(())
}

/// Returns a progress bar, which is invisible if standard error is not a terminal.
pub(crate) fn progress_bar(length: usize, unit: &str) -> ProgressBar {
    let bar = ProgressBar::new(length as u64);
    let template = format!("{{msg}} {{bar:40}} {{pos}}/{{len}} {unit}, {{eta}} left");
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style);
    }
    bar
}

/// Returns a row of a [`table`] from its cells, between which is a `|`.
pub(crate) fn row(cells: &str) -> Vec<String> {
    cells.split('|').map(str::to_owned).collect()
}

/// Formats rows of cells in columns, the first `left` columns aligned left and the others right.
pub(crate) fn table<R: AsRef<[String]>>(rows: &[R], left: usize) -> String {
    let mut widths: Vec<usize> = Vec::new();
    for row in rows.iter().map(AsRef::as_ref) {
        widths.resize(widths.len().max(row.len()), 0);
        for (width, cell) in widths.iter_mut().zip(row) {
            *width = cell.chars().count().max(*width);
        }
    }
    let line = |row: &R| {
        let cells = widths.iter().zip(row.as_ref()).enumerate();
        let cells = cells.map(|(column, (&width, cell))| match column < left {
            true => format!("{cell:<width$}"),
            false => format!("{cell:>width$}"),
        });
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}
