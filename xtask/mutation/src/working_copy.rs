//! The copy of the workspace that is changed: what git knows of, as it is on disk.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

/// A copy of the workspace.
pub(crate) struct WorkingCopy {
    /// Its folder.
    pub(crate) root: PathBuf,
    /// Where it is built.
    pub(crate) target: PathBuf,
    /// The crate that is changed.
    pub(crate) package: String,
    /// The sources of that crate as they were, by their path in the workspace.
    pub(crate) sources: BTreeMap<String, String>,
}

impl WorkingCopy {
    /// Copies what is not yet there or has changed, so that what is built stays.
    pub(crate) fn make(root: &Path, target: &Path, package: &str) -> Result<Self> {
        let mut git = Command::new("git");
        git.args([
            "ls-files",
            "-z",
            "--cached",
            "--others",
            "--exclude-standard",
        ]);
        let files = output(git.current_dir(root))?;
        let files: Vec<&str> = files.split('\0').filter(|file| !file.is_empty()).collect();
        let tree = target.join("tree");
        remove_others(&tree, &tree, &files)?;
        let mut sources = BTreeMap::new();
        let prefix = format!("crates/{package}/src/");
        for file in files {
            let (from, to) = (root.join(file), tree.join(file));
            if !from.is_file() {
                continue; // Deleted, not yet for git; or a link to a folder.
            }
            let bytes = std::fs::read(&from).with_context(|| from.display().to_string())?;
            write(&to, &bytes)?;
            if file.starts_with(&prefix) && file.ends_with(".rs") {
                sources.insert(file.to_owned(), String::from_utf8(bytes)?);
            }
        }
        if sources.is_empty() {
            bail!("{prefix} holds no source, expected the folder of a crate");
        }
        Ok(Self {
            root: tree,
            target: target.join("build"),
            package: package.to_owned(),
            sources,
        })
    }

    /// The crate's library as it was, and nothing else changed either.
    pub(crate) fn restore(&self) -> Result<()> {
        for (file, text) in &self.sources {
            write(&self.root.join(file), text.as_bytes())?;
        }
        Ok(())
    }

    /// Cargo in the copy. Lints would only say what mutants are.
    pub(crate) fn cargo(&self, arguments: &[&str]) -> Command {
        let program = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
        let mut command = Command::new(program);
        command
            .args(arguments)
            .current_dir(&self.root)
            .env("CARGO_TARGET_DIR", &self.target)
            .env("RUSTFLAGS", "--cap-lints=allow");
        command
    }

    /// The folder of the crate.
    pub(crate) fn package_folder(&self) -> PathBuf {
        self.root.join("crates").join(&self.package)
    }
}

/// Writes a file unless it has that content.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    if std::fs::read(path).is_ok_and(|there| there == bytes) {
        return Ok(());
    }
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    std::fs::write(path, bytes).with_context(|| path.display().to_string())
}

/// Removes files of the copy that the workspace no longer has: a test that is gone must not catch anything.
fn remove_others(tree: &Path, folder: &Path, files: &[&str]) -> Result<()> {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Ok(()); // Not there yet.
    };
    for entry in entries.flatten() {
        let path = entry.path();
        if path.is_dir() {
            remove_others(tree, &path, files)?;
        } else if let Ok(relative) = path.strip_prefix(tree)
            && !files.iter().any(|file| Path::new(file) == relative)
        {
            std::fs::remove_file(&path).with_context(|| path.display().to_string())?;
        }
    }
    Ok(())
}

/// What a program writes to its standard output.
pub(crate) fn output(command: &mut Command) -> Result<String> {
    let output = command
        .stderr(std::process::Stdio::inherit())
        .output()
        .with_context(|| format!("{command:?}"))?;
    if !output.status.success() {
        bail!("{command:?}: {}", output.status);
    }
    Ok(String::from_utf8(output.stdout)?)
}
