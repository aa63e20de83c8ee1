//! `hybrid-icp bop show`.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::Args;
use hicp_bop::{Image, MaskSource, Models, Scenes};
use hicp_io::bop::{Dataset, ResultRow};

use super::eval::DELTA_MM;
use super::models;
use super::show_estimates::{Estimates, Inspection};
use super::show_lines::{self, HEADS, Line, cells};
use super::show_picture::{self, FileLegend, Scenery};
use crate::limits::limits;
use crate::outputs;
use crate::overlay::Picture;
use crate::terminal::{complain, say, warn};

/// Draw the estimates of an image: the outlines of the models at their poses, and what is known of each.
///
/// The picture is the colour or grey image, or the depth where there is neither. Outlines are faint where something that was
/// measured, or another model of the same file, is in front. The legend below has, per object, the score of the file, the MVE
/// in the mask that `bop refine` takes, and where the dataset has ground truth ADI and VSD (mean over the ten
/// tolerances) against the nearest instance. The same table is printed.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    /// The dataset's folder, with models/ and the split's folder.
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// The split's folder: test, test_primesense, train_pbr, …
    #[arg(long, value_name = "NAME", default_value = "test")]
    split: String,
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
    /// Show N estimates of every object, those with the best scores; as many as it has instances in the ground truth if not
    /// given, one where there is none.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), allow_negative_numbers = true)]
    top: Option<u16>,
    /// Take the masks of the MVE from a detections file (JSON with RLE segmentations) instead of mask_visib.
    #[arg(long, value_name = "FILE.json")]
    detections: Option<PathBuf>,
    /// Draw on the depth image even where there is a colour or grey one.
    #[arg(long)]
    depth: bool,
    /// Visibility tolerance of VSD in millimetres; the benchmark takes 5 for ITODD.
    #[arg(long, value_name = "MM", default_value_t = DELTA_MM, value_parser = super::positive)]
    delta: f64,
}

const USAGE: &str = "\
hybrid-icp bop show --dataset <DIR> [--split <NAME>] --scene <ID>
           --image <ID> --results <A.csv> [--against <B.csv>]
           --out <FILE.png> [OPTIONS]";

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop show --dataset bop/ycbv --scene 50 --image 1 --out 50-1.png \\
      --results refined_ycbv-test.csv --against cosypose_ycbv-test.csv

Exit codes: 0 done, with warnings of what is missing; 1 a file is damaged or
there is nothing to show; 2 the command line is wrong.";

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let mut read = vec![("--results", arguments.results.as_path())];
    read.extend(arguments.against.as_deref().map(|p| ("--against", p)));
    read.extend(arguments.detections.as_deref().map(|p| ("--detections", p)));
    let written = [("--out", arguments.out.as_path())];
    outputs::check(&written, &read, &[])?;
    outputs::check_dataset(&written, (&arguments.dataset, &arguments.split))?;
    let files = arguments.files()?;
    let dataset = Dataset::open(&arguments.dataset)?.with_limits(limits());
    dataset.scene_ids(&arguments.split)?;
    let masks = arguments.masks()?;

    let scenes = Scenes::new(&dataset, &arguments.split, 1);
    let image = scenes.read((arguments.scene, arguments.image));
    let image = image.map_err(|fault| anyhow::Error::msg(fault.text))?;
    let models = ShownModels::read(&dataset, &arguments.objects(&files))?;
    let inspection = Inspection {
        scenes: &scenes,
        image: &image,
        frame: (arguments.scene, arguments.image),
        models: &models.drawn,
        eval_models: models.evaluated(),
        masks: &masks,
        delta: 1e-3 * arguments.delta,
        top: arguments.top.map(usize::from),
    };
    let estimates = files.iter().map(|(_, rows)| inspection.estimates(rows));
    let estimates: Vec<Estimates> = estimates.collect();
    tell_of_the_rest(&files, &estimates, &models);
    let damaged = tell_of_damaged(&estimates, &models);
    if estimates.iter().all(|found| found.shown.is_empty()) {
        bail!(
            "nothing to show: no model of the dataset can be used for the estimates of image {} of scene {}",
            arguments.image,
            arguments.scene
        );
    }
    let of_file = |file: usize| estimates.get(file).map_or(&[][..], |e| e.shown.as_slice());
    let lines = show_lines::lines([of_file(0), of_file(1)], &visible(&image));
    let legends = files.iter().zip(&estimates);
    let legends: Vec<FileLegend<'_>> = legends
        .map(|((path, _), found)| FileLegend {
            name: name(path),
            estimates: &found.shown,
        })
        .collect();
    let mut picture = arguments.background(&image)?;
    let scenery = Scenery {
        image: &image,
        models: &models.drawn,
    };
    show_picture::outlines(&mut picture, &scenery, &legends, &lines)?;
    let picture = show_picture::with_legend(picture, &arguments.title(), &legends, &lines)?;
    picture.write(&arguments.out)?;
    let (table, out) = (table(&legends, &lines), arguments.out.display());
    say(format_args!("{table}\n{out}"))?;
    if damaged > 0 {
        bail!("{damaged} files could not be used; {out} is without what depends on them");
    }
    Ok(())
}

/// The models of the objects that are shown.
struct ShownModels {
    dir: PathBuf,
    drawn: Models,
    /// Those that BOP evaluates with, where they are others.
    evaluated: Option<(PathBuf, Models)>,
}

impl ShownModels {
    fn read(dataset: &Dataset, objects: &BTreeSet<u32>) -> anyhow::Result<Self> {
        let (dir, eval_dir) = (dataset.models_dir()?, dataset.eval_models_dir()?);
        let drawn = models::read(&dir, objects)?;
        let evaluated = match eval_dir == dir {
            true => None,
            false => {
                let evaluated = models::read(&eval_dir, objects)?;
                Some((eval_dir, evaluated))
            }
        };
        Ok(Self {
            dir,
            drawn,
            evaluated,
        })
    }

    fn evaluated(&self) -> &Models {
        self.all().last().map_or(&self.drawn, |(_, models)| models)
    }

    fn all(&self) -> impl Iterator<Item = (&Path, &Models)> {
        let evaluated = self.evaluated.as_ref();
        let evaluated = evaluated.map(|(dir, models)| (dir.as_path(), models));
        std::iter::once((self.dir.as_path(), &self.drawn)).chain(evaluated)
    }

    fn tell_missing(&self) -> Option<String> {
        self.all()
            .find_map(|(dir, models)| models::tell_missing(models, dir))
    }
}

impl Arguments {
    /// Reads the result files, each of which has a row of the image.
    fn files(&self) -> anyhow::Result<Vec<(&Path, Vec<ResultRow>)>> {
        let paths = std::iter::once(&self.results).chain(&self.against);
        let mut files = Vec::new();
        for path in paths {
            let rows = limits().read_results(path)?;
            if !rows.iter().any(|row| self.shows(row)) {
                let images: BTreeSet<u32> = rows
                    .iter()
                    .filter(|row| row.scene_id == self.scene)
                    .map(|row| row.im_id)
                    .collect();
                let images: Vec<String> = images.iter().take(8).map(u32::to_string).collect();
                let there = match images.as_slice() {
                    [] => format!("none of scene {} either", self.scene),
                    images => format!("of scene {} it has image {}", self.scene, images.join(", ")),
                };
                bail!(
                    "{} has no row of image {} of scene {}, expected at least one ({there})",
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
        let dataset = self.dataset.canonicalize();
        let dataset = dataset.as_deref().unwrap_or(&self.dataset);
        let (dataset, split) = (name(dataset), &self.split);
        format!(
            "{dataset}/{split} · scene {} · image {}",
            self.scene, self.image
        )
    }

    fn shows(&self, row: &ResultRow) -> bool {
        (row.scene_id, row.im_id) == (self.scene, self.image)
    }

    /// The objects that the files have estimates of in the image.
    fn objects(&self, files: &[(&Path, Vec<ResultRow>)]) -> BTreeSet<u32> {
        let rows = files.iter().flat_map(|(_, rows)| rows);
        let shown = rows.filter(|row| self.shows(row));
        shown.map(|row| row.obj_id).collect()
    }

    /// The masks of the ground truth, or those of the detections of the image.
    fn masks(&self) -> anyhow::Result<MaskSource> {
        let Some(path) = &self.detections else {
            return Ok(MaskSource::Visible);
        };
        let mut detections = limits().read_detections(path)?;
        detections.retain(|d| (d.scene_id, d.image_id) == (self.scene, self.image));
        Ok(MaskSource::detections(detections))
    }

    /// What is drawn on: the colour or grey image where it is a PNG file of the depth image's size, else the depth.
    fn background(&self, image: &Image) -> anyhow::Result<Picture> {
        let of_depth = || Ok(Picture::shaded(&image.depth, &image.camera)?);
        let path = image.scene.color_path(image.im_id);
        let Some(path) = path.filter(|_| !self.depth) else {
            return of_depth();
        };
        if path.extension().is_none_or(|extension| extension != "png") {
            warn(format_args!(
                "{} is no PNG file, which is what is read here: the picture is of the depth",
                path.display()
            ));
            return of_depth();
        }
        let (width, height, rgb) = hicp_io::read_rgb_png(&path)?;
        let expected = (image.depth.width(), image.depth.height());
        if (width, height) != expected {
            bail!(
                "{} is {width}x{height} pixels, expected {}x{} as the depth image",
                path.display(),
                expected.0,
                expected.1
            );
        }
        Ok(Picture { width, height, rgb })
    }
}

/// Visible part from which the legend tells that an instance has no estimate, as the benchmark asks for it.
const MIN_VISIBLE: f64 = 0.1;

/// The objects of the ground truth that are visible, an entry per instance.
fn visible(image: &Image) -> Vec<u32> {
    let truths = image.scene.ground_truth(image.im_id).unwrap_or_default();
    let infos = image.scene.ground_truth_info(image.im_id);
    let fraction = |index: usize| infos.and_then(|infos| infos.get(index)?.visible_fraction);
    let truths = truths.iter().enumerate();
    let visible = truths.filter(|(index, _)| fraction(*index).is_none_or(|f| f >= MIN_VISIBLE));
    visible.map(|(_, truth)| truth.obj_id).collect()
}

/// Complains about files that cannot be used; returns how many there are.
fn tell_of_damaged(estimates: &[Estimates], models: &ShownModels) -> usize {
    let broken = models.all().flat_map(|(_, models)| models.broken.values());
    let damaged = estimates.iter().flat_map(|found| &found.damaged);
    let damaged: BTreeSet<&String> = broken.chain(damaged).collect();
    damaged.iter().for_each(complain);
    damaged.len()
}

/// Warns of rows that are not in the picture.
fn tell_of_the_rest(
    files: &[(&Path, Vec<ResultRow>)],
    estimates: &[Estimates],
    models: &ShownModels,
) {
    if let Some(text) = models.tell_missing() {
        warn(format_args!("{text}; its estimates are not shown"));
    }
    for ((path, _), found) in files.iter().zip(estimates) {
        if found.beyond > 0 {
            warn(format_args!(
                "{}: {} estimates of the image with lower scores are not shown, --top shows more",
                path.display(),
                found.beyond
            ));
        }
    }
}

fn name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// The legend as text.
fn table(legends: &[FileLegend<'_>], lines: &[Line]) -> String {
    let mut text = String::from("      ");
    for legend in legends {
        let _ = write!(text, " {:<35}  ", legend.name);
    }
    text.push_str("\nobject");
    for _ in legends {
        for head in HEADS {
            let _ = write!(text, " {head:>8}");
        }
        text.push_str("  ");
    }
    for line in lines {
        let _ = write!(text, "\n{:>6}", line.tag);
        for (legend, place) in legends.iter().zip(line.estimates) {
            for cell in cells(place.and_then(|place| legend.estimates.get(place))) {
                let _ = write!(text, " {cell:>8}");
            }
            text.push_str("  ");
        }
    }
    text.lines()
        .map(str::trim_end)
        .collect::<Vec<_>>()
        .join("\n")
}
