//! `docs/deviations.md`: where the code departs from the paper, collected from `// Deviation:`
//! comments.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context as _, Result};

use crate::{read, rust_files};

const FILE: &str = "docs/deviations.md";
const MARK: &str = "// Deviation:";

/// Writes the document.
pub(crate) fn bless() -> Result<()> {
    std::fs::write(FILE, document()?).context(FILE)
}

/// Returns a message if the document is not what [`bless`] would write.
pub(crate) fn check() -> Result<Option<String>> {
    let is_current = read(FILE)? == document()?;
    Ok((!is_current).then(|| format!("{FILE} differs from the code: run `cargo xtask bless`")))
}

fn document() -> Result<String> {
    let mut text = String::from(
        "# Deviations from the paper\n\n\
         Collected from the `// Deviation:` comments in the code by `cargo xtask bless`; edit them there.\n\n\
         | where | what and why |\n|---|---|\n",
    );
    for file in rust_files(Path::new("crates")) {
        let code = read(&file)?;
        let mut lines = code.lines().map(str::trim).peekable();
        while let Some(line) = lines.next() {
            let Some(first) = line.strip_prefix(MARK) else {
                continue;
            };
            let mut words = first.trim().to_owned();
            while let Some(more) = lines.peek().and_then(|l| l.strip_prefix("// ")) {
                words.push(' ');
                words.push_str(more.trim());
                lines.next();
            }
            let _ = writeln!(text, "| `{}` | {words} |", file.display());
        }
    }
    Ok(text)
}
