//! Downsampling of point clouds.

use hicp_core::internal::bounds;
use hicp_core::{Point3, UnitVector3, Vector3};

/// Cells along one axis that fit into the key of a cell.
const MAX_CELLS: f64 = (1 << 21) as f64;

/// Replaces the points in every cell of a cubic grid by their mean, and their normals likewise.
///
/// `edge` is the edge of a cell in meters, and `normals` has one entry per point. The cells are in
/// the order of their coordinates. Normals that are not finite do not count. Without others, or if
/// these cancel, the normal of the cell is NaN. Points that are not finite are left out. If `edge`
/// is not positive, or so small that more than 2²¹ cells lie along an axis, the points are returned
/// as they are.
///
/// Cost: O(n log n), about 50 ns per point.
///
/// # Panics
///
/// If there are fewer normals than points.
#[must_use]
pub fn voxel_downsample(
    points: &[Point3<f32>],
    normals: Option<&[UnitVector3<f32>]>,
    edge: f64,
) -> (Vec<Point3<f32>>, Option<Vec<UnitVector3<f32>>>) {
    let finite = |p: &&Point3<f32>| p.iter().all(|x| x.is_finite());
    let [min, max] = bounds(points.iter().filter(finite).copied()).unwrap_or_default();
    let inverse = 1.0 / edge;
    let cells = (max.cast::<f64>() - min.cast::<f64>()).max() * inverse;
    let fits = edge > 0.0 && cells < MAX_CELLS;
    if !fits {
        return (points.to_vec(), normals.map(<[_]>::to_vec));
    }
    // Below 2²¹ and not negative.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let cell = |x: f32, min: f32| ((f64::from(x) - f64::from(min)) * inverse) as u64;
    let mut keys: Vec<(u64, u32)> = (0_u32..)
        .zip(points)
        .filter(|(_, p)| finite(p))
        .map(|(i, p)| {
            let [x, y, z] = [0, 1, 2].map(|axis| cell(p[axis], min[axis]));
            (x << 42 | y << 21 | z, i)
        })
        .collect();
    keys.sort_unstable();
    let unknown = UnitVector3::new_unchecked(Vector3::repeat(f32::NAN));
    let (mut means, mut directions) = (Vec::new(), Vec::new());
    for members in keys.chunk_by(|a, b| a.0 == b.0) {
        // Relative to the first member, sums stay small.
        let origin = points[members[0].1 as usize];
        let (mut sum, mut direction) = (Vector3::zeros(), Vector3::zeros());
        for (_, i) in members {
            sum += points[*i as usize] - origin;
            let normal = normals.map(|normals| normals[*i as usize].into_inner());
            if let Some(normal) = normal.filter(|n| n.iter().all(|x| x.is_finite())) {
                direction += normal;
            }
        }
        if normals.is_some() {
            directions.push(UnitVector3::try_new(direction, 1e-3).unwrap_or(unknown));
        }
        means.push(origin + sum / members.len() as f32);
    }
    (means, normals.map(|_| directions))
}
