//! The camera's view of the object.

use std::sync::{Arc, OnceLock};

use crate::derived::Derived;
use crate::id::Id;
use crate::internal;
use crate::sensor::camera::PinholeCamera;
use crate::sensor::image::{ColorImage, DepthImage, ImageError, Mask, check_size};
use crate::sensor::normals::{DepthPatch, NormalWindow, estimate_normals, n_measured, n_surfels};
use crate::sensor::region::PixelRegion;
use crate::surfel::Surfel;

/// A segmented depth image with its vertex and normal maps: the point cloud C and vertex map V_C of
/// §III-A.
///
/// It is immutable. It keeps the whole depth image next to the mask: correspondences come from
/// inside the mask, but the score also needs the surfaces in front of the object. The vertex and
/// normal maps cover only the mask's bounding box. A pixel has a surfel if all of these hold:
///
/// - It is masked and its depth is at least 0.1 mm.
/// - It has enough neighbors on its own side of the depth edges to determine a normal.
///
/// An empty mask or a depth image of zeros gives an observation without surfels. Refining against
/// it ends with "no pairs".
///
/// Cost: building one counts the measured pixels inside the mask's bounding box. The surfels are
/// estimated when they are first requested, since some refinements never need a normal: 5 to 20 ns
/// per pixel of the box, more with more depth edges. Pixels outside cost nothing, since the
/// observations of one image share its depth (an `Arc`). Share an observation between threads and
/// hypotheses, because surfels and search trees are built once per observation, see
/// [`Observation::derived`].
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
    color: Option<Arc<ColorImage>>,
    mask: Arc<Mask>,
    region: PixelRegion,
    normal_window: NormalWindow,
    surfels: Arc<OnceLock<Surfels>>,
    n_measured: usize,
    /// The observation whose every n-th surfel this one has, and n.
    fine: Option<(Box<Observation>, u32)>,
    derived: Derived,
}

/// The surfels of the region, row-major, and the number of those that are not missing.
#[derive(Clone, Debug)]
struct Surfels(Vec<Surfel>, usize);

impl Observation {
    /// Creates an observation from a depth image in meters, a mask and the camera of both.
    ///
    /// `depth` is a [`DepthImage`], or an `Arc` of one that other observations share. It is not
    /// copied.
    ///
    /// # Errors
    ///
    /// [`ImageError::SizeMismatch`] if depth image, mask and camera differ in size.
    pub fn new(
        depth: impl Into<Arc<DepthImage>>,
        mask: Mask,
        camera: PinholeCamera,
    ) -> Result<Self, ImageError> {
        Self::with_normal_window(depth, mask, camera, NormalWindow::Automatic)
    }

    /// Creates an observation as [`Observation::new`] does, with another window for its normals.
    ///
    /// ```
    /// use hicp_core::{DepthImage, Mask, NormalWindow, Observation, PinholeCamera};
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let camera = PinholeCamera::new(50.0, 50.0, 15.5, 15.5, 32, 32)?;
    /// # let wall = DepthImage::from_meters(32, 32, vec![0.8; 32 * 32])?;
    /// let small = NormalWindow::HalfSide(1); // 3 × 3 pixels, whatever the noise.
    /// let observation =
    ///     Observation::with_normal_window(wall, Mask::full(32, 32), camera, small)?;
    /// assert_eq!(observation.normal_window(), small);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`Observation::new`], and [`ImageError::NormalWindow`] if the half side is not from
    /// 1 to 10 pixels.
    pub fn with_normal_window(
        depth: impl Into<Arc<DepthImage>>,
        mask: Mask,
        camera: PinholeCamera,
        normal_window: NormalWindow,
    ) -> Result<Self, ImageError> {
        let depth = depth.into();
        normal_window.check()?;
        check_size("mask", mask.size(), "depth image", depth.size())?;
        check_size("camera", camera.size(), "depth image", depth.size())?;
        Ok(Self {
            id: Id::next(),
            camera,
            n_measured: n_measured(&depth, &mask),
            depth,
            color: None,
            region: mask.bounding_region(),
            mask: Arc::new(mask),
            normal_window,
            surfels: Arc::default(),
            fine: None,
            derived: Derived::default(),
        })
    }

    fn surfels_once(&self) -> &Surfels {
        // Deviation: pixels without normals leave C: §III-A gives every point of C a normal. Here a
        // pixel whose neighbors do not determine a plane (a flying pixel, a line) has no surfel. It
        // is not paired by any metric, and still counts toward the MVE.
        self.surfels.get_or_init(|| {
            if let Some((fine, factor)) = &self.fine {
                return fine.every(*factor, &self.region);
            }
            let patch = DepthPatch::new(&self.depth, &self.mask, &self.camera);
            let (surfels, n_surfels) = estimate_normals(&patch, self.normal_window);
            Surfels(surfels, n_surfels)
        })
    }

    /// Returns every `factor`-th surfel in both directions, for a coarse region.
    fn every(&self, factor: u32, coarse: &PixelRegion) -> Surfels {
        let fine = self.surfel_map();
        let surfels: Vec<Surfel> = coarse
            .pixels()
            .filter_map(|(u, v)| self.region.index(u * factor, v * factor))
            .map(|index| fine[index])
            .collect();
        let n_surfels = n_surfels(&surfels);
        Surfels(surfels, n_surfels)
    }

    /// Returns the observation with the color image of the same camera: pixel (u, v) of both shows
    /// the same ray.
    ///
    /// `color` is a [`ColorImage`], or an `Arc` of one that other observations share. It is used
    /// only where depth leaves a choice, and only with a model that has colors.
    ///
    /// # Errors
    ///
    /// [`ImageError::SizeMismatch`] if the images differ in size.
    pub fn with_color(mut self, color: impl Into<Arc<ColorImage>>) -> Result<Self, ImageError> {
        let color = color.into();
        check_size(
            "color image",
            color.size(),
            "depth image",
            self.depth.size(),
        )?;
        self.color = Some(color);
        // Caches must not confuse it with the observation without color.
        (self.id, self.derived) = (Id::next(), Derived::default());
        Ok(self)
    }

    /// The identity of this observation, for caches.
    #[must_use]
    pub fn id(&self) -> Id {
        self.id
    }

    /// The camera.
    #[must_use]
    pub fn camera(&self) -> &PinholeCamera {
        &self.camera
    }

    /// The whole depth image, in meters; 0 where nothing was measured.
    #[must_use]
    pub fn depth(&self) -> &DepthImage {
        &self.depth
    }

    /// The depth image as an `Arc`, for observations of the same image with other masks.
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

    /// The color image, if there is one. It has the size of the depth image.
    #[must_use]
    pub fn color(&self) -> Option<&Arc<ColorImage>> {
        self.color.as_ref()
    }

    /// The segmentation mask.
    #[must_use]
    pub fn mask(&self) -> &Mask {
        &self.mask
    }

    /// The mask's bounding box, pixels.
    #[must_use]
    pub fn region(&self) -> PixelRegion {
        self.region
    }

    /// The window that the normals were fitted over.
    #[must_use]
    pub fn normal_window(&self) -> NormalWindow {
        self.normal_window
    }

    /// Number of pixels that have a surfel.
    #[must_use]
    pub fn n_surfels(&self) -> usize {
        self.surfels_once().1
    }

    /// Returns true if at least three masked pixels have a depth.
    ///
    /// With fewer there is no surfel, and nothing to refine. Cost: O(1); no surfel is estimated.
    #[must_use]
    pub fn has_surface(&self) -> bool {
        self.n_measured >= 3
    }

    /// The surfels of all pixels of [`Observation::region`], row-major.
    ///
    /// The point of a pixel without a surfel has depth 0.
    ///
    /// A loop that looks up many surfels should get this slice once.
    #[must_use]
    pub fn surfel_map(&self) -> &[Surfel] {
        &self.surfels_once().0
    }

    /// Number of masked pixels with a measured depth.
    #[must_use]
    pub fn n_measured(&self) -> usize {
        self.n_measured
    }

    /// Returns the surfel of a pixel, or `None` if it has none.
    ///
    /// The surfel is in the camera frame, in meters, with its normal facing the camera.
    #[must_use]
    pub fn surfel_at(&self, u: u32, v: u32) -> Option<&Surfel> {
        self.region
            .index(u, v)
            .map(|i| &self.surfel_map()[i])
            .filter(|s| s.point.z > 0.0)
    }

    /// Returns the surfel of the pixel whose square contains the image position (u, v).
    ///
    /// It is the surfel at [`Observation::index_near`].
    #[must_use]
    #[inline]
    pub fn surfel_near(&self, u: f32, v: f32) -> Option<&Surfel> {
        self.index_near(u, v)
            .map(|index| &self.surfel_map()[index as usize])
    }

    /// Returns the surfel index of the pixel whose square contains the image position (u, v).
    ///
    /// Returns `None` if that pixel has no surfel, outside the region, and for NaN. The square of a
    /// pixel extends half a pixel around its integer center; its lower edges belong to it.
    #[must_use]
    #[inline]
    pub fn index_near(&self, u: f32, v: f32) -> Option<u32> {
        self.place_near(u, v)
            .filter(|index| self.surfel(*index).is_some())
    }

    /// Returns the depth, in meters, that was measured at the pixel whose square contains the image
    /// position (u, v).
    ///
    /// Returns `None` without a depth, outside of the mask, and for NaN. Unlike surfels, no normal
    /// is needed.
    #[must_use]
    pub fn depth_near(&self, u: f32, v: f32) -> Option<f32> {
        let (u, v) = self.pixel(self.place_near(u, v)?);
        self.mask.get(u, v).filter(|masked| *masked)?;
        self.depth.get(u, v).filter(|z| *z > 0.0)
    }

    /// Returns the row-major position in the region of the pixel whose square contains (u, v).
    #[inline]
    fn place_near(&self, u: f32, v: f32) -> Option<u32> {
        let column = u - self.region.u_min as f32 + 0.5;
        let row = v - self.region.v_min as f32 + 0.5;
        let (width, height) = (self.region.width(), self.region.height());
        // False for NaN, so the casts below only receive numbers inside the region.
        if column >= 0.0 && row >= 0.0 && column < width as f32 && row < height as f32 {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            // Floor of a checked value, below 2³².
            Some(row as u32 * width as u32 + column as u32)
        } else {
            None
        }
    }

    /// Returns the surfel at an index, or `None` if there is none.
    ///
    /// The index is the row-major position of the surfel's pixel in [`Observation::region`].
    #[must_use]
    #[inline]
    pub fn surfel(&self, index: u32) -> Option<&Surfel> {
        self.surfel_map()
            .get(index as usize)
            .filter(|s| s.point.z > 0.0)
    }

    /// Returns the pixel (u, v) of a surfel's index; see [`Observation::surfel`].
    #[must_use]
    pub fn pixel(&self, index: u32) -> (u32, u32) {
        // An empty region has no indices; the maximum avoids a division by zero.
        let width = internal::index(self.region.width()).max(1);
        (
            self.region.u_min + index % width,
            self.region.v_min + index / width,
        )
    }

    /// Iterates over the surfels on the pixel grid u ≡ v ≡ 0 (mod `stride`), in row-major order.
    ///
    /// Each comes with its index, see [`Observation::surfel`]. The grid starts at the image's
    /// corner, so equal strides select equal pixels for every mask. A stride of 0 counts as 1.
    pub fn surfels(&self, stride: u32) -> impl Iterator<Item = (u32, &Surfel)> {
        let stride = stride.max(1);
        let (region, surfels) = (self.region, self.surfel_map());
        let grid = PixelRegion {
            u_min: region.u_min.next_multiple_of(stride),
            v_min: region.v_min.next_multiple_of(stride),
            ..region
        };
        grid.grid(stride as usize)
            .map(move |(u, v)| {
                (v - region.v_min) as usize * region.width() + (u - region.u_min) as usize
            })
            .map(|index| (internal::index(index), &surfels[index]))
            .filter(|(_, s)| s.point.z > 0.0)
    }

    /// Returns this observation at a lower resolution: every `factor`-th pixel in both directions.
    ///
    /// The pixel grid starts at the image's corner. The camera of the result is phase-aligned: a
    /// coarse pixel has exactly the ray of the fine pixel that it was copied from, so a pose means
    /// the same in both. Normals are copied, and so keep the smoothing of the full resolution. A
    /// factor of 0 counts as 1.
    ///
    /// The result is built once per factor and shared. Cost: O(image / factor²).
    #[must_use]
    pub fn decimated(&self, factor: u32) -> Arc<Self> {
        let factor = factor.max(1);
        self.derived
            .get_or_build(u64::from(factor), || self.decimate(factor))
    }

    fn decimate(&self, factor: u32) -> Self {
        let region = self.region.decimated(factor);
        let camera = self.camera.scaled_down(factor);
        let is_set = |u, v| self.mask.get(u * factor, v * factor) == Some(true);
        let mask = Mask::in_region(camera.width(), camera.height(), &region, is_set);
        let depth = self.depth.decimated(factor);
        Self {
            id: Id::next(),
            camera,
            n_measured: n_measured(&depth, &mask),
            depth: Arc::new(depth),
            // Color is used at full resolution only.
            color: None,
            mask: Arc::new(mask),
            region,
            normal_window: self.normal_window,
            surfels: Arc::default(),
            // A clone is without derived values, of which this observation is one.
            fine: Some((Box::new(self.clone()), factor)),
            derived: Derived::default(),
        }
    }

    /// Values derived from this observation, such as search trees: built once, shared by all
    /// threads.
    #[must_use]
    pub fn derived(&self) -> &Derived {
        &self.derived
    }
}
