//! `cargo xtask bench`: runs the criterion benches and prints one table of them, against a saved baseline if there is one.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::{Findings, process};

/// Medians that differ by less than this share are called the same, however narrow their intervals.
const NOISE: f64 = 0.05;

/// What the command line asks for.
#[derive(Debug, Default, PartialEq)]
struct Options {
    save: Option<String>,
    against: Option<String>,
    filter: Option<String>,
}

/// Runs `cargo xtask bench [--save NAME] [--against NAME] [FILTER]`.
pub(crate) fn run(root: &Path, arguments: &[&str]) -> Findings {
    let options = parse(arguments)?;
    let results = process::target(root).join("criterion");
    let start = SystemTime::now();
    // All but the instruction counts, which want a feature.
    let mut command = process::cargo(root, &["bench", "--package", "hicp-benches", "--benches"]);
    command.env("CRITERION_HOME", &results).arg("--");
    // Without a name of one's own, the results go where nobody compares: comparing is done here.
    command.args(["--save-baseline", options.save.as_deref().unwrap_or("last")]);
    command.args(&options.filter);
    process::run(&mut command)?;

    let mut rows = Vec::new();
    collect(&results, start, options.against.as_deref(), &mut rows);
    rows.sort_by(|a, b| a.id.cmp(&b.id));
    if rows.is_empty() {
        return Err(vec![format!(
            "no bench matches {:?}",
            options.filter.unwrap_or_default()
        )]);
    }
    print!("{}", table(&rows, options.against.as_deref()));
    match options.against {
        Some(name) if rows.iter().all(|row| row.before.is_none()) => Err(vec![format!(
            "no baseline is named {name:?}: save one with `cargo xtask bench --save {name}`"
        )]),
        _ => Ok(()),
    }
}

fn parse(arguments: &[&str]) -> Result<Options, Vec<String>> {
    let mut options = Options::default();
    let mut words = arguments.iter().copied();
    while let Some(word) = words.next() {
        let slot = match word {
            "--save" => &mut options.save,
            "--against" => &mut options.against,
            _ if word.starts_with("--") => {
                return Err(vec![format!(
                    "bench: unknown option {word}, expected --save NAME or --against NAME"
                )]);
            }
            _ => {
                options.filter = Some(word.to_owned());
                continue;
            }
        };
        let name = words.next().filter(|name| is_name(name)).ok_or_else(|| {
            vec![format!(
                "bench: {word} wants a name of letters, digits, - and _"
            )]
        })?;
        *slot = Some(name.to_owned());
    }
    Ok(options)
}

fn is_name(name: &str) -> bool {
    // `new` and `base` are criterion's own.
    !name.is_empty()
        && !["new", "base", "change", "report"].contains(&name)
        && !name.starts_with('-')
        && name
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c))
}

/// A median in nanoseconds and its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Median {
    low: f64,
    nanoseconds: f64,
    high: f64,
}

struct Row {
    id: String,
    before: Option<Median>,
    after: Median,
}

/// Collects the benches below a folder that ran since `start`.
fn collect(folder: &Path, start: SystemTime, against: Option<&str>, rows: &mut Vec<Row>) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    let new = folder.join("new");
    if let Some(after) = fresh(&new, start).and_then(|text| median(&text)) {
        let described = std::fs::read_to_string(new.join("benchmark.json")).unwrap_or_default();
        let id = string(&described, "full_id").unwrap_or_else(|| folder.display().to_string());
        let before = against
            .and_then(|name| std::fs::read_to_string(folder.join(name).join("estimates.json")).ok())
            .and_then(|text| median(&text));
        rows.push(Row { id, before, after });
        return;
    }
    let folders: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    for path in folders.iter().filter(|path| path.is_dir()) {
        collect(path, start, against, rows);
    }
}

/// The estimates of a folder, if they were written since `start`.
fn fresh(folder: &Path, start: SystemTime) -> Option<String> {
    let file = folder.join("estimates.json");
    let written = file.metadata().and_then(|data| data.modified()).ok()?;
    (written >= start).then(|| std::fs::read_to_string(file).ok())?
}

/// Reads the median of an `estimates.json`.
fn median(text: &str) -> Option<Median> {
    let (_, text) = text.split_once("\"median\":")?;
    Some(Median {
        low: number(text, "lower_bound")?,
        nanoseconds: number(text, "point_estimate")?,
        high: number(text, "upper_bound")?,
    })
}

/// The first number of that key.
fn number(text: &str, key: &str) -> Option<f64> {
    let (_, value) = text.split_once(&format!("\"{key}\":"))?;
    let end = value.find([',', '}'])?;
    value[..end].trim().parse().ok()
}

/// The first string of that key; bench ids hold no quotes.
fn string(text: &str, key: &str) -> Option<String> {
    let (_, value) = text.split_once(&format!("\"{key}\":\""))?;
    value.split_once('"').map(|(value, _)| value.to_owned())
}

fn table(rows: &[Row], against: Option<&str>) -> String {
    let width = rows
        .iter()
        .map(|row| row.id.len())
        .max()
        .unwrap_or(0)
        .max(5);
    let before = against.unwrap_or("before");
    let mut text = format!(
        "{:width$}  {before:>12}  {:>12}  {:>6}\n",
        "bench", "now", "ratio"
    );
    for row in rows {
        let now = time(row.after.nanoseconds);
        let (before, ratio, verdict) = match row.before {
            Some(before) => (
                time(before.nanoseconds),
                format!("{:.2}", row.after.nanoseconds / before.nanoseconds),
                verdict(&before, &row.after),
            ),
            None => (String::from("-"), String::from("-"), ""),
        };
        let line = format!(
            "{:width$}  {before:>12}  {now:>12}  {ratio:>6}  {verdict}",
            row.id
        );
        text.push_str(line.trim_end());
        text.push('\n');
    }
    if let Some(ratio) = middle_ratio(rows) {
        text.push_str(&format!(
            "{:width$}  {:>12}  {:>12}  {ratio:>6.2}  the machine itself, if most benches were not touched\n",
            "median", "", ""
        ));
    }
    text
}

/// The median of the ratios: what a machine that is faster or slower today does to all of them.
fn middle_ratio(rows: &[Row]) -> Option<f64> {
    let mut ratios: Vec<f64> = rows
        .iter()
        .filter_map(|row| Some(row.after.nanoseconds / row.before?.nanoseconds))
        .collect();
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied()
}

/// Whether two medians differ beyond noise: disjoint confidence intervals, and by more than [`NOISE`].
fn verdict(before: &Median, after: &Median) -> &'static str {
    let ratio = after.nanoseconds / before.nanoseconds;
    if after.low > before.high && ratio > 1.0 + NOISE {
        "SLOWER"
    } else if after.high < before.low && ratio < 1.0 / (1.0 + NOISE) {
        "faster"
    } else {
        ""
    }
}

fn time(nanoseconds: f64) -> String {
    match nanoseconds {
        ns if ns < 1e3 => format!("{ns:.1} ns"),
        ns if ns < 1e6 => format!("{:.2} µs", ns / 1e3),
        ns => format!("{:.3} ms", ns / 1e6),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_read() {
        let options = parse(&["--save", "a", "render", "--against", "b"]).unwrap();
        assert_eq!(options.save.as_deref(), Some("a"));
        assert_eq!(options.against.as_deref(), Some("b"));
        assert_eq!(options.filter.as_deref(), Some("render"));
        assert!(parse(&["--save"]).is_err());
        assert!(parse(&["--save", "../x"]).is_err());
        assert!(parse(&["--fast"]).is_err());
    }

    #[test]
    fn estimates_are_read() {
        let text = r#"{"mean":{"confidence_interval":{"confidence_level":0.95,"lower_bound":1.0,"upper_bound":3.0},"point_estimate":2.0,"standard_error":0.1},"median":{"confidence_interval":{"confidence_level":0.95,"lower_bound":10.5,"upper_bound":12.5},"point_estimate":11.25,"standard_error":0.1}}"#;
        let expected = Median {
            low: 10.5,
            nanoseconds: 11.25,
            high: 12.5,
        };
        assert_eq!(median(text), Some(expected));
    }

    #[test]
    fn only_what_lies_beyond_noise_is_flagged() {
        let at = |ns: f64, half: f64| Median {
            low: ns - half,
            nanoseconds: ns,
            high: ns + half,
        };
        assert_eq!(verdict(&at(100.0, 1.0), &at(120.0, 1.0)), "SLOWER");
        assert_eq!(verdict(&at(100.0, 1.0), &at(80.0, 1.0)), "faster");
        assert_eq!(verdict(&at(100.0, 15.0), &at(120.0, 15.0)), "");
        assert_eq!(verdict(&at(100.0, 0.1), &at(102.0, 0.1)), "");
    }
}
