//! Whole refinements of scenes made from arbitrary bytes.
//!
//! The bytes define a small mesh, camera, depth image, mask, pose and pipeline.

use hybrid_icp::core::internal::pose_bits;
use hybrid_icp::core::{
    DepthImage, Isometry3, Mask, Model, ModelConfig, Observation, PinholeCamera, Point3,
    Symmetries, SymmetryAxis, TriMesh, Vector3, se3,
};
use hybrid_icp::icp::Verdict;
use hybrid_icp::pipeline::{PipelineFile, PipelineLimits};
use hybrid_icp::{Preset, Refinement, Refiner};

use super::bytes::Bytes;
use super::parts;
use crate::render;

/// Refines a scene twice and checks the outcome.
///
/// Nothing may panic. The pose is finite, or has the bits of the initial pose. Scores are from 0 to
/// 1, and both runs return the same bits.
pub(super) fn refine(data: &[u8]) {
    let mut bytes = Bytes::new(data);
    let Some(mut refiner) = refiner(&mut bytes) else {
        return;
    };
    let Some((model, observation, init)) = scene(&mut bytes) else {
        return;
    };
    let first = refiner.refine(&model, &observation, &init);
    check_outcome(&first, &init);
    let again = refiner.refine(&model, &observation, &init);
    assert_eq!(bits(&first), bits(&again), "{first:?} {again:?}");
}

fn check_outcome(refined: &Refinement, init: &Isometry3<f64>) {
    let pose = refined.outcome.camera_from_object;
    let kept = pose_bits(&pose) == pose_bits(init);
    assert!(kept || se3::is_finite(&pose), "{refined:?}");
    assert!((0.0..=1.0).contains(&refined.mve), "{refined:?}");
    assert!((0.0..=1.0).contains(&refined.mve_initial), "{refined:?}");
    if let Verdict::KeptInitial(_) = refined.outcome.verdict {
        assert!(
            kept,
            "a kept pose must have the same bits: {refined:?} from {init:?}"
        );
    }
}

fn bits(refined: &Refinement) -> ([u64; 7], u64, u64) {
    (
        pose_bits(&refined.outcome.camera_from_object),
        refined.mve.to_bits(),
        refined.mve_initial.to_bits(),
    )
}

/// Limits on the work, so that a fuzzer can run many inputs.
const LIMITS: PipelineLimits = PipelineLimits {
    max_iterations: 2000,
    max_hypotheses: 500,
    max_samples: 20_000,
    max_neighbors: 100,
};

fn refiner(bytes: &mut Bytes<'_>) -> Option<Refiner> {
    if !bytes.one_in(2) {
        return Some(Refiner::preset(bytes.pick(&Preset::ALL)));
    }
    let text = parts::pipeline(bytes);
    let file = PipelineFile::parse(&text, "a.toml").unwrap_or_else(|e| panic!("{e}: {text}"));
    file.build_within(&LIMITS).ok().map(Refiner::boxed)
}

fn scene(bytes: &mut Bytes<'_>) -> Option<(Model, Observation, Isometry3<f64>)> {
    let camera = camera(bytes)?;
    let model = model(bytes)?;
    let truth = pose(bytes, &Isometry3::translation(0.0, 0.0, 0.6), 0.2, 3.0);
    let depth = depth(bytes, &camera, &model, &truth)?;
    let mask = mask(bytes, &depth)?;
    let init = pose(bytes, &truth, 0.02, 0.2);
    let observation = Observation::new(depth, mask, camera).ok()?;
    Some((model, observation, init))
}

fn camera(bytes: &mut Bytes<'_>) -> Option<PinholeCamera> {
    let (width, height) = (16 + bytes.below(24) as u32, 16 + bytes.below(24) as u32);
    let mut numbers = [
        20.0 + f64::from(bytes.byte()),
        20.0 + f64::from(bytes.byte()),
        f64::from(width) / 2.0,
        f64::from(height) / 2.0,
    ];
    if bytes.one_in(8) {
        let which = bytes.below(4);
        numbers[which] = bytes.any_number();
    }
    let [fx, fy, cx, cy] = numbers;
    PinholeCamera::new(fx, fy, cx, cy, width, height).ok()
}

fn model(bytes: &mut Bytes<'_>) -> Option<Model> {
    const SCALES: [f64; 10] = [0.2, 0.1, 0.05, 1.0, 1e3, 1e-6, 1e-20, 1e-40, 1e15, 1e30];
    let scale = bytes.pick(&SCALES);
    let raw = bytes.one_in(8);
    let n_vertices = 3 + bytes.below(12);
    let vertices = (0..n_vertices)
        .map(|_| {
            if raw {
                Point3::from([0; 3].map(|_| f32::from_le_bytes(bytes.array())))
            } else {
                let corner = bytes.array::<3>();
                Point3::from(corner.map(|c| (f64::from(c as i8) / 128.0 * scale) as f32))
            }
        })
        .collect();
    let triangles = (0..=bytes.below(20))
        .map(|_| [0; 3].map(|_| bytes.below(n_vertices) as u32))
        .collect();
    let mesh = TriMesh::new(vertices, triangles).ok()?;
    let config = ModelConfig {
        samples: bytes.below(250),
        diameter: bytes.one_in(8).then(|| bytes.any_number()),
        symmetries: symmetries(bytes),
        ..ModelConfig::default()
    };
    Some(Model::with_config(mesh, config))
}

fn symmetries(bytes: &mut Bytes<'_>) -> Symmetries {
    let mut symmetries = Symmetries::default();
    if bytes.one_in(8) {
        let direction = Vector3::from([0; 3].map(|_| bytes.signed()));
        symmetries
            .continuous
            .extend(SymmetryAxis::new(direction, Point3::origin()).ok());
        symmetries
            .discrete
            .push(pose(bytes, &Isometry3::identity(), 0.1, 3.0));
    }
    symmetries
}

/// Returns a pose near another, or one with an arbitrary number.
fn pose(bytes: &mut Bytes<'_>, near: &Isometry3<f64>, meters: f64, radians: f64) -> Isometry3<f64> {
    let mut translation = Vector3::from([0; 3].map(|_| bytes.signed() * meters));
    let rotation = Vector3::from([0; 3].map(|_| bytes.signed() * radians));
    if bytes.one_in(8) {
        let axis = bytes.below(3);
        translation[axis] = bytes.any_number();
    }
    let turn = Isometry3::rotation(rotation);
    Isometry3::from_parts(
        (near.translation.vector + translation).into(),
        near.rotation * turn.rotation,
    )
}

fn depth(
    bytes: &mut Bytes<'_>,
    camera: &PinholeCamera,
    model: &Model,
    truth: &Isometry3<f64>,
) -> Option<DepthImage> {
    let n = (camera.width() * camera.height()) as usize;
    let meters = match bytes.below(4) {
        // The rendered depth, with or without noise on every third pixel.
        0 | 1 => {
            let (seen, _) = render(model, camera, truth);
            let noise = bytes.one_in(2);
            let seen = seen.pixels().iter().enumerate();
            seen.map(|(i, z)| {
                if noise && i % 3 == 0 {
                    z * (1.0 + 0.01 * bytes.signed() as f32)
                } else {
                    *z
                }
            })
            .collect()
        }
        2 => {
            let [start, right, down] = [0; 3].map(|_| bytes.signed() as f32);
            (0..n)
                .map(|i| {
                    let (u, v) = (i as u32 % camera.width(), i as u32 / camera.width());
                    0.7 + 0.3 * start + 0.01 * (right * u as f32 + down * v as f32)
                })
                .collect()
        }
        _ => (0..n).map(|_| f32::from_le_bytes(bytes.array())).collect(),
    };
    DepthImage::from_meters(camera.width(), camera.height(), meters).ok()
}

fn mask(bytes: &mut Bytes<'_>, depth: &DepthImage) -> Option<Mask> {
    let (width, height) = (depth.width(), depth.height());
    let pixels = match bytes.below(3) {
        0 => return Some(Mask::measured(depth)),
        1 => return Some(Mask::full(width, height)),
        _ => {
            let pattern = bytes.array::<16>();
            (0..(width * height) as usize)
                .map(|i| pattern[i / 8 % 16] & 1 << (i % 8) != 0)
                .collect()
        }
    };
    Mask::new(width, height, pixels).ok()
}
