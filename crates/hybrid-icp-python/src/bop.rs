//! Refines result files image by image, for `hybrid_icp.bop` and the engines that build on it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use hicp_bop::{
    BoxMask, DatasetRefiner, FaultKind, MaskSource, ModelFolder, Models, Rescore, Scenes, frames_of,
};
use hicp_io::ReadLimits;
use hicp_io::bop::{Dataset, ResultRow, read_detections, read_results, results_from_csv};
use hybrid_icp::Refiner;
use pyo3::prelude::*;

use crate::array;
use crate::errors::{self, InputError};
use crate::mutex::locked;
use crate::pipeline::PyPipeline;

/// Number of scenes whose annotations stay in memory. Images arrive scene by scene.
const OPEN_SCENES: usize = 2;

/// The rows of one image: scene, image, indices in the file, and their lines with a header.
type ImageRows = (u32, u32, Vec<usize>, String);

/// Reads a result file and groups its rows by image, in the order of scene and image.
///
/// Parameters
/// ----------
/// results : str or os.PathLike
///     The result file: CSV with scene_id, im_id, obj_id, score, R, t (mm) and time.
/// limit : int, optional
///     Read only the first rows.
///
/// Returns
/// -------
/// list of (int, int, list of int, str)
///     Scene, image, indices of its rows in the file, and those rows as CSV with a header.
#[pyfunction]
#[pyo3(signature = (results, *, limit = None))]
pub(crate) fn read_images(
    py: Python<'_>,
    results: PathBuf,
    limit: Option<usize>,
) -> PyResult<Vec<ImageRows>> {
    py.detach(|| {
        let mut rows = read_results(&results).map_err(errors::file)?;
        rows.truncate(limit.unwrap_or(usize::MAX));
        let images = frames_of(&rows).into_iter();
        Ok(images
            .map(|((scene_id, im_id), indices)| {
                let mut csv = ResultRow::header();
                for index in &indices {
                    csv.push_str(&format!("\n{}", rows[*index]));
                }
                (scene_id, im_id, indices, csv)
            })
            .collect())
    })
}

/// Returns the first line of a result file, without the line end.
///
/// Returns
/// -------
/// str
#[pyfunction]
pub(crate) fn result_header() -> String {
    ResultRow::header()
}

/// Refines the rows of result files image by image, like `hybrid-icp bop refine`.
///
/// It reads the models of the dataset once. It has no threads and writes no files.
///
/// Parameters
/// ----------
/// dataset : str or os.PathLike
///     The folder of the dataset, with models/ and the folder of the split.
/// split : str
///     The folder of the split, such as "test".
/// pipeline : Pipeline
/// objects : sequence of int
///     Ids of the objects whose models the constructor reads.
/// detections : str or os.PathLike, optional
///     Use the masks of a detections file instead of mask_visib.
/// mask : {"visible", "none"}, optional
///     Without detections: mask_visib, or all measured points in a box around the pose of each row.
/// models : str or os.PathLike, optional
///     Another folder of meshes: one of the dataset, such as "models_color", or a path. Diameters
///     and symmetries are still those of models/models_info.json.
/// color : bool, optional
///     Use the colors of the meshes and the images in rgb/ if both exist.
/// sensor : str, optional
///     The sensor of scenes with several: "cam1" for scene_camera_cam1.json and depth_cam1/.
/// rescore : {"keep", "mve", "confidence"}, optional
///     The score of a row: its old score, 1 − MVE, or its confidence. With the last two, a row
///     that did not reach the pipeline has the score 0.
#[pyclass(frozen, module = "hybrid_icp.bop", name = "DatasetRefiner")]
pub(crate) struct PyDatasetRefiner {
    shared: DatasetRefiner,
    refiner: Mutex<Refiner>,
    rescore: Rescore,
}

#[pymethods]
impl PyDatasetRefiner {
    #[new]
    #[pyo3(signature = (
        dataset,
        split,
        pipeline,
        objects,
        *,
        detections = None,
        mask = "visible",
        models = None,
        color = true,
        sensor = None,
        rescore = "keep"
    ))]
    #[allow(clippy::too_many_arguments)] // Options of Python.
    fn new(
        py: Python<'_>,
        dataset: PathBuf,
        split: &str,
        pipeline: &Bound<'_, PyPipeline>,
        objects: Vec<u32>,
        detections: Option<PathBuf>,
        mask: &str,
        models: Option<PathBuf>,
        color: bool,
        sensor: Option<&str>,
        rescore: &str,
    ) -> PyResult<Self> {
        let masks = [
            ("visible", MaskSource::Visible),
            ("none", MaskSource::Box(BoxMask::default())),
        ];
        let masks = array::choice("mask", mask, masks)?;
        let choices = [
            ("keep", Rescore::Keep),
            ("mve", Rescore::Mve),
            ("confidence", Rescore::Confidence),
        ];
        let rescore = array::choice("rescore", rescore, choices)?;
        let refiner = Mutex::new(Refiner::boxed(pipeline.get().build()?));
        let shared = py
            .detach(|| -> Result<_, hicp_io::IoError> {
                let mut dataset = Dataset::open(dataset)?.with_sensor(sensor);
                dataset.scene_ids(split)?;
                if let Some(models) = models {
                    dataset = dataset.with_models(models)?;
                }
                let (dir, info) = (dataset.models_dir()?, dataset.models_info_path()?);
                let mut folder = ModelFolder::with_info(ReadLimits::DEFAULT, dir, info)?;
                if !color {
                    folder = folder.without_color();
                }
                Ok(DatasetRefiner {
                    models: Models::read(&folder, &BTreeSet::from_iter(objects)),
                    scenes: Scenes::new(&dataset, split, OPEN_SCENES),
                    masks: match detections {
                        Some(path) => MaskSource::detections(read_detections(path)?),
                        None => masks,
                    },
                })
            })
            .map_err(errors::file)?;
        Ok(Self {
            shared,
            refiner,
            rescore,
        })
    }

    /// Refines the rows of one image.
    ///
    /// Rows that cannot be refined keep their poses. The time column is -1, so that equal input
    /// gives equal bytes.
    ///
    /// Parameters
    /// ----------
    /// rows : str
    ///     CSV with a header, as `read_images` returns it.
    ///
    /// Returns
    /// -------
    /// lines : list of str
    ///     The refined rows in the same order, without line ends.
    /// statuses : list of str
    ///     The status of each row.
    /// faults : list of str
    ///     The damaged files.
    #[allow(clippy::type_complexity)] // Three lists.
    fn refine(
        &self,
        py: Python<'_>,
        rows: &str,
    ) -> PyResult<(Vec<String>, Vec<String>, Vec<String>)> {
        py.detach(|| {
            let mut rows =
                results_from_csv(rows.as_bytes(), Path::new("rows")).map_err(errors::input)?;
            let images = frames_of(&rows);
            let [(key, indices)] = &images[..] else {
                return Err(InputError::new_err(format!(
                    "rows belong to {} images, expected the rows of one image",
                    images.len()
                )));
            };
            // One image at a time, because one thread uses the scratch memory. It stays usable
            // after a panic, because runs do not depend on its contents.
            let result = self
                .shared
                .frame(&mut locked(&self.refiner), *key, &rows, indices);
            result.enter(&mut rows, self.rescore, false);
            let damaged = result
                .faults
                .iter()
                .filter(|fault| fault.kind == FaultKind::Damaged);
            Ok((
                rows.iter().map(ToString::to_string).collect(),
                result
                    .rows
                    .iter()
                    .map(|row| row.status.to_string())
                    .collect(),
                damaged.map(|fault| fault.text.clone()).collect(),
            ))
        })
    }

    /// The faults of models, as a dict from object id to message. Rows of these objects keep their
    /// poses.
    #[getter]
    fn broken_models(&self) -> std::collections::BTreeMap<u32, String> {
        self.shared.models.broken.clone()
    }

    /// Ids of the objects without a model in the dataset.
    #[getter]
    fn missing_models(&self) -> Vec<u32> {
        self.shared.models.missing.iter().copied().collect()
    }
}
