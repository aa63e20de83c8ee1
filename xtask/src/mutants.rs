//! `cargo xtask mutants`: changes to the numerical crates that no test notices, all of them in one build by `xtask/mutation`. Those of
//! which it is known why are in `xtask/mutation/left`.

use std::path::Path;
use std::process::Stdio;

use crate::{Findings, process};

/// The crates that `.cargo/mutants.toml` looks at.
const CRATES: [&str; 4] = ["hicp-core", "hicp-metric", "hicp-score", "hicp-fusion"];

/// Runs `cargo xtask mutants [CRATE [--only WORD]... [--again] [--jobs N]]`: all mutants of all crates or of one, those whose name
/// contains a word, or those that the last run missed.
pub(crate) fn run(root: &Path, arguments: &[&str]) -> Findings {
    let (crates, options) = parse(arguments)?;
    if !process::has_subcommand(root, "mutants") {
        return Err(vec![
            "mutants: cargo-mutants is not installed: `cargo install cargo-mutants --version 27.1.0 --locked`".to_owned(),
        ]);
    }
    let target = process::target(root).join("mutants");
    let mut table = vec![
        "| crate | mutants | do not compile | caught | of these by time | missed | of these with a reason | share caught |"
            .to_owned(),
        "|---|---|---|---|---|---|---|---|".to_owned(),
    ];
    for name in crates {
        let mut command = process::cargo(root, &["run", "--quiet", "--package", "mutation", "--"]);
        command.arg("--root").arg(root).arg("--target").arg(&target);
        command.args(["--package", name]).args(options);
        let output = command
            .stderr(Stdio::inherit())
            .output()
            .map_err(|e| vec![format!("{command:?}: {e}")])?;
        if !output.status.success() {
            return Err(vec![format!("{command:?}: {}", output.status)]);
        }
        table.push(
            String::from_utf8_lossy(&output.stdout)
                .trim_end()
                .to_owned(),
        );
        println!(
            "xtask mutants: {}",
            target.join(name).join("missed.tsv").display()
        );
    }
    println!("{}", table.join("\n"));
    Ok(())
}

/// What is wrong with the lists of mutants that are left with a reason: lines of code that are not there any more, and reasons without
/// words. That they are still missed only `mutants` can say.
pub(crate) fn outdated_reasons(root: &Path) -> Vec<String> {
    let mut findings = Vec::new();
    for name in CRATES {
        let list = format!("xtask/mutation/left/{name}.tsv");
        let Ok(text) = std::fs::read_to_string(root.join(&list)) else {
            continue;
        };
        let source = |file: &str| {
            std::fs::read_to_string(root.join("crates").join(name).join("src").join(file))
                .unwrap_or_default()
        };
        for (number, line) in text.lines().enumerate() {
            if let Some(finding) = outdated(line, source) {
                findings.push(format!("{list}:{}: {finding}", number + 1));
            }
        }
    }
    findings
}

fn outdated(line: &str, source: impl Fn(&str) -> String) -> Option<String> {
    let fields: Vec<&str> = line.split('\t').collect();
    let [file, _, code, _, reason] = fields[..] else {
        return Some(format!("{} fields, expected five", fields.len()));
    };
    if !source(file).lines().any(|line| line.trim() == code) {
        return Some(format!("{file} has no line {code:?}"));
    }
    let is_reason = reason.contains(' ') && !reason.starts_with('?');
    (!is_reason).then(|| format!("{reason:?}, expected the reason why no test can tell"))
}

/// The crates, and what `mutation` is told besides.
fn parse<'a, 'b>(arguments: &'b [&'a str]) -> Result<(Vec<&'a str>, &'b [&'a str]), Vec<String>> {
    match arguments {
        [] => Ok((CRATES.to_vec(), &[])),
        [name, options @ ..] if CRATES.contains(name) => Ok((vec![*name], options)),
        _ => Err(vec![format!(
            "mutants: cannot read {arguments:?}, expected one of {} and then, if wanted, --only WORD, --again or --jobs N",
            CRATES.join(", ")
        )]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_go_with_the_code() {
        let source = |file: &str| match file {
            "a.rs" => "fn f() {\n    x < y\n}".to_owned(),
            _ => String::new(),
        };
        let told = |line: &str| outdated(line, source).unwrap();
        let right = "a.rs\t3\tx < y\treplace < with <= in f\tequal only by rounding";
        assert_eq!(outdated(right, source), None);
        assert!(told(&right.replace("a.rs", "b.rs")).contains("no line"));
        assert!(told(&right.replace("x < y", "x > y")).contains("no line"));
        assert!(told("a.rs\t3\tx < y\tc\t? line 2, reached by 0 tests").contains("reason"));
        assert!(told("a.rs\t3").contains("2 fields"));
    }

    #[test]
    fn arguments_are_read() {
        assert_eq!(parse(&[]).unwrap(), (CRATES.to_vec(), &[][..]));
        let again = parse(&["hicp-core", "--again"]).unwrap();
        assert_eq!(again, (vec!["hicp-core"], &["--again"][..]));
        for wrong in [&["hicp-io"][..], &["--again"], &["0/40"]] {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
    }
}
