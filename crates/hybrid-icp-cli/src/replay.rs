//! `hybrid-icp replay`.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow, bail};
use clap::Args;
use serde_json::Value;

use crate::choice::Pipeline;
use crate::limits::limits;
use crate::refine::Inputs;
use crate::terminal::{say, warn};
use crate::trace_lines::TraceLines;

/// Run a trace again and compare every iteration.
///
/// The trace (`hybrid-icp refine --trace FILE`) names the files and holds the pipeline that made it. The same files give the
/// same iterations to the last digit; the first line that differs ends with exit code 1.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The trace.
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
            serde_json::from_str(line)
                .with_context(|| format!("{}:{number}: expected JSON", path.display()))
        })
        .collect::<anyhow::Result<Vec<Value>>>()?;
    let Some(header) = old.first() else {
        bail!("{}: empty, expected a trace", path.display());
    };
    let header = Header { path, line: header };
    if header.text("event")? != "start" {
        bail!(
            "{}:1: \"event\" is {}, expected \"start\": the first line of a trace says what ran",
            path.display(),
            header.line["event"]
        );
    }
    let version = header.text("version")?;
    if version != env!("CARGO_PKG_VERSION") {
        warn(format_args!(
            "{} was made by version {version}, this is {}: results may differ",
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
            "{}:{number} differs:\n  there {old}\n  now   {new}",
            path.display()
        );
    }
    if new.len() != old.len() {
        bail!(
            "{} has {} lines, the run has {}; those of both agree",
            path.display(),
            old.len(),
            new.len()
        );
    }
    say(format_args!(
        "{}: {} lines, all as they were",
        path.display(),
        old.len()
    ))
}

/// Runs what the header says; the lines that it makes, under the same header.
fn replay(header: &Header<'_>) -> anyhow::Result<Vec<Value>> {
    let texts = |values: &Vec<Value>| {
        let texts = values.iter().map(|value| value.as_str().map(str::to_owned));
        texts.collect::<Option<Vec<_>>>()
    };
    let overrides = header.line["set"]
        .as_array()
        .and_then(texts)
        .ok_or_else(|| header.refuse("set", "a list of texts"))?;
    let origin = format!("the pipeline of {}", header.path.display());
    let pipeline = Pipeline::parse(&origin, header.text("toml")?.to_owned(), &overrides)?;
    let inputs = Inputs {
        model: header.text("model")?.into(),
        model_unit: header
            .text("model_unit")?
            .parse()
            .map_err(|_| header.refuse("model_unit", "m, mm or cm"))?,
        depth: header.text("depth")?.into(),
        depth_scale: Some(
            header.line["depth_scale"]
                .as_f64()
                .filter(|scale| scale.is_finite() && *scale > 0.0)
                .ok_or_else(|| header.refuse("depth_scale", "a number above 0"))?,
        ),
        mask: header.text("mask")?.into(),
        camera: header.text("camera")?.into(),
        init: header.text("init")?.into(),
    };
    let read = inputs.read()?;
    let init = read.init.camera_from_object;
    let observation = inputs.observe(read.depth, read.mask, read.camera)?;
    let mut trace = TraceLines::new(Some(header.line.clone()));
    let mut refiner = pipeline.refiner();
    refiner.refine_observed(&read.model, &observation, &init, &mut trace);
    // As they are written: numbers in JSON are read back exactly.
    trace
        .lines()
        .iter()
        .map(|line| Ok(serde_json::from_str(&line.to_string())?))
        .collect()
}

/// The first line.
struct Header<'a> {
    path: &'a Path,
    line: &'a Value,
}

impl Header<'_> {
    fn text(&self, key: &str) -> anyhow::Result<&str> {
        self.line[key]
            .as_str()
            .ok_or_else(|| self.refuse(key, "a text"))
    }

    fn refuse(&self, key: &str, expected: &str) -> anyhow::Error {
        anyhow!(
            "{}:1: \"{key}\" is {}, expected {expected}",
            self.path.display(),
            self.line[key]
        )
    }
}
