//! `cargo xtask counts`: what every preset does on a fixed set of scenes, against a blessed file.

use std::path::Path;

use crate::{Findings, process};

const FILE: &str = "benches/counts.txt";
/// Lines of difference that are shown.
const SHOWN: usize = 12;

/// Counts anew and compares with the file.
pub(crate) fn check(root: &Path) -> Findings {
    let blessed =
        std::fs::read_to_string(root.join(FILE)).map_err(|e| vec![format!("{FILE}: {e}")])?;
    let differences = differences(&blessed, &count(root)?);
    if differences.is_empty() {
        println!("xtask counts: as in {FILE}");
        return Ok(());
    }
    let mut findings: Vec<String> = differences.iter().take(SHOWN).cloned().collect();
    if differences.len() > SHOWN {
        findings.push(format!("… {} lines differ in all", differences.len()));
    }
    findings.push(format!(
        "the work differs from {FILE}: if that is meant, run `cargo xtask counts --bless` and say why in the commit"
    ));
    Err(findings)
}

/// Writes the file.
pub(crate) fn bless(root: &Path) -> Findings {
    let counted = count(root)?;
    std::fs::write(root.join(FILE), counted).map_err(|e| vec![format!("{FILE}: {e}")])
}

fn count(root: &Path) -> Result<String, Vec<String>> {
    // The profile of the tests, whose artifacts are there. Always the same one: optimisers may leave out an allocation of the
    // cold run (release makes one fewer in some); all other counts are those of any profile.
    let arguments = [
        "run",
        "--quiet",
        "--package",
        "hicp-benches",
        "--example",
        "counts",
    ];
    process::cargo_output(root, &arguments)
}

/// The columns in which two tables differ, a message per line.
fn differences(blessed: &str, counted: &str) -> Vec<String> {
    let header: Vec<&str> = counted
        .lines()
        .next()
        .unwrap_or("")
        .split_whitespace()
        .collect();
    let (before, after): (Vec<&str>, Vec<&str>) =
        (blessed.lines().collect(), counted.lines().collect());
    let mut messages = Vec::new();
    for index in 0..before.len().max(after.len()) {
        let cells = |lines: &[&str]| -> Vec<String> {
            let line = lines.get(index).unwrap_or(&"");
            line.split_whitespace().map(str::to_owned).collect()
        };
        let (before, after) = (cells(&before), cells(&after));
        if before == after {
            continue;
        }
        let same_run = before.len() == after.len()
            && before.len() == header.len()
            && before[..4] == after[..4];
        messages.push(if same_run {
            let changes = header.iter().zip(before.iter().zip(&after));
            let changes: Vec<String> = changes
                .filter(|(_, (before, after))| before != after)
                .map(|(name, (before, after))| format!("{name} {before} → {after}"))
                .collect();
            format!("{}: {}", after[..4].join(" "), changes.join(", "))
        } else {
            format!(
                "line {}: {:?} → {:?}",
                index + 1,
                before.join(" "),
                after.join(" ")
            )
        });
    }
    messages
}

#[cfg(test)]
mod tests {
    use super::differences;

    const TABLE: &str = "object noise start preset pairs warm\nmug 0% aligned hybrid 100 0\n";

    #[test]
    fn equal_tables_do_not_differ_whatever_their_spacing() {
        assert!(differences(TABLE, &TABLE.replace(' ', "  ")).is_empty());
    }

    #[test]
    fn a_difference_names_run_and_column() {
        let found = differences(TABLE, &TABLE.replace("100 0", "120 1"));
        assert_eq!(
            found,
            ["mug 0% aligned hybrid: pairs 100 → 120, warm 0 → 1"]
        );
    }

    #[test]
    fn a_missing_line_is_a_difference() {
        assert_eq!(
            differences(TABLE, "object noise start preset pairs warm\n").len(),
            1
        );
    }
}
