//! The program `hybrid-icp`. `hybrid-icp --help` lists its commands.
//!
//! **Should you use this crate?** Install the program with it. Rust programs depend on
//! `hybrid-icp`. The Python module runs the same program as `python -m hybrid_icp`.
//!
//! ```
//! assert_eq!(hybrid_icp_cli::run(["hybrid-icp", "pipelines"]), 0);
//! ```
//!
//! [`run_with`] is the same program with custom parts for pipeline files.
//!
//! Exit codes: 0 if the command succeeded, 1 if something failed, 2 if the command line is wrong,
//! 130 if the program was interrupted. A message names the cause of a failure.

mod align;
mod bop;
mod choice;
mod demo;
mod experiment;
mod inspect;
mod interrupt;
mod limits;
mod objects;
mod options;
mod outputs;
mod pipelines;
mod pose_json;
mod refine;
mod terminal;
mod track;

use std::ffi::OsString;

use clap::{Parser, Subcommand};
use hybrid_icp::pipeline::Catalog;

/// Refine 6D object poses in depth images.
///
/// A detector provides a segmentation mask and a rough pose. This program aligns the object's mesh
/// with the measured depth. It scores the result by the mean VSD estimate (MVE), from 0 (the pose
/// explains every pixel) to 1 (it explains none). It also estimates the confidence, the probability
/// that the pose is right. Accept a pose with a confidence of 0.95 or more.
#[derive(Debug, Parser)]
#[command(name = "hybrid-icp", version, after_help = EXAMPLES, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    limits: limits::Limits,
}

const EXAMPLES: &str = "\
Examples:
  hybrid-icp demo
  hybrid-icp refine --model mug.ply --model-unit mm --depth depth.png \\
      --depth-scale 0.1 --mask mask.png --camera camera.json --init pose.json
  hybrid-icp estimate --model mug.ply --model-unit mm --depth depth.png \\
      --depth-scale 0.1 --mask mask.png --camera camera.json
  hybrid-icp doctor --model mug.ply --model-unit mm --depth depth.png \\
      --depth-scale 0.1 --mask mask.png --camera camera.json --init pose.json
  hybrid-icp track --model mug.ply --model-unit mm --depth recording/depth \\
      --depth-scale 0.1 --camera camera.json --init pose.json \\
      --output tracked.jsonl
  hybrid-icp align a.ply b.pcd --output moved.json
  hybrid-icp bop refine --dataset bop/ycbv --results in.csv --output out.csv
  hybrid-icp bop eval --dataset bop/ycbv --results out.csv
  hybrid-icp bop show --dataset bop/ycbv --scene 50 --image 1 \\
      --results out.csv --against in.csv --out 50-1.png
  hybrid-icp inspect mug.ply --unit mm
  hybrid-icp pipelines
  hybrid-icp objects --out objects
  hybrid-icp experiment init-noise --poses 30

Run `hybrid-icp help refine` for the details of a command.
Exit codes: 0 done, 1 something failed, 2 the command line is wrong, 130
interrupted. Ctrl-C and SIGTERM end the program within a second. `bop refine`,
`bop estimate` and `experiment` then continue with --resume, `bop compare`
without it.";

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Arguments),
    Refine(refine::Arguments),
    Estimate(refine::estimate::Arguments),
    Doctor(refine::doctor::Arguments),
    Replay(refine::replay::Arguments),
    Track(track::Arguments),
    Align(align::Arguments),
    /// Work on datasets in the layout of the BOP benchmark.
    #[command(subcommand)]
    Bop(bop::Command),
    Inspect(inspect::Arguments),
    Pipelines(pipelines::Arguments),
    Objects(objects::Arguments),
    #[command(subcommand)]
    Experiment(experiment::Command),
}

/// Runs the program with the words of its command line, the first of which is its name.
///
/// Prints results and errors, listens to Ctrl-C and SIGTERM, and returns the exit code.
#[must_use]
pub fn run<I>(words: I) -> u8
where
    I: IntoIterator<Item: Into<OsString> + Clone>,
{
    run_with(Catalog::built_in().clone(), words)
}

/// Runs the program with the parts of a catalog for pipeline files, which may include custom ones.
///
/// All commands with `--pipeline` accept them, and `pipelines --parts` lists them. The studies of
/// `experiment` build from the parts that ship. The catalog of the first call in a process stays.
///
/// ```
/// use hybrid_icp::association::OutlierFilter;
/// use hybrid_icp::core::{Correspondences, Iteration};
/// use hybrid_icp::pipeline::{Catalog, range::METERS};
///
/// /// Keeps pairs up to a depth.
/// struct MaxDepth(f64);
///
/// impl OutlierFilter for MaxDepth {
///     fn filter(&mut self, _: &Iteration<'_>, pairs: &mut Correspondences) {
///         pairs.retain(|pair| f64::from(pair.target.point.z) <= self.0);
///     }
/// }
///
/// let mut catalog = Catalog::built_in().clone();
/// catalog.add_filter("max-depth", |p| {
///     p.about = "Keeps pairs up to a depth. Cost: O(n).";
///     Ok(MaxDepth(p.number("meters", METERS, 2.0, "largest depth")?))
/// });
/// # let folder = tempfile::tempdir().unwrap();
/// # std::env::set_current_dir(&folder).unwrap();
/// let pipeline = r#"
/// type = "icp"
/// selection = "visible-surface"
/// association = "projective"
/// filter = [{ type = "max-depth", meters = 1.5 }]
/// metric = "point-to-plane"
/// "#;
/// std::fs::write("mine.toml", pipeline).unwrap();
/// // The `main` of a program passes `std::env::args_os()`.
/// let words = ["hybrid-icp", "demo", "--pipeline", "mine.toml"];
/// assert_eq!(hybrid_icp_cli::run_with(catalog, words), 0);
/// ```
#[must_use]
pub fn run_with<I>(catalog: Catalog, words: I) -> u8
where
    I: IntoIterator<Item: Into<OsString> + Clone>,
{
    let cli = match Cli::try_parse_from(words) {
        Ok(cli) => cli,
        Err(message) => return show(&message),
    };
    cli.limits.choose();
    choice::choose_parts(catalog);
    interrupt::listen();
    let result = match cli.command {
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Refine(arguments) => refine::run(&arguments),
        Command::Estimate(arguments) => refine::estimate::run(&arguments),
        Command::Doctor(arguments) => refine::doctor::run(&arguments),
        Command::Replay(arguments) => refine::replay::run(&arguments),
        Command::Track(arguments) => track::run(&arguments),
        Command::Align(arguments) => align::run(&arguments),
        Command::Bop(command) => bop::run(&command),
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::Pipelines(arguments) => pipelines::run(&arguments),
        Command::Objects(arguments) => objects::run(&arguments),
        Command::Experiment(command) => experiment::run(&command),
    };
    match result {
        Ok(()) => 0,
        Err(error) => {
            interrupt::end_unless_saving();
            if let Some(message) = error.downcast_ref() {
                return show(message);
            }
            terminal::complain(format_args!("{error:#}"));
            if interrupt::asked() {
                interrupt::EXIT_CODE
            } else {
                1
            }
        }
    }
}

/// Prints a message about the command line, and returns its exit code.
fn show(message: &clap::Error) -> u8 {
    // Help and version are messages, too. If the terminal is gone, nobody reads them.
    let _ = message.print();
    u8::try_from(message.exit_code()).unwrap_or(2)
}
