//! Checks the files of a command before anything is computed.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use hicp_picture::Picture;
use serde::Serialize;

/// Checks that pictures have the name of a PNG file, which they are.
pub(crate) fn check_png<'a>(
    option: &str,
    paths: impl IntoIterator<Item = &'a PathBuf>,
) -> anyhow::Result<()> {
    for path in paths {
        let extension = path.extension();
        if extension.is_some_and(|found| !found.eq_ignore_ascii_case("png")) {
            bail!(
                "{option} names {}, expected a name that ends with .png",
                path.display()
            );
        }
    }
    Ok(())
}

/// Writes a picture as PNG.
pub(crate) fn write_picture(path: &Path, picture: &Picture) -> Result<(), hicp_io::IoError> {
    hicp_io::write_rgb_png(path, picture.width, picture.height, &picture.rgb)
}

/// Writes a value as indented JSON.
pub(crate) fn write_json(path: &Path, value: &impl Serialize) -> anyhow::Result<()> {
    let json = serde_json::to_string_pretty(value).context("cannot write JSON")?;
    hicp_io::write_atomically(path, |file| writeln!(file, "{json}"))?;
    Ok(())
}

/// The files that a command reads and writes, with the options that name them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Files<'a> {
    read: Vec<(&'static str, &'a Path)>,
    written: Vec<(&'static str, &'a Path)>,
}

impl<'a> Files<'a> {
    /// Adds inputs.
    pub(crate) fn reads(
        mut self,
        option: &'static str,
        paths: impl IntoIterator<Item = &'a PathBuf>,
    ) -> Self {
        let paths = paths.into_iter();
        self.read.extend(paths.map(|path| (option, path.as_path())));
        self
    }

    /// Adds outputs.
    pub(crate) fn writes(
        mut self,
        option: &'static str,
        paths: impl IntoIterator<Item = &'a PathBuf>,
    ) -> Self {
        let paths = paths.into_iter();
        self.written
            .extend(paths.map(|path| (option, path.as_path())));
        self
    }

    /// Checks that every output can be written and that none replaces an input or another output.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        self.check_in_place("", "")
    }

    /// Checks the files, but allows the output of one option to replace the input of another.
    pub(crate) fn check_in_place(&self, output: &str, input: &str) -> anyhow::Result<()> {
        for (index, (option, path)) in self.written.iter().enumerate() {
            hicp_io::check_writable(path)?;
            let before = self.written[..index]
                .iter()
                .find(|(_, other)| other == path);
            if let Some((other, _)) = before.filter(|_| *path == Path::new("-")) {
                bail!("{option} and {other} both write to standard output, expected only one");
            }
            for (other, other_path) in self.written[..index].iter().chain(&self.read) {
                if (*option, *other) != (output, input) && same_file(path, other_path) {
                    bail!(
                        "{option} and {other} both name {}, which would be overwritten: expected different files",
                        path.display()
                    );
                }
            }
        }
        Ok(())
    }

    /// Checks that no output replaces a file of a dataset.
    ///
    /// These files are the models, the files of scenes, and the annotations of the whole. Result
    /// files inside the dataset's folder may be replaced, and so may the inputs that
    /// [`Files::check_in_place`] allows. Links in either path are followed. Other code checks that
    /// a file in the place of a journal is a journal.
    pub(crate) fn spare_dataset(&self, root: &Path, split: &str) -> anyhow::Result<()> {
        let replaces_input = |path: &Path| self.read.iter().any(|(_, read)| same_file(path, read));
        let mut parts = None;
        for (option, path) in &self.written {
            if !path.exists() || is_journal(path) || replaces_input(path) {
                continue;
            }
            let parts = parts.get_or_insert_with(|| parts_of(root, split));
            if places(path).iter().any(|place| parts.contains(place)) {
                bail!(
                    "{option} names {}, which belongs to the dataset {} (its scenes, models or targets) \
                     and would be overwritten: expected another file",
                    path.display(),
                    root.display()
                );
            }
        }
        Ok(())
    }
}

/// Returns the path of an output's journal, a file next to it; `None` for outputs that are streams.
pub(crate) fn journal_of(output: &Path) -> Option<PathBuf> {
    let mut name = output.as_os_str().to_owned();
    name.push(".journal");
    (!hicp_io::is_stream(output)).then(|| name.into())
}

fn is_journal(path: &Path) -> bool {
    path.extension().is_some_and(|end| end == "journal")
}

/// Returns whether two paths lead to the same file, which need not exist yet.
pub(crate) fn same_file(a: &Path, b: &Path) -> bool {
    let destinations = (hicp_io::destination(a), hicp_io::destination(b));
    // A stream can be written to any number of times.
    !hicp_io::is_stream(a) && matches!(destinations, (Ok(a), Ok(b)) if a == b)
}

/// Returns the folders and files that a dataset consists of, with links followed.
fn parts_of(root: &Path, split: &str) -> BTreeSet<PathBuf> {
    let mut parts = Vec::new();
    for folder in entries(root).into_iter().chain([root.join(split)]) {
        let mut within = entries(&folder);
        within.retain(|path| is_model(path) || is_scene(path));
        if is_annotation(&folder) || !within.is_empty() {
            parts.push(folder);
        }
        parts.append(&mut within);
    }
    let mut parts: BTreeSet<PathBuf> = parts.iter().flat_map(|p| p.canonicalize()).collect();
    // With the split `.`, the root contains scenes, but it may also contain result files.
    let root = root.canonicalize().unwrap_or_default();
    parts.retain(|part| !root.starts_with(part));
    parts
}

/// Returns the entries of a folder; none if it cannot be listed.
pub(crate) fn entries(folder: &Path) -> Vec<PathBuf> {
    let listed = std::fs::read_dir(folder).into_iter().flatten().flatten();
    listed.map(|entry| entry.path()).collect()
}

fn name_of(path: &Path) -> std::borrow::Cow<'_, str> {
    path.file_name().unwrap_or_default().to_string_lossy()
}

fn is_model(path: &Path) -> bool {
    let name = name_of(path);
    name == "models_info.json" || (name.starts_with("obj_") && name.ends_with(".ply"))
}

fn is_scene(path: &Path) -> bool {
    let is_annotation = |name: &str| name.starts_with("scene_") && name.ends_with(".json");
    let holds = |is: &dyn Fn(&str) -> bool| entries(path).iter().any(|file| is(&name_of(file)));
    name_of(path).parse::<u32>().is_ok() && holds(&is_annotation)
}

/// Returns whether a file next to the dataset's folders belongs to the dataset.
fn is_annotation(path: &Path) -> bool {
    let name = name_of(path);
    let is_json = name.ends_with(".json");
    name.starts_with("dataset_info")
        || (is_json && (name.starts_with("camera") || name.contains("_targets")))
}

/// Returns the destination of a path, the folders around it, and the folders that the path passes.
fn places(path: &Path) -> Vec<PathBuf> {
    // The folders before `..` are left again, so they do not count.
    let passed = path.ancestors().take_while(|path| !path.ends_with(".."));
    let mut places: Vec<PathBuf> = passed.flat_map(|path| path.canonicalize()).collect();
    let real = places.first().cloned().unwrap_or_default();
    places.extend(real.ancestors().map(Path::to_owned));
    places
}
