//! Tests of the filter of targets at the boundary of the observed surface.

use crate::common::{Scene, ball_scene, scene_of};
use crate::support::cuboid;
use hicp_association::BoundaryTargets;
use hicp_core::{DepthImage, Mask, Observation, Pair, PinholeCamera, Point3, Surfel, Vector3};

#[test]
fn boundary_targets_equal_their_definition() {
    for scene in [ball_scene(), scene_of(cuboid(0.06, 0.18, 0.1), 0.0, 8)] {
        let (observation, region) = (&scene.observation, scene.observation.region());
        let pairs: Vec<Pair> = observation
            .surfels(1)
            .map(|(index, target)| Pair::new(0, *target, index, *target))
            .collect();
        let depth = |u: i64, v: i64| -> Option<f32> {
            let (u, v) = (u32::try_from(u).ok()?, u32::try_from(v).ok()?);
            let masked = observation.mask().get(u, v)?;
            observation.depth().get(u, v).filter(|z| masked && *z > 0.0)
        };
        let focal = observation.camera().fx().min(observation.camera().fy());
        for (width, max_tilt_degrees) in [
            (0, 60.0),
            (1, 60.0),
            (2, 60.0),
            (1, 85.0),
            (1, 90.0),
            (1, f64::NAN),
        ] {
            let slope = f64::to_radians(max_tilt_degrees).tan();
            let max_step = (slope / focal) as f32;
            let reach = i64::from(width);
            let expected: Vec<Pair> = pairs
                .iter()
                .filter(|pair| {
                    let columns = region.width() as u32;
                    let u = i64::from(region.u_min + pair.target_index % columns);
                    let v = i64::from(region.v_min + pair.target_index / columns);
                    let center = depth(u, v).unwrap();
                    (-reach..=reach).all(|dv| {
                        (-reach..=reach).all(|du| {
                            let r = du.abs().max(dv.abs()) as f32;
                            depth(u + du, v + dv).is_some_and(|z| {
                                r == 0.0 || (z - center).abs() <= max_step * r * z.min(center)
                            })
                        })
                    })
                })
                .copied()
                .collect();
            let mut filter = BoundaryTargets {
                width,
                max_tilt_degrees,
            };
            let kept = scene.filter(&mut filter, &pairs);
            assert_eq!(kept, expected);
            assert_eq!(kept.len() == pairs.len(), width == 0);
            assert_eq!(kept.is_empty(), max_step.is_nan());
        }
        // An invalid index counts as boundary.
        let beyond = Pair {
            target_index: u32::MAX - 1,
            ..pairs[0]
        };
        let kept = scene.filter(&mut BoundaryTargets::default(), &[beyond]);
        assert!(kept.is_empty());
        // A target that is not a surfel of the observation is kept.
        let unlisted = Pair {
            target_index: Pair::UNLISTED,
            ..pairs[0]
        };
        assert_eq!(
            scene.filter(&mut BoundaryTargets::default(), &[unlisted]),
            [unlisted]
        );
    }
}

/// A limit in depth per pixel would treat slanted surface as an edge at a lower resolution.
#[test]
fn edges_do_not_depend_on_the_resolution() {
    for zoom in [0.25, 1.0, 4.0] {
        let camera = PinholeCamera::new(120.0 * zoom, 120.0 * zoom, 31.5, 23.5, 64, 48).unwrap();
        // A plane through (0, 0, 0.5), tilted by 80° around the image's vertical, then one tilted
        // by 88°.
        for (degrees, is_edge) in [(80.0_f64, false), (88.0, true)] {
            let slope = degrees.to_radians().tan();
            let depth = |u: f64| 0.5 / (1.0 - slope * (u - 31.5) / (120.0 * zoom));
            // Only near the axis: farther away, rays meet the plane at another angle.
            let columns = 30..34;
            let pixels = (0..48).flat_map(|_| {
                (0..64).map(|u| {
                    if columns.contains(&u) {
                        depth(f64::from(u)) as f32
                    } else {
                        0.0
                    }
                })
            });
            let depth = DepthImage::collect(64, 48, pixels).unwrap();
            let scene = Scene {
                observation: Observation::new(depth, Mask::full(64, 48), camera).unwrap(),
                ..ball_scene()
            };
            let target = Surfel {
                point: Point3::new(0.0, 0.0, 0.5),
                normal: -Vector3::z_axis(),
            };
            // Columns 31 and 32 of row 24 have neighbors on both sides.
            let region = scene.observation.region();
            let index = |u: u32| (24 - region.v_min) * region.width() as u32 + u - region.u_min;
            let pairs = [31, 32].map(|u| Pair::new(0, target, index(u), target));
            let kept = scene.filter(&mut BoundaryTargets::default(), &pairs);
            assert_eq!(kept.len(), if is_edge { 0 } else { 2 }, "{zoom} {degrees}");
        }
    }
}
