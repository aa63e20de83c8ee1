//! `cargo xtask python` and `cargo xtask wheel`: the Python module tested and packed.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::{Findings, process, venv};

/// The module's package.
pub(crate) const PACKAGE: &str = "crates/hybrid-icp-python";

/// What is installed when asked for, because it is large; the tests that want it skip aloud otherwise.
const EXTRAS: [&str; 2] = ["--ray", "--open3d"];

/// Seconds after which a test is taken to hang: Ray waits for ever for processes that its surroundings do not let it start.
const HANGS: &str = "900";

/// Tests the module as [`check`] does, with all [`EXTRAS`], or without them, aloud, where they cannot be installed.
pub(crate) fn check_all(root: &Path) -> Findings {
    let extras = match process::is_there(venv::PYTHON).then(|| tools(root, &EXTRAS)) {
        Some(Err(findings)) => {
            println!(
                "xtask python: SKIPPED the tests with Ray and Open3D, which could not be installed: {}",
                findings.join("; ")
            );
            &[][..]
        }
        _ => &EXTRAS[..],
    };
    check(root, extras)
}

/// Tests the module: pytest with the doctests and examples, mypy on the stubs and the examples.
///
/// `options` are [`EXTRAS`], then pytest's. Skips, aloud, without Python.
pub(crate) fn check(root: &Path, options: &[&str]) -> Findings {
    if !process::is_there(venv::PYTHON) {
        println!("xtask python: SKIPPED, no {} on the PATH", venv::PYTHON);
        return Ok(());
    }
    let package = root.join(PACKAGE);
    let extras: Vec<&str> = options
        .iter()
        .copied()
        .filter(|o| EXTRAS.contains(o))
        .collect();
    let options = options.iter().filter(|option| !EXTRAS.contains(option));
    let python = with_module(root, &extras, "dev")?;
    process::run(&mut process::cargo(
        root,
        &["build", "--quiet", "--package", "hybrid-icp-cli"],
    ))?;

    let program = process::target(root).join("debug/hybrid-icp");
    let run = |arguments: &[&str]| {
        process::run(
            Command::new(&python)
                .args(arguments)
                .env("HYBRID_ICP_PROGRAM", &program)
                // What Open3D depends on brings plugins of its own.
                .env("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
                .current_dir(&package),
        )
    };
    let hangs = format!("faulthandler_timeout={HANGS}");
    let mut pytest = vec![
        "-m",
        "pytest",
        "--quiet",
        "-rs",
        "-p",
        "no:cacheprovider",
        "-o",
        &hangs,
        "-o",
        "faulthandler_exit_on_timeout=true",
        "tests",
    ];
    pytest.extend(options.copied());
    run(&pytest)?;
    let cache = process::target(root).join("python/mypy");
    let cache = cache.to_string_lossy();
    run(&[
        "-m",
        "mypy",
        "--strict",
        "--cache-dir",
        &cache,
        "-p",
        "hybrid_icp",
    ])?;
    run(&[
        "-m",
        "mypy",
        "--strict",
        "--cache-dir",
        &cache,
        "examples",
        "benches",
    ])?;
    run(&[
        "-m",
        "mypy.stubtest",
        "hybrid_icp._native",
        "--ignore-disjoint-bases",
    ])
}

/// Builds the wheel as it is published, says its size, and tries it in a fresh environment: the README's example must improve a pose.
pub(crate) fn pack(root: &Path) -> Findings {
    let python = tools(root, &[])?;
    let wheel = wheel(root, &python, "release")?;
    let size = std::fs::metadata(&wheel).map_err(|e| vec![format!("{}: {e}", wheel.display())])?;

    let python = venv::fresh(&process::target(root).join("python/fresh"))?;
    process::run(venv::pip(&python).arg(&wheel))?;
    process::run(
        Command::new(&python)
            .arg(root.join(PACKAGE).join("examples/smoke.py"))
            .arg(root.join("README.md")),
    )?;
    println!(
        "{}: {:.2} MB; pip install it",
        wheel.display(),
        size.len() as f64 / 1e6
    );
    Ok(())
}

/// The environment with the tools and the extras, and the module built with a profile.
pub(crate) fn with_module(
    root: &Path,
    extras: &[&str],
    profile: &str,
) -> Result<PathBuf, Vec<String>> {
    let python = tools(root, extras)?;
    let wheel = wheel(root, &python, profile)?;
    process::run(
        venv::pip(&python)
            .args(["--force-reinstall", "--no-deps"])
            .arg(wheel),
    )?;
    Ok(python)
}

/// The environment with maturin, pytest and mypy, and the extras.
fn tools(root: &Path, extras: &[&str]) -> Result<PathBuf, Vec<String>> {
    let folder = process::target(root)
        .join("python")
        .join(format!("venv{}", extras.concat()));
    let mut files = vec![format!("{PACKAGE}/requirements.txt")];
    files.extend(
        extras
            .iter()
            .map(|extra| format!("{PACKAGE}/requirements{}.txt", &extra[1..])),
    );
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    venv::environment(root, &folder, &files)
}

/// Builds a wheel and returns it.
fn wheel(root: &Path, python: &Path, profile: &str) -> Result<PathBuf, Vec<String>> {
    let folder = process::target(root).join("python/wheels").join(profile);
    if folder.is_dir() {
        std::fs::remove_dir_all(&folder).map_err(|e| vec![format!("{}: {e}", folder.display())])?;
    }
    process::run(
        Command::new(python)
            .args([
                "-m",
                "maturin",
                "build",
                "--quiet",
                "--locked",
                "--profile",
                profile,
                "--out",
            ])
            .arg(&folder)
            .current_dir(root.join(PACKAGE)),
    )?;
    let entries =
        std::fs::read_dir(&folder).map_err(|e| vec![format!("{}: {e}", folder.display())])?;
    let mut wheels = entries.flatten().map(|entry| entry.path());
    wheels
        .find(|path| path.extension().is_some_and(|e| e == "whl"))
        .ok_or_else(|| vec![format!("{}: maturin left no wheel there", folder.display())])
}
