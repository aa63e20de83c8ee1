//! The shell blocks of the book run, in order, in a folder with the files that they name.

use std::path::Path;
use std::process::Command;

use hicp_io::LengthUnit;
use hybrid_icp::raster::render_depth_image;

use crate::common::*;

/// Returns the blocks of a page in one language.
fn blocks<'a>(page: &'a str, language: &str) -> Vec<&'a str> {
    let fence = format!("```{language}\n");
    let rest = page.split(fence.as_str()).skip(1);
    rest.filter_map(|block| block.split("\n```").next())
        .collect()
}

/// Runs the `sh` blocks of a page. Blocks marked `bash` need data or tools that may be missing.
fn run_page(name: &str) {
    let page = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../docs")
        .join(name);
    let page = std::fs::read_to_string(page).unwrap();
    let scene = Scene::new();
    let depth = render_depth_image(&car(), &camera(), &truth());
    hicp_io::write_ply(scene.path("mug.ply"), &car(), LengthUnit::Millimeters).unwrap();
    hicp_io::write_depth_png(scene.path("depth.png"), &depth, 1.0).unwrap();
    std::fs::copy(scene.path("init.json"), scene.path("pose.json")).unwrap();
    let program = Path::new(env!("CARGO_BIN_EXE_hybrid-icp"));
    let path = format!(
        "{}:{}",
        program.parent().unwrap().display(),
        std::env::var("PATH").unwrap()
    );
    let blocks = blocks(&page, "sh");
    assert!(!blocks.is_empty(), "{name}: no `sh` block");
    for block in blocks {
        let mut shell = Command::new("sh");
        shell
            .args(["-e", "-c", block])
            .current_dir(scene.folder.path());
        let output = shell.env("PATH", &path).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{name}: {block}\n{errors}");
    }
}

#[test]
fn the_first_refinement_runs() {
    run_page("book/first-refinement.md");
}

#[test]
fn the_chapter_about_custom_parts_runs() {
    run_page("book/build-your-own.md");
}

#[test]
fn the_chapter_about_datasets_runs() {
    run_page("book/datasets.md");
}

#[test]
fn the_chapter_about_sequences_runs() {
    run_page("book/sequences.md");
}

#[test]
fn the_page_about_the_command_line_runs() {
    run_page("cli.md");
}
