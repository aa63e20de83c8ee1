//! Truncated signed distance fields (TSDF).
//!
//! Source: Curless & Levoy, "A Volumetric Method for Building Complex Models from Range Images",
//! 1996.

use hicp_core::{DepthImage, Isometry3, PinholeCamera, Point3, TriMesh, Vector3};

use crate::error::{SimError, check_range, check_size};
use crate::narrow;
use crate::tsdf::meshing::ScalarGrid;

/// Largest number of voxels. A voxel has two numbers of 4 bytes each.
pub const MAX_VOXELS: usize = 400_000_000;

/// The position and the resolution of a volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TsdfConfig {
    /// Lowest corner in the volume's frame, meters. The frame is that of the object or of the
    /// world.
    pub min: Point3<f64>,
    /// Highest corner, meters.
    pub max: Point3<f64>,
    /// Distance between voxels, meters.
    pub voxel_meters: f64,
    /// Largest stored distance from the surface, meters: a few voxels, and more than twice the
    /// noise.
    pub truncation_meters: f64,
}

/// A volume into which depth images are integrated.
///
/// Every voxel stores the weighted mean of its signed distances to the observed surfaces along the
/// rays, positive in front. An image does not affect voxels farther behind its surface than the
/// truncation. Larger distances in front count as the truncation.
///
/// The weight is 1 in front of the surface and up to half the truncation behind it. From there, it
/// falls linearly to 0, so that observations of the near side of a thin wall do not overrule the
/// far side. A weight that falls from the surface on keeps thin walls thinner, but noise then
/// removes plates of a few millimeters.
#[derive(Clone, Debug)]
pub struct TsdfVolume {
    config: TsdfConfig,
    size: [usize; 3],
    /// Mean signed distance in meters and sum of the weights per voxel, with x varying fastest.
    voxels: Vec<(f32, f32)>,
    images: u32,
}

impl TsdfVolume {
    /// Creates an empty volume.
    ///
    /// # Errors
    ///
    /// [`SimError`] if a length is not positive and finite, if the corners are in the wrong order,
    /// or if there would be more than [`MAX_VOXELS`] voxels.
    pub fn new(config: TsdfConfig) -> Result<Self, SimError> {
        let extent = config.max - config.min;
        for (what, value, largest) in [
            ("voxel size in meters", config.voxel_meters, 1e3),
            ("truncation in meters", config.truncation_meters, 1e3),
            ("volume along x in meters", extent.x, 1e6),
            ("volume along y in meters", extent.y, 1e6),
            ("volume along z in meters", extent.z, 1e6),
        ] {
            check_range(what, value, 1e-6..=largest)?;
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // Positive and at most 10¹².
        let size = [extent.x, extent.y, extent.z]
            .map(|side| (side / config.voxel_meters).ceil() as usize + 1);
        let count = size
            .iter()
            .try_fold(1_usize, |product, n| product.checked_mul(*n));
        let limit = MAX_VOXELS;
        let count = count.filter(|count| *count <= limit);
        let count = count.ok_or(SimError::VolumeSize { size, limit })?;
        Ok(Self {
            config,
            size,
            voxels: vec![(0.0, 0.0); count],
            images: 0,
        })
    }

    /// Integrates a depth image taken at `camera_from_volume`, in meters.
    ///
    /// The ray of a pixel without depth hits nothing, as in the render of a single object.
    ///
    /// Cost: O(voxels), some nanoseconds each.
    ///
    /// # Errors
    ///
    /// [`SimError::Image`] if the sizes of image and camera differ.
    pub fn integrate(
        &mut self,
        depth: &DepthImage,
        camera: &PinholeCamera,
        camera_from_volume: &Isometry3<f64>,
    ) -> Result<(), SimError> {
        check_size(depth, camera)?;
        let (width, height) = (depth.width(), depth.height());
        self.images += 1;
        let [nx, ny, nz] = self.size;
        let spacing = self.config.voxel_meters;
        let step = camera_from_volume.rotation * Vector3::x() * spacing;
        let mut rows = self.voxels.chunks_exact_mut(nx);
        let truncation = self.config.truncation_meters;
        for k in 0..nz {
            for j in 0..ny {
                let offset = Vector3::new(0.0, j as f64, k as f64) * spacing;
                let start = (camera_from_volume * (self.config.min + offset)).coords;
                let Some(row) = rows.next() else { break };
                for (i, voxel) in row.iter_mut().enumerate() {
                    let p = start + step * i as f64;
                    if p.z <= 0.0 {
                        continue;
                    }
                    let u = camera.fx() * p.x / p.z + camera.cx() + 0.5;
                    let v = camera.fy() * p.y / p.z + camera.cy() + 0.5;
                    if !(u >= 0.0 && v >= 0.0 && u < f64::from(width) && v < f64::from(height)) {
                        continue;
                    }
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                    // Inside the image.
                    let measured =
                        f64::from(depth.pixels()[v as usize * width as usize + u as usize]);
                    if measured <= 0.0 {
                        // Open: pixels without depth in a reconstruction: §VI-B.3. The renders of a
                        // single object are empty around it, so these rays carve.
                        merge(voxel, truncation, 1.0);
                        continue;
                    }
                    let along_axis = measured - p.z;
                    // The distance along the ray is larger than along the optical axis.
                    if along_axis >= truncation {
                        merge(voxel, truncation, 1.0);
                    } else if along_axis > -truncation {
                        let distance = along_axis * p.norm() / p.z;
                        // Open: weight of voxels behind a surface: §VI-B.3. It falls from half the
                        // truncation on, so that a thin wall keeps both sides.
                        let weight = (2.0 + 2.0 * distance / truncation).min(1.0);
                        if weight > 0.0 {
                            merge(voxel, distance.min(truncation), weight);
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Returns the surface between free space (positive) and the inside.
    ///
    /// Voxels that no image reached count as inside. The surface is closed, also along the border
    /// of the volume, and normals point to free space. It is always manifold, see
    /// [`ScalarGrid::surface`]. It may have several parts, including cavities; see
    /// [`components`](crate::components).
    ///
    /// Cost: O(voxels).
    ///
    /// # Errors
    ///
    /// [`SimError::NoSurface`] if there is no surface, or if no image reached a voxel.
    pub fn surface(&self) -> Result<TriMesh, SimError> {
        let no_surface = SimError::NoSurface {
            images: self.images,
        };
        if self.voxels.iter().all(|(_, weight)| *weight <= 0.0) {
            return Err(no_surface);
        }
        let truncation = narrow(self.config.truncation_meters);
        // A layer of free space around the volume closes the surface.
        let size = self.size.map(|n| n + 2);
        let mut values = vec![truncation; size.iter().product()];
        for (row, k_j) in self.voxels.chunks_exact(self.size[0]).zip(0..) {
            let (j, k) = (k_j % self.size[1] + 1, k_j / self.size[1] + 1);
            let start = (k * size[1] + j) * size[0] + 1;
            for (new, (distance, weight)) in values[start..start + row.len()].iter_mut().zip(row) {
                *new = *distance;
                if *weight <= 0.0 {
                    // Open: voxels that no image reached: §VI-B.3. They count as inside, so that
                    // reconstructions are closed.
                    *new = -truncation;
                }
            }
        }
        let grid = ScalarGrid {
            origin: self.config.min - Vector3::repeat(self.config.voxel_meters),
            spacing: self.config.voxel_meters,
            size,
            values,
        };
        match grid.surface() {
            Err(SimError::Mesh(_)) => Err(no_surface),
            result => result,
        }
    }
}

/// Adds a distance to a voxel's weighted mean.
fn merge(voxel: &mut (f32, f32), distance: f64, weight: f64) {
    let (mean, sum) = (f64::from(voxel.0), f64::from(voxel.1));
    let total = sum + weight;
    let mean = mean + (distance - mean) * weight / total;
    *voxel = (narrow(mean), narrow(total));
}
