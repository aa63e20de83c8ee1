//! `hybrid-icp pipelines`.

use std::io::Write;

use hybrid_icp::Preset;

/// Prints every pipeline's name and one line about it.
pub(crate) fn run() -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    let width = Preset::ALL
        .iter()
        .map(|p| p.name().len())
        .max()
        .unwrap_or(0);
    for preset in Preset::ALL {
        writeln!(out, "{preset:width$}  {}", preset.summary())?;
    }
    Ok(())
}
