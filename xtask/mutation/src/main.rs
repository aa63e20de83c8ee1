//! Mutation testing of a crate with one build: `cargo xtask mutants`.
//!
//! cargo-mutants builds a crate anew for each of its mutants, which for thousands of them takes a day. Here cargo-mutants only lists them
//! (`cargo mutants --list`); a copy of the crate is written that holds all of them at once, each behind a switch that an environment
//! variable turns on ("mutant schemata", Untch, Offutt & Harrold 1993), and is built once. Each test is then run once to see which
//! mutants it reaches, and each mutant is tried by the tests that reach it until one fails.
//!
//! Mutants that do not compile are found by compiling: the compiler's errors point into them. Those of which it can't be said so, or
//! that can't be put behind a switch, are built one by one.

mod listing;
mod programs;
mod report;
mod schema;
mod trial;
mod viability;
mod working_copy;

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use crate::listing::Mutant;
use crate::report::Fate;
use crate::working_copy::WorkingCopy;

/// What the command line asks for.
struct Options {
    root: PathBuf,
    target: PathBuf,
    package: String,
    /// Only mutants whose name contains one of these, if any is given.
    only: Vec<String>,
    /// Only those that the last run missed.
    again: bool,
    jobs: usize,
}

fn main() -> Result<()> {
    let options = parse()?;
    let copy = WorkingCopy::make(&options.root, &options.target, &options.package)?;
    let folder = options.target.join(&options.package);
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    let mut mutants = listing::list(&copy)?;
    if !options.only.is_empty() {
        mutants.retain(|m| options.only.iter().any(|word| m.name.contains(word)));
    }
    if options.again {
        let missed = report::missed(&folder)?;
        mutants.retain(|m| missed.contains_key(&m.key));
    }
    eprintln!("mutation: {}, {} mutants", options.package, mutants.len());
    let fates = fates(&copy, &mutants, options.jobs)?;
    let reasons = format!("xtask/mutation/left/{}.tsv", options.package);
    let left = match options.root.join(&reasons) {
        path if path.is_file() => report::read(&path)?,
        _ => report::Left::new(),
    };
    report::write(&folder, &mutants, &fates, &left)?;
    if options.only.is_empty() && !options.again {
        for key in report::outdated(&left, &mutants, &fates) {
            eprintln!("mutation: {reasons} explains what is not missed: {key:?}");
        }
    }
    println!("{}", report::row(&options.package, &mutants, &fates, &left));
    Ok(())
}

/// What became of each mutant.
fn fates(copy: &WorkingCopy, mutants: &[Mutant], jobs: usize) -> Result<BTreeMap<usize, Fate>> {
    let mut fates = BTreeMap::new();
    let mut singles = Vec::new();
    viability::weave(copy, mutants, &mut fates, &mut singles)?;
    let tests = programs::build(copy)?;
    let reached = trial::trace(copy, &tests)?;
    let woven: Vec<usize> = (0..mutants.len())
        .filter(|id| !fates.contains_key(id) && !singles.contains(id))
        .collect();
    eprintln!(
        "mutation: {} do not compile, {} woven in, {} built one by one; {} tests",
        fates.len(),
        woven.len(),
        singles.len(),
        tests.len()
    );
    fates.extend(trial::try_woven(copy, &tests, &reached, &woven, jobs)?);
    let usual = trial::programs_seconds(&tests, &reached);
    for (place, &id) in singles.iter().enumerate() {
        let fate = viability::alone(copy, &mutants[id], &usual)?;
        eprintln!(
            "mutation: alone, {} of {}: {fate:?} {}",
            place + 1,
            singles.len(),
            mutants[id].name
        );
        fates.insert(id, fate);
    }
    copy.restore()?;
    Ok(fates)
}

fn parse() -> Result<Options> {
    const USAGE: &str = "mutation --root FOLDER --target FOLDER --package CRATE [--only WORD]... [--again] [--jobs N]";
    let (mut root, mut target, mut package) = (None, None, None);
    let (mut only, mut again, mut jobs) = (Vec::new(), false, None);
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        if word == "--again" {
            again = true;
            continue;
        }
        let value = words
            .next()
            .with_context(|| format!("{word} wants a value; {USAGE}"))?;
        match word.as_str() {
            "--root" => root = Some(PathBuf::from(value)),
            "--target" => target = Some(PathBuf::from(value)),
            "--package" => package = Some(value),
            "--only" => only.push(value),
            "--jobs" => {
                let n: usize = value
                    .parse()
                    .with_context(|| format!("--jobs {value}, expected a number"))?;
                jobs = Some(n.max(1));
            }
            _ => bail!("cannot read {word:?}; {USAGE}"),
        }
    }
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    Ok(Options {
        root: root.context(USAGE)?,
        target: target.context(USAGE)?,
        package: package.context(USAGE)?,
        only,
        again,
        jobs: jobs.unwrap_or_else(cores),
    })
}
