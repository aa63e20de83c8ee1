//! Subsets with evenly distributed normals.

use hicp_core::internal::Scratch;
use hicp_core::{Context, Isometry3, Problem, Surfel, UnitVector3};

use crate::selection::all_samples::AllSamples;
use crate::selection::keep::spread;
use crate::selection::point_selection::PointSelection;

/// Keeps `count` points of another selection whose normals are spread evenly over all directions.
///
/// Source: normal-space sampling, Rusinkiewicz & Levoy 2001. Small features that keep an object
/// from sliding (the rim of a plate, the handle of a mug) have few points but distinct normals.
/// Here every direction has the same influence.
///
/// Points are sorted into buckets by the direction of their normal. The buckets are the cells of a
/// grid on the six faces of a cube, with nearly equal solid angles. Every bucket contributes the
/// same number of points, or all that it has. The points of a bucket are evenly spaced in the order
/// of the inner selection, which does not change. If there are at most `count` points, all are
/// kept.
///
/// Cost: the inner selection, and O(points + buckets).
#[derive(Clone, Debug, PartialEq)]
pub struct NormalSpace<P> {
    /// The selection to select from.
    pub selection: P,
    /// Number of points to keep.
    pub count: usize,
    /// Cells along an edge of the cube, for 6·resolution² buckets.
    ///
    /// 0 counts as 1, and values above 64 count as 64.
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

/// The largest effective resolution.
const MAX_RESOLUTION: usize = 64;

impl<P> NormalSpace<P> {
    /// Creates the selection.
    #[must_use]
    pub fn new(selection: P, count: usize, resolution: usize) -> Self {
        Self {
            selection,
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
        self.selection.select(context, camera_from_object, source);
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

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        self.selection.unsupported(problem)
    }
}

/// Sets quotas with the sum `count`, which is less than the number of points.
///
/// Quotas are equal, unless a bucket has fewer points.
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
    // The rest is less than one point for each bucket that has more. It comes from evenly spaced
    // buckets.
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

/// Returns the bucket of a direction: the face of the cube that it points through, and its cell.
///
/// The arc tangent of the position on the face gives cells of nearly equal solid angles.
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
