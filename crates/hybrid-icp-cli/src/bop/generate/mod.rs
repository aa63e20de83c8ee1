//! `hybrid-icp bop generate`.

mod objects;
mod scenes;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::Args;
use hicp_io::bop::{
    Dataset, ModelInfo, ResultRow, write_models_info, write_results, write_targets,
};
use hicp_io::{LengthUnit, write_ply};
use hybrid_icp::core::PinholeCamera;
use rayon::prelude::*;
use serde_json::json;

use self::objects::Objects;
use self::scenes::{DEPTH_SCALE, Generator, ImageRecord};
use super::options::ThreadOptions;
use crate::interrupt;
use crate::options::positive;
use crate::outputs::write_json;
use crate::terminal::{progress_bar, say};

/// Generate a dataset of cluttered scenes, to try all commands without real data.
///
/// A scene has objects on a table and images of them from all sides. The depth has the noise of an
/// Intel D435. The dataset has masks, true poses, models and targets in the BOP layout. It also has
/// two result files: initial_synthetic-test.csv with perturbed poses to refine, and
/// truth_synthetic-test.csv with the true poses. The same options give the same bytes.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(crate) struct Arguments {
    /// The folder to write to, which must be new or empty. It appears when it is complete.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// A folder of meshes (PLY, OBJ, STL) or BOP models (models_info.json with obj_000001.ply, …).
    /// Ids are kept if all meshes have one in their names, else the meshes are numbered from 1 by
    /// name. Without the option, the twenty household objects are used.
    #[arg(long, value_name = "DIR")]
    objects: Option<PathBuf>,
    /// The length unit of the meshes: m, mm or cm. BOP models are always in mm.
    #[arg(long, value_name = "UNIT", default_value = "m")]
    objects_unit: LengthUnit,
    /// Number of scenes.
    #[arg(long, value_name = "N", value_parser = count(), allow_negative_numbers = true)]
    scenes: u32,
    /// Number of images per scene.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = count(), allow_negative_numbers = true)]
    images: u32,
    /// Move the camera along a path toward and around the objects, instead of placing it on all
    /// sides. `bop sequence` needs such a path.
    #[arg(long)]
    trajectory: bool,
    /// Move an object in front of the camera, which stands still. The object moves at up to 0.3 m/s
    /// and 90 degrees/s, in 30 images per second. A hand passes in front of it; every second
    /// sequence of at least 5 s has a hand that hides it for 1 to 3 s. The object of scene N is the
    /// N-th, and its first instance. `bop track` tracks it.
    #[arg(long, conflicts_with = "trajectory")]
    moving: bool,
    /// Number of objects per scene. An object may appear several times.
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=40), allow_negative_numbers = true)]
    instances: u32,
    /// Number of perturbed poses per object that is at least a tenth visible. The n-th of each has
    /// the score 1/n, so that an evaluation uses the first ones.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = count(), allow_negative_numbers = true)]
    starts: u32,
    /// Size of the perturbation in units of the mean errors of a sampling-based estimator (6.2 mm
    /// and 9.5 degrees). Translation and rotation are each drawn from 0.5 to 1.5 times this size.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = perturbation, allow_negative_numbers = true)]
    perturbation: f64,
    /// Seed of the random numbers.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    threads: ThreadOptions,
}

fn count() -> clap::builder::RangedI64ValueParser<u32> {
    clap::value_parser!(u32).range(1..=100_000)
}

/// The largest `--perturbation`. Larger values would write numbers of any size.
const MAX_PERTURBATION: f64 = 1000.0;

fn perturbation(text: &str) -> Result<f64, String> {
    positive(text)
        .ok()
        .filter(|x| *x <= MAX_PERTURBATION)
        .ok_or_else(|| format!("expected a number above 0 and at most {MAX_PERTURBATION}"))
}

/// The largest number of images: their annotations stay in memory until all are done.
const MAX_IMAGES: u64 = 1_000_000;

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop generate --scenes 2 --out synthetic
  hybrid-icp bop refine --dataset synthetic --output refined.csv \\
      --results synthetic/initial_synthetic-test.csv
  hybrid-icp bop eval --dataset synthetic --results refined.csv";

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let objects = match &arguments.objects {
        Some(dir) => Objects::read(dir, arguments.objects_unit)?,
        None => Objects::household()?,
    };
    let n_images = u64::from(arguments.scenes) * u64::from(arguments.images);
    if n_images > MAX_IMAGES {
        bail!(
            "--scenes {} with --images {} give {n_images} images, expected at most {MAX_IMAGES} in all",
            arguments.scenes,
            arguments.images
        );
    }
    check_folder(&arguments.out)?;
    // The folder gets its name when it is complete.
    let made = interrupt::begin_folder(&arguments.out)?;
    let out = made.path();
    let camera = PinholeCamera::new(570.0, 570.0, 319.5, 239.5, 640, 480)?;
    write_camera(out, &camera)?;
    write_models(out, &objects)?;
    make_folder(&out.join("test"))?;
    let generator = Generator {
        dir: out.join("test"),
        objects: &objects,
        camera,
        seed: arguments.seed,
        instances: arguments.instances as usize,
        images: arguments.images as usize,
        path: arguments.trajectory,
        moving: arguments.moving,
        starts: arguments.starts,
        perturbation: arguments.perturbation,
    };
    for scene in 1..=arguments.scenes {
        for folder in ["", "depth", "mask", "mask_visib"] {
            make_folder(&generator.scene_dir(scene).join(folder))?;
        }
    }
    let images = (1..=arguments.scenes)
        .flat_map(|scene| (0..arguments.images).map(move |image| (scene, image)));
    let images: Vec<(u32, u32)> = images.collect();
    let pool = arguments.threads.pool(images.len())?;
    let progress = progress_bar(images.len(), "images");
    let records: anyhow::Result<Vec<ImageRecord>> = pool.install(|| {
        let images = images.par_iter().with_max_len(1);
        let records = images.map(|(scene, image)| {
            let record = generator.image(*scene, *image);
            progress.inc(1);
            record
        });
        records.collect()
    });
    progress.finish_and_clear();
    let records = records?;
    generator.write_annotations(&records)?;
    let targets = scenes::targets(&records);
    write_targets(out.join("test_targets_bop19.json"), &targets)?;
    let rows = |of: fn(&ImageRecord) -> &[ResultRow]| -> Vec<ResultRow> {
        records.iter().flat_map(of).cloned().collect()
    };
    let initial = rows(|record| &record.initial);
    write_results(out.join("initial_synthetic-test.csv"), &initial)?;
    let truth = rows(|record| &record.truth);
    write_results(out.join("truth_synthetic-test.csv"), &truth)?;
    interrupt::finish_folder(made)?;
    say(format_args!(
        "{}: {} images of {} scenes, {} targets, {} rows in initial_synthetic-test.csv",
        arguments.out.display(),
        records.len(),
        arguments.scenes,
        targets.len(),
        initial.len(),
    ))
}

/// Creates a folder in an existing one.
///
/// It never creates the parent, so an unfinished dataset does not reappear while it is removed.
fn make_folder(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir(folder).with_context(|| cannot_make(folder))
}

fn cannot_make(folder: &Path) -> String {
    format!("cannot create the folder {}", folder.display())
}

/// Checks that a folder is empty. If it does not exist, creates the folders above it.
fn check_folder(out: &Path) -> anyhow::Result<()> {
    if !out.exists() {
        let parent = out.parent().unwrap_or(Path::new(""));
        return std::fs::create_dir_all(parent).with_context(|| cannot_make(parent));
    }
    let entries =
        std::fs::read_dir(out).with_context(|| format!("cannot list {}", out.display()))?;
    match entries.count() {
        0 => Ok(()),
        found => bail!(
            "--out {} has {found} entries, expected a new or empty folder",
            out.display()
        ),
    }
}

fn write_models(out: &Path, objects: &Objects) -> anyhow::Result<()> {
    let dir = out.join("models");
    make_folder(&dir)?;
    let mut infos = BTreeMap::new();
    for (id, model) in objects.ids.iter().zip(&objects.models) {
        let path = Dataset::model_path_in(&dir, *id);
        write_ply(path, model.mesh(), LengthUnit::Millimeters)?;
        let info = ModelInfo {
            diameter_m: model.diameter(),
            symmetries: model.symmetries().clone(),
        };
        infos.insert(*id, info);
    }
    Ok(write_models_info(dir.join("models_info.json"), &infos)?)
}

fn write_camera(out: &Path, camera: &PinholeCamera) -> anyhow::Result<()> {
    let value = json!({
        "cx": camera.cx(), "cy": camera.cy(), "fx": camera.fx(), "fy": camera.fy(),
        "width": camera.width(), "height": camera.height(), "depth_scale": DEPTH_SCALE,
    });
    write_json(&out.join("camera.json"), &value)
}
