//! The state of a mesh during parsing.

use std::collections::HashMap;
use std::path::Path;

use hicp_core::{MAX_COORDINATE_METERS, MeshError, Point3, TriMesh, Vector3};

use super::colors::Colors;
use super::polygon;
use crate::error::{IoError, Place};
use crate::limits::{Limit, ReadLimits};
use crate::number::whole;
use crate::unit::LengthUnit;

/// The file being parsed, its unit and the limits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reading<'a> {
    pub(crate) path: &'a Path,
    pub(crate) unit: LengthUnit,
    pub(crate) limits: &'a ReadLimits,
    /// `true` if colors are read, too.
    pub(crate) with_color: bool,
}

impl Reading<'_> {
    pub(crate) fn refuse(
        &self,
        place: Place,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> IoError {
        IoError::new(self.path, place, found, expected)
    }

    pub(crate) fn check(&self, limit: Limit, place: Place, count: usize) -> Result<(), IoError> {
        self.limits.check(limit, self.path, place, count as u64)
    }

    /// Returns an error for a position, in the unit of the file, that a mesh cannot have.
    pub(crate) fn check_position(&self, place: Place, position: &[f64]) -> Result<(), IoError> {
        let most = f64::from(MAX_COORDINATE_METERS) * self.unit.units_per_meter();
        // The limit is below 2^24 and so exact in `f32`; rounding cannot exceed it.
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
pub(crate) struct RawMesh<'a> {
    pub(super) reading: Reading<'a>,
    pub(crate) vertices: Vec<Point3<f64>>,
    /// The normals of a point cloud.
    pub(crate) normals: Vec<Vector3<f64>>,
    /// Number of points of a point cloud that were skipped.
    pub(crate) n_skipped: usize,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) colors: Colors,
    /// The triangles of the last face, as places among its corners.
    pub(super) places: Vec<[usize; 3]>,
    /// The error if there are no triangles.
    pub(super) empty: IoError,
    /// The indices of welded vertices by position.
    index_at: HashMap<[u64; 3], u32>,
    /// The number of steps left for cutting polygons.
    pub(super) clipping_budget: u64,
}

/// The expected text for a file without triangles.
pub(super) const FACE: &str = "a face of three corners or more";

impl<'a> RawMesh<'a> {
    pub(super) fn new(reading: Reading<'a>, empty: IoError) -> Self {
        Self {
            reading,
            vertices: Vec::new(),
            normals: Vec::new(),
            n_skipped: 0,
            triangles: Vec::new(),
            colors: Colors::default(),
            places: Vec::new(),
            empty,
            index_at: HashMap::new(),
            clipping_budget: polygon::CLIPPING_BUDGET,
        }
    }

    pub(super) fn add_vertex(&mut self, place: Place, position: [f64; 3]) -> Result<(), IoError> {
        self.reading.check_position(place.clone(), &position)?;
        self.vertices.push(position.into());
        self.reading
            .check(Limit::VERTICES, place, self.vertices.len())
    }

    /// Adds a vertex unless there is one at the same position, and returns its index.
    ///
    /// Used for files that repeat the vertices of every facet.
    pub(super) fn weld(&mut self, place: Place, position: [f64; 3]) -> Result<u32, IoError> {
        // Adding 0 turns -0 into +0.
        let key = position.map(|value| (value + 0.0).to_bits());
        // A mesh refuses larger numbers of vertices later.
        let next = u32::try_from(self.vertices.len()).unwrap_or(u32::MAX);
        let index = *self.index_at.entry(key).or_insert(next);
        if index == next {
            self.add_vertex(place, position)?;
        }
        Ok(index)
    }

    /// Adds the face with index `number` by its corners. Refuses a corner that is not a vertex.
    pub(super) fn add_corners(
        &mut self,
        place: Place,
        number: usize,
        corners: &[f64],
    ) -> Result<(), IoError> {
        let count = self.vertices.len();
        let is_vertex = |index: &f64| (0.0..count as f64).contains(index) && index.fract() == 0.0;
        if let Some(index) = corners.iter().find(|index| !is_vertex(index)) {
            let expected = match count.checked_sub(1) {
                None => "no face, because there are no vertices".to_owned(),
                Some(last) => format!("vertices from 0 to {last}"),
            };
            let found = format!("vertex {index} in face {number}");
            return Err(self.reading.refuse(place, found, expected));
        }
        let corners: Vec<u32> = corners.iter().copied().map(whole).collect();
        self.add_face(place, &corners)
    }

    /// Covers the last face with an image, by the texture coordinates of its corners.
    pub(super) fn texture_face(&mut self, image: u32, coordinates: &[[f32; 2]]) {
        let corner = |place: usize| coordinates.get(place).copied().unwrap_or_default();
        for places in &self.places {
            self.colors.cover(image, places.map(corner));
        }
    }

    /// Adds a face. Its corners must be indices of existing vertices.
    pub(super) fn add_face(&mut self, place: Place, corners: &[u32]) -> Result<(), IoError> {
        let count = self.triangles.len() + corners.len().saturating_sub(2);
        self.reading.check(Limit::TRIANGLES, place.clone(), count)?;
        let budget = &mut self.clipping_budget;
        self.places.clear();
        if polygon::triangulate(&self.vertices, corners, &mut self.places, budget) {
            let triangles = self.places.iter();
            self.triangles
                .extend(triangles.map(|places| places.map(|place| corners[place])));
            return Ok(());
        }
        let found = format!("a concave polygon of {} corners", corners.len());
        let expected = format!(
            "at most {} steps to cut all polygons of the file: triangulate the mesh beforehand",
            polygon::CLIPPING_BUDGET
        );
        Err(self.reading.refuse(place, found, expected))
    }

    /// Returns the mesh in meters, and the reason if its colors cannot be used.
    pub(super) fn finish(self) -> Result<(TriMesh, Option<IoError>), IoError> {
        let path = self.reading.path;
        let (color, fault) = self
            .colors
            .finish(path, self.vertices.len(), self.triangles.len());
        let scale = self.reading.unit.units_per_meter();
        let vertices = self.vertices.iter().map(|p| (p / scale).cast::<f32>());
        let mesh = TriMesh::new(vertices.collect(), self.triangles);
        let mesh = mesh.map_err(|error| {
            let expected = match error {
                MeshError::NoTriangles { .. } => return self.empty,
                MeshError::NoArea { .. } => "a triangle that has an area",
                _ => "a usable one",
            };
            IoError::new(path, None, "no usable mesh", expected).with_source(error)
        })?;
        let Some(color) = color else {
            return Ok((mesh, fault));
        };
        // Its counts are those of the mesh.
        let mesh = mesh
            .with_color(color)
            .map_err(|error| IoError::unusable(path, "color", error));
        Ok((mesh?, fault))
    }
}

/// Parses three coordinates from the first words.
pub(super) fn position<'a>(words: impl Iterator<Item = &'a str>) -> Option<[f64; 3]> {
    let mut numbers = words.map_while(|word| word.parse().ok());
    Some([numbers.next()?, numbers.next()?, numbers.next()?])
}
