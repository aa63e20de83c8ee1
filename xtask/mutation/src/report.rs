//! What became of the mutants.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result, bail};

use crate::listing::{Key, Mutant};

/// What became of a mutant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fate {
    /// It is no program.
    DoesNotCompile,
    /// A test failed, or ran out of the memory it may have.
    Caught,
    /// A test did not end in time.
    Late,
    /// No test failed, of so many that reach it.
    Missed { n_tests: usize },
}

/// Mutants that are known to be missed, with the reason.
pub(crate) type Left = BTreeMap<Key, String>;

/// Files of the report, by fate.
const FILES: [&str; 4] = ["unviable.txt", "caught.txt", "timeout.txt", "missed.tsv"];

/// Writes the mutants of each fate into a file of its own, a line each; those that are missed as tables that [`read`] reads, with the
/// reason if it is known.
pub(crate) fn write(
    folder: &Path,
    mutants: &[Mutant],
    fates: &BTreeMap<usize, Fate>,
    left: &Left,
) -> Result<()> {
    let mut texts = [const { String::new() }; 4];
    for (id, fate) in fates {
        let mutant = &mutants[*id];
        let (file, line) = match fate {
            Fate::DoesNotCompile => (0, mutant.name.clone()),
            Fate::Caught => (1, mutant.name.clone()),
            Fate::Late => (2, mutant.name.clone()),
            Fate::Missed { n_tests } => (3, missed_line(mutant, *n_tests, left)),
        };
        texts[file].push_str(&line);
        texts[file].push('\n');
    }
    for (file, text) in FILES.iter().zip(texts) {
        let path = folder.join(file);
        std::fs::write(&path, text).with_context(|| path.display().to_string())?;
    }
    Ok(())
}

fn missed_line(mutant: &Mutant, n_tests: usize, left: &Left) -> String {
    let Key {
        file,
        change,
        code,
        column,
    } = &mutant.key;
    let reason = left.get(&mutant.key).cloned().unwrap_or_else(|| {
        let line = mutant.name.split(':').nth(1).unwrap_or("?");
        format!("? line {line}, reached by {n_tests} tests")
    });
    format!("{file}\t{column}\t{code}\t{change}\t{reason}")
}

/// Reads a table of missed mutants: file, character of the line, line, change, reason.
pub(crate) fn read(path: &Path) -> Result<Left> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let mut left = Left::new();
    for (number, line) in text.lines().enumerate() {
        let place = || format!("{}:{}", path.display(), number + 1);
        let fields: Vec<&str> = line.split('\t').collect();
        let [file, column, code, change, reason] = fields[..] else {
            bail!(
                "{}: {} fields, expected file, character, line of code, change and reason with tabs between",
                place(),
                fields.len()
            );
        };
        let key = Key {
            file: file.to_owned(),
            change: change.to_owned(),
            code: code.to_owned(),
            column: column.parse().with_context(place)?,
        };
        left.insert(key, reason.to_owned());
    }
    Ok(left)
}

/// Mutants that the last run missed.
pub(crate) fn missed(folder: &Path) -> Result<Left> {
    read(&folder.join(FILES[3]))
}

/// Those of the known ones that are caught now, or gone: they need no reason any more.
pub(crate) fn outdated<'a>(
    left: &'a Left,
    mutants: &[Mutant],
    fates: &BTreeMap<usize, Fate>,
) -> Vec<&'a Key> {
    let missed: BTreeSet<&Key> = fates
        .iter()
        .filter(|(_, fate)| matches!(fate, Fate::Missed { .. }))
        .map(|(id, _)| &mutants[*id].key)
        .collect();
    left.keys().filter(|key| !missed.contains(key)).collect()
}

/// A line of the table.
pub(crate) fn row(
    package: &str,
    mutants: &[Mutant],
    fates: &BTreeMap<usize, Fate>,
    left: &Left,
) -> String {
    let count = |wanted: fn(&Fate) -> bool| fates.values().filter(|fate| wanted(fate)).count();
    let unviable = count(|fate| matches!(fate, Fate::DoesNotCompile));
    let late = count(|fate| matches!(fate, Fate::Late));
    let caught = count(|fate| matches!(fate, Fate::Caught)) + late;
    let missed = count(|fate| matches!(fate, Fate::Missed { .. }));
    let explained = fates
        .iter()
        .filter(|(id, fate)| {
            matches!(fate, Fate::Missed { .. }) && left.contains_key(&mutants[**id].key)
        })
        .count();
    #[allow(clippy::cast_precision_loss)] // Some thousands.
    let share = match caught + missed {
        0 => "-".to_owned(),
        of => format!("{:.1} %", 100.0 * caught as f64 / of as f64),
    };
    format!(
        "| `{package}` | {} | {unviable} | {caught} | {late} | {missed} | {explained} | {share} |",
        fates.len()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_counts_and_a_report_is_read_again() {
        let mutants: Vec<Mutant> = (0..6)
            .map(|id| Mutant {
                name: format!("x.rs:7:3: m{id}"),
                file: String::new(),
                genre: String::new(),
                range: 0..0,
                returns_impl: false,
                replacement: String::new(),
                key: Key {
                    file: "x.rs".to_owned(),
                    change: format!("m{id}"),
                    code: "a < b".to_owned(),
                    column: 3,
                },
            })
            .collect();
        let fates = BTreeMap::from([
            (0, Fate::Caught),
            (1, Fate::Late),
            (2, Fate::Caught),
            (3, Fate::Missed { n_tests: 7 }),
            (4, Fate::DoesNotCompile),
            (5, Fate::Missed { n_tests: 8 }),
        ]);
        let known = |id: usize| (mutants[id].key.clone(), "rounding".to_owned());
        let left = Left::from([known(2), known(5)]);
        assert_eq!(
            row("x", &mutants, &fates, &left),
            "| `x` | 6 | 1 | 3 | 1 | 2 | 1 | 60.0 % |"
        );
        assert_eq!(outdated(&left, &mutants, &fates), [&mutants[2].key]);
        let folder = std::env::temp_dir().join(format!("mutation-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        write(&folder, &mutants, &fates, &left).unwrap();
        let read = missed(&folder).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        let new = "? line 7, reached by 7 tests".to_owned();
        assert_eq!(read, Left::from([(mutants[3].key.clone(), new), known(5)]));
        let none = BTreeMap::new();
        assert_eq!(
            row("x", &mutants, &none, &left),
            "| `x` | 0 | 0 | 0 | 0 | 0 | 0 | - |"
        );
    }
}
