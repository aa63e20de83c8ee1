//! `cargo xtask python` and `cargo xtask wheel`: tests and packs the Python module.

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context as _, Result};

use crate::process::{cargo, command, execute, succeeds, target};
use crate::venv;

/// The module's package.
pub(crate) const PACKAGE: &str = "crates/hybrid-icp-python";

/// Large packages, installed on request. Without them, the tests that need them are skipped with a
/// message.
const EXTRAS: [&str; 3] = ["--ray", "--open3d", "--rerun"];

/// Links with zig, so that the wheel also runs on Linux distributions of 2018 and later.
const OLD_GLIBC: &str = "--zig --compatibility manylinux_2_28";

/// Runs pytest with the doctests and examples (Ray waits forever for processes that it cannot
/// start, hence the timeout), and mypy on the stubs, the examples and the benches.
const TESTS: [&str; 4] = [
    "-m pytest --quiet -rs -p no:cacheprovider -o faulthandler_timeout=900 -o faulthandler_exit_on_timeout=true tests",
    "-m mypy --strict -p hybrid_icp",
    "-m mypy --strict examples benches",
    "-m mypy.stubtest hybrid_icp._native --ignore-disjoint-bases",
];

/// Tests the module with Ray and Open3D, or without them and with a message if they cannot be
/// installed.
pub(crate) fn check_all() -> Result<()> {
    let installed = !has_python() || tools(&EXTRAS[..2]).inspect_err(|error| {
        println!("xtask python: SKIPPED the tests with Ray and Open3D, which cannot be installed: {error:#}");
    }).is_ok();
    check(if installed { &EXTRAS[..2] } else { &[] })
}

/// Tests the module. `options` are [`EXTRAS`] and options of pytest. Skips with a message without
/// Python.
pub(crate) fn check(options: &[&str]) -> Result<()> {
    if !has_python() {
        println!("xtask python: SKIPPED: no python3 on the PATH");
        return Ok(());
    }
    let (extras, options): (Vec<&str>, Vec<&str>) =
        options.iter().partition(|o| EXTRAS.contains(o));
    let python = with_module(&extras, "dev")?;
    execute(&mut cargo("build --quiet --bin hybrid-icp"))?;
    for test in TESTS {
        let mut run = Command::new(&python);
        run.args(test.split(' ')).current_dir(PACKAGE);
        if test == TESTS[0] {
            run.args(&options);
        }
        run.env("HYBRID_ICP_PROGRAM", target().join("debug/hybrid-icp"));
        run.env("MYPY_CACHE_DIR", target().join("python/mypy"));
        // Dependencies of Open3D install plugins of pytest.
        execute(run.env("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1"))?;
    }
    Ok(())
}

/// Builds the wheel as it is published and tries it in a new environment: the README's example must
/// improve a pose.
pub(crate) fn pack() -> Result<()> {
    let options = if cfg!(target_os = "linux") {
        OLD_GLIBC
    } else {
        ""
    };
    let wheel = wheel(&tools(&["--wheel"])?, "release", options)?;
    let python = venv::fresh(&target().join("python/fresh"))?;
    execute(venv::pip(&python).arg(&wheel))?;
    execute(Command::new(&python).args([&format!("{PACKAGE}/examples/smoke.py"), "README.md"]))?;
    let megabytes = std::fs::metadata(&wheel)?.len() as f64 / 1e6;
    println!("{}: {megabytes:.2} MB; pip install it", wheel.display());
    Ok(())
}

/// Returns the environment with the tools, the extras, and the module built in a profile.
pub(crate) fn with_module(extras: &[&str], profile: &str) -> Result<PathBuf> {
    let python = tools(extras)?;
    let wheel = wheel(&python, profile, "")?;
    execute(
        venv::pip(&python)
            .args(["--force-reinstall", "--no-deps"])
            .arg(wheel),
    )?;
    Ok(python)
}

fn has_python() -> bool {
    succeeds(command("python3 --version"))
}

/// Returns the environment with maturin, pytest, mypy and the extras.
fn tools(extras: &[&str]) -> Result<PathBuf> {
    let venv = target().join(format!("python/venv{}", extras.concat()));
    let names = std::iter::once("").chain(extras.iter().map(|extra| &extra[1..]));
    let files = names.map(|name| format!("{PACKAGE}/requirements{name}.txt"));
    venv::environment(&venv, &files.collect::<Vec<_>>())
}

/// Builds a wheel with more options of maturin, and returns its path.
fn wheel(python: &PathBuf, profile: &str, options: &str) -> Result<PathBuf> {
    let folder = target().join("python/wheels").join(profile);
    let _ = std::fs::remove_dir_all(&folder);
    let mut maturin = Command::new(python);
    maturin
        .args("-m maturin build --quiet --locked --profile".split(' '))
        .arg(profile);
    // maturin looks for zig on the path.
    let tools = python.parent().unwrap_or(python).to_owned();
    let path = std::env::var_os("PATH").unwrap_or_default();
    let places = std::iter::once(tools).chain(std::env::split_paths(&path));
    maturin
        .args(options.split_whitespace())
        .env("PATH", std::env::join_paths(places)?);
    execute(maturin.arg("--out").arg(&folder).current_dir(PACKAGE))?;
    let entries = std::fs::read_dir(&folder).context("maturin wrote no wheel")?;
    let mut paths = entries.flatten().map(|entry| entry.path());
    let wheel = paths.find(|path| path.extension().is_some_and(|e| e == "whl"));
    wheel.context("maturin wrote no wheel")
}
