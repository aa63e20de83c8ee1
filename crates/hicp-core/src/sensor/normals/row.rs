//! A row of pixels that get their surfels.

use super::lanes::LANES;
use super::patch::DepthPatch;
use crate::surfel::Surfel;

/// A row of the patch, and what the fits of its pixels need.
pub(super) struct Row<'a> {
    pub(super) patch: &'a DepthPatch<'a>,
    pub(super) rays: &'a Rays,
    pub(super) v: usize,
    /// The surfels of its pixels.
    pub(super) surfels: &'a mut [Surfel],
}

/// Ray slopes (x/z, y/z) of the region's columns and rows.
pub(super) struct Rays {
    pub(super) fx: f64,
    pub(super) fy: f64,
    /// Followed by as many zeros as there are lanes.
    pub(super) x: Vec<f64>,
    pub(super) y: Vec<f64>,
}

impl Rays {
    pub(super) fn new(patch: &DepthPatch<'_>) -> Self {
        let (camera, region) = (patch.camera, patch.region);
        let columns =
            (region.u_min..region.u_max).map(|u| (f64::from(u) - camera.cx()) / camera.fx());
        Self {
            fx: camera.fx(),
            fy: camera.fy(),
            x: columns.chain([0.0; LANES]).collect(),
            y: (region.v_min..region.v_max)
                .map(|v| (f64::from(v) - camera.cy()) / camera.fy())
                .collect(),
        }
    }
}
