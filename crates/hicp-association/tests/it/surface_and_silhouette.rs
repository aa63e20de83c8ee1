//! Tests of the fit of the rendered surface and its silhouette on images by definition.
//!
//! A box or a ball stands in front of a plane. Without noise, the image is the render itself.

use crate::common::bumpy_ball;
use crate::support::{Numbers, RayCaster, cuboid, degrees_between, depth_image, render_depth};
use hicp_association::{Contour, DataAssociation, Length, RenderedSurface, Stride};
use hicp_core::{
    Context, Correspondences, DepthImage, Isometry3, Mask, Model, Observation, Pair, PinholeCamera,
    Problem, RenderCache, Translation3, Vector3,
};

/// Distance of the plane from the camera, meters.
const PLANE: f64 = 0.62;

fn camera() -> PinholeCamera {
    PinholeCamera::new(280.0, 280.0, 79.6, 59.3, 160, 120).unwrap()
}

/// An object in front of a plane.
struct Scene {
    model: Model,
    truth: Isometry3<f64>,
    depth: DepthImage,
    /// The mask of the object's pixels.
    exact: Mask,
}

impl Scene {
    fn of(model: Model, truth: Isometry3<f64>) -> Self {
        let camera = camera();
        let object = render_depth(&model, &camera, &truth);
        let behind = |z: &f32| if *z > 0.0 { *z } else { PLANE as f32 };
        let depth = object.pixels().iter().map(behind).collect();
        Self {
            model,
            truth,
            depth: DepthImage::from_meters(160, 120, depth).unwrap(),
            exact: Mask::measured(&object),
        }
    }

    /// A box whose face is parallel to the image, 45 pixels wide.
    fn box_in_front() -> Self {
        let truth = Isometry3::translation(0.003, -0.002, 0.5);
        Self::of(Model::new(cuboid(0.08, 0.06, 0.04)), truth)
    }

    fn ball() -> Self {
        let truth = Isometry3::new(
            Vector3::new(-0.004, 0.003, 0.5),
            Vector3::new(0.4, -0.9, 0.2),
        );
        Self::of(Model::new(bumpy_ball(0.05)), truth)
    }

    fn observed(&self, mask: Mask) -> Observation {
        Observation::new(self.depth.clone(), mask, camera()).unwrap()
    }

    /// Returns the true pose, moved sideways by pixels at its depth.
    fn shifted(&self, right: f64, down: f64) -> Isometry3<f64> {
        let meters = self.truth.translation.z / camera().fx();
        Translation3::new(right * meters, down * meters, 0.0) * self.truth
    }

    fn pairs(
        &self,
        association: &mut impl DataAssociation,
        observation: &Observation,
        pose: &Isometry3<f64>,
    ) -> Correspondences {
        pairs(association, &self.model, observation, pose)
    }
}

fn pairs(
    association: &mut impl DataAssociation,
    model: &Model,
    observation: &Observation,
    pose: &Isometry3<f64>,
) -> Correspondences {
    let mut renders = RenderCache::new(RayCaster);
    let mut context = Context::new(Problem::new(model, observation), &mut renders);
    let mut pairs = Correspondences::new();
    pairs.begin(pose, 0);
    association.associate(&mut context, &[], pose, &mut pairs);
    for pair in pairs.as_slice() {
        assert!(pair.distance().is_finite(), "{pair:?}");
        assert!(pair.weight.is_finite() && pair.weight >= 0.0, "{pair:?}");
    }
    assert!(pairs.len() <= pairs.n_candidates());
    pairs
}

/// Returns a mask that contains all pixels at a distance of up to `pixels` from another one.
fn dilated(mask: &Mask, pixels: i32) -> Mask {
    by_pixel(|u, v| {
        (-pixels..=pixels).any(|dv| {
            (-pixels..=pixels).any(|du| {
                let near = du * du + dv * dv <= pixels * pixels;
                let at = u.checked_add_signed(du).zip(v.checked_add_signed(dv));
                near && at.is_some_and(|(u, v)| mask.get(u, v) == Some(true))
            })
        })
    })
}

/// Returns the smallest rectangle around a mask, enlarged by some pixels.
fn boxed(mask: &Mask, pixels: u32) -> Mask {
    let region = mask.bounding_region();
    by_pixel(|u, v| {
        let columns = region.u_min - pixels..region.u_max + pixels;
        columns.contains(&u) && (region.v_min - pixels..region.v_max + pixels).contains(&v)
    })
}

fn by_pixel(on: impl Fn(u32, u32) -> bool) -> Mask {
    Mask::in_region(160, 120, &camera().region(), on)
}

/// Returns the signed distance from a source to its target along the normal, pixels.
fn offset(pair: &Pair) -> f64 {
    let (source, target) = (&pair.source, &pair.target);
    let meters = f64::from((target.point - source.point).dot(&source.normal));
    meters * camera().fx() / f64::from(source.point.z)
}

/// Returns the offsets of the pairs whose normal points in a direction of the image.
fn toward(pairs: &Correspondences, x: f64, y: f64) -> Vec<f64> {
    let direction = Vector3::new(x, y, 0.0).cast::<f32>();
    let pairs = pairs.as_slice().iter();
    pairs
        .filter(|pair| pair.source.normal.dot(&direction) > 0.9)
        .map(offset)
        .collect()
}

fn assert_all_near(offsets: &[f64], expected: f64, within: f64) {
    assert!(offsets.len() >= 10, "{offsets:?}");
    for offset in offsets {
        assert!(
            (offset - expected).abs() <= within,
            "{expected}: {offsets:?}"
        );
    }
}

#[test]
fn the_surface_at_the_true_pose_has_no_residual() {
    for scene in [Scene::box_in_front(), Scene::ball()] {
        let observation = scene.observed(scene.exact.clone());
        let mut association = RenderedSurface {
            stride: Stride::Pixels(1),
            limit: Length::Meters(0.02),
        };
        let pairs = scene.pairs(&mut association, &observation, &scene.truth);
        assert!(pairs.len() > 1000);
        for pair in pairs.as_slice() {
            assert!(pair.distance() < 1e-6, "{pair:?}");
            let pixel = camera().project(&pair.target.point.cast()).unwrap();
            let observed = observation.surfel_near(pixel.x as f32, pixel.y as f32);
            assert!((observed.unwrap().point - pair.target.point).norm() < 1e-6);
        }
    }
}

/// A row of point-to-plane is √w n·(p − c). With the weight of a pair, it is the error of depth.
#[test]
fn a_weighted_residual_is_the_error_of_depth() {
    let scene = Scene::ball();
    let observation = scene.observed(scene.exact.clone());
    let limit = 0.02;
    let mut association = RenderedSurface {
        stride: Stride::Pixels(2),
        limit: Length::Meters(f64::from(limit)),
    };
    let pose = Translation3::new(0.0, 0.0, 0.004) * scene.truth;
    let pairs = scene.pairs(&mut association, &observation, &pose);
    assert!(pairs.len() > 300);
    for pair in pairs.as_slice() {
        let (source, target) = (&pair.source, &pair.target);
        let along_ray = (target.point - source.point).norm();
        let residual = (target.point - source.point).dot(&target.normal).abs();
        let behind = target.point.z - source.point.z;
        let t = 1.0 - (behind / limit).powi(2);
        let expected = t * along_ray;
        let found = pair.weight.sqrt() * residual;
        assert!(
            (found - expected).abs() < 1e-5,
            "{found} {expected} {pair:?}"
        );
    }
}

#[test]
fn depths_farther_apart_than_the_limit_have_no_pair() {
    let scene = Scene::box_in_front();
    let observation = scene.observed(scene.exact.clone());
    for (away, any) in [(0.009, true), (0.011, false)] {
        let mut association = RenderedSurface {
            stride: Stride::Pixels(1),
            limit: Length::Meters(0.01),
        };
        let pose = Translation3::new(0.0, 0.0, away) * scene.truth;
        let pairs = scene.pairs(&mut association, &observation, &pose);
        assert_eq!(!pairs.is_empty(), any);
        assert!(pairs.n_candidates() > 1000);
    }
}

/// Detectors often miss a part of the object.
#[test]
fn the_surface_outside_of_the_mask_has_pairs() {
    let scene = Scene::box_in_front();
    let left_half = by_pixel(|u, v| u < 80 && scene.exact.get(u, v) == Some(true));
    let observation = scene.observed(left_half.clone());
    let pairs = scene.pairs(&mut RenderedSurface::default(), &observation, &scene.truth);
    let mut outside = 0;
    for pair in pairs.as_slice() {
        let pixel = camera().project(&pair.target.point.cast()).unwrap();
        let masked = left_half.get(pixel.x.round() as u32, pixel.y.round() as u32);
        outside += usize::from(masked == Some(false));
    }
    assert!(outside > 300 && outside + 300 < pairs.len());
}

#[test]
fn the_silhouette_at_the_true_pose_has_no_offset() {
    for scene in [Scene::box_in_front(), Scene::ball()] {
        let observation = scene.observed(scene.exact.clone());
        let pairs = scene.pairs(&mut Contour::default(), &observation, &scene.truth);
        assert!(pairs.len() > 70, "{}", pairs.len());
        let offsets: Vec<f64> = pairs.as_slice().iter().map(offset).collect();
        assert_all_near(&offsets, 0.0, 1.0);
        let exact = offsets.iter().filter(|offset| offset.abs() < 1e-3).count();
        assert!(exact * 10 > offsets.len() * 9, "{offsets:?}");
        for pair in pairs.as_slice() {
            assert_eq!(pair.target_index, Pair::UNLISTED);
            // The normal is perpendicular to the ray and points away from the object's middle.
            let normal = pair.source.normal.cast::<f64>().into_inner();
            let point = pair.source.point.cast::<f64>().coords;
            assert!((degrees_between(&normal, &point) - 90.0).abs() < 0.01);
            let out = point - scene.truth.translation.vector;
            assert!(normal.dot(&Vector3::new(out.x, out.y, 0.0)) > 0.0);
        }
    }
}

/// The border lies where the object is, opposite to the shift of the pose.
#[test]
fn the_offset_of_the_silhouette_is_the_shift_of_the_pose() {
    let scene = Scene::box_in_front();
    let observation = scene.observed(scene.exact.clone());
    for shift in [-5.0, -3.0, 2.0, 4.0] {
        let pose = scene.shifted(shift, 0.0);
        let pairs = scene.pairs(&mut Contour::default(), &observation, &pose);
        assert_all_near(&toward(&pairs, 1.0, 0.0), -shift, 1.0);
        assert_all_near(&toward(&pairs, -1.0, 0.0), shift, 1.0);
        let pose = scene.shifted(0.0, shift);
        let pairs = scene.pairs(&mut Contour::default(), &observation, &pose);
        assert_all_near(&toward(&pairs, 0.0, 1.0), -shift, 1.0);
        assert_all_near(&toward(&pairs, 0.0, -1.0), shift, 1.0);
    }
}

#[test]
fn a_dilated_mask_gives_the_pairs_of_the_exact_mask() {
    let scene = Scene::box_in_front();
    for (right, down) in [(0.0, 0.0), (3.0, -2.0)] {
        let pose = scene.shifted(right, down);
        let of = |mask: Mask| scene.pairs(&mut Contour::default(), &scene.observed(mask), &pose);
        let exact = of(scene.exact.clone());
        for pixels in [4, 8] {
            let wide = of(dilated(&scene.exact, pixels));
            let mut same = 0;
            for pair in wide.as_slice() {
                let mut others = exact.as_slice().iter();
                if let Some(other) = others.find(|p| p.source_index == pair.source_index) {
                    assert!(
                        (offset(pair) - offset(other)).abs() <= 1.01,
                        "{pair:?} {other:?}"
                    );
                    same += 1;
                }
            }
            assert!(same * 10 >= exact.len() * 9, "{same} of {}", exact.len());
        }
    }
}

/// At the true pose, the borders of the box are up to 15 pixels from the silhouette of the ball.
#[test]
fn a_box_as_mask_does_not_pull() {
    for (scene, wider) in [
        (Scene::ball(), 0),
        (Scene::ball(), 5),
        (Scene::box_in_front(), 6),
    ] {
        let observation = scene.observed(boxed(&scene.exact, wider));
        let pairs = scene.pairs(&mut Contour::default(), &observation, &scene.truth);
        assert!(pairs.len() > 70, "{}", pairs.len());
        for pair in pairs.as_slice() {
            assert!(offset(pair).abs() <= 1.01, "{wider}: {pair:?}");
        }
    }
}

/// A bar covers the right part of the box, and the mask ends where the bar starts.
#[test]
fn a_border_that_is_hidden_has_no_pair() {
    let mut scene = Scene::box_in_front();
    let bar = 85..130;
    let depths = scene.depth.pixels().iter().zip(0_u32..);
    let depths = depths.map(|(z, i)| if bar.contains(&(i % 160)) { 0.4 } else { *z });
    scene.depth = DepthImage::from_meters(160, 120, depths.collect()).unwrap();
    let visible = by_pixel(|u, v| !bar.contains(&u) && scene.exact.get(u, v) == Some(true));
    let observation = scene.observed(visible);
    let pairs = scene.pairs(&mut Contour::default(), &observation, &scene.truth);
    assert!(pairs.len() > 30);
    for pair in pairs.as_slice() {
        let pixel = camera().project(&pair.source.point.cast()).unwrap();
        assert!(!bar.contains(&(pixel.x.round() as u32)), "{pair:?}");
        assert!(offset(pair).abs() <= 1.01, "{pair:?}");
    }
    assert!(toward(&pairs, 1.0, 0.0).is_empty());
    // The surface behind the bar has no pair either.
    let mut surface = RenderedSurface {
        limit: Length::Meters(0.05),
        ..RenderedSurface::default()
    };
    let pairs = scene.pairs(&mut surface, &observation, &scene.truth);
    for pair in pairs.as_slice() {
        assert!(pair.distance() < 1e-6, "{pair:?}");
    }
}

#[test]
fn the_border_of_the_image_is_not_a_silhouette() {
    // The left half of the box is outside of the image.
    let truth = Isometry3::translation(-79.6 * 0.5 / 280.0, 0.0, 0.5);
    let scene = Scene::of(Model::new(cuboid(0.08, 0.06, 0.04)), truth);
    let observation = scene.observed(scene.exact.clone());
    let pairs = scene.pairs(&mut Contour::default(), &observation, &scene.truth);
    assert!(pairs.len() > 30);
    assert!(toward(&pairs, -1.0, 0.0).is_empty());
    for pair in pairs.as_slice() {
        assert!(offset(pair).abs() <= 1.01, "{pair:?}");
    }
    assert!(
        !scene
            .pairs(&mut RenderedSurface::default(), &observation, &truth)
            .is_empty()
    );
}

#[test]
fn images_without_information_give_no_pairs() {
    let scene = Scene::box_in_front();
    let nothing = depth_image(&camera(), |_| 0.0);
    // Without depth, the mask cannot be compared with anything, and has no influence.
    for mask in [
        by_pixel(|_, _| false),
        Mask::full(160, 120),
        scene.exact.clone(),
    ] {
        let blind = Observation::new(nothing.clone(), mask, camera()).unwrap();
        let mut join = (RenderedSurface::default(), Contour::default());
        assert!(scene.pairs(&mut join, &blind, &scene.truth).is_empty());
    }
    // Nothing is known to be the object. One pixel has no surfel either.
    for mask in [by_pixel(|_, _| false), by_pixel(|u, v| (u, v) == (80, 60))] {
        let unmasked = scene.observed(mask);
        assert_eq!(unmasked.n_surfels(), 0);
        let mut join = (RenderedSurface::default(), Contour::default());
        let pairs = scene.pairs(&mut join, &unmasked, &scene.truth);
        assert_eq!((pairs.len(), pairs.n_candidates()), (0, 0));
    }
}

#[test]
fn holes_in_the_depth_do_not_move_the_border() {
    let mut numbers = Numbers(5);
    let mut scene = Scene::box_in_front();
    let depths = scene.depth.pixels().iter();
    let depths = depths.map(|z| if numbers.unit() < 0.3 { 0.0 } else { *z });
    scene.depth = DepthImage::from_meters(160, 120, depths.collect()).unwrap();
    let observation = scene.observed(scene.exact.clone());
    let pairs = scene.pairs(&mut Contour::default(), &observation, &scene.truth);
    let offsets: Vec<f64> = pairs.as_slice().iter().map(offset).collect();
    assert_all_near(&offsets, 0.0, 2.01);
}

/// The number of candidates of a join is the sum of its members', and so are the pairs.
#[test]
fn joined_associations_add_up() {
    let scene = Scene::ball();
    let observation = scene.observed(scene.exact.clone());
    let (surface, contour) = (RenderedSurface::default(), Contour::default());
    let pose = scene.shifted(1.0, 2.0);
    let of = |association: &mut dyn DataAssociation| {
        pairs(&mut &mut *association, &scene.model, &observation, &pose)
    };
    let (first, second) = (of(&mut surface.clone()), of(&mut contour.clone()));
    let expected: Vec<Pair> = first
        .as_slice()
        .iter()
        .chain(second.as_slice())
        .copied()
        .collect();
    let candidates = first.n_candidates() + second.n_candidates();
    let members: Vec<Box<dyn DataAssociation>> = vec![Box::new(surface), Box::new(contour.clone())];
    let (s, c) = (surface, contour.clone());
    let mut nested = (Vec::<Contour>::new(), (s,), c);
    for join in [
        &mut (surface, contour) as &mut dyn DataAssociation,
        &mut { members },
        &mut nested,
    ] {
        let joined = of(join);
        assert_eq!(joined.as_slice(), expected);
        assert_eq!(joined.n_candidates(), candidates);
    }
    assert_eq!(of(&mut Vec::<Contour>::new()).n_candidates(), 0);
}
