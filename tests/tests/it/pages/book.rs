//! Checks that the TOML blocks of the README and the book are pipelines that build.

use std::path::{Path, PathBuf};

use hybrid_icp::pipeline::PipelineFile;

/// Returns the Markdown pages of a folder and of the folders in it.
fn pages(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    paths
        .flat_map(|path| match path.is_dir() {
            true => pages(&path),
            false => vec![path],
        })
        .filter(|path| path.extension().is_some_and(|e| e == "md"))
        .collect()
}

#[test]
fn every_toml_block_is_a_pipeline_that_builds() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut pages = pages(&root.join("docs"));
    pages.push(root.join("README.md"));
    let mut built = 0;
    for page in pages {
        let text = std::fs::read_to_string(&page).unwrap();
        for block in text.split("```toml\n").skip(1) {
            let block = block.split("\n```").next().unwrap();
            if block.starts_with("[dependencies]") {
                continue;
            }
            let file = PipelineFile::parse(block, &page.display().to_string());
            file.unwrap().build().unwrap();
            built += 1;
        }
    }
    assert!(built > 0);
}
