//! `hybrid-icp bop compare`.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::Args;

use super::compare_report::{Comparison, Entry};
use super::eval;
use super::journal::Journal;
use super::refine;
use crate::choice::{PipelineArguments, Source};
use crate::outputs;
use crate::terminal::say;

/// Refine a result file with several pipelines, and compare them by their evaluations.
///
/// Writes, for every pipeline, its result file and its evaluation as JSON, and the comparison as compare.md, compare.html and
/// compare.json: average recalls, the median ADI, the shares of the poses whose ADI fell and rose by more than 0.1 mm, the time
/// per pose on one thread of those given and its ratio to that of the first pipeline; AR and median ADI by object. The same command goes
/// on with a pipeline that was interrupted.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(crate) struct Arguments {
    /// The dataset's folder, with models/ and the split's folder.
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// The split's folder: test, test_primesense, train_pbr, …
    #[arg(long, value_name = "NAME", default_value = "test")]
    split: String,
    /// The result file to refine.
    #[arg(long, value_name = "FILE.csv")]
    init: PathBuf,
    /// The pipelines: names (`hybrid-icp pipelines` lists them) or TOML files.
    #[arg(long, value_name = "A,B,…", value_delimiter = ',', required = true)]
    pipelines: Vec<Source>,
    /// The folder to write to; made when it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Threads; the number of cores if not given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), allow_negative_numbers = true)]
    threads: Option<u16>,
}

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop compare --dataset bop/ycbv --init cosypose_ycbv-test.csv \\
      --pipelines hybrid,nn-point-to-point --out compared";

/// What the initial poses are called.
const INITIAL: &str = "initial";
/// What the files of the comparison are called.
const COMPARISON: &str = "compare";
/// Their endings.
const FORMS: [&str; 3] = ["md", "html", "json"];

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let mut names = BTreeSet::from([INITIAL, COMPARISON].map(str::to_owned));
    for pipeline in &arguments.pipelines {
        let name = pipeline.short_name();
        if !names.insert(name.clone()) {
            bail!(
                "--pipelines gives {name} twice, expected names that differ from each other, from {INITIAL} and from {COMPARISON}"
            );
        }
        // A file that cannot be built is told before anything is computed.
        PipelineArguments::plain(pipeline.clone()).choose()?;
    }
    let out = &arguments.out;
    std::fs::create_dir_all(out)
        .with_context(|| format!("cannot make the folder {}", out.display()))?;
    arguments.check_files()?;
    let dataset = (arguments.dataset.as_path(), arguments.split.as_str());
    let evaluate = |name: &str, results: &Path, seconds: Option<f64>| {
        say(format_args!("\n{name}:"))?;
        let json = out.join(format!("{name}.json"));
        let words = eval::Arguments::plain(dataset, results, json, arguments.threads);
        Ok::<Entry, anyhow::Error>(Entry {
            name: name.to_owned(),
            evaluation: eval::evaluate(&words)?,
            seconds,
        })
    };
    let initial = evaluate(INITIAL, &arguments.init, None)?;
    let mut pipelines = Vec::new();
    for pipeline in &arguments.pipelines {
        let name = pipeline.short_name();
        let output = out.join(format!("{name}.csv"));
        let seconds = refine::refine(&refine::Arguments::plain(
            dataset,
            PipelineArguments::plain(pipeline.clone()),
            (&arguments.init, output.clone()),
            arguments.threads,
        ))?;
        pipelines.push(evaluate(&name, &output, seconds)?);
    }
    let comparison = Comparison {
        dataset: arguments.dataset.display().to_string(),
        split: arguments.split.clone(),
        init: arguments.init.display().to_string(),
        initial,
        pipelines,
    };
    let markdown = comparison.markdown();
    let json = comparison.json()?;
    for (ending, text) in FORMS.iter().zip([&markdown, &comparison.html(), &json]) {
        let path = out.join(format!("{COMPARISON}.{ending}"));
        hicp_io::write_atomically(path, |writer| writer.write_all(text.as_bytes()))?;
    }
    let page = out.join(format!("{COMPARISON}.html"));
    say(format_args!(
        "\n{}\n{}",
        comparison.overall().markdown(),
        page.display()
    ))
}

impl Arguments {
    /// Checks that every file of the comparison can be written, and that none takes the place of an input: the next pipeline
    /// would begin where the one before it ended.
    fn check_files(&self) -> anyhow::Result<()> {
        let in_out = |name: &str| self.out.join(name);
        let mut written = vec![in_out(&format!("{INITIAL}.json"))];
        written.extend(FORMS.map(|ending| in_out(&format!("{COMPARISON}.{ending}"))));
        let mut journals = Vec::new();
        for pipeline in &self.pipelines {
            let name = pipeline.short_name();
            let results = in_out(&format!("{name}.csv"));
            journals.push(Journal::path_of(&results));
            written.extend([results, in_out(&format!("{name}.json"))]);
        }
        let by_out = |path| ("--out", PathBuf::as_path(path));
        let written: Vec<_> = written.iter().map(by_out).collect();
        let journals: Vec<_> = journals.iter().map(by_out).collect();

        let mut read = vec![("--init", self.init.as_path())];
        let files = self.pipelines.iter().filter_map(Source::file);
        read.extend(files.map(|path| ("--pipelines", path.as_path())));
        outputs::check(&[&written[..], &journals].concat(), &read, &[])?;
        outputs::check_dataset(&written, (&self.dataset, &self.split))
    }
}
