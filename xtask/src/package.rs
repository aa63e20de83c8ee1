//! `cargo xtask package`: what the registry gets, built and tested without this workspace.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context as _, Result};
use serde_json::Value;

use crate::process::{cargo, command, execute, output, succeeds, target};

/// Metadata that needs a public address, which is not decided.
const ADDRESSES: [&str; 3] = ["repository", "homepage", "documentation"];

/// Packages all published crates, unpacks the archives, tests each of them, and builds them with
/// the oldest supported compiler.
///
/// The crates find each other by `[patch.crates-io]`, and everything else in the registry.
pub(crate) fn check() -> Result<()> {
    let metadata = output(&mut cargo("metadata --no-deps --locked --format-version 1"))?;
    let metadata: Value = serde_json::from_str(&metadata)?;
    let packages = metadata["packages"].as_array().context("no packages")?;
    let published: Vec<&Value> = packages.iter().filter(|p| p["publish"].is_null()).collect();

    let mut package = cargo("package --no-verify --allow-dirty --quiet");
    for crate_ in &published {
        package.args(["--package", text(crate_, "name")?]);
    }
    execute(&mut package)?;

    let folder = target().join("packages");
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    fs::create_dir_all(&folder)?;
    let mut manifest = String::from(
        "[workspace]\nresolver = \"3\"\nmembers = [\"*\"]\n\n\
         [profile.dev]\nopt-level = 2\ndebug = false\n\n[patch.crates-io]\n",
    );
    for crate_ in &published {
        let name = text(crate_, "name")?;
        let stem = format!("{name}-{}", text(crate_, "version")?);
        let archive = target().join(format!("package/{stem}.crate"));
        // With new times, because archives have equal ones and cargo would not build again.
        execute(command("tar -xzmf").arg(&archive).arg("-C").arg(&folder))?;
        writeln!(manifest, "{name} = {{ path = \"{stem}\" }}")?;
    }
    fs::write(folder.join("Cargo.toml"), manifest)?;
    fs::copy("Cargo.lock", folder.join("Cargo.lock"))?;
    let oldest = published.first().context("no published crate")?;
    check_oldest(text(oldest, "rust_version")?, &folder)?;
    execute(cargo("test --workspace --quiet --no-fail-fast").current_dir(&folder))?;

    for key in ADDRESSES {
        let without = published.iter().filter(|crate_| crate_[key].is_null());
        let count = without.count();
        if count > 0 {
            println!("xtask package: {count} crates have no `{key}`");
        }
    }
    println!("xtask package: {} crates pass", published.len());
    Ok(())
}

/// Checks the crates in a folder with a version of Rust, or prints a message without it.
fn check_oldest(version: &str, folder: &Path) -> Result<()> {
    let cargo = format!("rustup run {version} cargo");
    if !succeeds(command(&format!("{cargo} --version"))) {
        let install = format!("rustup toolchain install {version}");
        println!("xtask package: SKIPPED Rust {version}: install it with `{install}`");
        return Ok(());
    }
    execute(command(&format!("{cargo} check --workspace --quiet")).current_dir(folder))
}

fn text<'a>(package: &'a Value, key: &str) -> Result<&'a str> {
    package[key]
        .as_str()
        .with_context(|| format!("cargo metadata: no `{key}`"))
}
