//! `hybrid-icp bop`: the commands over whole datasets.

mod advice;
mod compare;
mod estimate;
mod eval;
mod faults;
mod follow;
mod generate;
mod models;
mod options;
mod refine;
mod sequence;
mod show;
mod statistics;
mod targets;
mod track;
pub(crate) mod tracking;

use clap::Subcommand;

/// Work on datasets in the layout of the BOP benchmark.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Refine(refine::Arguments),
    Estimate(estimate::Arguments),
    Eval(eval::Arguments),
    Generate(generate::Arguments),
    Compare(compare::Arguments),
    Show(show::Arguments),
    Sequence(sequence::Arguments),
    Track(track::Arguments),
}

/// Runs the command.
pub(crate) fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Refine(arguments) => refine::run(arguments),
        Command::Estimate(arguments) => estimate::run(arguments),
        Command::Eval(arguments) => eval::run(arguments),
        Command::Generate(arguments) => generate::run(arguments),
        Command::Compare(arguments) => compare::run(arguments),
        Command::Show(arguments) => show::run(arguments),
        Command::Sequence(arguments) => sequence::run(arguments),
        Command::Track(arguments) => track::run(arguments),
    }
}
