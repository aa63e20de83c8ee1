//! `hybrid-icp bop show`.

mod estimates;
mod lines;
mod picture;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Error, bail};
use clap::Args;
use hicp_bop::{Image, MaskSource, Models, Scenes, visible_objects};
use hicp_io::bop::{Dataset, ResultRow};
use hicp_picture::Picture;

use self::estimates::{Estimates, Inspection};
use self::lines::{grid, lines};
use self::picture::{Scenery, outlines, with_legend};
use super::eval::DELTA_MM;
use super::options::DatasetOptions;
use super::{faults, models};
use crate::limits::limits;
use crate::options::{file_name, positive};
use crate::outputs::{Files, check_png, write_picture};
use crate::terminal::{say, table, warn};

/// Draw the estimates of an image: outlines of the models, with their scores and errors.
///
/// The picture is the color or gray image, or the depth if there is neither. Outlines are faint
/// where a measured surface, or another model of the same file, is in front. The legend has the
/// score of every estimate and its MVE in the mask that `bop refine` uses. If the dataset has
/// ground truth, it also has ADI and VSD (mean over the ten tolerances) against the nearest
/// instance. The same table is printed.
///
/// The exit code is 0 with warnings about missing files, and 1 if a file is damaged or there is
/// nothing to show.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    dataset: DatasetOptions,
    /// The scene's id.
    #[arg(long, value_name = "ID", allow_negative_numbers = true)]
    scene: u32,
    /// The image's id.
    #[arg(long, value_name = "ID", allow_negative_numbers = true)]
    image: u32,
    /// The result file: blue outlines.
    #[arg(long, value_name = "A.csv")]
    results: PathBuf,
    /// A result file to compare with, such as the one that was refined: dashed orange outlines.
    #[arg(long, value_name = "B.csv")]
    against: Option<PathBuf>,
    /// The picture.
    #[arg(long, value_name = "FILE.png")]
    out: PathBuf,
    /// Show the N estimates of every object that have the best scores. The default is the number of
    /// its instances in the ground truth, and 1 without ground truth.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), allow_negative_numbers = true)]
    top: Option<u16>,
    /// Read the masks of the MVE from a detections file (JSON with RLE segmentations) instead of
    /// mask_visib.
    #[arg(long, value_name = "FILE.json")]
    detections: Option<PathBuf>,
    /// Draw on the depth image even where there is a color or gray one.
    #[arg(long)]
    depth: bool,
    /// Visibility tolerance of VSD in millimeters; the benchmark uses 5 for ITODD.
    #[arg(long, value_name = "MM", default_value_t = DELTA_MM, value_parser = positive)]
    delta: f64,
}

const USAGE: &str = "\
hybrid-icp bop show --dataset <DIR> [--split <NAME>] --scene <ID>
           --image <ID> --results <A.csv> [--against <B.csv>]
           --out <FILE.png> [OPTIONS]";

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop show --dataset bop/ycbv --scene 50 --image 1 --out 50-1.png \\
      --results refined_ycbv-test.csv --against cosypose_ycbv-test.csv";

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let written = Files::default()
        .reads("--results", [&arguments.results])
        .reads("--against", &arguments.against)
        .reads("--detections", &arguments.detections)
        .writes("--out", [&arguments.out]);
    written.check()?;
    written.spare_dataset(&arguments.dataset.root, &arguments.dataset.split)?;
    check_png("--out", [&arguments.out])?;
    let files = arguments.files()?;
    let dataset = arguments.dataset.open()?;
    let masks = arguments.masks()?;
    let scenes = Scenes::new(&dataset, &arguments.dataset.split, 1);
    let frame = (arguments.scene, arguments.image);
    let image = scenes.read(frame).map_err(|fault| Error::msg(fault.text))?;
    let shown = files.iter().flat_map(|(_, rows)| rows);
    let shown = shown.filter(|row| arguments.shows(row));
    let models = read_models(&dataset, &shown.map(|row| row.obj_id).collect())?;
    let drawn = &models[0].1;
    let inspection = Inspection {
        scenes: &scenes,
        image: &image,
        frame,
        models: drawn,
        eval_models: models.last().map_or(drawn, |(_, models)| models),
        masks: &masks,
        delta_meters: 1e-3 * arguments.delta,
        top: arguments.top.map(usize::from),
    };
    let estimates = files.iter();
    let estimates = estimates.map(|(path, rows)| inspection.estimates(file_name(path), rows));
    let estimates: Vec<Estimates> = estimates.collect();
    let missing = models
        .iter()
        .find_map(|(dir, models)| models::missing(models, dir));
    if let Some(text) = missing {
        warn(format_args!("{text}; its estimates are not shown"));
    }
    for ((path, _), found) in files.iter().zip(&estimates) {
        if found.beyond > 0 {
            warn(format_args!(
                "{}: {} estimates of the image with lower scores are not shown, --top shows more",
                path.display(),
                found.beyond
            ));
        }
    }
    let broken = models.iter().flat_map(|(_, models)| models.broken.values());
    let damaged = faults::report(estimates.iter().flat_map(|found| &found.faults), broken);
    if estimates.iter().all(|found| found.shown.is_empty()) {
        bail!(
            "nothing to show: no model of the dataset can be used for the estimates of image {} of scene {}",
            arguments.image,
            arguments.scene
        );
    }
    let lines = lines(&estimates, &visible_objects(&image.scene, image.im_id));
    let mut picture = arguments.background(&image)?;
    let scenery = Scenery {
        image: &image,
        models: drawn,
    };
    outlines(&mut picture, &scenery, &estimates, &lines)?;
    let picture = with_legend(&picture, &arguments.title(), &estimates, &lines)?;
    write_picture(&arguments.out, &picture)?;
    let names: Vec<&str> = estimates.iter().map(|found| found.file.as_str()).collect();
    let (names, out) = (names.join(" against "), arguments.out.display());
    say(format_args!(
        "{names}\n{}\n{out}",
        table(&grid(&estimates, &lines), 0)
    ))?;
    if let Some(damaged) = damaged {
        bail!("{damaged}; {out} is without what depends on them");
    }
    Ok(())
}

/// Reads the models to draw, and those that BOP evaluates with if they differ.
fn read_models(
    dataset: &Dataset,
    objects: &BTreeSet<u32>,
) -> anyhow::Result<Vec<(PathBuf, Models)>> {
    let mut dirs = vec![dataset.models_dir()?, dataset.eval_models_dir()?];
    dirs.dedup();
    let read = |dir: PathBuf| Ok((dir.clone(), models::read(&dir, objects)?));
    dirs.into_iter().map(read).collect()
}

impl Arguments {
    /// Reads the result files, each of which has a row of the image.
    fn files(&self) -> anyhow::Result<Vec<(&Path, Vec<ResultRow>)>> {
        let mut files = Vec::new();
        for path in std::iter::once(&self.results).chain(&self.against) {
            let rows = limits().read_results(path)?;
            if !rows.iter().any(|row| self.shows(row)) {
                let of_scene = rows.iter().filter(|row| row.scene_id == self.scene);
                let images: BTreeSet<u32> = of_scene.map(|row| row.im_id).collect();
                let found = match images.is_empty() {
                    true => format!("none of scene {} either", self.scene),
                    false => {
                        let few = models::ids(images.iter().take(8));
                        format!("of scene {} it has image {few}", self.scene)
                    }
                };
                bail!(
                    "{} has no row of image {} of scene {}, expected at least one ({found})",
                    path.display(),
                    self.image,
                    self.scene
                );
            }
            files.push((path.as_path(), rows));
        }
        Ok(files)
    }

    fn title(&self) -> String {
        let dataset = self.dataset.name();
        let (split, scene, image) = (&self.dataset.split, self.scene, self.image);
        format!("{dataset}/{split} · scene {scene} · image {image}")
    }

    fn shows(&self, row: &ResultRow) -> bool {
        (row.scene_id, row.im_id) == (self.scene, self.image)
    }

    /// Returns the masks of the ground truth, or those of the detections of the image.
    fn masks(&self) -> anyhow::Result<MaskSource> {
        let Some(path) = &self.detections else {
            return Ok(MaskSource::Visible);
        };
        let mut detections = limits().read_detections(path)?;
        detections.retain(|d| (d.scene_id, d.image_id) == (self.scene, self.image));
        Ok(MaskSource::detections(detections))
    }

    /// Returns the picture to draw on: the color or gray image if there is one, else the depth.
    fn background(&self, image: &Image) -> anyhow::Result<Picture> {
        let path = image.scene.color_path(image.im_id);
        let Some(path) = path.filter(|_| !self.depth) else {
            return Ok(Picture::shaded(&image.depth, &image.camera)?);
        };
        let color = limits().read_color(&path)?;
        let ((width, height), (w, h)) = (color.size(), image.depth.size());
        if (width, height) != (w, h) {
            bail!(
                "{} is {width}x{height} pixels, expected {w}x{h} as the depth image",
                path.display()
            );
        }
        Ok(Picture {
            width,
            height,
            rgb: color.pixels().as_flattened().to_vec(),
        })
    }
}
