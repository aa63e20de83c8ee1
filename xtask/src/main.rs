//! Automation of the workspace: `cargo xtask help` lists the commands.

mod checks;
mod ci;
mod measure;
mod package;
mod pages;
mod process;
mod python;
mod venv;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, Result};

use checks::{fuzz, licenses, marks, miri, mutants, tidy, valgrind};
use measure::{bench, counts, instructions, peers, repro, scale};
use pages::{book, look, pictures};

const HELP: &str = "\
cargo xtask COMMAND

  ci        everything that must pass before a change lands
  tidy      layer table, import cycles, confined libraries, crate documentation, open ends,
            docs/deviations.md and docs/paper-open.md, style of comments and Markdown
  licenses  licenses and sources of all dependencies, against deny.toml
  bless     writes docs/deviations.md and docs/paper-open.md from the `// Deviation:` and
            `// Open:` comments in the code

  book      builds the book into target/book/site; fails on dead links
  pictures [--data]
            draws the pictures of the book from simulated scenes into docs/pictures; with --data those of real
            frames into target/pictures (needs BOP_PATH)
  look PAGE.html...
            takes pictures of pages, 400 and 1,400 pixels wide, into target/look; needs Chromium

  python [--ray] [--open3d] [--rerun] [PYTEST OPTIONS]
            builds and tests the Python module: pytest, doctests, mypy, examples; --ray, --open3d and --rerun add
            the tests that need these packages; needs Python 3, and network access on the first run
  wheel     builds the Python wheel, prints its size, and tries it in a new environment

  package   packages all crates, tests each from its archive, and builds it with the oldest supported Rust if that
            is installed; prints what the metadata lacks

  bench [--save NAME | --against NAME] [FILTER]
            runs the benches whose id contains FILTER, saves them as a baseline, or compares them with one
  counts [--bless]
            work of every preset on fixed scenes (pairs, renders, allocations, ...), against benches/counts.txt
  instructions
            instructions of every step, against the limits in benches/benches/instructions.rs
  peers [--instances N] [--rounds N] [--clouds]
            small_gicp, Open3D and this library on the same arrays, as Markdown tables; with --clouds only point
            clouds
  scale [--rows N] [--threads N] [--ray]
            `bop refine` on 20,000 generated rows: throughput, peak memory, kill and resume, shards; with --ray
            the same rows on N Ray workers; fails if the outputs differ
  fuzz [--minutes N] [--target T]...
            every fuzz target, or those given, for N minutes each (default 5)
  mutants [BASE [OPTIONS]]
            cargo-mutants on the lines that differ from BASE (default main)
  valgrind  the vectorized loops and the fuzz seeds under memcheck
  miri      unit tests under miri; needs a nightly toolchain

  repro fig6|fig6-meshes|normals|table1|alpha|fig7|fig7-improved [--quick]
            reruns a part of the paper's studies into target/study; --quick takes minutes
";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match dispatch(&words) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn dispatch(words: &[&str]) -> Result<()> {
    std::env::set_current_dir(root()).with_context(|| root().display().to_string())?;
    match words {
        ["ci"] => ci::run(),
        ["tidy"] => tidy::run(),
        ["book"] => book::build(),
        ["pictures"] => pictures::draw(),
        ["pictures", "--data"] => pictures::draw_data(),
        ["look", pages @ ..] => look::take(pages),
        ["licenses"] => licenses::run(),
        ["bless"] => marks::bless(),
        ["python", options @ ..] => python::check(options),
        ["wheel"] => python::pack(),
        ["package"] => package::check(),
        ["bench", options @ ..] => bench::run(options),
        ["counts"] => counts::check(),
        ["counts", "--bless"] => counts::bless(),
        ["instructions"] => instructions::run(),
        ["peers", options @ ..] => peers::run(options),
        ["scale", options @ ..] => scale::run(options),
        ["fuzz", options @ ..] => fuzz::run(options),
        ["mutants"] => mutants::run("main", &[]),
        ["mutants", base, options @ ..] => mutants::run(base, options),
        ["valgrind"] => valgrind::run(),
        ["miri"] => miri::run(),
        ["repro", figure] => repro::run(figure, false),
        ["repro", figure, "--quick"] => repro::run(figure, true),
        ["help" | "--help" | "-h"] => {
            print!("{HELP}");
            Ok(())
        }
        _ => anyhow::bail!("cannot read `{}`\n\n{HELP}", words.join(" ")),
    }
}

/// The workspace's root folder, in which every command runs.
fn root() -> PathBuf {
    let xtask = Path::new(env!("CARGO_MANIFEST_DIR"));
    xtask.parent().unwrap_or(xtask).to_path_buf()
}

/// Reads a file of the workspace.
fn read(path: impl AsRef<Path>) -> Result<String> {
    let path = path.as_ref();
    std::fs::read_to_string(path).with_context(|| path.display().to_string())
}

/// Returns every Rust source file below a folder, in a fixed order.
fn rust_files(folder: &Path) -> Vec<PathBuf> {
    files(folder, &["rs"])
}

/// Returns every file below a folder with one of some extensions, in a fixed order, without build
/// artifacts and hidden folders.
fn files(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            let path = entry.path();
            let name = entry.file_name();
            let extension = path.extension().and_then(|extension| extension.to_str());
            if path.is_dir() {
                if name != "target" && !name.to_string_lossy().starts_with('.') {
                    folders.push(path);
                }
            } else if extension.is_some_and(|e| extensions.contains(&e)) {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}
