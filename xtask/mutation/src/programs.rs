//! The crate's test programs.

use std::path::PathBuf;

use anyhow::{Result, bail};
use serde_json::Value;

use crate::working_copy::{WorkingCopy, output};

/// A test of a program.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Test {
    /// The program.
    pub(crate) program: PathBuf,
    /// Its name there.
    pub(crate) name: String,
}

/// Builds the crate's unit and integration tests and lists them. Examples in the documentation are left out: each would be built anew.
pub(crate) fn build(copy: &WorkingCopy) -> Result<Vec<Test>> {
    let said = output(&mut copy.cargo(&[
        "test",
        "--no-run",
        "--lib",
        "--tests",
        "--quiet",
        "--package",
        &copy.package,
        "--message-format=json",
    ]))?;
    let mut tests = Vec::new();
    for line in said.lines() {
        let Ok(value) = serde_json::from_str::<Value>(line) else {
            continue;
        };
        let Some(program) = value["executable"].as_str() else {
            continue;
        };
        let program = PathBuf::from(program);
        let mut list = std::process::Command::new(&program);
        let listed = output(list.args(["--list", "--format", "terse"]))?;
        tests.extend(names(&listed).map(|name| Test {
            program: program.clone(),
            name: name.to_owned(),
        }));
    }
    if tests.is_empty() {
        bail!("{} has no test", copy.package);
    }
    Ok(tests)
}

/// The tests of a list as libtest writes it.
fn names(listed: &str) -> impl Iterator<Item = &str> {
    listed
        .lines()
        .filter_map(|line| line.strip_suffix(": test"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tests_are_listed() {
        let listed = "a::b: test\nc: benchmark\nd: test\n";
        assert_eq!(names(listed).collect::<Vec<_>>(), ["a::b", "d"]);
    }
}
