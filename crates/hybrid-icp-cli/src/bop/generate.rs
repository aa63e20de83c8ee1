//! `hybrid-icp bop generate`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::Args;
use hicp_io::bop::{self, GroundTruth, GroundTruthInfo, ModelInfo, ResultRow, SceneCamera, Target};
use hicp_io::{LengthUnit, write_depth_png, write_mask_png, write_ply};
use hicp_sim::{
    AxialPolynomial, Clutter, ClutterView, DepthNoise, DepthSensor, Dropout,
    MEAN_ROTATION_ERROR_DEGREES, MEAN_TRANSLATION_ERROR_METERS, SeenObject, perturb, stream,
};
use hybrid_icp::{Mask, Matrix3, Model, PinholeCamera};
use rand::RngExt as _;
use rayon::prelude::*;
use serde_json::json;

use super::objects::Objects;
use super::{progress_bar, thread_pool};
use crate::interrupt;
use crate::terminal::say;

/// Make a dataset of cluttered scenes, to try everything without one.
///
/// Every scene has objects standing on a table, and images of them from all sides: depth with the noise of an Intel D435,
/// masks, true poses, models and targets in the BOP layout. Beside them are two result files: initial_synthetic-test.csv with
/// perturbed poses to refine, and truth_synthetic-test.csv. The same options make the same bytes.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(crate) struct Arguments {
    /// The folder to write to: new or empty. It is made beside, and there when it is whole.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// A folder of meshes (PLY, OBJ, STL), or of BOP models (models_info.json with obj_000001.ply, …); the twenty household
    /// objects if not given.
    #[arg(long, value_name = "DIR")]
    objects: Option<PathBuf>,
    /// The length unit of the meshes: m, mm or cm. BOP models are in mm whatever it says.
    #[arg(long, value_name = "UNIT", default_value = "m")]
    objects_unit: LengthUnit,
    /// Number of scenes.
    #[arg(long, value_name = "N", value_parser = count(), allow_negative_numbers = true)]
    scenes: u32,
    /// Images of every scene.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = count(), allow_negative_numbers = true)]
    images: u32,
    /// Move the camera along a path through the images of a scene, nearer and round the objects, instead of looking from all
    /// sides: for bop sequence.
    #[arg(long)]
    trajectory: bool,
    /// Objects of every scene; one may be there several times.
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=40), allow_negative_numbers = true)]
    instances: u32,
    /// Perturbed poses of every object that is at least a tenth visible.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = count(), allow_negative_numbers = true)]
    starts: u32,
    /// How far off these are, in the mean errors of a sampling-based estimator (6.2 mm and 9.5 degrees): half to one and a half
    /// times this, drawn for translation and rotation apart.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = perturbation, allow_negative_numbers = true)]
    perturbation: f64,
    /// Where the random numbers come from.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Threads; the number of cores if not given. No byte depends on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), allow_negative_numbers = true)]
    threads: Option<u16>,
}

fn count() -> clap::builder::RangedI64ValueParser<u32> {
    clap::value_parser!(u32).range(1..=100_000)
}

/// The largest `--perturbation`: beyond it no object is near its place, and numbers of any size would be written.
const MAX_PERTURBATION: f64 = 1000.0;

fn perturbation(text: &str) -> Result<f64, String> {
    super::positive(text)
        .ok()
        .filter(|x| *x <= MAX_PERTURBATION)
        .ok_or_else(|| format!("expected a number above 0 and at most {MAX_PERTURBATION}"))
}

/// The largest number of images: what is told of them is held until all are there.
const MAX_IMAGES: u64 = 1_000_000;

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop generate --scenes 2 --out synthetic
  hybrid-icp bop refine --dataset synthetic --output refined.csv \\
      --results synthetic/initial_synthetic-test.csv
  hybrid-icp bop eval --dataset synthetic --results refined.csv";

/// Millimetres per unit of the depth images.
const DEPTH_SCALE: f64 = 0.1;
/// Visible part from which an instance is a target, as in the benchmark.
const MIN_VISIBLE: f64 = 0.1;
/// A perturbation against the mean one (§VI-A.4), translation and rotation each.
const PERTURBATION: std::ops::Range<f64> = 0.5..1.5;

/// What is told of an image in the files of its scene and of the dataset.
struct ImageRecord {
    scene_id: u32,
    im_id: u32,
    camera: SceneCamera,
    truths: Vec<GroundTruth>,
    infos: Vec<GroundTruthInfo>,
    initial: Vec<ResultRow>,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let objects = match &arguments.objects {
        Some(dir) => Objects::read(dir, arguments.objects_unit)?,
        None => Objects::household()?,
    };
    let n_images = u64::from(arguments.scenes) * u64::from(arguments.images);
    if n_images > MAX_IMAGES {
        bail!(
            "--scenes {} of --images {} are {n_images} images, expected at most {MAX_IMAGES} in all",
            arguments.scenes,
            arguments.images
        );
    }
    check_folder(&arguments.out)?;
    // Whoever sees the dataset sees all of it.
    let made = interrupt::begin_folder(&arguments.out)?;
    let out = made.path();
    write_models(out, &objects)?;
    let camera = PinholeCamera::new(570.0, 570.0, 319.5, 239.5, 640, 480)?;
    write_camera(out, &camera)?;

    let images: Vec<(u32, u32)> = (1..=arguments.scenes)
        .flat_map(|scene| (0..arguments.images).map(move |image| (scene, image)))
        .collect();
    let models: Vec<Model> = objects
        .models
        .iter()
        .map(|(_, model)| model.clone())
        .collect();
    let generator = Generator {
        arguments,
        out,
        ids: objects.models.iter().map(|(id, _)| *id).collect(),
        models,
        camera,
        sensor: sensor(),
    };
    make_folder(&out.join("test"))?;
    for scene in 1..=arguments.scenes {
        for folder in ["", "depth", "mask", "mask_visib"] {
            make_folder(&generator.scene_dir(scene).join(folder))?;
        }
    }
    let pool = thread_pool(arguments.threads, images.len())?;
    let progress = progress_bar(images.len(), "images");
    let records: Vec<ImageRecord> = pool.install(|| {
        let images = images.par_iter().with_max_len(1);
        images
            .map(|(scene, image)| {
                let record = generator.image(*scene, *image);
                progress.inc(1);
                record
            })
            .collect::<anyhow::Result<_>>()
    })?;
    progress.finish_and_clear();
    write_annotations(&generator, &records)?;
    let initial: Vec<ResultRow> = records.iter().flat_map(|r| r.initial.clone()).collect();
    bop::write_results(out.join("initial_synthetic-test.csv"), &initial)?;
    bop::write_results(out.join("truth_synthetic-test.csv"), &truth(&records))?;
    interrupt::finish_folder(made)?;
    say(format_args!(
        "{}: {} images of {} scenes, {} targets, {} rows in initial_synthetic-test.csv",
        arguments.out.display(),
        records.len(),
        arguments.scenes,
        targets(&records).len(),
        initial.len(),
    ))
}

/// The axial noise of a D435, its millimetre steps, and no depth at grazing angles and edges.
fn sensor() -> DepthSensor {
    DepthSensor {
        noise: DepthNoise::Axial(AxialPolynomial::d435_ahn2019_axial()),
        quantization_meters: Some(0.001),
        dropout: Dropout {
            max_incidence_degrees: Some(80.0),
            edge_pixels: 1,
        },
    }
}

/// Makes a folder in one that is there: whoever removes what is unfinished does not meet it again.
fn make_folder(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir(folder).with_context(|| cannot_make(folder))
}

fn cannot_make(folder: &Path) -> String {
    format!("cannot make the folder {}", folder.display())
}

/// Refuses a folder that has something in it, and makes those that it is to be in.
fn check_folder(out: &Path) -> anyhow::Result<()> {
    if !out.exists() {
        if let Some(parent) = out.parent().filter(|p| !p.as_os_str().is_empty()) {
            std::fs::create_dir_all(parent).with_context(|| cannot_make(parent))?;
        }
        return Ok(());
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
    for (id, model) in &objects.models {
        let path = bop::Dataset::model_path_in(&dir, *id);
        write_ply(path, model.mesh(), LengthUnit::Millimeters)?;
        let info = ModelInfo {
            diameter_m: model.diameter(),
            symmetries: model.symmetries().clone(),
        };
        infos.insert(*id, info);
    }
    bop::write_models_info(dir.join("models_info.json"), &infos)?;
    Ok(())
}

fn write_camera(out: &Path, camera: &PinholeCamera) -> anyhow::Result<()> {
    let value = json!({
        "cx": camera.cx(), "cy": camera.cy(), "fx": camera.fx(), "fy": camera.fy(),
        "width": camera.width(), "height": camera.height(), "depth_scale": DEPTH_SCALE,
    });
    hicp_io::write_atomically(out.join("camera.json"), |writer| {
        writeln!(writer, "{value:#}")
    })?;
    Ok(())
}

struct Generator<'a> {
    arguments: &'a Arguments,
    /// Where the dataset is made.
    out: &'a Path,
    ids: Vec<u32>,
    models: Vec<Model>,
    camera: PinholeCamera,
    sensor: DepthSensor,
}

impl Generator<'_> {
    fn scene_dir(&self, scene: u32) -> PathBuf {
        self.out.join(format!("test/{scene:06}"))
    }

    /// Makes an image and writes its files. Every image is drawn from streams of its own, so their order means nothing.
    fn image(&self, scene_id: u32, im_id: u32) -> anyhow::Result<ImageRecord> {
        let (seed, place) = (
            self.arguments.seed,
            (u64::from(scene_id) << 32) + u64::from(im_id),
        );
        let mut placing = stream(seed, &["bop", "scene"], u64::from(scene_id));
        let count = self.arguments.instances as usize;
        let clutter = Clutter::draw(&mut placing, &self.models, count)?;
        let mut looking = stream(seed, &["bop", "view"], place);
        let (models, camera, sensor) = (&self.models, &self.camera, &self.sensor);
        let view = if self.arguments.trajectory {
            let mut moving = stream(seed, &["bop", "path"], u64::from(scene_id));
            let images = self.arguments.images as usize;
            let path = clutter.path(&mut moving, camera, images);
            clutter.view_from(&mut looking, path[im_id as usize], models, camera, sensor)?
        } else {
            clutter.view(&mut looking, models, camera, sensor)?
        };
        self.write_images(scene_id, im_id, &view)?;

        let infos: Vec<GroundTruthInfo> = view.instances.iter().map(info).collect();
        let mut starting = stream(seed, &["bop", "start"], place);
        let mut initial = Vec::new();
        for (instance, info) in view.instances.iter().zip(&infos) {
            if !is_target(info) {
                continue;
            }
            for _ in 0..self.arguments.starts {
                let mut factor = || {
                    PERTURBATION.start
                        + (PERTURBATION.end - PERTURBATION.start) * starting.random::<f64>()
                };
                let off = self.arguments.perturbation;
                let translation = off * MEAN_TRANSLATION_ERROR_METERS * factor();
                let angle = (off * MEAN_ROTATION_ERROR_DEGREES * factor()).to_radians();
                let truth = &instance.camera_from_object;
                let pose = perturb(&mut starting, truth, translation, angle);
                initial.push(ResultRow::new(
                    scene_id,
                    im_id,
                    self.ids[instance.model],
                    pose,
                ));
            }
        }
        let truth = |instance: &SeenObject| GroundTruth {
            obj_id: self.ids[instance.model],
            camera_from_object: instance.camera_from_object,
        };
        let camera = &self.camera;
        Ok(ImageRecord {
            scene_id,
            im_id,
            camera: SceneCamera {
                matrix: Matrix3::new(
                    camera.fx(),
                    0.0,
                    camera.cx(),
                    0.0,
                    camera.fy(),
                    camera.cy(),
                    0.0,
                    0.0,
                    1.0,
                ),
                image_size: None,
                depth_scale: Some(DEPTH_SCALE),
                camera_from_world: Some(view.camera_from_world),
            },
            truths: view.instances.iter().map(truth).collect(),
            infos,
            initial,
        })
    }

    fn write_images(&self, scene_id: u32, im_id: u32, view: &ClutterView) -> anyhow::Result<()> {
        let dir = self.scene_dir(scene_id);
        let depth = dir.join(format!("depth/{im_id:06}.png"));
        write_depth_png(depth, &view.depth, DEPTH_SCALE)?;
        for (index, instance) in view.instances.iter().enumerate() {
            let name = format!("{im_id:06}_{index:06}.png");
            write_mask_png(dir.join("mask").join(&name), &instance.silhouette)?;
            write_mask_png(dir.join("mask_visib").join(&name), &instance.visible)?;
        }
        Ok(())
    }
}

/// What is visible of an instance; its silhouette is that inside the image.
fn info(instance: &SeenObject) -> GroundTruthInfo {
    let (all, bbox_object) = extent(&instance.silhouette);
    let (visible, bbox_visible) = extent(&instance.visible);
    GroundTruthInfo {
        visible_fraction: Some(f64::from(visible) / f64::from(all.max(1))),
        bbox_object: Some(bbox_object),
        bbox_visible: Some(bbox_visible),
        visible_pixels: Some(visible),
    }
}

/// Number of pixels of a mask, and their box: x, y, width, height, -1 without any.
fn extent(mask: &Mask) -> (u32, [f64; 4]) {
    let (mut low, mut high, mut pixels) = ((u32::MAX, u32::MAX), (0, 0), 0);
    let rows = mask.pixels().chunks_exact(mask.width() as usize);
    for (v, row) in (0..).zip(rows) {
        for (u, _) in (0..).zip(row).filter(|(_, set)| **set) {
            low = (low.0.min(u), low.1.min(v));
            high = (high.0.max(u + 1), high.1.max(v + 1));
            pixels += 1;
        }
    }
    if pixels == 0 {
        return (0, [-1.0; 4]);
    }
    let bounds = [low.0, low.1, high.0 - low.0, high.1 - low.1];
    (pixels, bounds.map(f64::from))
}

fn is_target(info: &GroundTruthInfo) -> bool {
    info.visible_fraction.unwrap_or(0.0) >= MIN_VISIBLE
}

/// Instances of a record that are targets.
fn wanted(record: &ImageRecord) -> impl Iterator<Item = &GroundTruth> {
    let both = record.truths.iter().zip(&record.infos);
    both.filter(|(_, info)| is_target(info))
        .map(|(truth, _)| truth)
}

fn targets(records: &[ImageRecord]) -> Vec<Target> {
    let mut targets = Vec::new();
    for record in records {
        let mut counts: BTreeMap<u32, u32> = BTreeMap::new();
        for truth in wanted(record) {
            *counts.entry(truth.obj_id).or_default() += 1;
        }
        let of_image = counts.into_iter().map(|(obj_id, inst_count)| Target {
            scene_id: record.scene_id,
            im_id: record.im_id,
            obj_id,
            inst_count,
        });
        targets.extend(of_image);
    }
    targets
}

fn truth(records: &[ImageRecord]) -> Vec<ResultRow> {
    let row = |record: &ImageRecord, truth: &GroundTruth| {
        let (scene, image) = (record.scene_id, record.im_id);
        ResultRow::new(scene, image, truth.obj_id, truth.camera_from_object)
    };
    let rows = records
        .iter()
        .flat_map(|r| wanted(r).map(move |t| row(r, t)));
    rows.collect()
}

fn write_annotations(generator: &Generator<'_>, records: &[ImageRecord]) -> anyhow::Result<()> {
    for of_scene in records.chunk_by(|a, b| a.scene_id == b.scene_id) {
        let dir = generator.scene_dir(of_scene[0].scene_id);
        let cameras = of_scene.iter().map(|r| (r.im_id, r.camera.clone()));
        bop::write_scene_camera(dir.join("scene_camera.json"), &cameras.collect())?;
        let truths = of_scene.iter().map(|r| (r.im_id, r.truths.clone()));
        bop::write_scene_gt(dir.join("scene_gt.json"), &truths.collect())?;
        let infos = of_scene.iter().map(|r| (r.im_id, r.infos.clone()));
        bop::write_scene_gt_info(dir.join("scene_gt_info.json"), &infos.collect())?;
    }
    let path = generator.out.join("test_targets_bop19.json");
    bop::write_targets(path, &targets(records))?;
    Ok(())
}
