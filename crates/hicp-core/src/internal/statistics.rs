//! Order statistics of numbers and points.

use std::cmp::Ordering;

use nalgebra::{Point3, RealField, Vector3};

use crate::surfel::Surfel;

/// Returns the median: of an even number of values, the upper of the two middle ones.
///
/// Reorders `values`. Without values, returns `None`.
pub fn median<T: Copy>(values: &mut [T], order: impl FnMut(&T, &T) -> Ordering) -> Option<T> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, order).1)
}

/// Returns the least and the largest coordinates of points, or `None` without points.
pub fn bounds<T: RealField + Copy>(
    points: impl IntoIterator<Item = Point3<T>>,
) -> Option<[Point3<T>; 2]> {
    let both = points.into_iter().map(|point| [point; 2]);
    both.reduce(|[low, high], [point, _]| [low.inf(&point), high.sup(&point)])
}

/// Returns the mean of the points of surfels, or `None` without surfels.
pub fn centroid<'a>(surfels: impl IntoIterator<Item = &'a Surfel>) -> Option<Point3<f64>> {
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for surfel in surfels {
        sum += surfel.point.coords.cast::<f64>();
        count += 1.0;
    }
    (count > 0.0).then(|| Point3::from(sum / count))
}
