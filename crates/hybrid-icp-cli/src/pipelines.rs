//! `hybrid-icp pipelines`.

use clap::Args;
use hybrid_icp::Preset;

use crate::choice::parts;
use crate::terminal::{say, table};

/// List the pipelines, print one as a TOML file, or print the catalog of parts.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Print this pipeline as a TOML file, as a start for a custom one.
    #[arg(long, value_name = "NAME")]
    show: Option<Preset>,
    /// Print the catalog of parts, with their parameters, as Markdown.
    #[arg(long, conflicts_with = "show")]
    parts: bool,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    if let Some(preset) = arguments.show {
        return say(preset.toml());
    }
    if arguments.parts {
        return say(parts().page());
    }
    let rows = Preset::ALL.iter();
    let rows = rows.map(|preset| [preset.name().to_owned(), preset.summary().to_owned()]);
    say(table(&rows.collect::<Vec<_>>(), 2))
}
