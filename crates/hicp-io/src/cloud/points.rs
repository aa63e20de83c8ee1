//! A point cloud, and one that grows while a file is parsed.

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
    /// Number of points of the file that were skipped: they are not finite, or have no normal in a
    /// file with normals. In the clouds of images, pixels without a measurement do not count.
    pub n_skipped: usize,
}

impl PointCloud {
    /// Forgets the skipped points if the file has the rows and columns of an image.
    pub(super) fn organized(self, is_organized: bool) -> Self {
        let n_skipped = if is_organized { 0 } else { self.n_skipped };
        Self { n_skipped, ..self }
    }
}

/// The points of a file that is being parsed.
pub(super) struct Points<'a> {
    reading: Reading<'a>,
    points: Vec<Point3<f32>>,
    normals: Vec<UnitVector3<f32>>,
    with_normals: bool,
    n_skipped: usize,
}

impl<'a> Points<'a> {
    pub(super) fn new(reading: Reading<'a>, with_normals: bool) -> Self {
        Self {
            reading,
            points: Vec::new(),
            normals: Vec::new(),
            with_normals,
            n_skipped: 0,
        }
    }

    /// Adds a point in the unit of the file, with its normal.
    ///
    /// Skips a point without a position or a normal, as organized clouds have them where nothing
    /// was measured.
    pub(super) fn add(&mut self, place: Place, values: &[f64; 6]) -> Result<(), IoError> {
        let [x, y, z, nx, ny, nz] = *values;
        let used = if self.with_normals { 6 } else { 3 };
        if !values[..used].iter().all(|value| value.is_finite()) {
            self.n_skipped += 1;
            return Ok(());
        }
        if self.with_normals {
            let normal = Vector3::new(nx, ny, nz).cast::<f32>();
            let normal = UnitVector3::try_new(normal, 1e-6);
            // Beyond the range of `f32`, a number is infinite, and so is the norm.
            match normal.filter(|normal| normal.iter().all(|value| value.is_finite())) {
                Some(normal) => self.normals.push(normal),
                None => {
                    self.n_skipped += 1;
                    return Ok(());
                }
            }
        }
        self.reading.check_position(place.clone(), &[x, y, z])?;
        let point = Point3::new(x, y, z) / self.reading.unit.units_per_meter();
        self.points.push(point.cast());
        self.reading
            .check(Limit::VERTICES, place, self.points.len())
    }

    pub(super) fn finish(self) -> Result<PointCloud, IoError> {
        if self.points.is_empty() {
            let expected = "a point with three finite coordinates";
            return Err(IoError::new(self.reading.path, None, "no points", expected));
        }
        Ok(PointCloud {
            points: self.points,
            normals: self.with_normals.then_some(self.normals),
            n_skipped: self.n_skipped,
        })
    }
}
