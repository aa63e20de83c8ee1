//! `docs/catalogue.md` is what the code says.

use hybrid_icp::pipeline::catalogue;

#[test]
fn the_catalogue_page_is_up_to_date() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/catalogue.md");
    let page = std::fs::read_to_string(path).unwrap_or_default();
    // The program ends what it prints with a line break of its own.
    assert!(
        page.trim_end() == catalogue().trim_end(),
        "run `cargo run --release -- pipelines --parts > docs/catalogue.md`"
    );
}
