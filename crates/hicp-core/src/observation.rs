//! What the camera saw of the object.

use std::sync::Arc;

use nalgebra::{Point3, UnitVector3, Vector3};

use crate::camera::PinholeCamera;
use crate::derived::Derived;
use crate::id::Id;
use crate::image::{DepthImage, ImageError, Mask, check_size};
use crate::index;
use crate::normals::{DepthPatch, estimate_normals};
use crate::region::PixelRegion;
use crate::surfel::Surfel;

/// A segmented depth image with its vertex and normal maps: the point cloud C and vertex map V_C of §III-A.
///
/// Immutable. The whole depth image and the mask are kept apart: correspondences come from inside the mask, but the score
/// needs what stands in front of the object. Vertex and normal maps cover the mask's bounding box only; a pixel has a surfel
/// when it is masked, has a depth of at least 0.1 mm, and enough neighbours on its own side of the depth edges to carry a normal.
///
/// An empty mask or a depth image of zeros makes an observation without surfels; refining against it ends with "no pairs".
///
/// Building one costs 15 to 30 ns for every pixel inside the mask's box, the more the more depth edges there are, and nothing for the
/// others: the observations of one image share its depth (an `Arc`). Share an observation between threads and hypotheses: search
/// trees and the like are built once per observation, see [`Observation::derived`].
///
/// ```
/// use hicp_core::{DepthImage, Mask, Observation, PinholeCamera};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let camera = PinholeCamera::new(50.0, 50.0, 15.5, 15.5, 32, 32)?;
/// let wall = DepthImage::from_meters(32, 32, vec![0.8; 32 * 32])?;
/// let observation = Observation::new(wall, Mask::full(32, 32), camera)?;
/// let surfel = observation.surfel_at(4, 20).ok_or("no depth there")?;
/// assert_eq!(surfel.point.z, 0.8);
/// assert!((surfel.normal.z + 1.0).abs() < 1e-6); // The wall faces the camera.
/// # Ok(()) }
/// ```
#[derive(Clone, Debug)]
pub struct Observation {
    id: Id,
    camera: PinholeCamera,
    depth: Arc<DepthImage>,
    mask: Mask,
    region: PixelRegion,
    surfels: Vec<Surfel>,
    n_surfels: usize,
    n_measured: usize,
    derived: Derived,
}

impl Observation {
    /// Makes an observation.
    ///
    /// `depth` is a [`DepthImage`], or an `Arc` of one that observations with other masks share; it is not copied.
    ///
    /// # Errors
    ///
    /// [`ImageError::SizeMismatch`] when depth image, mask and camera are not of one size.
    pub fn new(
        depth: impl Into<Arc<DepthImage>>,
        mask: Mask,
        camera: PinholeCamera,
    ) -> Result<Self, ImageError> {
        Self::of_shared(depth.into(), mask, camera)
    }

    fn of_shared(
        depth: Arc<DepthImage>,
        mask: Mask,
        camera: PinholeCamera,
    ) -> Result<Self, ImageError> {
        let size = (depth.width(), depth.height());
        check_size("mask", (mask.width(), mask.height()), "depth image", size)?;
        check_size(
            "camera",
            (camera.width(), camera.height()),
            "depth image",
            size,
        )?;

        let region = mask.bounding_region();
        let mut patch = Vec::with_capacity(region.area());
        for v in region.v_min..region.v_max {
            let row = v as usize * depth.width() as usize;
            let columns = row + region.u_min as usize..row + region.u_max as usize;
            patch.extend(
                depth.pixels()[columns.clone()]
                    .iter()
                    .zip(&mask.pixels()[columns])
                    .map(|(z, masked)| if *masked { *z } else { 0.0 }),
            );
        }
        // Below 2³⁰ in any accepted image; counted in 32 bits, of which a vector holds more.
        let n_measured = patch.iter().map(|z| u32::from(*z > 0.0)).sum::<u32>() as usize;

        let width = region.width();
        let (xs, ys) = (
            ray_slopes(region.u_min, region.u_max, camera.fx(), camera.cx()),
            ray_slopes(region.v_min, region.v_max, camera.fy(), camera.cy()),
        );
        let nothing = Surfel {
            point: Point3::origin(),
            normal: Vector3::z_axis(),
        };
        let mut surfels = Vec::with_capacity(region.area());
        let mut n_surfels = 0;
        let depth_patch = DepthPatch {
            region,
            camera: &camera,
            depth: &patch,
        };
        estimate_normals(&depth_patch, |row, first, normals| {
            let start = row * width;
            surfels.resize(start + first, nothing);
            let (depth, xs) = (&patch[start + first..], &xs[first..]);
            let pixels = normals.iter().zip(depth).zip(xs);
            surfels.extend(pixels.map(|((normal, z), x)| {
                let has_normal = *normal != [0.0; 3];
                n_surfels += usize::from(has_normal);
                if has_normal {
                    Surfel {
                        point: Point3::new(x * z, ys[row] * z, *z),
                        normal: UnitVector3::new_unchecked(Vector3::from(*normal)),
                    }
                } else {
                    nothing
                }
            }));
            surfels.resize(start + width, nothing);
        });
        Ok(Self {
            id: Id::next(),
            camera,
            depth,
            mask,
            region,
            surfels,
            n_surfels,
            n_measured,
            derived: Derived::default(),
        })
    }

    /// Identity for caches.
    #[must_use]
    pub fn id(&self) -> Id {
        self.id
    }

    /// The camera.
    #[must_use]
    pub fn camera(&self) -> &PinholeCamera {
        &self.camera
    }

    /// The whole depth image, metres, 0 where nothing was measured.
    #[must_use]
    pub fn depth(&self) -> &DepthImage {
        &self.depth
    }

    /// The same, to make observations of other masks with: they share it.
    ///
    /// ```
    /// use hicp_core::{DepthImage, Mask, Observation, PinholeCamera};
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let camera = PinholeCamera::new(50.0, 50.0, 15.5, 15.5, 32, 32)?;
    /// # let wall = DepthImage::from_meters(32, 32, vec![0.8; 32 * 32])?;
    /// let one = Observation::new(wall, Mask::full(32, 32), camera)?;
    /// let left = (0..32 * 32).map(|pixel| pixel % 32 < 16).collect();
    /// let other = Observation::new(one.shared_depth().clone(), Mask::new(32, 32, left)?, camera)?;
    /// assert!(std::ptr::eq(one.depth(), other.depth()));
    /// # Ok(()) }
    /// ```
    #[must_use]
    pub fn shared_depth(&self) -> &Arc<DepthImage> {
        &self.depth
    }

    /// The segmentation mask.
    #[must_use]
    pub fn mask(&self) -> &Mask {
        &self.mask
    }

    /// The mask's bounding box.
    #[must_use]
    pub fn region(&self) -> PixelRegion {
        self.region
    }

    /// Number of pixels that have a surfel.
    #[must_use]
    pub fn n_surfels(&self) -> usize {
        self.n_surfels
    }

    /// Number of masked pixels that have a depth.
    #[must_use]
    pub fn n_measured(&self) -> usize {
        self.n_measured
    }

    /// Returns the surfel of a pixel in the camera frame (metres, normal facing the camera), or `None` where there is none.
    #[must_use]
    pub fn surfel_at(&self, u: u32, v: u32) -> Option<&Surfel> {
        self.region
            .index(u, v)
            .map(|i| &self.surfels[i])
            .filter(|s| s.point.z > 0.0)
    }

    /// Returns the surfel of the pixel whose square contains the image position (u, v), as [`Observation::index_near`] finds it.
    #[must_use]
    #[inline]
    pub fn surfel_near(&self, u: f32, v: f32) -> Option<&Surfel> {
        self.index_near(u, v)
            .map(|index| &self.surfels[index as usize])
    }

    /// Returns the index of the surfel of the pixel whose square contains the image position (u, v); `None` where there is
    /// none, outside, and for NaN.
    ///
    /// The square of a pixel reaches half a pixel to every side of its integer centre; its lower edges belong to it.
    #[must_use]
    #[inline]
    pub fn index_near(&self, u: f32, v: f32) -> Option<u32> {
        let column = u - self.region.u_min as f32 + 0.5;
        let row = v - self.region.v_min as f32 + 0.5;
        let (width, height) = (self.region.width(), self.region.height());
        // False for NaN, so the casts below see numbers inside the region.
        if column >= 0.0 && row >= 0.0 && column < width as f32 && row < height as f32 {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            // Floor of a checked value, below 2³².
            let index = row as u32 * width as u32 + column as u32;
            self.surfel(index).map(|_| index)
        } else {
            None
        }
    }

    /// Returns the surfel of an index: the row-major position of its pixel in [`Observation::region`]. `None` where there is none.
    #[must_use]
    #[inline]
    pub fn surfel(&self, index: u32) -> Option<&Surfel> {
        self.surfels.get(index as usize).filter(|s| s.point.z > 0.0)
    }

    /// Returns the pixel (u, v) of a surfel's index, see [`Observation::surfel`].
    #[must_use]
    pub fn pixel(&self, index: u32) -> (u32, u32) {
        // An empty region has no indices.
        let width = index::index(self.region.width()).max(1);
        (
            self.region.u_min + index % width,
            self.region.v_min + index / width,
        )
    }

    /// Returns the surfels on the pixel grid u ≡ v ≡ 0 (mod `stride`) in row-major order, each with its index, see [`Observation::surfel`].
    ///
    /// The grid is anchored at the image's corner, so equal strides pick equal pixels whatever the mask.
    pub fn surfels(&self, stride: u32) -> impl Iterator<Item = (u32, &Surfel)> {
        let stride = stride.max(1);
        let (region, width) = (self.region, self.region.width());
        let step = stride as usize;
        (region.v_min.next_multiple_of(stride)..region.v_max)
            .step_by(step)
            .flat_map(move |v| {
                let row = (v - region.v_min) as usize * width;
                (region.u_min.next_multiple_of(stride)..region.u_max)
                    .step_by(step)
                    .map(move |u| row + (u - region.u_min) as usize)
            })
            .map(|index| (index::index(index), &self.surfels[index]))
            .filter(|(_, s)| s.point.z > 0.0)
    }

    /// Returns this observation at a lower resolution: every `factor`-th pixel in both directions, from the image's corner.
    ///
    /// Its camera is phase-aligned: a pixel of the coarse image looks along exactly the ray of the fine pixel that it was
    /// taken from, so a pose means the same in both. Normals are taken over, with the noise they were smoothed against at
    /// full resolution. Made once per factor and shared. A factor of 0 counts as 1. Cost: O(image / factor²).
    #[must_use]
    pub fn decimated(&self, factor: u32) -> Arc<Self> {
        let factor = factor.max(1);
        self.derived
            .get_or_build(u64::from(factor), || self.decimate(factor))
    }

    fn decimate(&self, factor: u32) -> Self {
        let step = factor as usize;
        let (width, height) = (
            self.depth.width().div_ceil(factor),
            self.depth.height().div_ceil(factor),
        );
        let fine_width = self.depth.width() as usize;
        let pixels = || {
            (0..self.depth.height() as usize)
                .step_by(step)
                .flat_map(move |v| {
                    (0..fine_width)
                        .step_by(step)
                        .map(move |u| v * fine_width + u)
                })
        };
        let region = PixelRegion {
            u_min: self.region.u_min.div_ceil(factor),
            v_min: self.region.v_min.div_ceil(factor),
            u_max: self.region.u_max.div_ceil(factor),
            v_max: self.region.v_max.div_ceil(factor),
        };
        let surfels: Vec<Surfel> = (region.v_min..region.v_max)
            .flat_map(|v| (region.u_min..region.u_max).map(move |u| (u * factor, v * factor)))
            .filter_map(|(u, v)| self.region.index(u, v))
            .map(|index| self.surfels[index])
            .collect();
        let depth = pixels().map(|i| self.depth.pixels()[i]).collect();
        let mask: Vec<bool> = pixels().map(|i| self.mask.pixels()[i]).collect();
        let measured = |i: &usize| self.mask.pixels()[*i] && self.depth.pixels()[*i] > 0.0;
        let n_measured = pixels().filter(measured).count();
        let camera = self.camera.scaled_down(factor);
        let (Ok(depth), Ok(mask)) = (
            DepthImage::from_meters(width, height, depth),
            Mask::new(width, height, mask),
        ) else {
            unreachable!("the pixels were collected for an image of {width}x{height}");
        };
        Self {
            id: Id::next(),
            camera,
            depth: Arc::new(depth),
            mask,
            region,
            n_surfels: surfels.iter().filter(|s| s.point.z > 0.0).count(),
            surfels,
            n_measured,
            derived: Derived::default(),
        }
    }

    /// Values derived from this observation, such as search trees: built once, shared by all threads.
    #[must_use]
    pub fn derived(&self) -> &Derived {
        &self.derived
    }
}

#[allow(clippy::cast_possible_truncation)] // Slopes of a few units; f32 is the precision of buffers.
fn ray_slopes(from: u32, to: u32, focal: f64, center: f64) -> Vec<f32> {
    (from..to)
        .map(|p| ((f64::from(p) - center) / focal) as f32)
        .collect()
}
