//! `cargo xtask book`: builds the book with MkDocs, and fails on dead links.

use std::process::Command;

use anyhow::Result;

use crate::process::{command, execute, succeeds, target};
use crate::venv;

/// Builds the book into `target/book/site`.
pub(crate) fn build() -> Result<()> {
    let venv = target().join("book/venv");
    let python = venv::environment(&venv, &["docs/requirements.txt".to_owned()])?;
    let mut mkdocs = Command::new(python);
    mkdocs.args(["-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir"]);
    execute(mkdocs.arg(target().join("book/site")))?;
    println!("{}", target().join("book/site/index.html").display());
    Ok(())
}

/// Builds the book, or skips it with a message if MkDocs cannot be installed.
pub(crate) fn check() -> Result<()> {
    let venv = target().join("book/venv");
    if !succeeds(command("python3 --version")) {
        println!("xtask book: SKIPPED: no python3 on the PATH");
        return Ok(());
    }
    match venv::environment(&venv, &["docs/requirements.txt".to_owned()]) {
        Ok(_) => build(),
        Err(error) => {
            println!("xtask book: SKIPPED: MkDocs cannot be installed: {error:#}");
            Ok(())
        }
    }
}
