//! Subsets of evenly distributed normals.

use hicp_core::{Context, Isometry3, Surfel, UnitVector3};

use crate::scratch::Scratch;
use crate::selection::all_samples::AllSamples;
use crate::selection::keep::spread;
use crate::selection::point_selection::PointSelection;

/// Keeps `count` points of another selection whose normals are spread as evenly as possible over all directions
/// (normal-space sampling, Rusinkiewicz & Levoy 2001).
///
/// Small features that hold an object from sliding (the flatness of a plate, the handle of a mug) have few points but
/// directions of their own; this gives every direction the same say. Points are sorted into buckets by the direction of
/// their normal: the cells of a grid on the six faces of a cube, of nearly equal solid angles. Every bucket gives the same
/// number of points, or all that it has; points of a bucket are drawn evenly spaced in the order of the inner selection,
/// which is kept. All are kept when there are not more than `count`. Cost: the inner selection, and O(points + buckets).
#[derive(Clone, Debug, PartialEq)]
pub struct NormalSpace<P> {
    /// The selection to choose from.
    pub inner: P,
    /// How many points are kept.
    pub count: usize,
    /// Cells along an edge of the cube, so 6·resolution² buckets; 0 counts as 1, and above 64 as 64.
    pub resolution: usize,
    scratch: Scratch<Vec<Bucket>>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Bucket {
    size: usize,
    quota: usize,
    seen: usize,
    kept: usize,
}

/// The largest resolution that counts.
const MAX_RESOLUTION: usize = 64;

impl<P> NormalSpace<P> {
    /// Makes the selection.
    #[must_use]
    pub fn new(inner: P, count: usize, resolution: usize) -> Self {
        Self {
            inner,
            count,
            resolution,
            scratch: Scratch::default(),
        }
    }
}

impl Default for NormalSpace<AllSamples> {
    /// 500 of the model's samples, from 96 buckets of about 20° across.
    fn default() -> Self {
        Self::new(AllSamples, 500, 4)
    }
}

impl<P: PointSelection> PointSelection for NormalSpace<P> {
    fn select(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        self.inner.select(context, camera_from_object, source);
        if source.len() <= self.count {
            return;
        }
        let resolution = self.resolution.clamp(1, MAX_RESOLUTION);
        let buckets = &mut self.scratch.0;
        buckets.clear();
        buckets.resize(6 * resolution * resolution, Bucket::default());
        for surfel in &*source {
            buckets[bucket_of(&surfel.normal, resolution)].size += 1;
        }
        share_out(self.count, buckets);
        source.retain(|surfel| {
            let bucket = &mut buckets[bucket_of(&surfel.normal, resolution)];
            let take = bucket.kept < bucket.quota
                && bucket.seen == spread(bucket.kept, bucket.quota, bucket.size);
            bucket.seen += 1;
            bucket.kept += usize::from(take);
            take
        });
    }

    fn name(&self) -> &'static str {
        "normal-space"
    }
}

/// Sets quotas that add up to `count`, fewer than there are points: equal, unless a bucket has not as many.
fn share_out(count: usize, buckets: &mut [Bucket]) {
    // The largest level at which every bucket can give min(size, level) points.
    let total = |level: usize| -> usize { buckets.iter().map(|b| b.size.min(level)).sum() };
    let (mut level, mut too_much) = (0, count + 1);
    while too_much - level > 1 {
        let middle = level.midpoint(too_much);
        if total(middle) <= count {
            level = middle;
        } else {
            too_much = middle;
        }
    }
    // What is left is less than one for each bucket that has more; evenly spaced ones of these give it.
    let left = count - total(level);
    let richer = buckets.iter().filter(|b| b.size > level).count();
    let (mut rank, mut given) = (0, 0);
    for bucket in buckets {
        bucket.quota = bucket.size.min(level);
        if bucket.size > level {
            if given < left && rank == spread(given, left, richer) {
                bucket.quota += 1;
                given += 1;
            }
            rank += 1;
        }
    }
}

/// Returns the bucket of a direction: the face of the cube that it points through, and the cell there.
///
/// The arc tangent of the position on the face makes cells of nearly equal solid angles.
fn bucket_of(normal: &UnitVector3<f32>, resolution: usize) -> usize {
    let axis = normal.iamax();
    let (major, second, third) = (normal[axis], normal[(axis + 1) % 3], normal[(axis + 2) % 3]);
    let cell = |x: f32| {
        let share = (x / major.abs()).atan() * std::f32::consts::FRAC_2_PI + 0.5;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // Between 0 and the resolution; NaN becomes 0.
        let cell = (share * resolution as f32) as usize;
        cell.min(resolution - 1)
    };
    let face = 2 * axis + usize::from(major < 0.0);
    (face * resolution + cell(second)) * resolution + cell(third)
}
