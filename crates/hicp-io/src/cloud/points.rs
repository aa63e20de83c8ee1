//! A point cloud, and one that grows while a file is parsed.

use std::path::Path;

use hicp_core::{Point3, UnitVector3, Vector3};

use crate::error::{IoError, Place};
use crate::limits::Limit;
use crate::mesh::raw::Reading;

/// Points in meters, with normals if the file has them.
#[derive(Clone, Debug, PartialEq)]
pub struct PointCloud {
    /// Positions, meters.
    pub points: Vec<Point3<f32>>,
    /// One unit normal per point, or none at all.
    pub normals: Option<Vec<UnitVector3<f32>>>,
    /// Number of points of the file that were skipped: they are not finite, or have no normal where
    /// others have one.
    ///
    /// It is 0 for clouds with the rows and columns of an image, in which gaps are common.
    pub n_skipped: usize,
}

impl PointCloud {
    /// Creates a cloud from points with and without a normal.
    ///
    /// Those without one are skipped, unless no point has one.
    pub(super) fn of(points: &[(Point3<f32>, Option<UnitVector3<f32>>)], n_skipped: usize) -> Self {
        let with_normals = points
            .iter()
            .filter_map(|(p, normal)| Some((*p, (*normal)?)));
        let (positions, normals): (Vec<_>, Vec<_>) = with_normals.unzip();
        if normals.is_empty() {
            return Self {
                points: points.iter().map(|(position, _)| *position).collect(),
                normals: None,
                n_skipped,
            };
        }
        Self {
            n_skipped: n_skipped + points.len() - positions.len(),
            points: positions,
            normals: Some(normals),
        }
    }

    /// Forgets the skipped points if the file has the rows and columns of an image.
    pub(super) fn organized(self, is_organized: bool) -> Self {
        let n_skipped = if is_organized { 0 } else { self.n_skipped };
        Self { n_skipped, ..self }
    }
}

/// Returns a normal of unit length, or `None` if the numbers have no direction.
pub(super) fn normal_of(numbers: [f64; 3]) -> Option<UnitVector3<f32>> {
    let normal = UnitVector3::try_new(Vector3::from(numbers).cast::<f32>(), 1e-6);
    // Beyond the range of `f32`, a number is infinite, and so is the norm.
    normal.filter(|normal| normal.iter().all(|value| value.is_finite()))
}

/// The points of a file that is being parsed.
pub(super) struct Points<'a> {
    reading: Reading<'a>,
    points: Vec<(Point3<f32>, Option<UnitVector3<f32>>)>,
    n_skipped: usize,
}

impl<'a> Points<'a> {
    pub(super) fn new(reading: Reading<'a>) -> Self {
        Self {
            reading,
            points: Vec::new(),
            n_skipped: 0,
        }
    }

    /// Adds a point in the unit of the file, with its normal, which is not finite if there is none.
    ///
    /// Skips a point without a position, as organized clouds have them where nothing was measured.
    pub(super) fn add(&mut self, place: Place, values: &[f64; 6]) -> Result<(), IoError> {
        let [x, y, z, nx, ny, nz] = *values;
        if ![x, y, z].iter().all(|value| value.is_finite()) {
            self.n_skipped += 1;
            return Ok(());
        }
        self.reading.check_position(place.clone(), &[x, y, z])?;
        let point = Point3::new(x, y, z) / self.reading.unit.units_per_meter();
        self.points.push((point.cast(), normal_of([nx, ny, nz])));
        self.reading
            .check(Limit::VERTICES, place, self.points.len())
    }

    pub(super) fn finish(self) -> Result<PointCloud, IoError> {
        if self.points.is_empty() {
            return Err(no_points(self.reading.path));
        }
        Ok(PointCloud::of(&self.points, self.n_skipped))
    }
}

/// Returns the error of a file without points.
pub(super) fn no_points(path: &Path) -> IoError {
    let expected = "a point with three finite coordinates";
    IoError::new(path, None, "no points", expected)
}
