//! `hybrid-icp bop`: work on whole datasets.

mod calibration;
mod compare;
mod compare_report;
mod digest;
mod errors_csv;
mod eval;
mod eval_report;
mod generate;
mod journal;
mod journal_entry;
mod judge;
mod models;
mod objects;
mod problem;
mod refine;
mod refine_rows;
mod refine_settings;
mod refine_summary;
mod refine_warnings;
mod sequence;
mod show;
mod show_estimates;
mod show_lines;
mod show_picture;
mod targets;

use anyhow::Context as _;
use clap::Subcommand;
use indicatif::{ProgressBar, ProgressStyle};

/// Work on datasets in the layout of the BOP benchmark.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Refine(refine::Arguments),
    Eval(eval::Arguments),
    Generate(generate::Arguments),
    Compare(compare::Arguments),
    Show(show::Arguments),
    Sequence(sequence::Arguments),
}

/// Runs the command.
pub(crate) fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Refine(arguments) => refine::run(arguments),
        Command::Eval(arguments) => eval::run(arguments),
        Command::Generate(arguments) => generate::run(arguments),
        Command::Compare(arguments) => compare::run(arguments),
        Command::Show(arguments) => show::run(arguments),
        Command::Sequence(arguments) => sequence::run(arguments),
    }
}

/// Makes the threads that were asked for, or one per core; more than there are frames have nothing to do.
fn thread_pool(threads: Option<u16>, frames: usize) -> anyhow::Result<rayon::ThreadPool> {
    let threads = match threads {
        Some(threads) => usize::from(threads),
        None => std::thread::available_parallelism().map_or(1, usize::from),
    };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.min(frames.max(1)))
        .build()
        .context("cannot start the threads")
}

/// Reads a number of an option.
fn positive(text: &str) -> Result<f64, String> {
    let value: Option<f64> = text.parse().ok();
    value
        .filter(|x| x.is_finite() && *x > 0.0)
        .ok_or_else(|| "expected a finite number above 0".to_owned())
}

/// A bar on a terminal; nothing where standard error is not one.
fn progress_bar(length: usize, unit: &str) -> ProgressBar {
    let bar = ProgressBar::new(length as u64);
    let template = format!("{{bar:40}} {{pos}}/{{len}} {unit}, {{eta}} left");
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style);
    }
    bar
}

/// Returns the median, of an even number of values the mean of the middle two; `None` without any.
fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let upper = values.get(values.len() / 2)?;
    match values.len() % 2 {
        0 => Some(0.5 * (values[values.len() / 2 - 1] + upper)),
        _ => Some(*upper),
    }
}
