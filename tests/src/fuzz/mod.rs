//! Bodies of the fuzz targets, for the fuzzers of `fuzz/` and for the test that replays their
//! findings.
//!
//! A target accepts any bytes. It panics if a property that must hold for all inputs does not hold.

mod bytes;
mod file;
mod parts;
mod readers;
mod refine;

/// The body of a fuzz target.
pub type Target = fn(&[u8]);

/// Every target by name: one per reader, and one for whole refinements.
pub const TARGETS: [(&str, Target); 14] = [
    ("bop_json", readers::bop_json),
    ("camera_json", readers::camera_json),
    ("cloud", readers::cloud),
    ("gltf", readers::gltf),
    ("image", readers::image),
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
/// If no target has that name, or if a property of the target does not hold.
pub fn run(name: &str, data: &[u8]) {
    let (_, target) = TARGETS
        .iter()
        .find(|(known, _)| *known == name)
        .unwrap_or_else(|| panic!("no fuzz target is named {name}"));
    target(data);
}
