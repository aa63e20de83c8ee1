//! Checks of the files to be written, before anything is computed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::bail;

/// A file that the command line names, with the option that names it.
pub(crate) type Named<'a> = (&'static str, &'a Path);

/// Checks that every output can be written, and that none takes the place of an input or of another output.
///
/// `in_place` lists pairs of options that may name the same file, because the output has the form of the input. What is written to
/// a stream is added to what is there: several may share one, and none takes the place of its input.
pub(crate) fn check(
    outputs: &[Named<'_>],
    inputs: &[Named<'_>],
    in_place: &[(&str, &str)],
) -> anyhow::Result<()> {
    for (index, (option, path)) in outputs.iter().enumerate() {
        hicp_io::check_writable(path)?;
        let is_stream = hicp_io::is_stream(path);
        let earlier = outputs[..index].iter();
        let earlier = earlier.filter(|(_, other)| !(is_stream && hicp_io::is_stream(other)));
        for (other, other_path) in earlier.chain(inputs) {
            let is_in_place = !is_stream && in_place.contains(&(option, other));
            if same_file(path, other_path) && !is_in_place {
                bail!(
                    "{option} and {other} both name {}, expected different files: it would be overwritten",
                    path.display()
                );
            }
        }
    }
    Ok(())
}

/// Checks that no output takes the place of a file of a dataset.
///
/// Those are what is in its folders of models and in those of its splits, also of others than `split`, and beside these its cameras,
/// its description and its targets. A path may name them in any way, by links or `..`. What is not there yet takes no place.
pub(crate) fn check_dataset(
    outputs: &[Named<'_>],
    (dataset, split): (&Path, &str),
) -> anyhow::Result<()> {
    let existing = outputs.iter().filter(|(_, path)| path.exists());
    let existing: Vec<_> = existing.collect();
    if existing.is_empty() {
        return Ok(());
    }
    let parts = parts_of(dataset, split);
    for (option, path) in existing {
        let part = places(path).into_iter().find_map(|p| parts.get(&p));
        if let Some(part) = part {
            bail!(
                "{option} names {}, which is there and belongs to the dataset {} ({part}): it would be overwritten, expected a file of its own",
                path.display(),
                dataset.display()
            );
        }
    }
    Ok(())
}

/// The folders and files of a dataset, with links followed, and what each holds.
fn parts_of(dataset: &Path, split: &str) -> BTreeMap<PathBuf, &'static str> {
    let root = dataset.canonicalize().ok();
    let mut parts = BTreeMap::new();
    let mut add = |path: &Path, what| {
        let real = path.canonicalize().ok();
        // A split may be the dataset's folder itself: not everything there is its.
        let real = real.filter(|real| !root.as_ref().is_some_and(|root| root.starts_with(real)));
        if let Some(real) = real {
            parts.insert(real, what);
        }
    };
    let mut folders = entries(dataset);
    folders.push(dataset.join(split));
    for path in folders {
        if is_annotation(&path) {
            add(&path, "a file beside its folders");
        }
        let is_split = path == dataset.join(split);
        let within = entries(&path);
        // What is in the folder may be links that lead out of it.
        let models = within.iter().filter(|entry| is_model(entry));
        let scenes = within.iter().filter(|entry| is_scene(entry));
        for (what, found, is_named) in [
            ("its models", models.collect::<Vec<_>>(), false),
            ("its scenes", scenes.collect(), is_split),
        ] {
            if is_named || !found.is_empty() {
                add(&path, what);
            }
            found.into_iter().for_each(|entry| add(entry, what));
        }
    }
    parts
}

/// What is in a folder; nothing where it cannot be listed.
fn entries(folder: &Path) -> Vec<PathBuf> {
    let listed = std::fs::read_dir(folder).into_iter().flatten().flatten();
    listed.map(|entry| entry.path()).collect()
}

/// The name of a file, for comparisons.
fn name_of(path: &Path) -> std::borrow::Cow<'_, str> {
    path.file_name().unwrap_or_default().to_string_lossy()
}

fn is_model(path: &Path) -> bool {
    let name = name_of(path);
    name == "models_info.json" || (name.starts_with("obj_") && name.ends_with(".ply"))
}

fn is_scene(path: &Path) -> bool {
    let is_annotation = |name: &str| name.starts_with("scene_") && name.ends_with(".json");
    name_of(path).parse::<u32>().is_ok()
        && entries(path)
            .iter()
            .any(|file| is_annotation(&name_of(file)))
}

/// Whether a file in the dataset's folder is one of those that come with it. Results are often written there.
fn is_annotation(path: &Path) -> bool {
    let name = name_of(path);
    let is_json = name.ends_with(".json");
    name.starts_with("dataset_info")
        || (is_json && (name.starts_with("camera") || name.contains("_targets")))
}

/// Where a path leads and the folders that this is in, and the folders that it leads through.
fn places(path: &Path) -> Vec<PathBuf> {
    let mut places = Vec::new();
    for folder in path.ancestors() {
        places.extend(folder.canonicalize());
        // Whatever comes before has been left again.
        if folder.ends_with("..") {
            break;
        }
    }
    let real = path.canonicalize().unwrap_or_default();
    places.extend(real.ancestors().map(Path::to_owned));
    places
}

/// Whether two paths lead to the same file, which may still have to be made.
pub(crate) fn same_file(a: &Path, b: &Path) -> bool {
    // Devices take anything any number of times.
    let is_device = a.metadata().is_ok_and(|found| !found.is_file());
    let destinations = (hicp_io::destination(a), hicp_io::destination(b));
    !is_device && matches!(destinations, (Ok(a), Ok(b)) if a == b)
}
