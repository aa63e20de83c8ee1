//! `hybrid-icp replay`.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow, bail};
use clap::Args;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::inputs::Inputs;
use super::trace::TraceLines;
use crate::choice::Pipeline;
use crate::limits::limits;
use crate::terminal::{say, warn};

/// Run a trace again and compare every iteration.
///
/// A trace (`hybrid-icp refine --trace FILE` or `estimate`) contains its pipeline and the names of
/// its files. The same files give the same iterations to the last digit. If a line differs, the
/// exit code is 1.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The trace file.
    #[arg(value_name = "TRACE")]
    trace: PathBuf,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let path = arguments.trace.as_path();
    let text = limits().read_text(path)?;
    let old = text
        .lines()
        .zip(1..)
        .map(|(line, number)| {
            serde_json::from_str(line).with_context(|| {
                format!(
                    "{}:{number}: expected a line of a trace, which is JSON",
                    path.display()
                )
            })
        })
        .collect::<anyhow::Result<Vec<Value>>>()?;
    let Some(header) = old.first() else {
        bail!("{}: empty, expected a trace", path.display());
    };
    let header = Header { path, line: header };
    if header.line["event"] != "start" {
        return Err(header.refuse("event", "\"start\" in the first line of a trace"));
    }
    let version = header.text("version")?;
    if version != env!("CARGO_PKG_VERSION") {
        warn(format_args!(
            "{} was written by version {version}, this is version {}: results may differ",
            path.display(),
            env!("CARGO_PKG_VERSION")
        ));
    }
    let new = replay(&header)?;
    let differing = (1..)
        .zip(new.iter().zip(&old))
        .find(|(_, (new, old))| new != old);
    if let Some((number, (new, old))) = differing {
        bail!(
            "{}:{number} differs:\n  trace    {old}\n  this run {new}",
            path.display()
        );
    }
    if new.len() != old.len() {
        bail!(
            "{} has {} lines, but this run has {}; the lines that both have are equal",
            path.display(),
            old.len(),
            new.len()
        );
    }
    say(format_args!(
        "{}: {} lines, all equal",
        path.display(),
        old.len()
    ))
}

/// Runs the refinement of a header, and returns the lines of that run below the same header.
fn replay(header: &Header<'_>) -> anyhow::Result<Vec<Value>> {
    let overrides: Vec<String> = header.get("set", "a list of strings")?;
    let origin = format!("the pipeline of {}", header.path.display());
    let pipeline = Pipeline::parse(&origin, header.text("toml")?, &overrides)?;
    let inputs = serde_path_to_error::deserialize::<_, Inputs>(&header.line["inputs"]);
    let inputs = inputs.map_err(|error| {
        let (place, key) = (header.path.display(), format!("inputs.{}", error.path()));
        anyhow!(
            "{place}:1: {:?}: {}",
            key.trim_end_matches('.'),
            error.inner()
        )
    })?;
    let read = inputs.read()?;
    let observation = inputs.observe(read.depth, read.mask, read.color, read.camera)?;
    let mut trace = TraceLines::new(Some(header.line.clone()));
    let mut refiner = pipeline.refiner();
    match &read.init {
        Some(init) => {
            let init = &init.camera_from_object;
            refiner.refine_observed(&read.model, &observation, init, &mut trace)
        }
        None => refiner.estimate_observed(&read.model, &observation, &mut trace),
    };
    // Convert through text as the old lines were; numbers in JSON are read back exactly.
    let lines = trace.lines().iter();
    lines
        .map(|line| Ok(serde_json::from_str(&line.to_string())?))
        .collect()
}

/// The first line of a trace.
struct Header<'a> {
    path: &'a Path,
    line: &'a Value,
}

impl Header<'_> {
    fn get<T: DeserializeOwned>(&self, key: &str, expected: &str) -> anyhow::Result<T> {
        let value = serde_json::from_value(self.line[key].clone());
        value.map_err(|_| self.refuse(key, expected))
    }

    fn text(&self, key: &str) -> anyhow::Result<String> {
        self.get(key, "a string")
    }

    fn refuse(&self, key: &str, expected: &str) -> anyhow::Error {
        anyhow!(
            "{}:1: \"{key}\" is {}, expected {expected}",
            self.path.display(),
            self.line[key]
        )
    }
}
