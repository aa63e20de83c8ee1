//! Automation of the workspace: `cargo xtask help` lists the commands.

mod api;
mod bench;
mod ci;
mod counts;
mod deny;
mod deviations;
mod fuzz;
mod instructions;
mod miri;
mod mutants;
mod peers;
mod process;
mod python;
mod repro;
mod scale;
mod scale_ray;
mod tidy;
mod valgrind;
mod venv;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// What a command returns: nothing, or what is wrong, one line per finding.
type Findings = Result<(), Vec<String>>;

const HELP: &str = "\
cargo xtask COMMAND

  ci      everything that must pass before a change lands: formatting, clippy, tests, documentation,
          benches in test mode, counts, instructions, tidy, api, deny, valgrind, the Python module,
          and the README's commands
  tidy    the rules that no other tool checks: the layer table, where glam, kiddo and tobj may be used,
          crate documentation, nothing left open, docs/deviations.md and reasons of missed mutants up to date
  bless   writes docs/deviations.md from the `// Deviation:` comments in the code

  python [--ray] [--open3d] [PYTEST OPTIONS]
          builds the Python module into an environment of its own and tests it: pytest, doctests, mypy, examples; wants
          Python 3 and, the first time, a network; with --ray the runs on two Ray workers too, with --open3d (which wants the
          system's libusb-1.0) the comparison with it; ci does both
  wheel   builds the Python wheel, states its size, and tries it in a fresh environment

  bench [--save NAME] [--against NAME] [FILTER]
          runs the benches whose id contains FILTER and prints a table; keeps it as a baseline, compares with one
  counts [--bless]
          pairs, iterations, renders, allocations and the like of every preset on fixed scenes, against benches/counts.txt;
          no clock changes them, and no x86-64 processor
  instructions [--bless]
          instructions of every step, against benches/instructions.txt within 3 %; wants valgrind and gungraun-runner
  peers [--instances N]
          small_gicp, Open3D and this library on the same arrays, as a Markdown table; wants Python 3 and, the
          first time, a network
  scale [--rows N] [--threads N] [--ray]
          20,000 rows over generated images through `bop refine`: throughput, on N threads against one, peak memory, kill and
          resume, shards; with --ray instead the same rows on N Ray workers, and once more with one of them killed; fails
          where the bytes differ
  api     public functions that no test and no example names
  deny    licences, sources and duplicates of what is linked, against deny.toml; runs cargo-deny as well where it is
  fuzz [--minutes N] [--target T]...
          every fuzz target, or those that are named, for N minutes of a processor each (5), and a table of executions;
          wants cargo-fuzz and a C++ compiler
  mutants [CRATE [--only WORD]... [--again] [--jobs N]]
          changes to the numerical crates that no test notices, and the share that is: every mutant that cargo-mutants lists, in one
          build per crate; those whose name holds a word; those that the last run missed; wants cargo-mutants, and git
  valgrind
          the vectorised loops under memcheck; wants valgrind
  miri    unit tests under miri; wants a nightly toolchain that has it

  repro   fig6, fig7, table1 or alpha: reruns that part of the paper's studies into target/study;
          --quick takes minutes instead of the paper's number of poses
";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let result = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["ci"] => ci::run(&root()),
        ["tidy"] => tidy::run(&root()),
        ["bless"] => deviations::bless(&root()),
        ["bench", ref options @ ..] => bench::run(&root(), options),
        ["counts"] => counts::check(&root()),
        ["counts", "--bless"] => counts::bless(&root()),
        ["instructions"] => instructions::check(&root()),
        ["instructions", "--bless"] => instructions::bless(&root()),
        ["peers", ref options @ ..] => peers::run(&root(), options),
        ["scale", ref options @ ..] => scale::run(&root(), options),
        ["api"] => api::run(&root()),
        ["deny"] => deny::run(&root()),
        ["fuzz", ref options @ ..] => fuzz::run(&root(), options),
        ["mutants", ref options @ ..] => mutants::run(&root(), options),
        ["valgrind"] => valgrind::run(&root()),
        ["miri"] => miri::run(&root()),
        ["python", ref options @ ..] => python::check(&root(), options),
        ["wheel"] => python::pack(&root()),
        ["repro", what] => repro::run(&root(), what, false),
        ["repro", what, "--quick"] => repro::run(&root(), what, true),
        ["help" | "--help" | "-h"] => {
            print!("{HELP}");
            Ok(())
        }
        _ => {
            eprint!("{HELP}");
            return ExitCode::from(2);
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(findings) => {
            for finding in &findings {
                eprintln!("xtask: {finding}");
            }
            ExitCode::FAILURE
        }
    }
}

/// The workspace's root folder.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .map_or_else(|| PathBuf::from("."), Path::to_path_buf)
}

/// Every Rust source file below a folder, in a fixed order.
fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        let Ok(entries) = std::fs::read_dir(&folder) else {
            continue;
        };
        for path in entries.flatten().map(|entry| entry.path()) {
            if path.is_dir() {
                if !path.ends_with("target") && !path.ends_with(".git") {
                    folders.push(path);
                }
            } else if path.extension().is_some_and(|e| e == "rs") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

/// A path as it is written in messages and documents: relative to the root, with forward slashes.
fn relative(root: &Path, path: &Path) -> String {
    path.strip_prefix(root)
        .unwrap_or(path)
        .to_string_lossy()
        .replace('\\', "/")
}
