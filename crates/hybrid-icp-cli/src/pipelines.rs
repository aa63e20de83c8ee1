//! `hybrid-icp pipelines`.

use hybrid_icp::Preset;

use crate::terminal::say;

/// Prints every pipeline's name and one line about it.
pub(crate) fn run() -> anyhow::Result<()> {
    let names = Preset::ALL.map(Preset::name);
    let width = names.iter().map(|name| name.len()).max().unwrap_or(0);
    let lines = Preset::ALL.map(|preset| format!("{preset:width$}  {}", preset.summary()));
    say(lines.join("\n"))
}
