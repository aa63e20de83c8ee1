//! `cargo xtask pictures`: draws the pictures of the book.

use std::path::Path;

use anyhow::{Context as _, Result};

use crate::process::{cargo, execute, target};

/// Writes the committed pictures into `docs/pictures`, from simulated scenes.
pub(crate) fn draw() -> Result<()> {
    execute(&mut cargo(
        "run --quiet --package hicp-tests --example pictures",
    ))
}

/// The estimates whose poses the gallery of real frames shows, and images of YCB-Video.
const ESTIMATES: &str = "sundermeyer_ycbv-test.csv";
const IMAGES: [(u32, u32); 5] = [(50, 1), (51, 1), (52, 34), (53, 33), (54, 1)];

/// Draws the gallery of real frames into `target/pictures`. `BOP_PATH` names the folder of the
/// datasets.
pub(crate) fn draw_data() -> Result<()> {
    let root =
        std::env::var("BOP_PATH").context("BOP_PATH: expected the folder that holds ycbv")?;
    let dataset = Path::new(&root).join("ycbv");
    let before = dataset.join("results").join(ESTIMATES);
    let folder = target().join("pictures");
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    let after = folder.join("refined_ycbv-test.csv");
    let bop = |name: &str| {
        let mut command = cargo("run --quiet --bin hybrid-icp -- bop");
        command.arg(name).arg("--dataset").arg(&dataset);
        command
    };
    let mut refine = bop("refine");
    refine.arg("--results").arg(&before);
    execute(refine.arg("--output").arg(&after))?;
    for (scene, image) in IMAGES {
        let picture = folder.join(format!("ycbv-{scene}-{image}.png"));
        let mut show = bop("show");
        show.args(["--scene", &scene.to_string(), "--image", &image.to_string()]);
        show.arg("--results").arg(&after);
        show.arg("--against").arg(&before);
        execute(show.arg("--out").arg(&picture))?;
        println!("{}", picture.display());
    }
    Ok(())
}
