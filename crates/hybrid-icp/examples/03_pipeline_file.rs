//! A pipeline from a TOML file: experiments without recompiling.
//!
//! `cargo run --release -p hybrid-icp --example 03_pipeline_file`

#![allow(clippy::print_stdout)]

use std::error::Error;

use hybrid_icp::pipeline::PipelineFile;

mod scene;

fn main() -> Result<(), Box<dyn Error>> {
    // `PipelineFile::read` takes a path; this text lies beside the example.
    let text = include_str!("03_pipeline.toml");
    let mut file = PipelineFile::parse(text, "03_pipeline.toml")?;
    file.set("stage.selection.points=2000")?; // What `--set` does.

    let given = scene::Scene::new()?;
    given.refine(file.build()?)?;

    // What is wrong is said with its place, and with what may have been meant.
    let misspelt = text.replace("\"projective\"", "\"projectiv\"");
    if let Err(message) = PipelineFile::parse(&misspelt, "03_pipeline.toml")?.build() {
        println!("\n{message}");
    }
    Ok(())
}
