//! `hybrid-icp bop`: work on whole datasets.

mod frame;
mod images;
mod models;
mod problem;
mod refine;

use clap::Subcommand;

/// Work on datasets in the layout of the BOP benchmark.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Refine(refine::Arguments),
}

/// Runs the command.
pub(crate) fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Refine(arguments) => refine::run(arguments),
    }
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
