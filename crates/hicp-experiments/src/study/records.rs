//! The cameras and objects in a configuration.

use hicp_core::{CameraError, PinholeCamera};
use serde::{Deserialize, Serialize};

use crate::subject::Subject;

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

/// Returns the camera of the studies: 640 × 480 pixels with a focal length of 573 pixels.
pub(crate) fn camera() -> Result<PinholeCamera, CameraError> {
    // Open: camera: §VI-A. That of the LINEMOD dataset, pixels.
    PinholeCamera::new(572.4, 573.6, 325.3, 242.0, 640, 480)
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
