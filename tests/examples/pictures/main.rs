//! Draws the pictures of the book and of the studies from simulated scenes: `cargo xtask
//! pictures`.

// Pixels and counts become places in a picture.
#![allow(clippy::cast_possible_truncation)]

mod chart;
mod curves;
mod gallery;
mod pairs;
mod scene;
mod studies;
mod svg;

use std::error::Error;
use std::path::{Path, PathBuf};

use svg::Svg;

fn main() -> Result<(), Box<dyn Error>> {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/pictures");
    let folder = std::env::args().nth(1).map_or(docs, PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    type Draw = fn() -> Result<Svg, Box<dyn Error>>;
    let pictures: [(&str, Draw); 12] = [
        ("before-after", gallery::before_after),
        ("selection", pairs::selection),
        ("correspondences", pairs::correspondences),
        ("rejection", pairs::rejection),
        ("convergence", curves::convergence),
        ("switch", curves::switch),
        ("basin", curves::basin),
        ("successes", gallery::successes),
        ("failures", gallery::failures),
        ("study-objects", studies::objects),
        ("study-reconstructions", studies::reconstructions),
        ("study-regimes", studies::regimes),
    ];
    let chosen = std::env::args().nth(2);
    for (name, draw) in pictures {
        if chosen.as_ref().is_none_or(|chosen| chosen == name) {
            let path = folder.join(name).with_extension("svg");
            draw()?.write(&path)?;
            println!("{}", path.display());
        }
    }
    Ok(())
}
