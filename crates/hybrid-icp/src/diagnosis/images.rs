//! Hypotheses about the depth image, the mask and their alignment.

use super::fault::Fault;
use super::inputs::{Corrected, Inputs, decimal, nearest};

/// Smallest difference between distance and depth that exceeds the errors of poses, meters.
const LEAST_RAY_SHIFT: f64 = 0.01;
/// Largest shift between depth and mask, as a part of the width.
const MAX_SHIFT: i64 = 10;
/// Smallest shift that is a fault, pixels.
const MIN_SHIFT: i64 = 4;

pub(super) fn ray_distance<'a>(inputs: &Inputs<'a>) -> Option<Corrected<'a>> {
    let ratio = |u: u32, v: u32| inputs.camera.distance_per_depth(u.into(), v.into());
    let changed = inputs.with_depth(|u, v, z| z / ratio(u, v));
    let middle = |inputs: &Inputs<'_>| inputs.median(|_, measured| measured);
    let shift = middle(inputs)? - middle(&changed)?;
    (shift > LEAST_RAY_SHIFT).then_some((Fault::RayDistance, changed))
}

pub(super) fn mirrored<'a>(inputs: &Inputs<'a>) -> Vec<Corrected<'a>> {
    let last = [inputs.depth.width(), inputs.depth.height()].map(|side| i64::from(side) - 1);
    let mirrored = |(horizontally, vertically)| {
        let from = |u, v| {
            (
                if horizontally { last[0] - u } else { u },
                if vertically { last[1] - v } else { v },
            )
        };
        let fault = Fault::Mirrored {
            horizontally,
            vertically,
        };
        (fault, inputs.with_depth_from(from).with_mask_from(from))
    };
    [(true, false), (false, true), (true, true)]
        .map(mirrored)
        .into()
}

/// Near surfaces have large values: a constant minus the depth, or divided by the depth.
///
/// Within a small object, the two are nearly the same. A power of ten decides for the division.
pub(super) fn depth_reversed<'a>(inputs: &Inputs<'a>) -> Vec<Corrected<'a>> {
    let sum = inputs.median(|rendered, measured| rendered + measured);
    let product = inputs.median(|rendered, measured| rendered * measured);
    let (Some(sum), Some(product)) = (sum, product) else {
        return Vec::new();
    };
    let unit = nearest(product, decimal(&[1.0]), 0.03);
    let product = unit.unwrap_or(product);
    let divided = inputs.with_depth(|_, _, value| product / value);
    let mut found = vec![(Fault::Disparity { product }, divided)];
    // The constant is near the largest values.
    let values = inputs.depth.pixels().iter().copied();
    let mut values: Vec<f32> = values.filter(|z| *z > 0.0).collect();
    let last = values.len() * 99 / 100;
    let (_, most, _) = values.select_nth_unstable_by(last, f32::total_cmp);
    if unit.is_none() && (0.4..1.2).contains(&(f64::from(*most) / sum)) {
        // Missing depth became the constant itself, which the subtraction makes missing again.
        let depth = |_, _, z| {
            if z > 0.0 && z < 0.95 * sum {
                sum - z
            } else {
                0.0
            }
        };
        found.push((Fault::DepthInverted, inputs.with_depth(depth)));
    }
    found
}

/// Shifts the depth to the model at the initial pose.
pub(super) fn depth_shifted<'a>(inputs: &Inputs<'a>) -> Option<Corrected<'a>> {
    let rendered = inputs.rendered();
    let width = i64::from(rendered.width());
    let pixels = (0_i64..).zip(rendered.pixels().iter().zip(inputs.mask.pixels()));
    let pixels = pixels.filter(|(_, (z, set))| **z > 0.0 && **set);
    let pixels: Vec<_> = pixels
        .map(|(i, (z, _))| (i % width, i / width, *z))
        .collect();
    let step = (pixels.len() / 256).max(1);
    #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
    let most = (0.25 * inputs.model.diameter()) as f32;
    let cost = |(right, down): &(i64, i64)| -> f32 {
        let gap = |(u, v, z): &(i64, i64, f32)| {
            let measured = inputs.depth_at(u + right, v + down);
            measured.map_or(most, |measured| (measured - z).abs().min(most))
        };
        pixels.iter().step_by(step).map(gap).sum()
    };
    let best = |(u, v): (i64, i64), reach: i64, step: usize| {
        let line = move || (-reach..=reach).step_by(step);
        let all = line().flat_map(move |x| line().map(move |y| (u + x, v + y)));
        all.min_by(|a, b| cost(a).total_cmp(&cost(b)))
            .unwrap_or((u, v))
    };
    let (right, down) = best(best((0, 0), width / MAX_SHIFT, 6), 6, 1);
    shifted(right, down, || {
        inputs.with_depth_from(|u, v| (u + right, v + down))
    })
}

/// Shifts the mask to the pixels at which the model at the initial pose agrees with the depth.
pub(super) fn mask_shifted<'a>(inputs: &Inputs<'a>) -> Option<Corrected<'a>> {
    let rendered = inputs.rendered();
    let (width, near) = (rendered.width() as usize, 0.2 * inputs.model.diameter());
    let center = |holds: &dyn Fn(usize) -> bool| {
        let (mut count, mut sum) = (0.0, [0.0, 0.0]);
        for pixel in (0..rendered.pixels().len()).filter(|i| holds(*i)) {
            count += 1.0;
            sum = [
                sum[0] + (pixel % width) as f64,
                sum[1] + (pixel / width) as f64,
            ];
        }
        (count > 0.0).then(|| sum.map(|sum| sum / count))
    };
    let agrees = |i: usize| {
        let (z, measured) = (rendered.pixels()[i], inputs.depth.pixels()[i]);
        z > 0.0 && measured > 0.0 && f64::from(z - measured).abs() < near
    };
    let (seen, masked) = (center(&agrees)?, center(&|i| inputs.mask.pixels()[i])?);
    #[allow(clippy::cast_possible_truncation)] // Within the image.
    let [right, down] = [0, 1].map(|axis| (seen[axis] - masked[axis]).round() as i64);
    shifted(right, down, || {
        inputs.with_mask_from(|u, v| (u - right, v - down))
    })
}

fn shifted<'a>(right: i64, down: i64, of: impl Fn() -> Inputs<'a>) -> Option<Corrected<'a>> {
    let fault = Fault::Misaligned { right, down };
    (right.abs().max(down.abs()) >= MIN_SHIFT).then(|| (fault, of()))
}

/// An object rarely fills most of the image, so an inverted mask is large.
pub(super) fn mask_inverted<'a>(inputs: &Inputs<'a>) -> Option<Corrected<'a>> {
    let is_large = 3 * inputs.n_masked() > inputs.mask.pixels().len();
    is_large.then(|| (Fault::MaskInverted, inputs.with_mask(|_, _, set| !set)))
}

/// Keeps the part of the mask that the model explains at the initial pose.
pub(super) fn mask_too_large<'a>(inputs: &Inputs<'a>) -> Option<Corrected<'a>> {
    let center = inputs.init * inputs.model.center();
    let radius = 1.1 * inputs.model.radius();
    let in_sphere = inputs.with_mask(|u, v, set| {
        let ray = |z: f64| inputs.camera.unproject(u.into(), v.into(), z);
        // Without a measurement, the viewing ray must meet the sphere.
        let point = match inputs.depth_at(u.into(), v.into()) {
            Some(z) => ray(z.into()),
            None => ray(center.coords.dot(&ray(1.0).coords) / ray(1.0).coords.norm_squared()),
        };
        set && (point - center).norm() < radius
    });
    let rendered = inputs.rendered();
    let near = 0.25 * inputs.model.diameter();
    let explained = inputs.with_mask(|u, v, set| {
        let measured = inputs.depth_at(u.into(), v.into());
        let gap = |z: f32| measured.map_or(0.0, |measured| f64::from(measured - z).abs());
        let z = rendered.get(u, v).filter(|z| *z > 0.0);
        set && z.is_some_and(|z| gap(z) < near)
    });
    let lost = |after: &Inputs<'_>| 1.0 - after.n_masked() as f64 / inputs.n_masked().max(1) as f64;
    let (outside, share) = (lost(&in_sphere), lost(&explained));
    let fault = match outside > 0.2 {
        true => Fault::MaskTooLarge { outside },
        false => Fault::PlaneInMask { share },
    };
    (outside > 0.2 || share > 0.15).then_some((fault, explained))
}
