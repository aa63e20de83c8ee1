//! What the fuzzers of `fuzz/` run, and what `tests/fuzz_regressions.rs` runs on their findings.
//!
//! A target takes any bytes and panics where something does not hold that must hold of all of them.

mod bytes;
mod file;
mod parts;
mod readers;
mod refine;

/// A body of a fuzz target.
pub type Target = fn(&[u8]);

/// Every target by name: one per reader, and whole refinements.
pub const TARGETS: [(&str, Target); 11] = [
    ("bop_json", readers::bop_json),
    ("camera_json", readers::camera_json),
    ("obj", readers::obj),
    ("pipeline_toml", readers::pipeline_toml),
    ("ply", readers::ply),
    ("png", readers::png),
    ("pose_json", readers::pose_json),
    ("refine", refine::refine),
    ("results_csv", readers::results_csv),
    ("rle", readers::rle),
    ("stl", readers::stl),
];

/// Runs a target.
///
/// # Panics
///
/// When there is no target of that name, or when what must hold does not.
pub fn run(name: &str, data: &[u8]) {
    let (_, target) = TARGETS
        .iter()
        .find(|(known, _)| *known == name)
        .unwrap_or_else(|| panic!("no fuzz target is called {name}"));
    target(data);
}
