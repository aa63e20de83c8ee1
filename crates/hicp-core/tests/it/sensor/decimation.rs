//! Tests of observations at a lower resolution, against the pixels that they are made of.

use std::sync::Arc;

use crate::support::Numbers;
use hicp_core::{DepthImage, Mask, Observation, PinholeCamera};

/// A tilted wall with a different depth at every pixel, holes, and a ragged mask away from the
/// borders.
fn fine() -> Observation {
    let (width, height) = (53, 47);
    let camera = PinholeCamera::new(80.0, 84.0, 25.3, 21.9, width, height).unwrap();
    let mut numbers = Numbers(51);
    let (mut depth, mut mask) = (Vec::new(), Vec::new());
    for (u, v) in camera.region().pixels() {
        let z = 0.5 + 0.001 * f64::from(u) + 0.003 * f64::from(v);
        depth.push(if numbers.unit() < 0.1 { 0.0 } else { z as f32 });
        mask.push((4..50).contains(&u) && (7..45).contains(&v) && numbers.unit() < 0.9);
    }
    let depth = DepthImage::from_meters(width, height, depth).unwrap();
    let mask = Mask::new(width, height, mask).unwrap();
    Observation::new(depth, mask, camera).unwrap()
}

#[test]
fn a_coarse_observation_is_every_nth_pixel_of_the_fine_one() {
    let fine = fine();
    for factor in [1, 2, 3, 4, 7, 60] {
        let coarse = fine.decimated(factor);
        assert_eq!(*coarse.camera(), fine.camera().scaled_down(factor));
        let (width, height) = (coarse.depth().width(), coarse.depth().height());
        assert_eq!(
            (width, height),
            (53_u32.div_ceil(factor), 47_u32.div_ceil(factor))
        );
        assert_eq!(
            (coarse.mask().width(), coarse.mask().height()),
            (width, height)
        );
        let (mut n_measured, mut surfels) = (0, Vec::new());
        for (u, v) in coarse.camera().region().pixels() {
            let (x, y) = (u * factor, v * factor);
            let (z, masked) = (coarse.depth().get(u, v), coarse.mask().get(u, v));
            assert_eq!((z, masked), (fine.depth().get(x, y), fine.mask().get(x, y)));
            assert_eq!(coarse.surfel_at(u, v), fine.surfel_at(x, y));
            n_measured += usize::from(masked == Some(true) && z > Some(0.0));
            surfels.extend(coarse.surfel_at(u, v).map(|surfel| (u, v, surfel)));
        }
        assert_eq!(coarse.n_measured(), n_measured, "{factor}");
        assert_eq!(coarse.n_surfels(), surfels.len(), "{factor}");
        // Indices refer to the coarse image.
        let indexed: Vec<_> = coarse
            .surfels(1)
            .map(|(index, surfel)| {
                let (u, v) = coarse.pixel(index);
                (u, v, surfel)
            })
            .collect();
        assert_eq!(indexed, surfels);
    }
    assert!(fine.decimated(2).n_surfels() > 200);
}

#[test]
fn a_resolution_is_built_once_and_is_a_separate_observation() {
    let fine = fine();
    let (half, third) = (fine.decimated(2), fine.decimated(3));
    assert!(Arc::ptr_eq(&half, &fine.decimated(2)));
    assert!(!Arc::ptr_eq(&half, &third));
    assert!(half.id() != third.id() && half.id() != fine.id());
    // A factor of 0 counts as 1. The coarse observation does not share derived values.
    assert!(Arc::ptr_eq(&fine.decimated(0), &fine.decimated(1)));
    assert!(fine.decimated(1).surfels(1).eq(fine.surfels(1)));
    assert_eq!(*fine.derived().get_or_build(9, || 1_u8), 1);
    assert_eq!(*half.derived().get_or_build(9, || 2_u8), 2);
    assert_eq!(*fine.derived().get_or_build(9, || 3_u8), 1);
}
