//! `Pipeline`.

use std::path::PathBuf;
use std::sync::Mutex;

use hybrid_icp::core::Isometry3;
use hybrid_icp::icp::Alternative;
use hybrid_icp::pipeline::PipelineFile;
use hybrid_icp::{Preset, Refinement, Refiner, Trace, checks::median_depth};
use pyo3::prelude::*;

use crate::array::{self, Motion};
use crate::batch;
use crate::errors::{self, InputError};
use crate::input::model::PyModel;
use crate::input::observation::PyObservation;
use crate::mutex::locked;
use crate::observer::Watch;
use crate::{results, toml, warnings};

const EXPECTED_POSES: &str = "an (N, 4, 4) float64 array of [R t; 0 0 0 1], meters";

/// A refinement pipeline: the default, another preset, or a custom pipeline from a TOML file.
///
/// `Pipeline()` is "auto", which suits most uses. `Pipeline.from_toml` reads a custom pipeline. A
/// pipeline keeps scratch memory between calls. Threads can share it.
///
/// Parameters
/// ----------
/// name : str, optional
///     One of `Pipeline.presets()`. "local" refines the pose near its start. "search" and "auto"
///     also search for the object: "search" unless the refined pose explains the image well, "auto"
///     only if it explains the image badly. "color" is "auto" with the colors of the model and the
///     observation, which the others use only in `estimate`. "hybrid" is Hybrid ICP as in the
///     paper, and "hybrid-visible" is a variant of it.
/// overrides : dict, or sequence of str, optional
///     Fields to set, such as `{"threshold": 0.3}` of "auto" or `["times=3"]` of "hybrid".
///
/// Raises
/// ------
/// InputError
///     If there is no such preset or field. The message suggests similar names.
///
/// Examples
/// --------
/// >>> from hybrid_icp import Pipeline
/// >>> Pipeline()
/// Pipeline('auto')
/// >>> Pipeline(overrides={"threshold": 0.3}).name
/// 'auto threshold=0.3'
/// >>> Pipeline("hybrid")
/// Pipeline('hybrid')
#[pyclass(frozen, module = "hybrid_icp", name = "Pipeline")]
#[derive(Debug)]
pub(crate) struct PyPipeline {
    name: String,
    origin: String,
    file: PipelineFile,
    toml: String,
    overrides: Vec<String>,
    /// `true` if a part compares colors.
    colors: bool,
    /// Refiners that are not in use, with their scratch memory.
    refiners: Mutex<Vec<Refiner>>,
}

/// The function that restores a pipeline, and its arguments: origin, text and overrides.
type Pickled = (Py<PyAny>, (String, String, Vec<String>));

#[pymethods]
#[allow(non_snake_case)]
impl PyPipeline {
    #[new]
    #[pyo3(signature = (name = "auto", *, overrides = None))]
    fn new(name: &str, overrides: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let preset: Preset = name.parse().map_err(errors::input)?;
        Self::parse(name, preset.toml().to_owned(), toml::overrides(overrides)?)
    }

    /// Creates a pipeline by name, like `Pipeline(name)`.
    ///
    /// Parameters
    /// ----------
    /// name : str
    ///     One of `Pipeline.presets()`.
    /// overrides : dict, or sequence of str, optional
    ///     Fields to set, as for `Pipeline`.
    ///
    /// Returns
    /// -------
    /// Pipeline
    #[staticmethod]
    #[pyo3(signature = (name, *, overrides = None))]
    fn preset(name: &str, overrides: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        Self::new(name, overrides)
    }

    /// Creates a pipeline from a TOML file or its text.
    ///
    /// Parameters
    /// ----------
    /// text_or_path : str or os.PathLike
    ///     A path object, a string that ends with ".toml", or the text itself.
    /// overrides : dict, or sequence of str, optional
    ///     Fields to set, as for `Pipeline`.
    ///
    /// Returns
    /// -------
    /// Pipeline
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If the text is not a valid pipeline. The message names the line, the field, the value
    ///     found and the values expected.
    /// FileError
    ///     If the file cannot be read.
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
    #[pyo3(signature = (text_or_path, *, overrides = None))]
    fn from_toml(
        text_or_path: &Bound<'_, PyAny>,
        overrides: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let overrides = toml::overrides(overrides)?;
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

    /// Creates a pipeline of one ICP stage from its parts.
    ///
    /// A part is its name, or a dict with its name as "type" and its parameters. `parts` returns
    /// all of them.
    ///
    /// Parameters
    /// ----------
    /// selection, association, metric : str or dict
    ///     The points to register, how they are paired, and the error to minimize.
    /// filter, stop : list of str or dict, optional
    ///     Outlier filters and weights, and stop rules, in order.
    ///
    /// Returns
    /// -------
    /// Pipeline
    ///
    /// Examples
    /// --------
    /// >>> from hybrid_icp import Pipeline
    /// >>> Pipeline.icp(
    /// ...     selection="visible-surface",
    /// ...     association="projective",
    /// ...     metric="point-to-plane",
    /// ...     filter=[{"type": "max-distance", "limit": 0.25, "unit": "diameters"}],
    /// ... )
    /// Pipeline('icp')
    #[staticmethod]
    #[pyo3(signature = (*, selection, association, metric, filter = None, stop = None))]
    fn icp(
        selection: &Bound<'_, PyAny>,
        association: &Bound<'_, PyAny>,
        metric: &Bound<'_, PyAny>,
        filter: Option<&Bound<'_, PyAny>>,
        stop: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let mut text = "type = \"icp\"\n".to_owned();
        for (name, part) in [
            ("selection", Some(selection)),
            ("association", Some(association)),
            ("metric", Some(metric)),
            ("filter", filter),
            ("stop", stop),
        ] {
            if let Some(part) = part {
                text += &format!("{name} = {}\n", toml::value(part)?);
            }
        }
        Self::parse("icp", text, Vec::new())
    }

    /// Returns the names of the pipelines that ship with the library, Hybrid ICP first.
    ///
    /// Returns
    /// -------
    /// list of str
    #[staticmethod]
    fn presets() -> Vec<&'static str> {
        Preset::ALL.map(Preset::name).to_vec()
    }

    /// Name in reports: the name of the preset or file, followed by the overrides.
    #[getter]
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// The pipeline as TOML text, without the overrides.
    #[getter]
    fn toml(&self) -> &str {
        &self.toml
    }

    /// Refines a pose.
    ///
    /// The result is deterministic. Data never causes an exception: without overlap, or with
    /// degenerate geometry, the result reports the reason. The call releases the GIL.
    ///
    /// Parameters
    /// ----------
    /// model : Model
    ///     The object.
    /// observation : Observation
    ///     The image.
    /// T_co : array_like, shape (4, 4)
    ///     The initial pose, camera from object, meters.
    /// observer : callable or object, optional
    ///     A callable receives an `IterationEvent` per iteration. An object can have any of the
    ///     methods `on_iteration`, `on_regime`, `on_decision` and `on_stage_end`. If one of them
    ///     returns `False`, the run stops at the last accepted pose. An exception stops the run
    ///     and is raised again.
    ///
    /// Returns
    /// -------
    /// Result
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If the pose is not a rigid motion in meters.
    ///
    /// Warns
    /// -----
    /// InputWarning
    ///     If the inputs do not fit together: the object is behind the camera, or at less than a
    ///     third or more than three times the measured depth; the mask is empty, without depth, or
    ///     has far more or fewer pixels than the object; or colors that the pipeline compares are
    ///     missing.
    ///
    /// Examples
    /// --------
    /// A plate is 0.5 m in front of the camera, and the detector reports 0.54 m:
    ///
    /// >>> import numpy as np
    /// >>> from hybrid_icp import Camera, Model, Observation, Pipeline, render_depth
    /// >>> corners = [[-.1, -.1, 0], [.1, -.1, 0], [.1, .1, 0], [-.1, .1, 0]]
    /// >>> model = Model(corners, [[0, 2, 1], [0, 3, 2]])
    /// >>> camera = Camera(100, 100, 31.5, 31.5, 64, 64)
    /// >>> true = np.eye(4); true[2, 3] = 0.5
    /// >>> depth = render_depth(model, camera, true)
    /// >>> observation = Observation(depth, depth > 0, camera)
    /// >>> rough = np.eye(4); rough[2, 3] = 0.54
    /// >>> result = Pipeline().refine(model, observation, rough)
    /// >>> bool(abs(result.T_co[2, 3] - 0.5) < 1e-4)
    /// True
    #[pyo3(signature = (model, observation, T_co, observer = None))]
    fn refine<'py>(
        &self,
        py: Python<'py>,
        model: &Bound<'py, PyModel>,
        observation: &Bound<'_, PyObservation>,
        T_co: &Bound<'_, PyAny>,
        observer: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let init = array::motion(T_co, "T_co")?;
        let (object, observation) = (model.get(), observation.get());
        self.warn_of(py, object, observation, &init)?;
        let mut watch = Watch::new(observer)?;
        let (seen, start) = (&observation.observation, &init.isometry);
        let (refinement, others) = self.run(py, |refiner| {
            refiner.refine_observed(&object.model, seen, start, &mut watch)
        })?;
        let stages = watch.finish()?.stages;
        results::result(model, &init, &refinement, &stages, &others)
    }

    /// Finds the pose of an object in its mask, without an initial pose.
    ///
    /// The pipeline refines the best poses that a search over all rotations finds. The result is
    /// deterministic. Data never causes an exception. The call releases the GIL.
    ///
    /// Parameters
    /// ----------
    /// model : Model
    ///     The object.
    /// observation : Observation
    ///     The image. Its mask shows one instance of the object.
    ///
    /// Returns
    /// -------
    /// Result
    ///     Its `mve_initial` equals `mve`, because there is no initial pose. If no surface was
    ///     measured inside the mask, `outcome` is "kept_initial" and `T_co` is the identity.
    ///
    /// Warns
    /// -----
    /// InputWarning
    ///     As for `refine`, if the model does not fit the image at the measured depth. Any pipeline
    ///     compares the colors of the observation.
    ///
    /// Examples
    /// --------
    /// A plate is 0.5 m in front of the camera:
    ///
    /// >>> import numpy as np
    /// >>> from hybrid_icp import Camera, Model, Observation, Pipeline, render_depth
    /// >>> corners = [[-.1, -.1, 0], [.1, -.1, 0], [.1, .1, 0], [-.1, .1, 0]]
    /// >>> model = Model(corners, [[0, 2, 1], [0, 3, 2]])
    /// >>> camera = Camera(100, 100, 31.5, 31.5, 64, 64)
    /// >>> true = np.eye(4); true[2, 3] = 0.5
    /// >>> depth = render_depth(model, camera, true)
    /// >>> result = Pipeline("local").estimate(model, Observation(depth, depth > 0, camera))
    /// >>> bool(result.mve < 0.1 and abs(result.T_co[2, 3] - 0.5) < 1e-3)
    /// True
    fn estimate<'py>(
        &self,
        py: Python<'py>,
        model: &Bound<'py, PyModel>,
        observation: &Bound<'_, PyObservation>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (object, observation) = (model.get(), observation.get());
        let colors = self.colors || observation.observation.color().is_some();
        // Without depth, any distance in front of the camera will do.
        let distance = median_depth(&observation.observation).unwrap_or(1.0);
        self.warn(py, object, observation, &[distance], colors)?;
        let (seen, mut trace) = (&observation.observation, Trace::new());
        let (refinement, others) = self.run(py, |refiner| {
            refiner.estimate_observed(&object.model, seen, &mut trace)
        })?;
        let init = Motion::new(Isometry3::identity());
        results::result(model, &init, &refinement, &trace.stages, &others)
    }

    /// Judges a pose as it is, for example a fused one or that of another library.
    ///
    /// The result has the scores, the confidence and the warnings of `estimate`: nothing is assumed
    /// about the way in which the pose was found. The call releases the GIL.
    ///
    /// Parameters
    /// ----------
    /// model : Model
    ///     The object.
    /// observation : Observation
    ///     The image. Its mask shows one instance of the object.
    /// T_co : array_like, shape (4, 4)
    ///     The pose, camera from object, meters.
    ///
    /// Returns
    /// -------
    /// Result
    ///     Its `T_co` is the given pose, and `outcome` is "kept_initial".
    ///
    /// Warns
    /// -----
    /// InputWarning
    ///     As for `refine`, except for colors.
    fn judge<'py>(
        &self,
        py: Python<'py>,
        model: &Bound<'py, PyModel>,
        observation: &Bound<'_, PyObservation>,
        T_co: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let pose = array::motion(T_co, "T_co")?;
        let (object, observation) = (model.get(), observation.get());
        self.warn(py, object, observation, &[object.z_at(&pose)], false)?;
        let seen = &observation.observation;
        let (judged, _) = self.run(py, |refiner| {
            refiner.judge(&object.model, seen, &pose.isometry)
        })?;
        results::result(model, &pose, &judged, &[], &[])
    }

    /// Refines many poses of one object in one image, on several threads.
    ///
    /// The results have the bits of single calls of `refine`, for any number of threads. The call
    /// releases the GIL. Ctrl-C stops it.
    ///
    /// Parameters
    /// ----------
    /// model : Model
    /// observation : Observation
    /// T_co : array_like, shape (N, 4, 4)
    ///     The initial poses, camera from object, meters.
    /// threads : int, optional
    ///     Number of threads. The default is the number that the machine runs at once.
    ///
    /// Returns
    /// -------
    /// list of Result
    ///     In the order of the poses.
    ///
    /// Warns
    /// -----
    /// InputWarning
    ///     As for `refine`, if no pose fits the image.
    #[pyo3(signature = (model, observation, T_co, threads = None))]
    fn refine_batch<'py>(
        &self,
        py: Python<'py>,
        model: &Bound<'py, PyModel>,
        observation: &Bound<'_, PyObservation>,
        T_co: &Bound<'_, PyAny>,
        threads: Option<i64>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let inits = array::motions(T_co, "T_co", EXPECTED_POSES, 1.0)?;
        let threads = match threads {
            Some(threads @ 1..) => usize::try_from(threads).unwrap_or(usize::MAX),
            Some(threads) => {
                let text = format!("threads is {threads}, expected 1 or more");
                return Err(InputError::new_err(text));
            }
            None => available_threads(),
        };
        let (object, observation) = (model.get(), observation.get());
        let distances: Vec<f64> = inits.iter().map(|init| object.z_at(init)).collect();
        self.warn(py, object, observation, &distances, self.colors)?;
        let poses: Vec<Isometry3<f64>> = inits.iter().map(|init| init.isometry).collect();
        let mut refiners = (0..threads.min(poses.len()))
            .map(|_| self.take())
            .collect::<PyResult<Vec<_>>>()?;
        let refined = py.detach(|| {
            batch::run(
                &object.model,
                &observation.observation,
                &poses,
                &mut refiners,
            )
        });
        self.put_back(refiners);
        let results = inits.iter().zip(refined?);
        results
            .map(|(init, (refinement, stages, others))| {
                results::result(model, init, &refinement, &stages, &others)
            })
            .collect()
    }

    /// Refines poses of any objects in any images, on several threads.
    ///
    /// It reads at most two items per thread ahead, so images can be loaded on the way.
    ///
    /// Parameters
    /// ----------
    /// items : iterable of (Model, Observation, T_co)
    ///     T_co has the shape (4, 4): camera from object, meters.
    /// threads : int, optional
    ///     Number of threads. The default is the number that the machine runs at once.
    ///
    /// Returns
    /// -------
    /// list of Result
    ///     In the order of the items, with the bits of single calls of `refine`.
    ///
    /// Raises
    /// ------
    /// InputError
    ///     As for `refine`, with the index of the item. The remaining items are not refined.
    #[pyo3(signature = (items, threads = None))]
    fn refine_many<'py>(
        slf: &Bound<'py, Self>,
        items: &Bound<'py, PyAny>,
        threads: Option<i64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let module = slf.py().import("hybrid_icp._many")?;
        let threads = threads.or_else(|| i64::try_from(available_threads()).ok());
        module.call_method1("refine", (slf, items, threads))
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Pickled> {
        let this = slf.get();
        let maker = slf.get_type().getattr("_restore")?.unbind();
        let (origin, toml) = (this.origin.clone(), this.toml.clone());
        Ok((maker, (origin, toml, this.overrides.clone())))
    }

    /// Restores a pipeline from its pickled arguments.
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
        let of_colors = |text: &str| {
            ["color-choice", "photometric"]
                .iter()
                .any(|p| text.contains(p))
        };
        let colors = of_colors(&toml) || overrides.iter().any(|text| of_colors(text));
        Ok(Self {
            name: [&[origin.to_owned()], &overrides[..]].concat().join(" "),
            origin: origin.to_owned(),
            file,
            toml,
            overrides,
            colors,
            refiners: Mutex::default(),
        })
    }

    /// Builds the pipeline.
    pub(crate) fn build(&self) -> PyResult<hybrid_icp::BoxedStage> {
        self.file.build().map_err(errors::input)
    }

    /// Runs a refiner without the GIL. Returns the result and the other poses that it found.
    fn run(
        &self,
        py: Python<'_>,
        run: impl FnOnce(&mut Refiner) -> Refinement + Send,
    ) -> PyResult<(Refinement, Vec<Alternative>)> {
        let mut refiner = self.take()?;
        let refinement = py.detach(|| run(&mut refiner));
        let others = refiner.alternatives().to_vec();
        self.put_back([refiner]);
        Ok((refinement, others))
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

    /// Warns as `refine` does for one pose.
    pub(crate) fn warn_of(
        &self,
        py: Python<'_>,
        model: &PyModel,
        observation: &PyObservation,
        init: &Motion,
    ) -> PyResult<()> {
        self.warn(py, model, observation, &[model.z_at(init)], self.colors)
    }

    /// Warns if missing colors are compared, and if the object fits the image at no distance.
    fn warn(
        &self,
        py: Python<'_>,
        object: &PyModel,
        observation: &PyObservation,
        distances: &[f64],
        compares_colors: bool,
    ) -> PyResult<()> {
        let by = compares_colors.then(|| self.__repr__());
        warnings::about_inputs(py, object, observation, distances, by)
    }
}

/// Returns the number of threads that the machine runs at once for this process.
fn available_threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
