//! What the results of a `bop refine` depend on.

use std::fmt::{self, Write as _};
use std::hash::{DefaultHasher, Hasher};

use clap::ValueEnum as _;
use hicp_bop::MaskSource;
use hicp_io::bop::ResultRow;

use super::refine::Arguments;
use crate::choice::Pipeline;

/// Returns what the results depend on, by option: a run goes on only with the work of one that has the same.
pub(super) fn of(
    arguments: &Arguments,
    pipeline: &Pipeline,
    rows: &[ResultRow],
    masks: &MaskSource,
) -> Vec<(&'static str, String)> {
    let stated = |value: Option<String>| value.unwrap_or_else(|| "not given".to_owned());
    let dataset = arguments.dataset.canonicalize();
    let dataset = dataset.unwrap_or_else(|_| arguments.dataset.clone());
    let mask = arguments.mask.to_possible_value();
    let targets = arguments.targets.as_ref();
    let detections = match masks {
        MaskSource::Detections(by_frame) => Some(digest(by_frame)),
        _ => None,
    };
    vec![
        ("hybrid-icp", env!("CARGO_PKG_VERSION").to_owned()),
        ("--dataset", dataset.display().to_string()),
        ("--split", arguments.split.clone()),
        ("--limit", stated(arguments.limit.map(|n| n.to_string()))),
        ("--top-k", stated(arguments.top_k.map(|k| k.to_string()))),
        (
            "--targets",
            stated(targets.map(|path| path.display().to_string())),
        ),
        ("--shard", stated(arguments.shard.map(|s| s.to_string()))),
        ("--results with the digest", digest(&rows)),
        (
            "--mask",
            mask.map_or_else(String::new, |m| m.get_name().to_owned()),
        ),
        ("--detections with the digest", stated(detections)),
        ("--pipeline", pipeline.name().to_owned()),
        (
            "--pipeline with the digest",
            digest(&(pipeline.toml(), pipeline.overrides())),
        ),
    ]
}

/// A digest of all that the debug form of a value shows.
fn digest(value: &impl fmt::Debug) -> String {
    struct Digest(DefaultHasher);
    impl fmt::Write for Digest {
        fn write_str(&mut self, text: &str) -> fmt::Result {
            self.0.write(text.as_bytes());
            Ok(())
        }
    }
    let mut digest = Digest(DefaultHasher::new());
    // Nothing above fails.
    let _ = write!(digest, "{value:?}");
    format!("{:016x}", digest.0.finish())
}
