//! The inputs of a refinement, which hypotheses change.

use std::borrow::Cow;
use std::sync::Arc;

use hicp_core::internal;
use hicp_core::{
    DepthImage, Isometry3, Mask, Model, PinholeCamera, PixelRegion, Point3, Translation3,
};
use hicp_raster::render_depth_image;

use super::fault::Fault;

/// A possible fault, and the inputs without it.
pub(super) type Corrected<'a> = (Fault, Inputs<'a>);

/// A model, an image and an initial pose; all of them can be replaced.
#[derive(Clone)]
pub(super) struct Inputs<'a> {
    pub(super) model: Cow<'a, Model>,
    pub(super) depth: Arc<DepthImage>,
    pub(super) mask: Cow<'a, Mask>,
    pub(super) camera: PinholeCamera,
    /// Camera from object.
    pub(super) init: Isometry3<f64>,
}

impl Inputs<'_> {
    /// Returns the inputs with other depths: `new` receives column, row and depth (0 if missing).
    pub(super) fn with_depth(&self, new: impl Fn(u32, u32, f64) -> f64) -> Self {
        let (width, height) = (self.depth.width(), self.depth.height());
        let places = PixelRegion::of_image(width, height).pixels();
        let depths = places.zip(self.depth.pixels());
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
        let depths = depths.map(|((u, v), z)| new(u, v, f64::from(*z)) as f32);
        let Ok(depth) = DepthImage::collect(width, height, depths) else {
            unreachable!("there is a value for each pixel");
        };
        let depth = Arc::new(depth);
        Self {
            depth,
            ..self.clone()
        }
    }

    /// Returns the inputs with another mask: `new` receives column, row and the pixel of the mask.
    pub(super) fn with_mask(&self, new: impl Fn(u32, u32, bool) -> bool) -> Self {
        let (width, height) = (self.mask.width(), self.mask.height());
        let set = |u, v| new(u, v, self.mask.get(u, v) == Some(true));
        let mask = Mask::in_region(width, height, &self.camera.region(), set);
        Self {
            mask: Cow::Owned(mask),
            ..self.clone()
        }
    }

    /// Returns the inputs with the depth of other pixels; outside of the image, it is missing.
    pub(super) fn with_depth_from(&self, from: impl Fn(i64, i64) -> (i64, i64)) -> Self {
        self.with_depth(|u, v, _| {
            let (u, v) = from(u.into(), v.into());
            self.depth_at(u, v).map_or(0.0, f64::from)
        })
    }

    /// Returns the inputs with the mask of other pixels; outside of the image, it is not set.
    pub(super) fn with_mask_from(&self, from: impl Fn(i64, i64) -> (i64, i64)) -> Self {
        self.with_mask(|u, v, _| {
            let (u, v) = from(u.into(), v.into());
            let place = u32::try_from(u).ok().zip(u32::try_from(v).ok());
            place.and_then(|(u, v)| self.mask.get(u, v)) == Some(true)
        })
    }

    /// Returns the inputs with another initial pose.
    pub(super) fn with_init(&self, init: Isometry3<f64>) -> Self {
        Self {
            init,
            ..self.clone()
        }
    }

    /// Returns the inputs with the translation of the initial pose times a factor.
    pub(super) fn with_scaled_translation(&self, factor: f64) -> Self {
        let translation = Translation3::from(factor * self.init.translation.vector);
        self.with_init(Isometry3::from_parts(translation, self.init.rotation))
    }

    /// Returns the depth at a pixel, or `None` outside of the image or without a measurement.
    pub(super) fn depth_at(&self, u: i64, v: i64) -> Option<f32> {
        let (u, v) = (u32::try_from(u).ok()?, u32::try_from(v).ok()?);
        self.depth.get(u, v).filter(|z| *z > 0.0)
    }

    /// Returns the depth image of the model at the initial pose.
    pub(super) fn rendered(&self) -> DepthImage {
        render_depth_image(self.model.mesh(), &self.camera, &self.init)
    }

    /// Returns the share of the pixels of model or mask that both cover, at the initial pose.
    pub(super) fn overlap(&self) -> f64 {
        let rendered = self.rendered();
        let pixels = rendered.pixels().iter().zip(self.mask.pixels());
        let (both, either) = pixels.fold((0_u32, 0_u32), |(both, either), (z, set)| {
            let seen = *z > 0.0;
            (
                both + u32::from(seen && *set),
                either + u32::from(seen || *set),
            )
        });
        f64::from(both) / f64::from(either.max(1))
    }

    /// Returns the point with the median coordinates of a depth image, in the camera frame, or
    /// `None` without a measurement.
    ///
    /// `counts` receives the index of a pixel.
    pub(super) fn middle(
        &self,
        depth: &DepthImage,
        counts: impl Fn(usize) -> bool,
    ) -> Option<Point3<f64>> {
        let width = depth.width() as usize;
        let pixels = depth.pixels().iter().enumerate();
        let points = pixels.filter(|(i, z)| **z > 0.0 && counts(*i));
        let points = points.map(|(i, z)| {
            let (u, v) = ((i % width) as f64, (i / width) as f64);
            self.camera.unproject(u, v, f64::from(*z))
        });
        let points: Vec<Point3<f64>> = points.collect();
        let middle = |axis: usize| median(points.iter().map(|point| point[axis]));
        Some(Point3::new(middle(0)?, middle(1)?, middle(2)?))
    }

    /// Returns the number of pixels of the mask.
    pub(super) fn n_masked(&self) -> usize {
        self.mask.n_set()
    }

    /// Returns the median of a value over the measured pixels of the mask that show the model at
    /// the initial pose, or `None` if there are none.
    ///
    /// `value` receives the depths of the model and of the measurement.
    pub(super) fn median(&self, value: impl Fn(f64, f64) -> f64) -> Option<f64> {
        let rendered = self.rendered();
        let pixels = rendered.pixels().iter().zip(self.depth.pixels());
        let pixels = pixels.zip(self.mask.pixels());
        let pixels = pixels.filter(|((z, measured), set)| **set && **z > 0.0 && **measured > 0.0);
        let values = pixels.map(|((z, measured), _)| value((*z).into(), (*measured).into()));
        median(values)
    }
}

/// Returns the median, or `None` of nothing.
pub(super) fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    internal::median(&mut values.collect::<Vec<_>>(), f64::total_cmp)
}

/// Returns the number of a list that is nearest by ratio, if it is within a relative distance.
pub(super) fn nearest(value: f64, of: impl IntoIterator<Item = f64>, within: f64) -> Option<f64> {
    let distance = |x: &f64| (value / x).ln().abs();
    let of = of.into_iter();
    let found = of.min_by(|a, b| distance(a).total_cmp(&distance(b)));
    found.filter(|found| distance(found) < within.ln_1p())
}

/// Returns all mantissas times powers of ten.
pub(super) fn decimal(mantissas: &[f64]) -> impl Iterator<Item = f64> + '_ {
    let powers = (-4..=4).map(|power| 10.0_f64.powi(power));
    powers.flat_map(|power| mantissas.iter().map(move |mantissa| mantissa * power))
}
