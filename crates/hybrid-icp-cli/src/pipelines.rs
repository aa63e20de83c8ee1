//! `hybrid-icp pipelines`.

use std::fmt::Write as _;

use clap::Args;
use hybrid_icp::Preset;
use hybrid_icp::pipeline::Catalog;

use crate::terminal::say;

/// List the pipelines by name, show one as a file, or list the parts that files are made of.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Print this pipeline as a TOML file: a place to start one's own from.
    #[arg(long, value_name = "NAME")]
    show: Option<Preset>,
    /// Print the catalogue of parts, with their parameters, as Markdown.
    #[arg(long, conflicts_with = "show")]
    parts: bool,
}

/// Prints what was asked for.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    if let Some(preset) = arguments.show {
        return say(preset.toml());
    }
    if arguments.parts {
        return say(Catalog::built_in().page());
    }
    let mut text = String::new();
    let width = Preset::ALL
        .iter()
        .map(|p| p.name().len())
        .max()
        .unwrap_or(0);
    for preset in Preset::ALL {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{preset:width$}  {}", preset.summary());
    }
    say(text.trim_end())
}
