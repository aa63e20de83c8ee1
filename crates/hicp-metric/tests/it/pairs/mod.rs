//! Helpers that create pairs.

use crate::support::Numbers;
use hicp_core::{Correspondences, Isometry3, Pair, Point3, Surfel, UnitVector3, Vector3};

pub fn pair(p: Point3<f64>, q: Point3<f64>, normal: Vector3<f64>, weight: f32) -> Pair {
    let normal = UnitVector3::new_unchecked(normal.cast::<f32>());
    let surfel = |p: Point3<f64>| Surfel {
        point: p.cast::<f32>(),
        normal,
    };
    Pair {
        source: surfel(p),
        target: surfel(q),
        weight,
        source_index: 0,
        target_index: 0,
    }
}

/// Returns fewer than `most` pairs at extreme scales, half of them on a line.
pub fn extreme(numbers: &mut Numbers, most: usize) -> Correspondences {
    let scales = [0.0, 1e-38, 1e-20, 1e-6, 1.0, 1e6, 1e18, 3e38];
    let line = numbers.direction();
    (0..numbers.below(most))
        .map(|i| {
            let [p, q] = [(); 2].map(|()| {
                let scale = scales[numbers.below(scales.len())];
                let p = if i % 2 == 0 { numbers.vector() } else { line };
                Point3::from(p.map(|x| x.clamp(-1.0, 1.0) * scale))
            });
            let known = f64::from(u8::from(numbers.below(4) > 0));
            let normal = numbers.direction() * known;
            pair(p, q, normal, numbers.below(3) as f32)
        })
        .collect()
}

/// Returns pairs of points and their images under a motion, both rounded to f32.
pub fn images(points: &[Point3<f64>], motion: &Isometry3<f64>) -> Correspondences {
    points
        .iter()
        .map(|p| pair(*p, motion * p, Vector3::z(), 1.0))
        .collect()
}

/// Returns the mean squared distance between the moved sources and the targets.
pub fn loss(pairs: &Correspondences, motion: &Isometry3<f64>) -> f64 {
    let (mut sum, mut weight) = (0.0, 0.0);
    for pair in pairs.as_slice() {
        let w = f64::from(pair.weight);
        let p = motion * pair.source.point.cast::<f64>();
        sum += w * (p - pair.target.point.cast::<f64>()).norm_squared();
        weight += w;
    }
    sum / weight
}

pub fn rms(pairs: &Correspondences, motion: &Isometry3<f64>) -> f64 {
    loss(pairs, motion).sqrt()
}

/// Returns the largest rounding of a point of the pairs.
///
/// It is half a unit in the last place of f32, times √3.
pub fn rounding(pairs: &Correspondences) -> f64 {
    let largest = pairs
        .as_slice()
        .iter()
        .flat_map(|p| [p.source.point.coords.amax(), p.target.point.coords.amax()])
        .fold(0.0_f32, f32::max);
    f64::from(largest) * f64::from(f32::EPSILON) * 0.5 * 3.0_f64.sqrt()
}

pub fn determinant(motion: &Isometry3<f64>) -> f64 {
    motion.rotation.to_rotation_matrix().matrix().determinant()
}

/// Returns pairs on an ellipsoid of 10 cm, with sources displaced by a motion around its center.
pub fn ellipsoid(
    numbers: &mut Numbers,
    count: usize,
    off: &Isometry3<f64>,
    center: &Vector3<f64>,
) -> Correspondences {
    let axes = Vector3::new(0.05, 0.04, 0.025);
    (0..count)
        .map(|_| {
            let direction = numbers.direction();
            let point = direction.component_mul(&axes);
            let normal = direction.component_div(&axes).normalize();
            pair(
                Point3::from(off * Point3::from(point) + center),
                Point3::from(point + center),
                normal,
                1.0,
            )
        })
        .collect()
}

pub fn small_motion(numbers: &mut Numbers, degrees: f64, shift: f64) -> Isometry3<f64> {
    let axis = numbers.direction() * degrees.to_radians();
    Isometry3::new(numbers.direction() * shift, axis)
}

pub fn moved(pairs: &Correspondences, motion: &Isometry3<f64>) -> Correspondences {
    pairs
        .as_slice()
        .iter()
        .map(|p| {
            let normal = motion.rotation * p.target.normal.cast::<f64>().into_inner();
            let point = |q: Point3<f32>| motion * q.cast::<f64>();
            pair(
                point(p.source.point),
                point(p.target.point),
                normal,
                p.weight,
            )
        })
        .collect()
}
