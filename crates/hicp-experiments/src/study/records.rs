//! The cameras and objects in a configuration.

use hicp_core::{CameraError, PinholeCamera};
use serde::{Deserialize, Serialize};

use crate::subject::Subject;

/// A camera in a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "the names of every camera file")]
pub struct CameraRecord {
    pub fx: f64,
    pub fy: f64,
    pub cx: f64,
    pub cy: f64,
    pub width: u32,
    pub height: u32,
}

/// An object in a configuration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectRecord {
    /// Its name.
    pub name: String,
    /// `household`, or the name of the mesh file.
    pub source: String,
    /// Number of triangles.
    pub triangles: usize,
    /// Diameter, millimeters.
    pub diameter_mm: f64,
    /// `true` if symmetries are declared, so that ADI replaces ADD.
    pub symmetric: bool,
    /// A hash of the mesh.
    pub fingerprint: String,
}

impl Default for CameraRecord {
    /// The camera of the studies: 640 × 480 pixels with a focal length of 573 pixels.
    fn default() -> Self {
        Self {
            // Open: camera: §VI-A. That of the LINEMOD dataset, pixels.
            fx: 572.4,
            fy: 573.6,
            cx: 325.3,
            cy: 242.0,
            width: 640,
            height: 480,
        }
    }
}

impl CameraRecord {
    pub(crate) fn pinhole(&self) -> Result<PinholeCamera, CameraError> {
        PinholeCamera::new(self.fx, self.fy, self.cx, self.cy, self.width, self.height)
    }
}

impl From<&Subject> for ObjectRecord {
    fn from(subject: &Subject) -> Self {
        Self {
            name: subject.name.clone(),
            source: subject.source.clone(),
            triangles: subject.model.mesh().triangles().len(),
            diameter_mm: subject.model.diameter() * 1e3,
            symmetric: subject.is_symmetric(),
            fingerprint: format!("{:016x}", subject.fingerprint()),
        }
    }
}
