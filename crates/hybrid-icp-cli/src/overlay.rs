//! A depth image with the outlines of a model drawn on it.

use hybrid_icp::{DepthImage, Isometry3, Model, Observation, Problem, Refiner};

/// A colour, 8 bits per channel.
pub(crate) type Rgb = [u8; 3];

/// Orange: the pose before. Distinguishable from [`AFTER`] by the colour-blind.
pub(crate) const BEFORE: Rgb = [230, 159, 0];
/// Sky blue: the pose after.
pub(crate) const AFTER: Rgb = [86, 180, 233];

/// An RGB picture.
pub(crate) struct Picture {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) rgb: Vec<u8>,
}

impl Picture {
    /// Shows depth in grey: near is bright, nothing is black.
    pub(crate) fn of_depth(depth: &DepthImage) -> Self {
        let mut measured: Vec<f32> = depth
            .pixels()
            .iter()
            .copied()
            .filter(|z| *z > 0.0)
            .collect();
        measured.sort_by(f32::total_cmp);
        // The middle 96 % set the contrast, so that a stray pixel does not.
        let at = |share: usize| {
            measured
                .get(measured.len().saturating_sub(1) * share / 100)
                .copied()
        };
        let (near, far) = (at(2).unwrap_or(0.0), at(98).unwrap_or(1.0));
        let range = (far - near).max(1e-3);
        let grey = |z: f32| {
            let t = ((z - near) / range).clamp(0.0, 1.0);
            (210.0 - 150.0 * t) as u8
        };
        let rgb = depth
            .pixels()
            .iter()
            .flat_map(|z| if *z > 0.0 { [grey(*z); 3] } else { [0; 3] })
            .collect();
        Self {
            width: depth.width(),
            height: depth.height(),
            rgb,
        }
    }

    /// Draws the silhouette's outline of a model at a pose, two pixels wide.
    pub(crate) fn outline(
        &mut self,
        refiner: &mut Refiner,
        model: &Model,
        observation: &Observation,
        camera_from_object: &Isometry3<f64>,
        color: Rgb,
    ) {
        let problem = Problem::new(model, observation);
        let mut context = refiner.workspace_mut().context(&problem);
        let view = context.view(camera_from_object);
        let region = view.region();
        let shown = |u: i64, v: i64| match (u32::try_from(u), u32::try_from(v)) {
            (Ok(u), Ok(v)) => view.depth_at(u, v) > 0.0,
            _ => false,
        };
        for v in region.v_min..region.v_max {
            for u in region.u_min..region.u_max {
                let (x, y) = (i64::from(u), i64::from(v));
                let border = shown(x, y) && (-2..=2).any(|d| !shown(x + d, y) || !shown(x, y + d));
                if border {
                    let index = 3 * (v as usize * self.width as usize + u as usize);
                    self.rgb[index..index + 3].copy_from_slice(&color);
                }
            }
        }
    }

    /// Writes the picture as PNG.
    pub(crate) fn write(&self, path: &std::path::Path) -> Result<(), hicp_io::IoError> {
        hicp_io::write_rgb_png(path, self.width, self.height, &self.rgb)
    }
}
