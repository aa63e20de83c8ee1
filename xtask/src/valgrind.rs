//! `cargo xtask valgrind`: tests that run every vectorised loop, under memcheck.
//!
//! The libraries have no unsafe code; the libraries below them do, pulp's dispatch to AVX2 above all.

use std::path::Path;
use std::process::Command;

use crate::{Findings, process};

/// What is built, and which of its tests run: the loops against their baseline, and whole refinements of the fuzzer's seeds.
const TESTS: [(&[&str], &str); 2] = [
    (&["--package", "hicp-core", "--lib"], "vectorized"),
    (
        &[
            "--package",
            "hicp-tests",
            "--test",
            "it",
            "fuzz_regressions",
        ],
        "every_target_holds_on_its_seeds",
    ),
];

/// Runs the tests. Skips, and says so, without valgrind.
pub(crate) fn run(root: &Path) -> Findings {
    if !process::is_there("valgrind") {
        println!("xtask valgrind: SKIPPED, valgrind is not installed");
        return Ok(());
    }
    // It may be there and not know the machine's C library.
    let tried = Command::new("valgrind").args(["--quiet", "true"]).output();
    if !tried.is_ok_and(|output| output.status.success()) {
        println!("xtask valgrind: SKIPPED, `valgrind true` fails on this machine");
        return Ok(());
    }
    for (package, filter) in TESTS {
        let mut arguments = vec!["test", "--no-run", "--message-format=json"];
        arguments.extend(package);
        let messages = process::cargo_output(root, &arguments)?;
        let program = executable(&messages).ok_or_else(|| {
            vec![format!(
                "valgrind: cargo {} built no program",
                arguments.join(" ")
            )]
        })?;
        let mut command = Command::new("valgrind");
        command
            .args(["--quiet", "--error-exitcode=99", "--leak-check=no"])
            .arg(program)
            .args([filter, "--test-threads=1"])
            .current_dir(root);
        process::run(&mut command)?;
    }
    Ok(())
}

/// The program among cargo's messages.
fn executable(messages: &str) -> Option<&str> {
    const KEY: &str = "\"executable\":\"";
    messages
        .lines()
        .filter_map(|line| line.split_once(KEY))
        .find_map(|(_, rest)| rest.split('"').next())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_is_found() {
        let messages = "{\"reason\":\"a\",\"executable\":null}\n{\"executable\":\"/t/deps/x-1\",\"fresh\":true}\n";
        assert_eq!(executable(messages), Some("/t/deps/x-1"));
        assert_eq!(executable("{}"), None);
    }
}
