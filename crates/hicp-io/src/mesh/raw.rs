//! A mesh while its file is parsed.

use std::path::Path;

use hicp_core::{MAX_COORDINATE_METERS, MeshError, Point3, TriMesh, Vector3};

use super::polygon;
use crate::error::{IoError, Place};
use crate::limits::{Limit, ReadLimits};
use crate::unit::LengthUnit;

/// The file that is parsed, its unit and the limits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reading<'a> {
    pub(crate) path: &'a Path,
    pub(crate) unit: LengthUnit,
    pub(crate) limits: &'a ReadLimits,
}

impl Reading<'_> {
    pub(super) fn refuse(
        &self,
        place: Place,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> IoError {
        IoError::new(self.path, place, found, expected)
    }

    pub(super) fn check(&self, limit: Limit, place: Place, count: usize) -> Result<(), IoError> {
        self.limits.check(limit, self.path, place, count as u64)
    }

    /// Refuses a position, in the unit of the file, that no mesh can have.
    pub(super) fn check_position(&self, place: Place, position: &[f64]) -> Result<(), IoError> {
        let most = f64::from(MAX_COORDINATE_METERS) * self.unit.units_per_meter();
        // Rounding to `f32` does not carry it over the limit, which is below 2^24 and so exact.
        if position.iter().all(|x| x.abs() <= most) {
            return Ok(());
        }
        let unit = self.unit;
        let expected = format!("finite coordinates within ±{MAX_COORDINATE_METERS} m (in {unit})");
        Err(self.refuse(place, format!("the position {position:?}"), expected))
    }
}

/// A mesh in the unit of its file.
#[derive(Debug)]
pub(crate) struct RawMesh {
    pub(crate) vertices: Vec<Point3<f64>>,
    /// The normals of a point cloud.
    pub(crate) normals: Vec<Vector3<f64>>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// The error if there are no triangles.
    pub(super) empty: IoError,
    /// The steps that cutting polygons may still cost.
    pub(super) clipping_budget: u64,
}

/// The expected text of a file without triangles.
pub(super) const FACE: &str = "a face of three corners or more";

impl RawMesh {
    pub(super) fn new(empty: IoError) -> Self {
        Self {
            vertices: Vec::new(),
            normals: Vec::new(),
            triangles: Vec::new(),
            empty,
            clipping_budget: polygon::CLIPPING_BUDGET,
        }
    }

    /// Adds a face by its corners, counted from 0; refuses a corner that is not a vertex. Messages name the number of the face.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the range is checked"
    )]
    pub(super) fn add_numbered_face(
        &mut self,
        reading: &Reading<'_>,
        place: Place,
        face: usize,
        corners: &[f64],
    ) -> Result<(), IoError> {
        let count = self.vertices.len();
        let mut indices = corners.iter();
        if let Some(index) = indices.find(|index| !(0.0..count as f64).contains(*index)) {
            let expected = match count.checked_sub(1) {
                None => "no face, because there are no vertices".to_owned(),
                Some(last) => format!("vertices from 0 to {last}"),
            };
            let found = format!("vertex {index} in face {face}");
            return Err(reading.refuse(place, found, expected));
        }
        let corners: Vec<u32> = corners.iter().map(|index| *index as u32).collect();
        self.add_face(reading, place, &corners)
    }

    /// Adds a face. Its corners must be vertices that are there.
    pub(super) fn add_face(
        &mut self,
        reading: &Reading<'_>,
        place: Place,
        corners: &[u32],
    ) -> Result<(), IoError> {
        let count = self.triangles.len() + corners.len().saturating_sub(2);
        reading.check(Limit::Triangles, place.clone(), count)?;
        let budget = &mut self.clipping_budget;
        if polygon::triangulate(&self.vertices, corners, &mut self.triangles, budget) {
            return Ok(());
        }
        let found = format!("a concave polygon of {} corners", corners.len());
        let expected = format!(
            "one that is cut into triangles within {} steps, together with those before it: cut it beforehand",
            polygon::CLIPPING_BUDGET
        );
        Err(reading.refuse(place, found, expected))
    }

    pub(super) fn finish(self, reading: &Reading<'_>) -> Result<TriMesh, IoError> {
        let scale = reading.unit.units_per_meter();
        let vertices = self.vertices.iter().map(|p| (p / scale).cast::<f32>());
        let mesh = TriMesh::new(vertices.collect(), self.triangles);
        mesh.map_err(|error| {
            let expected = match error {
                MeshError::NoTriangles { .. } => return self.empty,
                MeshError::NoArea { .. } => "a triangle that has an area",
                _ => "a usable one",
            };
            IoError::new(reading.path, None, "no usable mesh", expected).with_source(error)
        })
    }
}

/// Parses the three coordinates that words start with.
pub(super) fn position<'a>(words: impl Iterator<Item = &'a str>) -> Option<[f64; 3]> {
    let mut numbers = words.map_while(|word| word.parse().ok());
    Some([numbers.next()?, numbers.next()?, numbers.next()?])
}
