//! Registration of point clouds.

use std::ops::ControlFlow;
use std::path::PathBuf;

use hicp_io::{LengthUnit, PointCloud};
use hybrid_icp::core::{Isometry3, Point3, UnitVector3};
use hybrid_icp::icp::{IterationEvent, Observer, Session, Workspace};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::{CloudOptions, CloudSide, CloudWarning, Registration};
use pyo3::prelude::*;

use crate::array::{self, Matrix, Motion};
use crate::errors::{self, InputError};
use crate::results;

/// Registers two point clouds: finds the pose that moves the source onto the target.
///
/// Points that are not finite or at exactly (0, 0, 0) are skipped. Absent normals are estimated if
/// the method needs them. Warnings in the result report both. Ctrl-C stops the call.
///
/// Fitness and RMSE do not prove the pose: a can slides around its axis, and a box on its wrong
/// side can fit better than the truth. Start from a rough pose, and read the warning about
/// directions that the clouds do not determine.
///
/// Parameters
/// ----------
/// source, target : array_like, shape (N, 3), float32
///     Points, meters. A point cloud of Open3D, or the pair that `read_cloud` returns, is accepted
///     with its normals.
/// T_ts : array_like, shape (4, 4), optional
///     The rough pose, target from source, meters. The default is the identity. A translation
///     above 100 m is probably in millimeters, and causes a warning.
/// source_normals, target_normals : array_like, shape (N, 3), float32, optional
///     One normal per point, of any length above 0. Points whose normal is zero are skipped, except
///     for targets of "point-to-point".
/// method : {"gicp", "point-to-plane", "point-to-point"}, optional
///     The error to minimize. "gicp" ends at fewer wrong poses without a warning, and
///     "point-to-plane" is a little faster.
/// max_distance : float, optional
///     Largest distance of a pair, meters. The default is a tenth of the diameter of the source,
///     then a fiftieth.
/// voxel : float, optional
///     Edge of the cubic cells in which points are replaced by their mean first, meters.
/// neighbors : int, optional
///     Number of neighbors from which normals are estimated, at least 3.
///
/// Returns
/// -------
/// Alignment
///     The pose and how well the clouds fit.
#[pyfunction]
#[pyo3(signature = (source, target, T_ts = None, *, source_normals = None, target_normals = None, method = "gicp", max_distance = None, voxel = None, neighbors = 20))]
#[allow(non_snake_case, clippy::too_many_arguments)]
pub(crate) fn align<'py>(
    py: Python<'py>,
    source: &Bound<'_, PyAny>,
    target: &Bound<'_, PyAny>,
    T_ts: Option<&Bound<'_, PyAny>>,
    source_normals: Option<&Bound<'_, PyAny>>,
    target_normals: Option<&Bound<'_, PyAny>>,
    method: &str,
    max_distance: Option<f64>,
    voxel: Option<f64>,
    neighbors: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let method: Registration = method.parse().map_err(errors::input)?;
    for (name, length) in [("max_distance", max_distance), ("voxel", voxel)] {
        if let Some(length) = length.filter(|x| !(x.is_finite() && *x > 0.0)) {
            let text = format!("{name} is {length}, expected a finite number above 0, meters");
            return Err(InputError::new_err(text));
        }
    }
    if neighbors < 3 {
        let text = format!("neighbors is {neighbors}, expected at least 3");
        return Err(InputError::new_err(text));
    }
    let options = CloudOptions {
        voxel_meters: voxel,
        neighbors,
    };
    let source = Points::read(source, source_normals, "source")?;
    let target = Points::read(target, target_normals, "target")?;
    let init = match T_ts {
        Some(pose) => array::motion_of_cloud(pose, "T_ts")?,
        None => Motion::new(Isometry3::identity()),
    };
    let mut lengths: Vec<_> = [&source, &target]
        .into_iter()
        .zip([CloudSide::Source, CloudSide::Target])
        .filter_map(|(cloud, side)| CloudWarning::of_length("voxel", voxel, side, &cloud.points))
        .collect();
    let side = CloudSide::Target;
    let limit = CloudWarning::of_length("max_distance", max_distance, side, &target.points);
    lengths.extend(limit);
    let alignment = py.detach(|| -> PyResult<_> {
        // Normals of large clouds take seconds.
        let interrupted = || Python::attach(|py| py.check_signals());
        let of_source = options.for_source_of(method);
        let source = of_source.cloud(&source.points, source.normals.as_deref());
        let source = source.map_err(errors::input)?;
        interrupted()?;
        let target = options.target_of(method, &target.points, target.normals.as_deref());
        let target = target.map_err(errors::input)?;
        interrupted()?;
        let mut pipeline = method.build(max_distance);
        let mut signals = Signals(Ok(()));
        let mut workspace = Workspace::new(Rasterizer::default());
        let mut session = Session::new(&mut workspace, &mut signals);
        let init = &init.isometry;
        let found = hybrid_icp::align_in(&source, &target, init, &mut pipeline, &mut session);
        signals.0.map(|()| found)
    })?;
    let in_words = |warning: &CloudWarning| match warning {
        CloudWarning::LittleOverlap { .. }
            if lengths.is_empty() && alignment.outcome.n_pairs() == 0 =>
        {
            format!("{warning}: check T_ts, that it and the points are in meters, and max_distance")
        }
        _ => warning.to_string(),
    };
    let warnings = lengths.iter().chain(&alignment.warnings).map(in_words);
    let warnings = array::millimeters(&init.matrix, "T_ts")
        .into_iter()
        .chain(warnings);
    results::alignment(py, &alignment, &init, warnings.collect())
}

/// Reads a point cloud in meters, from a file of any supported format.
///
/// PLY, PCD, XYZ, CSV, NPY and NPZ files are recognized by their first bytes.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
/// unit : {"m", "mm", "cm"}, optional
///     Unit of the coordinates in the file.
///
/// Returns
/// -------
/// points : numpy.ndarray, shape (N, 3), float32
///     Points, meters. Those that are not finite are left out, and those without a normal if others
///     have one.
/// normals : numpy.ndarray, shape (N, 3), float32, or None
///     Their normals, if the file has them.
///
/// Raises
/// ------
/// FileError
///     If the file is malformed, or not a point cloud.
#[pyfunction]
#[pyo3(signature = (path, unit = "m"))]
pub(crate) fn read_cloud(
    py: Python<'_>,
    path: PathBuf,
    unit: &str,
) -> PyResult<(Matrix<f32>, Option<Matrix<f32>>)> {
    let unit: LengthUnit = unit.parse().map_err(InputError::new_err)?;
    let PointCloud {
        points, normals, ..
    } = py
        .detach(|| hicp_io::read_cloud(&path, unit))
        .map_err(errors::file)?;
    let points = points.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    let normals = normals.map(|normals| normals.iter().flat_map(|n| [n.x, n.y, n.z]).collect());
    let matrix = |numbers| Matrix::new(3, numbers);
    Ok((matrix(points), normals.map(matrix)))
}

/// Stops at the exception of a signal handler, such as `KeyboardInterrupt`.
struct Signals(PyResult<()>);

impl Observer for Signals {
    fn on_iteration(&mut self, _: &IterationEvent<'_>) -> ControlFlow<()> {
        if self.0.is_ok() {
            self.0 = Python::attach(|py| py.check_signals());
        }
        match self.0 {
            Ok(()) => ControlFlow::Continue(()),
            Err(_) => ControlFlow::Break(()),
        }
    }
}

/// Returns the points and, if present, the normals of a cloud.
///
/// Accepts a cloud of Open3D, the pair that `read_cloud` returns, or an array of points.
fn parts<'py>(
    cloud: &Bound<'py, PyAny>,
) -> PyResult<(Bound<'py, PyAny>, Option<Bound<'py, PyAny>>)> {
    // In a pair of points, the first one has no rows.
    let is_matrix = |value: &Bound<'_, PyAny>| {
        let row = value.get_item(0).and_then(|row| row.len());
        row.is_ok() || value.len().is_ok_and(|rows| rows == 0)
    };
    if let Ok((points, normals)) = cloud.extract::<(Bound<'_, PyAny>, Option<Bound<'_, PyAny>>)>()
        && (normals.is_none() || is_matrix(&points))
    {
        return Ok((points, normals));
    }
    if let (Some(points), Some(normals)) =
        (cloud.getattr_opt("points")?, cloud.getattr_opt("normals")?)
    {
        let has_normals = normals.len().is_ok_and(|rows| rows > 0);
        return Ok((points, has_normals.then_some(normals)));
    }
    Ok((cloud.clone(), None))
}

/// The arrays of a cloud.
struct Points {
    points: Vec<Point3<f32>>,
    normals: Option<Vec<UnitVector3<f32>>>,
}

impl Points {
    fn read(
        points: &Bound<'_, PyAny>,
        normals: Option<&Bound<'_, PyAny>>,
        name: &str,
    ) -> PyResult<Self> {
        // A zero normal becomes NaN, and its point is skipped.
        let unit = |n: Point3<f32>| UnitVector3::new_normalize(n.coords);
        let (points, own) = parts(points)?;
        let normals = normals
            .or(own.as_ref())
            .map(|array| array::triples(array, &format!("{name}_normals")))
            .transpose()?;
        Ok(Self {
            points: array::triples(&points, name)?,
            normals: normals.map(|normals| normals.into_iter().map(unit).collect()),
        })
    }
}
