//! `Pipeline`.

use std::path::PathBuf;
use std::sync::Mutex;

use hybrid_icp::core::Isometry3;
use hybrid_icp::pipeline::PipelineFile;
use hybrid_icp::{Preset, Refiner, Warning, warning_of_distance};
use pyo3::prelude::*;

use crate::array::{self, Motion};
use crate::batch;
use crate::errors::{self, InputError};
use crate::model::PyModel;
use crate::mutex::locked;
use crate::observation::PyObservation;
use crate::observer::Watch;
use crate::result::PyResultOf;

const EXPECTED_POSES: &str = "an (N, 4, 4) float64 array of [R t; 0 0 0 1], metres";

/// A refinement pipeline: Hybrid ICP, one of the classical variants that it was compared with, or
/// your own from a TOML file.
///
/// `Pipeline()` is the default, "auto". `Pipeline.from_toml` reads a custom one. A pipeline keeps
/// scratch memory from call to call, and threads may share it.
///
/// Parameters
/// ----------
/// name : str, optional
///     One of `Pipeline.presets()`: "auto" refines and, if the score stays bad, searches; "local"
///     never searches; "hybrid" is the method of the paper.
/// overrides : sequence of str, optional
///     Fields to set, such as "threshold=0.3" of "auto" or "times=3" of "hybrid".
///
/// Examples
/// --------
/// >>> from hybrid_icp import Pipeline
/// >>> Pipeline()
/// Pipeline('auto')
/// >>> Pipeline.preset("hybrid", overrides=["times=1"]).name
/// 'hybrid times=1'
#[pyclass(frozen, module = "hybrid_icp", name = "Pipeline")]
#[derive(Debug)]
pub(crate) struct PyPipeline {
    name: String,
    origin: String,
    file: PipelineFile,
    toml: String,
    overrides: Vec<String>,
    /// Warm refiners that are not in use.
    refiners: Mutex<Vec<Refiner>>,
}

/// What restores a pipeline, and what it takes: origin, text and overrides.
type Pickled = (Py<PyAny>, (String, String, Vec<String>));

#[pymethods]
#[allow(non_snake_case)]
impl PyPipeline {
    #[new]
    #[pyo3(signature = (name = "auto", *, overrides = Vec::new()))]
    fn new(name: &str, overrides: Vec<String>) -> PyResult<Self> {
        Self::preset(name, overrides)
    }

    /// Makes a pipeline by name: the same as `Pipeline(name)`.
    ///
    /// Parameters
    /// ----------
    /// name : str
    ///     One of `Pipeline.presets()`: "hybrid" is Hybrid ICP; "hybrid-visible" and "local" refine
    ///     better than it, "search" and "auto" also find the object where refinement fails, and
    ///     take longer.
    /// overrides : sequence of str, optional
    ///     Fields to set, such as "times=3" or "stage.switcher.alpha=0.5".
    ///
    /// Returns
    /// -------
    /// Pipeline
    #[staticmethod]
    #[pyo3(signature = (name, *, overrides = Vec::new()))]
    fn preset(name: &str, overrides: Vec<String>) -> PyResult<Self> {
        let preset: Preset = name.parse().map_err(errors::input)?;
        Self::parse(name, preset.toml().to_owned(), overrides)
    }

    /// Makes a pipeline from a TOML file or its text.
    ///
    /// Parameters
    /// ----------
    /// text_or_path : str or os.PathLike
    ///     A path object, a string that ends with ".toml", or the text itself.
    /// overrides : sequence of str, optional
    ///     Fields to set, as for `preset`.
    ///
    /// Returns
    /// -------
    /// Pipeline
    ///
    /// Raises
    /// ------
    /// InputError
    ///     Naming the line and field, what is there, and what would be right.
    /// FileError
    ///     When the file cannot be read.
    ///
    /// Examples
    /// --------
    /// >>> from hybrid_icp import Pipeline
    /// >>> Pipeline.from_toml('''
    /// ... type = "icp"
    /// ... selection = "visible-surface"
    /// ... association = "projective"
    /// ... metric = "point-to-plane"
    /// ... ''')
    /// Pipeline('text')
    #[staticmethod]
    #[pyo3(signature = (text_or_path, *, overrides = Vec::new()))]
    fn from_toml(text_or_path: &Bound<'_, PyAny>, overrides: Vec<String>) -> PyResult<Self> {
        let path = match text_or_path.extract::<String>() {
            Ok(text) if !text.trim_end().ends_with(".toml") || text.contains('\n') => {
                return Self::parse("text", text, overrides);
            }
            Ok(path) => PathBuf::from(path),
            Err(_) => text_or_path.extract::<PathBuf>().map_err(|_| {
                array::unexpected(
                    "text_or_path",
                    text_or_path,
                    "the text of a pipeline file or its path",
                )
            })?,
        };
        let text = PipelineFile::read_text(&path).map_err(errors::file)?;
        Self::parse(&path.to_string_lossy(), text, overrides)
    }

    /// Names of the pipelines that ship with the library, Hybrid ICP first.
    ///
    /// Returns
    /// -------
    /// list of str
    #[staticmethod]
    fn presets() -> Vec<&'static str> {
        Preset::ALL.map(Preset::name).to_vec()
    }

    /// Name in reports: that of the preset or file, and the overrides.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// The pipeline as a file, before the overrides.
    #[getter]
    fn toml(&self) -> &str {
        &self.toml
    }

    /// Refines a pose.
    ///
    /// Deterministic, and never fails on data: no overlap, degenerate geometry and the like end
    /// with a result that says so. The GIL is released.
    ///
    /// Parameters
    /// ----------
    /// model : Model
    ///     The object.
    /// observation : Observation
    ///     The image.
    /// T_co : array_like, shape (4, 4)
    ///     The rough pose, camera from object, metres.
    /// observer : callable or object, optional
    ///     A callable gets an `IterationEvent` per iteration; an object is told by those of its
    ///     methods `on_iteration`, `on_regime` and `on_stage_end` that it has. `False` from any of
    ///     them stops the run at the pose last evaluated; an exception stops it and is raised.
    ///
    /// Returns
    /// -------
    /// Result
    ///
    /// Raises
    /// ------
    /// InputError
    ///     When the pose is no rigid motion in metres.
    ///
    /// Warns
    /// -----
    /// InputWarning
    ///     When pose and image do not go together: the object behind the camera, or at a third or
    ///     three times of the depth measured.
    ///
    /// Examples
    /// --------
    /// A plate half a metre in front of the camera, and a detector that is four centimetres off:
    ///
    /// >>> import numpy as np
    /// >>> from hybrid_icp import Camera, Model, Observation, Pipeline, render_depth
    /// >>> model = Model([[-.1, -.1, 0], [.1, -.1, 0], [.1, .1, 0], [-.1, .1, 0]], [[0, 2, 1], [0, 3, 2]])
    /// >>> camera = Camera(100, 100, 31.5, 31.5, 64, 64)
    /// >>> true = np.eye(4); true[2, 3] = 0.5
    /// >>> depth = render_depth(model, camera, true)
    /// >>> observation = Observation(depth, depth > 0, camera)
    /// >>> rough = np.eye(4); rough[2, 3] = 0.54
    /// >>> result = Pipeline().refine(model, observation, rough)
    /// >>> bool(abs(result.T_co[2, 3] - 0.5) < 1e-4)
    /// True
    #[pyo3(signature = (model, observation, T_co, observer = None))]
    fn refine(
        &self,
        py: Python<'_>,
        model: &Bound<'_, PyModel>,
        observation: &Bound<'_, PyObservation>,
        T_co: &Bound<'_, PyAny>,
        observer: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PyResultOf> {
        let init = array::motion(T_co, "T_co")?;
        let (model, observation) = (model.get(), observation.get());
        warn(py, model, observation, [&init].into_iter())?;
        let mut watch = Watch::new(observer)?;
        let mut refiner = self.take()?;
        let refinement = py.detach(|| {
            refiner.refine_observed(
                &model.model,
                &observation.observation,
                &init.isometry,
                &mut watch,
            )
        });
        self.put_back([refiner]);
        Ok(PyResultOf::new(&init, refinement, watch.finish()?.stages))
    }

    /// Refines many poses of one object in one image, on several threads.
    ///
    /// Same bits as `refine` for each, whatever the number of threads. The GIL is released; Ctrl-C
    /// ends it.
    ///
    /// Parameters
    /// ----------
    /// model : Model
    /// observation : Observation
    /// T_co : array_like, shape (N, 4, 4)
    ///     The rough poses, camera from object, metres.
    /// threads : int, optional
    ///     Number of threads; as many as the machine runs at once if not given.
    ///
    /// Returns
    /// -------
    /// list of Result
    ///     In the order of the poses.
    ///
    /// Warns
    /// -----
    /// InputWarning
    ///     As `refine`, where it holds for every pose.
    #[pyo3(signature = (model, observation, T_co, threads = None))]
    fn refine_batch(
        &self,
        py: Python<'_>,
        model: &Bound<'_, PyModel>,
        observation: &Bound<'_, PyObservation>,
        T_co: &Bound<'_, PyAny>,
        threads: Option<usize>,
    ) -> PyResult<Vec<PyResultOf>> {
        let inits = array::motions(T_co, "T_co", EXPECTED_POSES, 1.0)?;
        let threads = match threads {
            Some(0) => return Err(InputError::new_err("threads is 0, expected 1 or more")),
            Some(threads) => threads,
            None => std::thread::available_parallelism().map_or(1, usize::from),
        };
        let (model, observation) = (model.get(), observation.get());
        warn(py, model, observation, inits.iter())?;
        let poses: Vec<Isometry3<f64>> = inits.iter().map(|init| init.isometry).collect();
        let mut refiners = (0..threads.min(poses.len()))
            .map(|_| self.take())
            .collect::<PyResult<Vec<_>>>()?;
        let refined = py.detach(|| {
            batch::run(
                &model.model,
                &observation.observation,
                &poses,
                &mut refiners,
            )
        });
        self.put_back(refiners);
        let results = inits.iter().zip(refined?);
        Ok(results
            .map(|(init, (refinement, stages))| PyResultOf::new(init, refinement, stages))
            .collect())
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Pickled> {
        let this = slf.get();
        let maker = slf.get_type().getattr("_restore")?.unbind();
        Ok((
            maker,
            (
                this.origin.clone(),
                this.toml.clone(),
                this.overrides.clone(),
            ),
        ))
    }

    /// Makes a pipeline again from what it was pickled as.
    #[staticmethod]
    fn _restore(origin: &str, toml: String, overrides: Vec<String>) -> PyResult<Self> {
        Self::parse(origin, toml, overrides)
    }

    fn __repr__(&self) -> String {
        format!("Pipeline('{}')", self.name)
    }
}

impl PyPipeline {
    /// Parses a pipeline, applies the overrides, and checks that it builds.
    fn parse(origin: &str, toml: String, overrides: Vec<String>) -> PyResult<Self> {
        let mut file = PipelineFile::parse(&toml, origin).map_err(errors::input)?;
        for assignment in &overrides {
            file.set(assignment).map_err(errors::input)?;
        }
        file.build().map_err(errors::input)?;
        let words = std::iter::once(origin).chain(overrides.iter().map(String::as_str));
        Ok(Self {
            name: words.collect::<Vec<_>>().join(" "),
            origin: origin.to_owned(),
            file,
            toml,
            overrides,
            refiners: Mutex::default(),
        })
    }

    /// Builds the pipeline.
    pub(crate) fn build(&self) -> PyResult<hybrid_icp::BoxedStage> {
        self.file.build().map_err(errors::input)
    }

    /// Returns a refiner that is not in use, or a new one.
    fn take(&self) -> PyResult<Refiner> {
        match locked(&self.refiners).pop() {
            Some(refiner) => Ok(refiner),
            None => self.build().map(Refiner::boxed),
        }
    }

    fn put_back(&self, refiners: impl IntoIterator<Item = Refiner>) {
        locked(&self.refiners).extend(refiners);
    }
}

/// Warns if no pose fits the image.
fn warn<'a>(
    py: Python<'_>,
    model: &PyModel,
    observation: &PyObservation,
    inits: impl Iterator<Item = &'a Motion>,
) -> PyResult<()> {
    let center = model.model.center();
    let mut first = None;
    for init in inits {
        let distance = (init.isometry * center).z;
        match warning_of_distance(distance, observation.median_depth) {
            Some(warning) => first.get_or_insert(warning),
            None => return Ok(()),
        };
    }
    match first {
        Some(Warning::BehindCamera { z }) => errors::warn(
            py,
            &format!(
                "T_co puts the object's centre at z = {z:.4} m, behind the camera, which looks along +z: expected camera \
                 from object, not object from camera"
            ),
        ),
        Some(Warning::Depth { measured, expected }) => errors::warn(
            py,
            &format!(
                "T_co puts the object's centre at z = {expected:.4} m, but the median depth inside the mask is {measured:.4} m: \
                 check the units of both, expected metres"
            ),
        ),
        _ => Ok(()),
    }
}
