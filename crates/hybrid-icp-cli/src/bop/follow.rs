//! The options of the commands that follow one object through a scene.

use std::collections::BTreeSet;
use std::fmt::Display;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Error, bail};
use clap::Args;
use hicp_bop::Models;
use hicp_io::LengthUnit;
use hicp_io::bop::{ResultRow, Scene, write_results};
use hybrid_icp::core::Isometry3;
use serde_json::Value;

use super::models;
use super::options::DatasetOptions;
use crate::limits::limits;
use crate::outputs::Files;
use crate::terminal::say_beside;

/// The options of a command that follows one object through a scene.
#[derive(Debug, Args)]
pub(super) struct FollowOptions {
    #[command(flatten)]
    pub(super) dataset: DatasetOptions,
    /// The id of the scene.
    #[arg(long, value_name = "ID")]
    pub(super) scene: u32,
    /// The id of the object.
    #[arg(long, value_name = "ID")]
    pub(super) object: u32,
    /// The rough pose in the first image: a pose file in a form of `refine`, or a result file
    /// (CSV), for example of bop estimate. Of a result file, the row for that image and object with
    /// the highest score is used.
    #[arg(long, value_name = "FILE|FILE.csv")]
    pub(super) init: PathBuf,
    /// Unit of the translation of a pose file: m, mm or cm. If not given: mm for cam_t_m2c, m for
    /// all other forms.
    #[arg(long, value_name = "UNIT")]
    init_unit: Option<LengthUnit>,
    /// The id of the image to start with; the scene's first if not given.
    #[arg(long, value_name = "ID")]
    first: Option<u32>,
    /// The file for the lines.
    #[arg(long, value_name = "OUT.jsonl")]
    pub(super) output: PathBuf,
    /// Also write the poses as a result file, for bop eval.
    #[arg(long, value_name = "OUT.csv")]
    results: Option<PathBuf>,
}

impl FollowOptions {
    /// Checks that the outputs can be written and replace no input.
    pub(super) fn check_files(
        &self,
        pipeline: Option<&PathBuf>,
        detections: Option<&PathBuf>,
    ) -> anyhow::Result<()> {
        let files = Files::default()
            .reads("--init", [&self.init])
            .reads("--pipeline", pipeline)
            .reads("--detections", detections)
            .writes("--output", [&self.output])
            .writes("--results", &self.results);
        files.check()?;
        files.spare_dataset(&self.dataset.root, &self.dataset.split)
    }

    /// Reads the model of the object, the only one of the result, from a folder.
    pub(super) fn model(&self, folder: &Path) -> anyhow::Result<Models> {
        let models = models::read(folder, &BTreeSet::from([self.object]))?;
        if models.by_id.contains_key(&self.object) {
            return Ok(models);
        }
        let broken = models.broken.get(&self.object).cloned();
        let cause = broken.or_else(|| models::missing(&models, folder));
        Err(Error::msg(cause.unwrap_or_default()))
    }

    /// Returns the ids of a scene's images in ascending order, from the first or from `--first`.
    pub(super) fn images(&self, scene: &Scene) -> anyhow::Result<Vec<u32>> {
        let first = self.first;
        let file = scene.file("scene_camera");
        if let Some(first) = first
            && !scene.image_ids().any(|id| id == first)
        {
            bail!(
                "--first {first} is not an image of {}, expected one of its {}",
                file.display(),
                scene.image_ids().count()
            );
        }
        let images: Vec<u32> = scene.image_ids().filter(|id| Some(*id) >= first).collect();
        if images.is_empty() {
            bail!("{} has no image, expected at least one", file.display());
        }
        Ok(images)
    }

    /// Returns whether `--init` is a result file, which is in mm.
    fn is_results(&self) -> bool {
        self.init.extension().is_some_and(|ending| ending == "csv")
    }

    /// Returns the advice to check the unit of `--init`.
    pub(super) fn check_unit(&self) -> &'static str {
        match self.is_results() {
            true => "that --init is in mm",
            false => "--init-unit",
        }
    }

    /// Returns what to check if all poses are guesses.
    pub(super) fn advice(&self) -> String {
        format!(
            "{}, {}, --object and its mesh, and cam_K and depth_scale in scene_camera.json",
            self.init.display(),
            self.check_unit()
        )
    }

    /// Reads the pose in the first image from a pose file or a result file (`.csv`).
    ///
    /// Of a result file, returns the row with the highest score for the image.
    pub(super) fn initial_pose(&self, im_id: u32) -> anyhow::Result<Isometry3<f64>> {
        let path = &self.init;
        if !self.is_results() {
            let pose = limits()
                .read_pose(path, self.init_unit)
                .context("cannot read --init")?;
            return Ok(pose.camera_from_object);
        }
        if let Some(unit) = self.init_unit {
            bail!(
                "--init-unit {unit} does not apply to {}: result files are in mm",
                path.display()
            );
        }
        let (scene_id, obj_id) = (self.scene, self.object);
        let place = (scene_id, im_id, obj_id);
        let rows = limits().read_results(path).context("cannot read --init")?;
        let of_place = |row: &&ResultRow| (row.scene_id, row.im_id, row.obj_id) == place;
        // Of rows with equal scores, the first is used.
        let best = rows
            .iter()
            .filter(of_place)
            .reduce(|best, row| if row.score > best.score { row } else { best });
        match best {
            Some(row) => Ok(row.camera_from_object()),
            None => bail!(
                "--init {}: none of its {} rows is for scene {scene_id}, image {im_id}, object {obj_id}, expected at least one: start from another image with --first",
                path.display(),
                rows.len()
            ),
        }
    }

    /// Prints a summary.
    pub(super) fn say(&self, text: impl Display) -> anyhow::Result<()> {
        say_beside(&[Some(&self.output), self.results.as_deref()], text)
    }

    /// Writes the lines and, if there is a file for them, the rows.
    pub(super) fn write(
        &self,
        mut lines: impl Iterator<Item = Value>,
        rows: impl Iterator<Item = ResultRow>,
    ) -> anyhow::Result<()> {
        hicp_io::write_atomically(&self.output, |file| {
            lines.try_for_each(|line| writeln!(file, "{line}"))
        })?;
        if let Some(path) = &self.results {
            write_results(path, &rows.collect::<Vec<_>>())?;
        }
        Ok(())
    }
}
