//! Checks that the tests that `docs/pitfalls.md` names exist.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Returns the cells of the table rows of a page, without headers and rules.
fn rows(page: &str) -> Vec<[String; 3]> {
    // A bar inside a cell is escaped with a backslash.
    let page = page.replace("\\|", "¦");
    page.lines()
        .filter(|line| line.starts_with('|'))
        .filter(|line| !line.starts_with("|---") && !line.starts_with("| what goes wrong"))
        .map(|line| {
            let cells = line.trim().trim_matches('|').split('|');
            let cells: Vec<String> = cells.map(|cell| cell.trim().to_owned()).collect();
            cells
                .try_into()
                .unwrap_or_else(|cells| panic!("expected three cells in {line}, found {cells:?}"))
        })
        .collect()
}

/// Returns the `path::name` entries of a cell.
fn named_tests(cell: &str) -> Vec<(&str, &str)> {
    cell.split(", ")
        .map(|entry| {
            let entry = entry.strip_prefix('`').and_then(|e| e.strip_suffix('`'));
            entry
                .and_then(|e| e.rsplit_once("::"))
                .unwrap_or_else(|| panic!("expected `path::name`, found {cell}"))
        })
        .collect()
}

/// Returns whether a source file has a test function of that name, also inside `proptest!`.
fn has_test(source: &str, name: &str) -> bool {
    let mut marked = false;
    for line in source.lines().map(str::trim) {
        if line == "#[test]" {
            marked = true;
        } else if marked && line.starts_with("fn ") {
            if line.starts_with(&format!("fn {name}(")) {
                return true;
            }
            marked = false;
        } else if line.starts_with("#[ignore") {
            marked = false;
        }
    }
    false
}

#[test]
fn every_test_named_on_the_page_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let page = fs::read_to_string(root.join("docs/pitfalls.md")).unwrap();
    let rows = rows(&page);
    for [what, rule, tests] in &rows {
        assert!(!what.is_empty() && !rule.is_empty(), "{what} | {rule}");
        for (path, name) in named_tests(tests) {
            let source = fs::read_to_string(root.join(path))
                .unwrap_or_else(|error| panic!("{path} of \"{what}\": {error}"));
            assert!(has_test(&source, name), "no test {name} in {path}");
        }
    }
    // The page has all 28 pitfalls that apply, and explains why one does not.
    let numbers: BTreeSet<u32> = rows
        .iter()
        .filter_map(|[what, ..]| what.split_once(". ")?.0.parse().ok())
        .collect();
    assert_eq!(numbers, (1..=28).collect());
}

/// The check itself finds each kind of missing test.
#[test]
fn missing_unmarked_and_ignored_tests_are_found() {
    let source =
        "#[test]\nfn real() {}\nfn helper() {}\n#[test]\n#[ignore = \"slow\"]\nfn idle() {}\n";
    let found = ["real", "helper", "idle", "rea", "none"].map(|name| has_test(source, name));
    assert_eq!(found, [true, false, false, false, false]);
    assert_eq!(named_tests("`a/b.rs::c`, `d.rs::e`").len(), 2);
}
