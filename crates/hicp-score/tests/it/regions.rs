//! Tests of the MVE for renders that cover a part of the image, and of its ties, with given pixels.

use crate::support::Numbers;
use hicp_core::{
    Context, DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, PixelRegion, Point3,
    Problem, RenderCache, RenderedView, Renderer, TriMesh,
};
use hicp_score::{MeanVsd, Occlusion, Score, tolerances};

/// A renderer that always draws the same.
#[derive(Clone, Debug)]
struct Drawn {
    region: PixelRegion,
    depth: Vec<f32>,
}

impl Renderer for Drawn {
    fn render(
        &mut self,
        _: &TriMesh,
        _: &PinholeCamera,
        _: &Isometry3<f64>,
        _: &PixelRegion,
        view: &mut RenderedView,
    ) {
        view.reset(self.region);
        view.buffers_mut().0.copy_from_slice(&self.depth);
    }
}

/// Returns a triangle with two corners a meter apart, which is its diameter.
fn of_one_meter() -> Model {
    let corners = [(0.0, 0.0), (1.0, 0.0), (0.25, 0.25)];
    let corners = corners.map(|(x, y)| Point3::new(x, y, 0.0));
    let model = Model::new(TriMesh::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap());
    assert_eq!(model.diameter(), 1.0);
    model
}

fn mve(mut mean_vsd: MeanVsd, drawn: &Drawn, observation: &Observation) -> f64 {
    let model = of_one_meter();
    let mut renders = RenderCache::new(drawn.clone());
    let problem = Problem::new(&model, observation);
    mean_vsd.score(
        &mut Context::new(problem, &mut renders),
        &Isometry3::identity(),
    )
}

/// Computes §IV-A over all pixels of the image.
fn by_definition(mean_vsd: MeanVsd, drawn: &Drawn, observation: &Observation) -> f64 {
    let camera = observation.camera();
    let (mut differences, mut union) = (Vec::new(), 0);
    for v in 0..camera.height() {
        for u in 0..camera.width() {
            let z = drawn.region.index(u, v).map_or(0.0, |i| drawn.depth[i]);
            let measured = observation.depth().get(u, v).unwrap();
            let ratio = camera.distance_per_depth(f64::from(u), f64::from(v));
            let behind = (f64::from(z) - f64::from(measured)) * ratio;
            let (seen, known) = (z > 0.0, measured > 0.0);
            if observation.mask().get(u, v).unwrap() {
                union += usize::from(known);
                if seen && known {
                    differences.push(behind.abs());
                }
            } else {
                let hidden = match mean_vsd.occlusion {
                    Occlusion::Tolerated { meters } => behind > meters,
                    Occlusion::Lenient { meters } => behind > -meters,
                    _ => false,
                };
                union += usize::from(seen && !(known && hidden));
            }
        }
    }
    let error = |tolerance: f64| {
        let correct = differences.iter().filter(|d| **d < tolerance).count();
        match union {
            0 => 1.0,
            _ => (union - correct) as f64 / union as f64,
        }
    };
    tolerances().map(error).iter().sum::<f64>() / 10.0
}

/// Regions of every width up to some blocks of pixels, anywhere in an image whose width is prime.
///
/// The object is as large as it is far away, so that a missing depth (0) is within the tolerances.
#[test]
fn a_part_of_the_image_has_the_score_of_the_whole() {
    let (width, height) = (61, 23);
    let camera = PinholeCamera::new(70.0, 75.0, 29.7, 11.2, width, height).unwrap();
    let mut numbers = Numbers(821);
    let mut distinct = std::collections::BTreeSet::new();
    for n_columns in 1..=33 {
        for mean_vsd in [MeanVsd::paper(), MeanVsd::default(), MeanVsd::lenient()] {
            let mut depths = |count: u32, empty: f64| -> Vec<f32> {
                (0..count)
                    .map(|_| match numbers.unit() < empty {
                        true => 0.0,
                        false => numbers.between(0.05, 0.5) as f32,
                    })
                    .collect()
            };
            let observed = DepthImage::from_meters(width, height, depths(width * height, 0.2));
            let drawn = depths(7 * n_columns, 0.3);
            let (u_min, v_min) = (numbers.below(61 - n_columns as usize), numbers.below(16));
            let (u_min, v_min) = (u32::try_from(u_min).unwrap(), u32::try_from(v_min).unwrap());
            let drawn = Drawn {
                region: PixelRegion {
                    u_min,
                    v_min,
                    u_max: u_min + n_columns,
                    v_max: v_min + 7,
                },
                depth: drawn,
            };
            let mask = (0..width * height).map(|_| numbers.unit() < 0.1).collect();
            let mask = Mask::new(width, height, mask).unwrap();
            let observation = Observation::new(observed.unwrap(), mask, camera).unwrap();
            let found = mve(mean_vsd, &drawn, &observation);
            let expected = by_definition(mean_vsd, &drawn, &observation);
            // The same counts; a sum of ten quotients.
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
            distinct.insert(found.to_bits());
        }
    }
    assert!(distinct.len() > 90, "{}", distinct.len());
}

/// Two pixels, one at the principal point, where depths equal distances to the bit.
fn two_pixels(measured: [f32; 2], masked: [bool; 2]) -> Observation {
    let camera = PinholeCamera::new(70.0, 75.0, 0.0, 0.0, 2, 1).unwrap();
    Observation::new(
        DepthImage::from_meters(2, 1, measured.to_vec()).unwrap(),
        Mask::new(2, 1, masked.to_vec()).unwrap(),
        camera,
    )
    .unwrap()
}

fn drawn(depth: [f32; 2]) -> Drawn {
    Drawn {
        region: PixelRegion {
            u_min: 0,
            v_min: 0,
            u_max: 2,
            v_max: 1,
        },
        depth: depth.to_vec(),
    }
}

#[test]
fn pitfall_24_a_difference_of_exactly_tau_is_wrong_in_the_mve_too() {
    let observation = two_pixels([0.5, 0.0], [true, false]);
    // A quarter of the diameter is wrong at 5 % to 25 %, and right at the other five.
    let found = |z: f32| mve(MeanVsd::paper(), &drawn([z, 0.0]), &observation);
    assert_eq!((found(0.25), found(0.75)), (0.5, 0.5));
    assert!((found(0.25_f32.next_up()) - 0.4).abs() < 1e-15);
}

#[test]
fn an_occluder_at_exactly_the_tolerance_does_not_hide() {
    // The second pixel agrees. The first one is outside the mask, a quarter of a meter behind the
    // measured surface.
    let observation = two_pixels([0.25, 0.5], [false, true]);
    let found = |tolerance: f64| {
        let mean_vsd = MeanVsd {
            occlusion: Occlusion::Tolerated { meters: tolerance },
            ..MeanVsd::default()
        };
        mve(mean_vsd, &drawn([0.5, 0.5]), &observation)
    };
    assert_eq!(
        (found(0.25), found(f64::from(0.25_f32.next_down()))),
        (0.5, 0.0)
    );
}
