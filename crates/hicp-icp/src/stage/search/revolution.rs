//! The axis of the part of an object that is a surface of revolution.

use hicp_core::internal::small::{eigen3, inverse3};
use hicp_core::internal::{centroid, median};
use hicp_core::{Matrix3, Surfel, UnitVector3, Vector3};

/// Number of fits, each to the samples that agree with the last one.
const FITS: usize = 12;
/// Deviation at which a sample agrees at least, as a share of the diameter.
const AGREES: f64 = 0.02;
/// Share of the samples that must agree in the end.
const LEAST_SHARE: f64 = 0.6;

/// Returns the axis around which most of the surface is one of revolution, object frame.
///
/// The handle of a mug tilts its principal axes, but does not change this axis. The lines along the
/// normals of a surface of revolution meet its axis. That is linear in the velocity of a rotation
/// around the axis, so it is fitted to all samples, and again to those whose lines pass near it
/// (Pottmann & Wallner, Computational Line Geometry, 2001).
///
/// Returns `None` if fewer than 60 % of the samples agree. Cost: O(samples), twelve times.
pub(crate) fn axis_of(samples: &[Surfel], diameter: f64) -> Option<UnitVector3<f64>> {
    let center = centroid(samples)?;
    let lines: Vec<_> = samples
        .iter()
        .map(|sample| {
            let normal = sample.normal.into_inner().cast::<f64>();
            let point = (sample.point.cast::<f64>() - center) / diameter;
            (point.cross(&normal), normal)
        })
        .collect();
    let mut limit = f64::INFINITY;
    let mut deviations = vec![0.0; lines.len()];
    // A surface that all normals leave free to shift, such as a tube, does not shift.
    let at_rest = Matrix3::identity() * (1e-6 * lines.len() as f64);
    let mut axis = Vector3::zeros();
    for _ in 0..FITS {
        let (mut turns, mut mixed, mut shifts) = (Matrix3::zeros(), Matrix3::zeros(), at_rest);
        for ((moment, normal), _) in lines.iter().zip(&deviations).filter(|(_, d)| **d <= limit) {
            turns += moment * moment.transpose();
            mixed += moment * normal.transpose();
            shifts += normal * normal.transpose();
        }
        // The best velocity of the origin for each rotation is eliminated.
        let velocity = -inverse3(&shifts)? * mixed.transpose();
        let eigen = eigen3(&(turns + mixed * velocity))?;
        axis = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into();
        let velocity = velocity * axis;
        for (deviation, (moment, normal)) in deviations.iter_mut().zip(&lines) {
            *deviation = (axis.dot(moment) + velocity.dot(normal)).abs();
        }
        let mut sorted = deviations.clone();
        limit = (2.0 * median(&mut sorted, f64::total_cmp)?).max(AGREES);
    }
    let agreeing = deviations.iter().filter(|d| **d <= AGREES).count();
    let enough = agreeing as f64 >= LEAST_SHARE * lines.len() as f64;
    UnitVector3::try_new(axis, 0.5).filter(|_| enough)
}

#[cfg(test)]
mod tests {
    use hicp_core::{Isometry3, Point3, UnitQuaternion};

    use super::*;

    fn surfel(point: [f32; 3], normal: [f32; 3]) -> Surfel {
        let normal = UnitVector3::new_normalize(Vector3::from(normal));
        Surfel {
            point: Point3::from(point),
            normal,
        }
    }

    /// Returns samples of a cylinder around the z axis.
    fn cylinder() -> Vec<Surfel> {
        let around = (0..400_u16).map(|i| {
            let (angle, z) = (f32::from(i) * 0.618, f32::from(i % 20) * 0.1 - 1.0);
            surfel(
                [angle.cos(), angle.sin(), z],
                [angle.cos(), angle.sin(), 0.0],
            )
        });
        around.collect()
    }

    #[test]
    fn a_handle_does_not_tilt_the_axis() {
        let mut samples = cylinder();
        for i in 0..100_u16 {
            let along = f32::from(i) * 0.01;
            let side = [[0.0, 1.0, 0.0], [0.3, 0.0, 1.0]][usize::from(i % 2)];
            samples.push(surfel([1.0 + along, 0.1, along - 0.9], side));
        }
        let turn = UnitQuaternion::from_euler_angles(0.4, -0.7, 0.2);
        let pose = Isometry3::from_parts(Vector3::new(0.3, 2.0, -1.0).into(), turn);
        for sample in &mut samples {
            sample.point = pose.cast() * sample.point;
            sample.normal = turn.cast() * sample.normal;
        }
        let axis = axis_of(&samples, 3.0).expect("most of it is a cylinder");
        assert!(axis.dot(&(turn * Vector3::z())).abs() > 0.99999, "{axis:?}");
    }

    #[test]
    fn a_box_has_no_axis_of_revolution() {
        let samples: Vec<_> = (0..600_u16)
            .map(|i| {
                let (a, b) = (
                    f32::from(i % 25) * 0.08 - 1.0,
                    f32::from(i / 25) * 0.08 - 1.0,
                );
                match i % 3 {
                    0 => surfel([1.0, a, 0.7 * b], [1.0, 0.0, 0.0]),
                    1 => surfel([a, 0.8, 0.7 * b], [0.0, 1.0, 0.0]),
                    _ => surfel([a, 0.8 * b, 0.7], [0.0, 0.0, 1.0]),
                }
            })
            .collect();
        assert_eq!(axis_of(&samples, 3.0), None);
        assert_eq!(axis_of(&[], 1.0), None);
    }
}
