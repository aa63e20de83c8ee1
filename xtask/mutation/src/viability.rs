//! Which mutants compile.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use anyhow::{Result, bail};
use serde_json::Value;

use crate::listing::Mutant;
use crate::programs;
use crate::report::Fate;
use crate::schema::{self, SWITCH, Woven};
use crate::trial;
use crate::working_copy::{WorkingCopy, write};

/// Errors of types: a mutant in which the compiler sees one does not compile by itself either.
const OF_TYPES: [&str; 8] = [
    "E0061", "E0277", "E0308", "E0369", "E0368", "E0599", "E0600", "E0614",
];

/// Writes the crate with all mutants that compile in it; notes those that do not, and those to be built alone.
pub(crate) fn weave(
    copy: &WorkingCopy,
    mutants: &[Mutant],
    fates: &mut BTreeMap<usize, Fate>,
    singles: &mut Vec<usize>,
) -> Result<()> {
    loop {
        let mut woven: BTreeMap<&str, Woven> = BTreeMap::new();
        for (file, text) in &copy.sources {
            let here: Vec<(usize, &Mutant)> = mutants
                .iter()
                .enumerate()
                .filter(|(id, m)| {
                    m.file == *file && !fates.contains_key(id) && !singles.contains(id)
                })
                .collect();
            let mut done = schema::weave(text, &here)?;
            singles.append(&mut done.left);
            if file.ends_with("/src/lib.rs") {
                done.text.push_str(SWITCH);
            }
            write(&copy.root.join(file), done.text.as_bytes())?;
            woven.insert(file, done);
        }
        let errors = errors(&mut check(copy))?;
        if errors.is_empty() {
            return Ok(());
        }
        let mut progress = false;
        for error in &errors {
            let Some(found) = woven.get(error.file.as_str()) else {
                continue;
            };
            let (wrong, alone) = blame(found, error);
            for id in wrong {
                progress |= fates.insert(id, Fate::DoesNotCompile).is_none();
            }
            for id in alone {
                if !fates.contains_key(&id) && !singles.contains(&id) {
                    singles.push(id);
                    progress = true;
                }
            }
        }
        if !progress {
            bail!(
                "the crate with its mutants does not compile, and no mutant is to blame: {errors:?}"
            );
        }
    }
}

/// A place that the compiler finds wrong.
#[derive(Debug)]
struct Error {
    code: String,
    file: String,
    begin: usize,
    end: usize,
}

/// Mutants that are wrong by themselves, and those of which it can't be said.
fn blame(woven: &Woven, error: &Error) -> (BTreeSet<usize>, BTreeSet<usize>) {
    let holds =
        |range: &std::ops::Range<usize>| range.start <= error.begin && error.end <= range.end;
    let (mut wrong, mut alone) = (BTreeSet::new(), BTreeSet::new());
    let inside = woven.alternatives.iter().filter(|(range, _)| holds(range));
    if let Some((_, id)) = inside.min_by_key(|(range, _)| range.len()) {
        if OF_TYPES.contains(&error.code.as_str()) {
            wrong.insert(*id);
        } else {
            alone.insert(*id);
        }
        return (wrong, alone);
    }
    let around = woven.places.iter().filter(|(range, _)| holds(range));
    if let Some((_, ids)) = around.min_by_key(|(range, _)| range.len()) {
        alone.extend(ids);
        return (wrong, alone);
    }
    // The place holds mutants: a statement of which the compiler says that it is wrong as a whole.
    for (range, ids) in &woven.places {
        if error.begin <= range.start && range.end <= error.end {
            alone.extend(ids);
        }
    }
    (wrong, alone)
}

fn check(copy: &WorkingCopy) -> Command {
    copy.cargo(&[
        "check",
        "--lib",
        "--package",
        &copy.package,
        "--message-format=json",
    ])
}

/// What the compiler finds wrong, each at its first primary place.
fn errors(command: &mut Command) -> Result<Vec<Error>> {
    let output = command.stderr(std::process::Stdio::null()).output()?;
    let mut errors = Vec::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let Ok(value) = serde_json::from_str::<Value>(line) else {
            continue;
        };
        let message = &value["message"];
        if message["level"] != "error" {
            continue;
        }
        let spans = message["spans"].as_array().map_or(&[][..], Vec::as_slice);
        errors.extend(
            spans
                .iter()
                .filter(|s| s["is_primary"] == true)
                .filter_map(|span| {
                    Some(Error {
                        code: message["code"]["code"].as_str().unwrap_or("").to_owned(),
                        file: span["file_name"].as_str()?.to_owned(),
                        begin: usize::try_from(span["byte_start"].as_u64()?).ok()?,
                        end: usize::try_from(span["byte_end"].as_u64()?).ok()?,
                    })
                }),
        );
    }
    if errors.is_empty() && !output.status.success() {
        bail!(
            "{command:?}: {}, without an error in the sources",
            output.status
        );
    }
    Ok(errors)
}

/// Tries a mutant by itself, in a build of its own.
pub(crate) fn alone(
    copy: &WorkingCopy,
    mutant: &Mutant,
    usual: &BTreeMap<String, f64>,
) -> Result<Fate> {
    copy.restore()?;
    let mut text = copy.sources[&mutant.file].clone();
    text.replace_range(mutant.range.clone(), &mutant.replacement);
    write(&copy.root.join(&mutant.file), text.as_bytes())?;
    if !errors(&mut check(copy))?.is_empty() {
        return Ok(Fate::DoesNotCompile);
    }
    let programs = programs::build(copy)?;
    trial::try_built(copy, &programs, usual)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_types_blame_the_innermost_alternative() {
        let woven = Woven {
            text: String::new(),
            alternatives: vec![(10..20, 0), (30..60, 1)],
            places: vec![(5..70, vec![0, 1])],
            left: Vec::new(),
        };
        let error = |code: &str, begin, end| Error {
            code: code.to_owned(),
            file: String::new(),
            begin,
            end,
        };
        let of = |ids: &[usize]| ids.iter().copied().collect::<BTreeSet<usize>>();
        let none = BTreeSet::new();
        assert_eq!(
            blame(&woven, &error("E0369", 12, 15)),
            (of(&[0]), none.clone())
        );
        assert_eq!(
            blame(&woven, &error("E0502", 31, 60)),
            (none.clone(), of(&[1]))
        );
        assert_eq!(
            blame(&woven, &error("E0308", 25, 28)),
            (none.clone(), of(&[0, 1]))
        );
        assert_eq!(
            blame(&woven, &error("E0308", 0, 90)),
            (none.clone(), of(&[0, 1]))
        );
        assert_eq!(blame(&woven, &error("E0308", 80, 90)), (none.clone(), none));
    }
}
