//! The settings that the results of `bop refine` depend on.

use std::collections::BTreeSet;
use std::fmt::{self, Write as _};
use std::hash::{DefaultHasher, Hasher};
use std::io::ErrorKind;
use std::path::Path;
use std::time::UNIX_EPOCH;

use hicp_bop::ModelFolder;
use hicp_io::bop::{Dataset, ResultRow};

use super::job::RefineJob;

/// Version of the journal's format.
const FORM: u32 = 5;

/// Returns the settings of a job as a line of text: its options and the state of its files.
///
/// A run continues only a run with equal settings. Images are left out because there are too many.
pub(super) fn of(job: &RefineJob<'_>, rows: &[ResultRow], folder: &ModelFolder) -> String {
    let root = &job.dataset.root;
    let dataset = root.canonicalize().unwrap_or_else(|_| root.clone());
    let pipeline = &job.pipeline;
    let mut settings = vec![
        format!("journal of bop refine, form {FORM}"),
        format!("hybrid-icp={}", env!("CARGO_PKG_VERSION")),
        format!("--dataset={}", dataset.display()),
        format!("--split={}", job.dataset.split),
        format!("--pipeline={}", pipeline.name),
    ];
    let chosen = job.choice.settings().into_iter();
    settings.extend(chosen.map(|(option, value)| {
        let value = value.as_deref().unwrap_or("none");
        format!("{option}={value}")
    }));
    settings.push(format!("digest-of-results={}", digest(&rows)));
    settings.push(format!("digest-of-masks={}", digest(&job.masks)));
    let parts = (&pipeline.toml, &pipeline.overrides);
    settings.push(format!("digest-of-pipeline={}", digest(&parts)));
    settings.push(format!("--no-color={}", job.models.no_color));
    settings.extend(files(job, rows, folder));
    settings.join(", ").replace('\n', " ")
}

/// Returns the files that describe the models and scenes of the rows, each with its state.
///
/// Files with equal size and modification time count as equal, because reading all of them would
/// take as long as some runs.
fn files(job: &RefineJob<'_>, rows: &[ResultRow], folder: &ModelFolder) -> Vec<String> {
    let objects: BTreeSet<u32> = rows.iter().map(|row| row.obj_id).collect();
    let scenes: BTreeSet<u32> = rows.iter().map(|row| row.scene_id).collect();
    let mut paths = vec![folder.info_path().to_owned()];
    let models = objects.iter();
    paths.extend(models.map(|id| Dataset::model_path_in(folder.dir(), *id)));
    let split = job.dataset.root.join(&job.dataset.split);
    for scene in scenes {
        let folder = split.join(format!("{scene:06}"));
        let names = ["scene_camera", "scene_gt", "scene_gt_info"];
        let names = names.map(|name| job.dataset.of_sensor(name) + ".json");
        paths.extend(names.map(|name| folder.join(name)));
    }
    let named = |path: &Path| {
        let inside = path.strip_prefix(&job.dataset.root).unwrap_or(path);
        format!("{}={}", inside.display(), state(path))
    };
    paths.iter().map(|path| named(path)).collect()
}

/// Describes a file by its size and its modification time in nanoseconds since 1970.
fn state(path: &Path) -> String {
    let state = std::fs::metadata(path).and_then(|metadata| {
        let changed = metadata.modified()?.duration_since(UNIX_EPOCH);
        let nanoseconds = changed.unwrap_or_default().as_nanos();
        Ok(format!("{}-bytes@{nanoseconds}", metadata.len()))
    });
    state.unwrap_or_else(|error| match error.kind() {
        ErrorKind::NotFound => "absent".to_owned(),
        _ => error.to_string(),
    })
}

/// Returns a digest of the debug text of a value without storing the text.
fn digest(value: &impl fmt::Debug) -> String {
    struct Digest(DefaultHasher);
    impl fmt::Write for Digest {
        fn write_str(&mut self, text: &str) -> fmt::Result {
            self.0.write(text.as_bytes());
            Ok(())
        }
    }
    let mut digest = Digest(DefaultHasher::new());
    // Hashing does not fail.
    let _ = write!(digest, "{value:?}");
    format!("{:016x}", digest.0.finish())
}
