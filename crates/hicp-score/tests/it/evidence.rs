//! Tests of the evidence against scenes with known shares.

use crate::support::{RayCaster, cuboid, pose, render_depth};
use hicp_core::{
    Context, DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Problem, RenderCache,
};
use hicp_score::Evidence;

/// A grid of this width has all pixels.
pub(crate) const WIDTH: u32 = 64;
pub(crate) const HEIGHT: u32 = 64;
/// Depth of the wall behind the object, meters.
pub(crate) const WALL: f32 = 0.6;

pub(crate) fn camera() -> PinholeCamera {
    PinholeCamera::new(80.0, 80.0, 31.6, 30.3, WIDTH, HEIGHT).unwrap()
}

pub(crate) fn cube() -> Model {
    Model::new(cuboid(0.08, 0.08, 0.08))
}

pub(crate) fn at() -> Isometry3<f64> {
    pose(0.003, -0.002, 0.3, 0.4, 0.8, 0.2)
}

/// Returns the rendered depth of the cube at a pose, 0 where it is not.
fn rendered(pose: &Isometry3<f64>) -> Vec<f32> {
    render_depth(&cube(), &camera(), pose).pixels().to_vec()
}

fn observe(depth: Vec<f32>, mask: Vec<bool>) -> Observation {
    let depth = DepthImage::from_meters(WIDTH, HEIGHT, depth).unwrap();
    Observation::new(depth, Mask::new(WIDTH, HEIGHT, mask).unwrap(), camera()).unwrap()
}

/// Returns the evidence at [`at`] for depths and masks that are functions of the pixel's index.
fn evidence(depth: impl Fn(usize) -> f32, mask: impl Fn(usize) -> bool) -> Evidence {
    let pixels = 0..(WIDTH * HEIGHT) as usize;
    let observation = observe(
        pixels.clone().map(depth).collect(),
        pixels.map(mask).collect(),
    );
    let model = cube();
    let mut renders = RenderCache::new(RayCaster);
    let problem = Problem::new(&model, &observation);
    let found = Evidence::at(&mut Context::new(problem, &mut renders), &at()).unwrap();
    let sum = found.agrees + found.contradicts() + found.hidden + found.unmeasured;
    assert!((sum - 1.0).abs() < 1e-12, "{found:?}");
    found
}

pub(crate) fn near(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() <= tolerance, "{a} {b}");
}

#[test]
fn at_the_true_pose_everything_agrees() {
    let z = rendered(&at());
    let scene = |i: usize| if z[i] > 0.0 { z[i] } else { WALL };
    let found = evidence(scene, |i| z[i] > 0.0);
    assert_eq!((found.agrees, found.contour), (1.0, Some(1.0)));
    assert_eq!(found.pixels, z.iter().filter(|z| **z > 0.0).count());
    assert_eq!(
        (found.unexplained, found.mask_extra, found.mask_missing),
        (0.0, 0.0, 0.0)
    );
    assert_eq!(found.mask_growth_pixels, 0.0);
    assert!(found.residual < 0.005 && found.noise < 0.02, "{found:?}");
}

#[test]
fn a_wall_behind_the_object_is_seen_through() {
    let z = rendered(&at());
    let found = evidence(
        |i| {
            if i % 64 < 32 && z[i] > 0.0 {
                z[i]
            } else {
                WALL
            }
        },
        |i| z[i] > 0.0,
    );
    let left = (0..z.len()).filter(|i| i % 64 < 32 && z[*i] > 0.0).count();
    let share = left as f64 / found.pixels as f64;
    assert_eq!((found.agrees, found.seen_through), (share, 1.0 - share));
    assert_eq!(found.unexplained, 1.0 - share);
    assert_eq!((found.mask_extra, found.hidden), (0.0, 0.0));
}

#[test]
fn a_bar_in_front_hides_but_a_table_contains() {
    let z = rendered(&at());
    let scene = |i: usize| if z[i] > 0.0 { z[i] } else { WALL };
    let bar = |i: usize| (28..36).contains(&(i % 64));
    let found = evidence(
        |i| if bar(i) { 0.15 } else { scene(i) },
        |i| z[i] > 0.0 && !bar(i),
    );
    let hidden = (0..z.len()).filter(|i| bar(*i) && z[*i] > 0.0).count();
    assert_eq!(found.hidden, hidden as f64 / found.pixels as f64);
    assert_eq!(
        (found.inside, found.contradicts(), found.unexplained),
        (0.0, 0.0, 0.0)
    );

    // A sloping surface that is behind the object at the left and in front of it at the right.
    let slope = |i: usize| 0.5 - 0.0068 * (i % 64) as f32;
    let inside = evidence(slope, |i| z[i] > 0.0);
    let nearer = |i: &usize| z[*i] > 0.0 && z[*i] - slope(*i) > 0.1 * cube().diameter() as f32;
    let nearer = (0..z.len()).filter(nearer).count();
    assert!(nearer > 100, "{nearer}");
    assert_eq!(inside.inside, nearer as f64 / inside.pixels as f64);
    assert_eq!(inside.hidden, 0.0);
    assert!(inside.contour.unwrap() < 0.7, "{inside:?}");
}

#[test]
fn missing_depth_is_unmeasured() {
    let z = rendered(&at());
    let found = evidence(|i| if i % 2 == 0 { z[i] } else { 0.0 }, |i| z[i] > 0.0);
    near(found.unmeasured, 0.5, 0.05);
    assert_eq!((found.contradicts(), found.unexplained), (0.0, 0.0));
    assert_eq!((found.contour, found.noise), (None, 0.0));
}

#[test]
fn the_growth_of_the_mask_is_that_of_its_border() {
    let z = rendered(&at());
    let scene = |i: usize| if z[i] > 0.0 { z[i] } else { WALL };
    let around = |i: u32, r: i32, all: bool| {
        let (u, v) = ((i % 64).cast_signed(), (i / 64).cast_signed());
        let disc = (-r..=r).flat_map(|dy| (-r..=r).map(move |dx| (dx, dy)));
        let mut set = disc
            .filter(|(dx, dy)| dx * dx + dy * dy <= r * r)
            .map(|(dx, dy)| z[((v + dy).clamp(0, 63) * 64 + (u + dx).clamp(0, 63)) as usize] > 0.0);
        if all {
            set.all(|on| on)
        } else {
            set.any(|on| on)
        }
    };
    for pixels in [1, 2, 3] {
        let large = evidence(scene, |i| around(i as u32, pixels, false));
        near(
            large.mask_growth_pixels,
            f64::from(pixels),
            0.35 * f64::from(pixels),
        );
        assert!(
            large.mask_extra > 0.1 && large.mask_missing == 0.0,
            "{large:?}"
        );
        let small = evidence(scene, |i| around(i as u32, pixels, true));
        near(
            small.mask_growth_pixels,
            -f64::from(pixels),
            0.35 * f64::from(pixels),
        );
        assert!(
            small.mask_missing > 0.1 && small.mask_extra == 0.0,
            "{small:?}"
        );
        assert_eq!(small.agrees, 1.0);
    }
}

#[test]
fn outside_of_the_image_there_is_no_evidence() {
    let observation = observe(vec![WALL; 4096], vec![true; 4096]);
    let model = cube();
    let mut renders = RenderCache::new(RayCaster);
    let problem = Problem::new(&model, &observation);
    let aside = pose(9.0, 0.0, 0.3, 0.0, 0.0, 0.0);
    let found = Evidence::at(&mut Context::new(problem, &mut renders), &aside).unwrap();
    assert_eq!(
        (found.pixels, found.agrees, found.unexplained),
        (0, 0.0, 1.0)
    );
    assert_eq!(found.mask_growth_pixels, 0.0);
    let nothing = &mut Context::new(Problem::default(), &mut renders);
    assert_eq!(Evidence::at(nothing, &aside), None);
}
