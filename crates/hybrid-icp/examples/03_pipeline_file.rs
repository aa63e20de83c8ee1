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
    file.set("stage.selection.points=2000")?; // As `--set` does.

    let given = scene::Scene::new()?;
    given.refine(file.build()?)?;

    // Errors name the place, and suggest a similar name.
    let misspelled = text.replace("\"projective\"", "\"projectiv\"");
    if let Err(message) = PipelineFile::parse(&misspelled, "03_pipeline.toml")?.build() {
        println!("\n{message}");
    }
    Ok(())
}
