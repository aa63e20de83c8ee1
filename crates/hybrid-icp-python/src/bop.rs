//! Whole result files, image by image: what `hybrid_icp.bop` and the engines above it are made of.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use hicp_bop::{
    DatasetRefiner, FaultKind, MaskSource, ModelFolder, Models, Rescore, Scenes, frames_of,
};
use hicp_io::bop::{Dataset, ResultRow, read_detections, read_results, results_from_csv};
use hybrid_icp::Refiner;
use pyo3::prelude::*;

use crate::array;
use crate::errors::{self, InputError};
use crate::mutex::locked;
use crate::pipeline::PyPipeline;

/// Scenes whose annotations are kept at hand: images come scene by scene.
const OPEN_SCENES: usize = 2;

/// The rows of one image: scene, image, where they stand in the file, and their lines under a
/// header.
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
///     Scene, image, where its rows stand in the file, and those rows as CSV with a header.
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

/// The first line of a result file, without its end.
///
/// Returns
/// -------
/// str
#[pyfunction]
pub(crate) fn result_header() -> String {
    ResultRow::header()
}

/// Refines the rows of result files, image by image, with the models of a dataset read once:
/// `hybrid-icp bop refine` without its threads and files.
///
/// Parameters
/// ----------
/// dataset : str or os.PathLike
///     The dataset's folder, with models/ and the split's folder.
/// split : str
///     The split's folder, such as "test".
/// pipeline : Pipeline
/// objects : sequence of int
///     Ids of the objects whose models are read, now.
/// detections : str or os.PathLike, optional
///     Take the masks from a detections file instead of mask_visib.
/// rescore : {"keep", "mve"}, optional
///     What becomes the score: the row's own, or 1 − MVE.
#[pyclass(frozen, module = "hybrid_icp.bop", name = "DatasetRefiner")]
pub(crate) struct PyDatasetRefiner {
    shared: DatasetRefiner,
    refiner: Mutex<Refiner>,
    rescore: Rescore,
}

#[pymethods]
impl PyDatasetRefiner {
    #[new]
    #[pyo3(signature = (dataset, split, pipeline, objects, *, detections = None, rescore = "keep"))]
    fn new(
        py: Python<'_>,
        dataset: PathBuf,
        split: &str,
        pipeline: &Bound<'_, PyPipeline>,
        objects: Vec<u32>,
        detections: Option<PathBuf>,
        rescore: &str,
    ) -> PyResult<Self> {
        let choices = [("keep", Rescore::Keep), ("mve", Rescore::Mve)];
        let rescore = array::choice("rescore", rescore, choices)?;
        let refiner = Mutex::new(Refiner::boxed(pipeline.get().build()?));
        let shared = py
            .detach(|| -> Result<_, hicp_io::IoError> {
                let dataset = Dataset::open(dataset)?;
                dataset.scene_ids(split)?;
                let folder = ModelFolder::open(dataset.models_dir()?)?;
                Ok(DatasetRefiner {
                    models: Models::read(&folder, &BTreeSet::from_iter(objects)),
                    scenes: Scenes::new(&dataset, split, OPEN_SCENES),
                    masks: match detections {
                        Some(path) => MaskSource::detections(read_detections(path)?),
                        None => MaskSource::Visible,
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
    /// Rows that cannot be refined keep their numbers. The time column is -1: equal input gives
    /// equal bytes.
    ///
    /// Parameters
    /// ----------
    /// rows : str
    ///     CSV with a header, as `read_images` returns it.
    ///
    /// Returns
    /// -------
    /// lines : list of str
    ///     The refined rows in the order given, without line ends.
    /// statuses : list of str
    ///     What became of each.
    /// faults : list of str
    ///     Files that are damaged.
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
                    "rows are of {} images, expected one",
                    images.len()
                )));
            };
            // One image at a time: the scratch memory is one thread's. A panic leaves it usable,
            // for runs do not depend on it.
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

    /// What is wrong with models, by object id; rows of these objects keep their numbers.
    ///
    /// Returns
    /// -------
    /// dict of int to str
    #[getter]
    fn broken_models(&self) -> std::collections::BTreeMap<u32, String> {
        self.shared.models.broken.clone()
    }

    /// Ids of the objects that the dataset has no model of.
    #[getter]
    fn missing_models(&self) -> Vec<u32> {
        self.shared.models.missing.iter().copied().collect()
    }
}
