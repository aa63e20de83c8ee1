//! Checks that `docs/catalogue.md` is the page that the code writes.

use hybrid_icp::pipeline::Catalog;

#[test]
fn the_catalog_page_is_up_to_date() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/catalogue.md");
    let written = Catalog::built_in().page();
    if std::env::var_os("HICP_BLESS").is_some() {
        std::fs::write(path, &written).unwrap();
    }
    let page = std::fs::read_to_string(path).unwrap_or_default();
    assert!(
        page == written,
        "run `HICP_BLESS=1 cargo test -p hicp-tests --test it catalogue`"
    );
}
