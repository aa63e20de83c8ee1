//! Tests of the colors next to the residuals of the pairs.

use crate::scenes::{Numbers, at, center, messy};
use hicp_core::{
    ColorImage, Correspondences, DepthImage, Isometry3, Iteration, Mask, Model, Observation,
    PinholeCamera, Point3, Problem, SurfaceColor, TriMesh, Vector6, se3,
};
use hicp_metric::{Minimize, Photometric, PointToPlane, PointToPoint};

const SIZE: (u32, u32) = (128, 96);
const DEPTH: f64 = 0.6;
/// Patches along each side of the board.
const GRID: u32 = 40;

/// A smooth pattern on the plane, meters to gray levels, without a symmetry.
fn pattern(x: f64, y: f64) -> [f64; 3] {
    let wave = |a: f64, b: f64, phase: f64| 120.0 + 60.0 * (a * x + b * y + phase).sin();
    [
        wave(70.0, 20.0, 0.3),
        wave(-30.0, 90.0, 1.1),
        0.5 * (wave(50.0, 50.0, 0.0) + wave(110.0, -40.0, 2.0)),
    ]
}

#[allow(clippy::cast_sign_loss)] // Clamped.
fn bytes(color: [f64; 3]) -> [u8; 3] {
    color.map(|value| value.round().clamp(0.0, 255.0) as u8)
}

/// A board of 0.2 m with the pattern.
fn board() -> Model {
    let place = |i: u32| 0.2 * (f64::from(i) / f64::from(GRID) - 0.5);
    let places = (0..=GRID).flat_map(|j| (0..=GRID).map(move |i| (place(i), place(j))));
    let colors = places.clone().map(|(x, y)| bytes(pattern(x, y)));
    let vertices = places.map(|(x, y)| Point3::new(x as f32, y as f32, 0.0));
    let corner = |i, j| j * (GRID + 1) + i;
    let cells = (0..GRID).flat_map(|j| (0..GRID).map(move |i| (i, j)));
    let triangles = cells.flat_map(|(i, j)| {
        let [a, b] = [corner(i, j), corner(i + 1, j)];
        let [c, d] = [corner(i + 1, j + 1), corner(i, j + 1)];
        [[a, c, b], [a, d, c]]
    });
    let mesh = TriMesh::new(vertices.collect(), triangles.collect()).unwrap();
    let colors = SurfaceColor::Vertices(colors.collect());
    Model::new(mesh.with_color(colors).unwrap())
}

/// A wall that shows the pattern, with a change of its colors.
fn wall(change: impl Fn([f64; 3]) -> [f64; 3]) -> Observation {
    let (width, height) = SIZE;
    let camera = PinholeCamera::new(200.0, 200.0, 63.5, 47.5, width, height).unwrap();
    let pixels = (0..height).flat_map(|v| (0..width).map(move |u| (f64::from(u), f64::from(v))));
    let colors = pixels.map(|(u, v)| {
        let point = camera.unproject(u, v, DEPTH);
        bytes(change(pattern(point.x, point.y)))
    });
    let colors = ColorImage::new(width, height, colors.collect()).unwrap();
    let count = (width * height) as usize;
    let depth = DepthImage::from_meters(width, height, vec![DEPTH as f32; count]).unwrap();
    let observation = Observation::new(depth, Mask::full(width, height), camera).unwrap();
    observation.with_color(colors).unwrap()
}

fn truth() -> Isometry3<f64> {
    Isometry3::translation(0.0, 0.0, DEPTH)
}

fn pairs(pose: &Isometry3<f64>) -> Correspondences {
    at(pose, &messy(&mut Numbers(3), 60))
}

fn color_loss(problem: Problem<'_>, pose: &Isometry3<f64>) -> f64 {
    let (iteration, pairs) = (Iteration::new(0, pose, problem), pairs(pose));
    let both = Photometric::new(PointToPlane).mean_loss(&iteration, &pairs);
    both.unwrap() - PointToPlane.mean_loss(&iteration, &pairs).unwrap()
}

#[test]
fn the_gradient_is_that_of_the_loss() {
    let (model, observation) = (board(), wall(|color| color));
    let problem = Problem::new(&model, &observation);
    let mut numbers = Numbers(17);
    for degrees in [0.5, 2.0] {
        let pose = numbers.motion(&center(), degrees, 0.002) * truth();
        let (iteration, pairs) = (Iteration::new(0, &pose, problem), pairs(&pose));
        let with = Photometric::new(PointToPlane).system(&iteration, &pairs);
        let without = PointToPlane.system(&iteration, &pairs).unwrap();
        let weight: f64 = pairs.as_slice().iter().map(|p| f64::from(p.weight)).sum();
        let found = (with.unwrap().gradient() - without.gradient()) / weight;
        for axis in 0..6 {
            let moved = |step: f64| {
                let twist = Vector6::from_fn(|i, _| if i == axis { step } else { 0.0 });
                color_loss(problem, &(se3::exp(&twist) * pose))
            };
            let slope = 0.5 * (moved(1e-6) - moved(-1e-6)) / 2e-6;
            let error = (found[axis] - slope).abs();
            assert!(
                error < 1e-4 * found.norm(),
                "{axis}: {} {slope}",
                found[axis]
            );
        }
        assert!(found.norm() > 1e-6, "{found}");
    }
}

#[test]
fn the_variance_is_that_of_the_pairs() {
    let (model, observation) = (board(), wall(|color| color));
    let pose = truth() * Isometry3::translation(0.002, 0.001, 0.0);
    let iteration = Iteration::new(0, &pose, Problem::new(&model, &observation));
    let (pairs, mut metric) = (pairs(&pose), Photometric::new(PointToPlane));
    let plain = PointToPlane.system(&iteration, &pairs).unwrap();
    let plain = plain.covariance().unwrap();
    // With hardly any weight, the colors change nothing.
    metric.weight_diameters = 1e-9;
    let with = metric.system(&iteration, &pairs).unwrap();
    assert!(with.rows() > 1000);
    let change = (with.covariance().unwrap() - plain).amax() / plain.amax();
    assert!(change < 1e-6, "{change}");
    // With more, they reduce every variance.
    metric.weight_diameters = 0.01;
    let with = metric.system(&iteration, &pairs).unwrap();
    let (with, before) = (with.covariance().unwrap().diagonal(), plain.diagonal());
    assert!(with.iter().zip(&before).all(|(with, before)| with < before));
    // Six pairs do not show their noise, and thousands of colors do not either.
    let six = at(&pose, &messy(&mut Numbers(3), 6));
    let with = metric.system(&iteration, &six).unwrap();
    assert_eq!((with.covariance(), with.rows() > 1000), (None, true));
}

#[test]
fn the_loss_is_smallest_at_the_truth_and_bounded() {
    let (model, observation) = (board(), wall(|color| color));
    let problem = Problem::new(&model, &observation);
    let lambda = Photometric::new(PointToPlane).weight_diameters * model.diameter();
    let at_truth = color_loss(problem, &truth());
    assert!(at_truth < 0.02 * lambda * lambda, "{at_truth}");
    for shift in [0.002, 0.004, 0.008] {
        let moved = color_loss(
            problem,
            &(truth() * Isometry3::translation(shift, 0.0, 0.0)),
        );
        assert!(
            moved > 2.0 * at_truth && moved <= lambda * lambda,
            "{shift}: {moved}"
        );
    }
}

#[test]
fn gain_and_offset_of_a_channel_change_nothing() {
    let model = board();
    let pose = truth() * Isometry3::translation(0.003, -0.002, 0.0);
    let lambda = Photometric::new(PointToPlane).weight_diameters * model.diameter();
    let loss = |change: fn([f64; 3]) -> [f64; 3]| {
        let observation = wall(change);
        color_loss(Problem::new(&model, &observation), &pose) / (lambda * lambda)
    };
    let same = loss(|color| color);
    // Bytes are rounded.
    for changed in [
        loss(|[r, g, b]| [0.6 * r, 1.3 * g, 0.8 * b]),
        loss(|[r, g, b]| [r + 40.0, g - 30.0, 0.7 * b + 60.0]),
    ] {
        assert!((changed - same).abs() < 2e-3, "{changed} {same}");
    }
}

#[test]
fn colors_that_contradict_the_model_pull_nothing() {
    let (model, negative) = (board(), wall(|color| color.map(|value| 240.0 - value)));
    let iteration = Iteration::new(0, &truth(), Problem::new(&model, &negative));
    let pairs = pairs(&truth());
    let step = Photometric::new(PointToPlane).minimize(&iteration, &pairs);
    let plain = PointToPlane.minimize(&iteration, &pairs);
    let (step, plain) = (step.unwrap(), plain.unwrap());
    assert_eq!(step.increment, plain.increment);
    assert!(step.mean_loss > plain.mean_loss);
}

#[test]
fn without_evidence_it_is_the_inner_metric_bit_for_bit() {
    let model = board();
    let gray = SurfaceColor::Vertices(vec![[90, 100, 110]; model.mesh().vertices().len()]);
    let gray = Model::new(model.mesh().clone().with_color(gray).unwrap());
    let bare = (
        model.mesh().vertices().to_vec(),
        model.mesh().triangles().to_vec(),
    );
    let bare = Model::new(TriMesh::new(bare.0, bare.1).unwrap());
    let seen = wall(|color| color);
    let depth = seen.shared_depth().clone();
    let depth = Observation::new(depth, seen.mask().clone(), *seen.camera()).unwrap();
    let white = wall(|_| [255.0; 3]);
    let away = truth() * Isometry3::translation(3.0, 0.0, 0.0);
    let behind = truth().inverse();
    for (model, observation, pose) in [
        (&gray, &seen, truth()),
        (&bare, &seen, truth()),
        (&model, &depth, truth()),
        (&model, &white, truth()),
        (&model, &seen, away),
        (&model, &seen, behind),
    ] {
        let iteration = Iteration::new(0, &pose, Problem::new(model, observation));
        let pairs = pairs(&pose);
        let mut metric = Photometric::new(PointToPoint);
        assert_eq!(
            metric.minimize(&iteration, &pairs),
            PointToPoint.minimize(&iteration, &pairs)
        );
        assert_eq!(
            metric.system(&iteration, &pairs),
            PointToPoint.system(&iteration, &pairs)
        );
        // Inside of another decorator, too.
        for seed in 0..20 {
            let pairs = at(&pose, &messy(&mut Numbers(seed), 60));
            assert_eq!(
                Photometric::new(PointToPlane).system_and_loss(&iteration, &pairs),
                PointToPlane.system_and_loss(&iteration, &pairs)
            );
        }
    }
    // No weight is none, too.
    let iteration = Iteration::new(0, &truth(), Problem::new(&model, &seen));
    let (pairs, mut metric) = (pairs(&truth()), Photometric::new(PointToPoint));
    metric.weight_diameters = 0.0;
    assert_eq!(
        metric.minimize(&iteration, &pairs),
        PointToPoint.minimize(&iteration, &pairs)
    );
}
