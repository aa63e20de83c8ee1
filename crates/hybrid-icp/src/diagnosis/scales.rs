//! Hypotheses about units, scales and resolutions.

use std::borrow::Cow;

use hicp_core::{Model, ModelConfig, PinholeCamera, TriMesh};

use super::fault::Fault;
use super::inputs::{Corrected, Inputs, decimal, median, nearest};

/// Factors between decimal units of meshes.
pub(super) const DECIMAL: [f64; 6] = [1e-3, 1e-2, 0.1, 10.0, 100.0, 1000.0];
/// Inches in millimeters, centimeters and meters.
const INCHES: [f64; 3] = [25.4, 2.54, 0.0254];
/// Widths and heights of images.
#[rustfmt::skip]
const SIZES: [[f64; 2]; 24] = [
    [320., 240.], [424., 240.], [480., 270.], [512., 424.], [640., 360.], [640., 400.],
    [640., 480.], [640., 512.], [640., 576.], [720., 540.], [800., 600.], [848., 480.],
    [960., 540.], [1024., 768.], [1024., 1024.], [1280., 720.], [1280., 800.], [1280., 960.],
    [1280., 1024.], [1440., 1080.], [1600., 1200.], [1920., 1080.], [2048., 1536.], [3840., 2160.],
];
/// Factors between images of the same shape.
#[rustfmt::skip]
const FACTORS: [f64; 10] = [
    0.25, 1.0 / 3.0, 0.5, 2.0 / 3.0, 0.75, 4.0 / 3.0, 1.5, 2.0, 3.0, 4.0,
];
/// Factors of focal lengths and sizes: powers of a number, from a half to two.
const STEP: f64 = 1.05;
const STEPS: i32 = 14;
/// Mantissas of usual depth scales.
const MANTISSAS: [f64; 6] = [1.0, 2.0, 2.5, 4.0, 5.0, 8.0];

pub(super) fn mesh_scale<'a>(inputs: &Inputs<'a>) -> Vec<Corrected<'a>> {
    let model = &inputs.model;
    let angle = (inputs.n_masked() as f64).sqrt() / inputs.camera.fx();
    // The camera is outside of the bounding sphere, and the mask fits the diameter.
    let plausible = |factor: &f64| {
        let z = (inputs.init * (model.center() * *factor)).z;
        let seen = angle * z / (factor * model.diameter());
        z > factor * model.radius() && (0.04..1.2).contains(&seen)
    };
    let factors = DECIMAL.into_iter().chain(INCHES).filter(plausible);
    factors
        .filter_map(|factor| with_mesh(inputs, factor))
        .collect()
}

/// Returns the inputs with the mesh times a factor.
fn with_mesh<'a>(inputs: &Inputs<'a>, factor: f64) -> Option<Corrected<'a>> {
    let model = &inputs.model;
    let vertices = model.mesh().vertices().iter();
    #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
    let vertices = vertices.map(|p| (p.cast::<f64>() * factor).cast::<f32>());
    let mesh = TriMesh::new(vertices.collect(), model.mesh().triangles().to_vec()).ok()?;
    let config = ModelConfig {
        samples: model.samples().len(),
        diameter: Some(model.diameter() * factor),
        ..ModelConfig::default()
    };
    let inputs = Inputs {
        model: Cow::Owned(Model::with_config(mesh, config)),
        ..inputs.clone()
    };
    Some((Fault::MeshScale { factor }, inputs))
}

/// With the right size, the model covers the mask best.
pub(super) fn mesh_size<'a>(inputs: &Inputs<'a>) -> Option<Corrected<'a>> {
    // The silhouette of a larger object is that of a nearer one.
    let overlap = |factor: f64| Some(inputs.with_scaled_translation(1.0 / factor).overlap());
    with_mesh(inputs, best_factor(overlap)?)
}

/// Returns the factor with the best score, if it is not 1 or nearly so.
fn best_factor(score: impl Fn(f64) -> Option<f64>) -> Option<f64> {
    let factors = (-STEPS..=STEPS).map(|step| STEP.powi(step));
    let scored = factors.filter_map(|factor| Some((score(factor)?, factor)));
    let (_, best) = scored.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.ln().abs() > 1.5 * STEP.ln()).then_some(best)
}

pub(super) fn depth_scale<'a>(inputs: &Inputs<'a>) -> Option<Corrected<'a>> {
    let ratio = inputs.median(|rendered, measured| rendered / measured)?;
    let factor = nearest(ratio, decimal(&MANTISSAS), 0.1)?;
    let scaled = || inputs.with_depth(|_, _, z| factor * z);
    (!(0.6..1.6).contains(&factor)).then(|| (Fault::DepthScale { factor }, scaled()))
}

pub(super) fn translation_scale<'a>(inputs: &Inputs<'a>) -> Option<Corrected<'a>> {
    let pixels = inputs.depth.pixels().iter().zip(inputs.mask.pixels());
    let depths = pixels.filter(|(z, set)| **set && **z > 0.0);
    let ratio = median(depths.map(|(z, _)| f64::from(*z)))? / inputs.init.translation.z;
    let factor = nearest(ratio, decimal(&[1.0]), 0.8)?;
    let scaled = || inputs.with_scaled_translation(factor);
    (factor != 1.0).then(|| (Fault::TranslationScale { factor }, scaled()))
}

/// With the right focal lengths, the model covers the mask best.
pub(super) fn focal_length<'a>(inputs: &Inputs<'a>) -> Option<Corrected<'a>> {
    let old = inputs.camera;
    let scaled = |factor: f64| {
        let (fx, fy) = (old.fx() * factor, old.fy() * factor);
        let size = (old.width(), old.height());
        let camera = PinholeCamera::new(fx, fy, old.cx(), old.cy(), size.0, size.1).ok()?;
        Some(Inputs {
            camera,
            ..inputs.clone()
        })
    };
    let factor = best_factor(|factor| Some(scaled(factor)?.overlap()))?;
    Some((Fault::FocalLength { factor }, scaled(factor)?))
}

/// The principal point is near the middle of the image that the intrinsics belong to.
///
/// The images of another resolution are scaled by axis, or cropped on two sides. The numbers of
/// this image may be in another order.
pub(super) fn intrinsics<'a>(inputs: &Inputs<'a>) -> Vec<Corrected<'a>> {
    let old = inputs.camera;
    let (width, height) = (f64::from(old.width()), f64::from(old.height()));
    let [fx, fy, cx, cy] = [old.fx(), old.fy(), old.cx(), old.cy()];
    let centered = |cx: f64, cy: f64, [w, h]: [f64; 2]| {
        let off = |center: f64, side: f64| (2.0 * center / side - 1.0).abs();
        off(cx, w).max(off(cy, h)) < 0.12
    };
    let same_shape = FACTORS.map(|factor| [width / factor, height / factor]);
    let sizes = SIZES.into_iter().filter(|[w, h]| w * height != h * width);
    let sizes = same_shape.into_iter().chain(sizes);
    let sizes = sizes.filter(|size| centered(cx, cy, *size));
    let corrected = sizes.flat_map(|[w, h]| {
        let (x, y) = (width / w, height / h);
        let scaled = [fx * x, fy * y, cx * x, cy * y];
        let s = x.max(y);
        let (right, down) = (cx - w / 2.0, cy - h / 2.0);
        let cropped = [
            fx * s,
            fy * s,
            right * s + width / 2.0,
            down * s + height / 2.0,
        ];
        std::iter::once(scaled).chain((x != y).then_some(cropped))
    });
    let numbers = [fx, fy, cx, cy];
    let pairs = (0..4).flat_map(|i| (0..4).map(move |j| [i, j]));
    let centers = pairs.filter(|[i, j]| i != j && [*i, *j] != [2, 3]);
    let orders = centers.filter_map(|center| {
        let [cx, cy] = center.map(|i: usize| numbers[i]);
        let mut others = (0..4).filter(|i| !center.contains(i)).map(|i| numbers[i]);
        let (fx, fy) = (others.next()?, others.next()?);
        let is_square = (0.8..1.25).contains(&(fx / fy));
        (is_square && centered(cx, cy, [width, height])).then_some([fx, fy, cx, cy])
    });
    let found = corrected.chain(orders).filter_map(|[fx, fy, cx, cy]| {
        let camera = PinholeCamera::new(fx, fy, cx, cy, old.width(), old.height()).ok()?;
        let inputs = Inputs {
            camera,
            ..inputs.clone()
        };
        Some((Fault::Intrinsics { fx, fy, cx, cy }, inputs))
    });
    found.collect()
}
