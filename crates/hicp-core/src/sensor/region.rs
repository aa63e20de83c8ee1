//! Axis-aligned rectangles of pixels.

/// A half-open rectangle of pixels: columns `u_min..u_max`, rows `v_min..v_max`.
///
/// It is a region of interest, and empty if either range is empty. Buffers over a region are
/// row-major and start at its corner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PixelRegion {
    /// First column.
    pub u_min: u32,
    /// First row.
    pub v_min: u32,
    /// One past the last column.
    pub u_max: u32,
    /// One past the last row.
    pub v_max: u32,
}

impl PixelRegion {
    /// Returns the region of a whole image.
    #[must_use]
    pub fn of_image(width: u32, height: u32) -> Self {
        Self {
            u_min: 0,
            v_min: 0,
            u_max: width,
            v_max: height,
        }
    }

    /// Number of columns.
    #[must_use]
    #[inline]
    pub fn width(&self) -> usize {
        self.u_max.saturating_sub(self.u_min) as usize
    }

    /// Number of rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.v_max.saturating_sub(self.v_min) as usize
    }

    /// Number of pixels.
    #[must_use]
    pub fn area(&self) -> usize {
        self.width() * self.height()
    }

    /// Returns whether the region contains no pixel.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.width() == 0 || self.height() == 0
    }

    /// Returns whether pixel (u, v) lies inside.
    #[must_use]
    #[inline]
    pub fn contains(&self, u: u32, v: u32) -> bool {
        (self.u_min..self.u_max).contains(&u) && (self.v_min..self.v_max).contains(&v)
    }

    /// Returns the row-major index of pixel (u, v) in a buffer over this region.
    ///
    /// Outside the region, returns `None`.
    #[must_use]
    #[inline]
    pub fn index(&self, u: u32, v: u32) -> Option<usize> {
        self.contains(u, v)
            .then(|| (v - self.v_min) as usize * self.width() + (u - self.u_min) as usize)
    }

    /// Returns the pixels of the region, row by row.
    ///
    /// ```
    /// let region = hicp_core::PixelRegion { u_min: 3, v_min: 1, u_max: 5, v_max: 3 };
    /// assert!(region.pixels().eq([(3, 1), (4, 1), (3, 2), (4, 2)]));
    /// ```
    pub fn pixels(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        self.grid(1)
    }

    /// Returns every `step`-th pixel of every `step`-th row, from the region's corner.
    ///
    /// # Panics
    ///
    /// If `step` is 0.
    pub fn grid(&self, step: usize) -> impl Iterator<Item = (u32, u32)> + use<> {
        let columns = (self.u_min..self.u_max).step_by(step);
        let rows = (self.v_min..self.v_max).step_by(step);
        rows.flat_map(move |v| columns.clone().map(move |u| (u, v)))
    }

    /// Returns the region with `by` more pixels on every side, which may leave the image.
    #[must_use]
    pub fn grown(&self, by: u32) -> Self {
        Self {
            u_min: self.u_min.saturating_sub(by),
            v_min: self.v_min.saturating_sub(by),
            u_max: self.u_max.saturating_add(by),
            v_max: self.v_max.saturating_add(by),
        }
    }

    /// Returns the region of its pixels in an image of every `factor`-th pixel of every `factor`-th
    /// row.
    ///
    /// A factor of 0 counts as 1.
    #[must_use]
    pub fn decimated(&self, factor: u32) -> Self {
        let factor = factor.max(1);
        let [u_min, v_min, u_max, v_max] =
            [self.u_min, self.v_min, self.u_max, self.v_max].map(|edge| edge.div_ceil(factor));
        Self {
            u_min,
            v_min,
            u_max,
            v_max,
        }
    }

    /// Returns the common part of two regions; empty, but well formed, if they do not overlap.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        let u_min = self.u_min.max(other.u_min);
        let v_min = self.v_min.max(other.v_min);
        Self {
            u_min,
            v_min,
            u_max: self.u_max.min(other.u_max).max(u_min),
            v_max: self.v_max.min(other.v_max).max(v_min),
        }
    }

    /// Returns the smallest region that contains both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        match (self.is_empty(), other.is_empty()) {
            (true, _) => *other,
            (_, true) => *self,
            (false, false) => Self {
                u_min: self.u_min.min(other.u_min),
                v_min: self.v_min.min(other.v_min),
                u_max: self.u_max.max(other.u_max),
                v_max: self.v_max.max(other.v_max),
            },
        }
    }
}
