//! `cargo xtask look`: takes pictures of pages in headless Chromium, narrow and wide.

use std::path::Path;

use anyhow::{Context as _, Result};

use crate::process::{command, execute, require, target};

/// The widths of a page, and the height that is shown of it, in pixels.
const WIDTHS: [u32; 2] = [400, 1400];
const HEIGHT: u32 = 3000;

/// Writes a picture of every page in every width into `target/look`.
pub(crate) fn take(pages: &[&str]) -> Result<()> {
    require(command("chromium --version"), "apt-get install chromium")?;
    let folder = target().join("look");
    std::fs::create_dir_all(&folder)?;
    let folder = folder.canonicalize()?;
    let frame = folder.join("frame.html");
    for page in pages {
        let page = Path::new(page)
            .canonicalize()
            .with_context(|| (*page).to_owned())?;
        let name = page.file_stem().unwrap_or_default().to_string_lossy();
        for width in WIDTHS {
            // Chromium has no windows narrower than 500 pixels, but frames may be narrower.
            let style = format!("border: 0; width: {width}px; height: {HEIGHT}px");
            let source = page.display();
            let html = format!("<body style='margin: 0'><iframe src='{source}' style='{style}'>");
            std::fs::write(&frame, html)?;
            let picture = folder.join(format!("{name}-{width}.png"));
            // Without the sandbox, it also starts in a container.
            let mut chromium = command("chromium --headless --no-sandbox --hide-scrollbars");
            chromium.arg(format!("--window-size={width},{HEIGHT}"));
            chromium.arg(format!("--screenshot={}", picture.display()));
            execute(chromium.arg(&frame))?;
            println!("{}", picture.display());
        }
    }
    Ok(())
}
