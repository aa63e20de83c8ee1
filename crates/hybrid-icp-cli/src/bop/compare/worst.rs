//! The rows with the largest errors, as pictures in a page.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Error;
use base64::prelude::{BASE64_STANDARD, Engine as _};
use hicp_bop::Scenes;
use hicp_experiments::html_escaped;
use hicp_io::bop::ResultRow;
use hicp_picture::Picture;
use hybrid_icp::core::{Mask, Observation};

use crate::bop::models;
use crate::bop::options::DatasetOptions;
use crate::limits::limits;

/// A row whose ADI after a pipeline is among the largest.
pub(super) struct Worst {
    /// Index into the result file.
    pub(super) row: usize,
    /// Name of the pipeline.
    pub(super) pipeline: String,
    /// ADI before and after, in meters.
    pub(super) adi_m: [Option<f64>; 2],
}

/// Draws rows with their poses before and after a pipeline, as HTML.
///
/// `refined` names the result file of a pipeline.
pub(super) fn pictures(
    worst: &[Worst],
    dataset: &DatasetOptions,
    init: &Path,
    refined: impl Fn(&str) -> PathBuf,
) -> anyhow::Result<String> {
    let opened = dataset.open()?;
    let scenes = Scenes::new(&opened, &dataset.split, 1);
    let initial = limits().read_results(init)?;
    let shown = worst.iter().filter_map(|worst| initial.get(worst.row));
    let objects: BTreeSet<u32> = shown.map(|row| row.obj_id).collect();
    let models = models::read(&opened.eval_models_dir()?, &objects)?;
    let mut html = String::new();
    for worst in worst {
        let refined = limits().read_results(refined(&worst.pipeline))?;
        let rows = initial.get(worst.row).zip(refined.get(worst.row));
        let model = rows.and_then(|(row, _)| models.by_id.get(&row.obj_id));
        let (Some((row, refined)), Some(model)) = (rows, model) else {
            continue;
        };
        let image = scenes.read((row.scene_id, row.im_id));
        let image = image.map_err(|fault| Error::msg(fault.text))?;
        let (width, height) = (image.depth.width(), image.depth.height());
        let nothing = Mask::new(width, height, vec![false; image.depth.pixels().len()])?;
        let observation = Observation::new(Arc::clone(&image.depth), nothing, image.camera)?;
        let poses = [row, refined].map(ResultRow::camera_from_object);
        let mm = |adi: Option<f64>| adi.map_or("-".to_owned(), |m| format!("{:.2}", 1e3 * m));
        let mm = worst.adi_m.map(mm);
        let caption = |name: &str, mm: &str| format!("{name}: ADI {mm} mm");
        let captioned = [
            (&poses[0], caption("initial", &mm[0])),
            (&poses[1], caption(&worst.pipeline, &mm[1])),
        ];
        let picture = Picture::before_and_after(model, &observation, &captioned)?;
        let png = BASE64_STANDARD.encode(picture.png()?);
        let (object, image, scene) = (row.obj_id, row.im_id, row.scene_id);
        let place = format!("Object {object} in image {image} of scene {scene}");
        let (pipeline, [before, after]) = (html_escaped(&worst.pipeline), mm);
        html += &format!(
            "<figure><img src=\"data:image/png;base64,{png}\" alt=\"{place}\">\n\
             <figcaption>{place}: ADI {before} mm, {after} mm after {pipeline}</figcaption></figure>\n"
        );
    }
    Ok(html)
}
