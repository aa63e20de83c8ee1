//! Tests of damping against its closed form.

use std::collections::VecDeque;

use crate::scenes::{AtStart, center};
use hicp_core::Iteration;
use hicp_core::{Correspondences, Isometry3, Matrix6, Point3, Vector3, Vector6, so3};
use hicp_metric::Minimize;
use hicp_metric::{Degeneracy, LevenbergMarquardt, NormalEquations};

/// L of the systems here.
const LENGTH: f64 = 0.1;
/// The residual of the rows that rotate around z.
const RESIDUAL: f64 = 1e-3;

/// A system in which no row acts on two unknowns, after the terms of each pair of rows have
/// canceled.
///
/// It has a row of weight `strong` for each translation, and two for each rotation around x and y,
/// all with residual zero. It has two of weight `weak` for the rotation around z, which demand
/// −`RESIDUAL`/`LENGTH`.
fn system(strong: f64, weak: f64) -> NormalEquations {
    let mut system = NormalEquations::new(center(), LENGTH);
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    for axis in 0..3 {
        system.add_row(&center(), &axes[axis], 0.0, strong);
        let (lever, direction) = (axes[(axis + 1) % 3] * LENGTH, axes[(axis + 2) % 3]);
        let (residual, weight) = [(0.0, strong), (RESIDUAL, weak)][usize::from(axis == 2)];
        system.add_row(&(center() + lever), &direction, residual, weight);
        system.add_row(&(center() - lever), &-direction, residual, weight);
    }
    system
}

/// The trace of JᵀWJ in scaled unknowns.
///
/// There are 3 translations, and pairs of rows that act on a translation and a rotation.
fn trace(strong: f64, weak: f64) -> f64 {
    3.0 * strong + 4.0 * (strong + strong + weak)
}

/// Returns the rotation around z and checks that nothing else moves.
fn turn(increment: &Isometry3<f64>) -> f64 {
    let shift = (increment * center() - center()).norm();
    let turn = so3::log(&increment.rotation);
    assert!(shift < 1e-12 && turn.xy().norm() < 1e-12, "{shift} {turn}");
    turn.z
}

/// Adds a prior of the pivot's displacement along x, a million times as stiff as the rows and
/// already satisfied.
fn pin(system: &mut NormalEquations) {
    let row = Vector3::x();
    let lever = center().coords.cross(&row);
    let mut jacobian = Matrix6::zeros();
    jacobian.set_row(
        0,
        &Vector6::new(row.x, row.y, row.z, lever.x, lever.y, lever.z).transpose(),
    );
    let mut information = Matrix6::zeros();
    information[(0, 0)] = 1e6;
    system.add_twist(&Vector6::zeros(), &jacobian, &information);
}

/// A direction with a millionth of the mean diagonal of the rows goes half of its way.
///
/// It does so for every way of assembling the rows and every prior of other directions.
#[test]
fn tikhonovs_damping_is_a_millionth_of_the_mean_diagonal_of_the_rows() {
    // 2 w = 10⁻⁶ (11 + 4 w)/6
    let weak = 11e-6 / (12.0 - 4e-6);
    assert!((2.0 * weak - 1e-6 * trace(1.0, weak) / 6.0).abs() < 1e-18);
    let part = |share: f64| system(share, weak * share);
    let pinned = |share: f64| {
        let mut system = part(share);
        pin(&mut system);
        system
    };
    let merged = |mut system: NormalEquations, other: NormalEquations, factor: f64| {
        system.merge(&other, factor);
        system
    };
    let sums = [
        ("whole", part(1.0)),
        ("scaled", part(4.0).scaled(0.25)),
        ("merged", merged(part(0.25), part(0.25), 3.0)),
        ("pinned", pinned(1.0)),
        ("pinned and scaled", pinned(4.0).scaled(0.25)),
        ("pinned and merged", merged(pinned(0.25), part(0.25), 3.0)),
        ("merged with pinned", merged(part(0.25), pinned(0.25), 3.0)),
        ("both pinned", merged(pinned(0.25), pinned(0.25), 3.0)),
    ];
    for (name, system) in sums {
        let found = turn(&system.solve().unwrap());
        let expected = -0.5 * RESIDUAL / LENGTH;
        assert!((found / expected - 1.0).abs() < 1e-9, "{name}: {found}");
    }
}

/// If the rows have no information, the damping is relative to that of the prior.
#[test]
fn a_prior_alone_determines_a_step() {
    let wanted = Vector6::new(1e-4, -2e-4, 3e-4, 4e-4, -5e-4, 6e-4);
    let mut system = NormalEquations::new(center(), LENGTH);
    system.add_twist(&-wanted, &Matrix6::identity(), &Matrix6::identity());
    let found = hicp_core::se3::log(&system.solve().unwrap());
    // Shortened by 10⁻⁶ of the mean over the smallest eigenvalue: rotations of a camera 0.6 m away
    // against translations.
    assert!((found - wanted).norm() < 1e-2 * wanted.norm(), "{found}");
}

/// An infinite stiffness must not become a divisor.
#[test]
fn infinite_stiffness_determines_none() {
    let mut system = NormalEquations::new(Point3::origin(), 1.0);
    system.merge(&self::system(1.0, 1.0), 1.0);
    assert!(system.solve().is_some());
    // Each entry is finite, but their sum is not.
    let mut information = Matrix6::zeros();
    information[(0, 0)] = f64::MAX;
    information[(1, 1)] = f64::MAX;
    system.add_twist(&Vector6::zeros(), &Matrix6::identity(), &information);
    for policy in [Degeneracy::Damp, Degeneracy::Freeze, Degeneracy::Ignore] {
        assert_eq!(system.with_policy(policy, 1e-3).solve(), None, "{policy:?}");
    }
}

/// A metric with one system and scripted losses, which records the poses at which they are
/// requested.
struct Scripted {
    system: NormalEquations,
    /// The losses in the order of the requests; the last one repeats.
    losses: VecDeque<f64>,
    asked: Vec<Isometry3<f64>>,
}

impl Minimize for Scripted {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        None
    }

    fn mean_loss(&mut self, _: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        self.asked.push(*pairs.camera_from_object());
        if self.losses.len() > 1 {
            self.losses.pop_front()
        } else {
            self.losses.front().copied()
        }
    }

    fn system(&mut self, _: &Iteration<'_>, _: &Correspondences) -> Option<NormalEquations> {
        Some(self.system)
    }

    fn label(&self) -> &'static str {
        "scripted"
    }
}

fn solver(system: NormalEquations, losses: &[f64]) -> LevenbergMarquardt<Scripted> {
    let mut solver = LevenbergMarquardt::new(Scripted {
        system,
        losses: losses.iter().copied().collect(),
        asked: Vec::new(),
    });
    solver.initial_damping = 1.0;
    solver.max_iterations = 100;
    solver.tolerance = 0.0;
    solver
}

/// Returns the rotations of the trial steps, relative to the full step.
fn tried(solver: &LevenbergMarquardt<Scripted>) -> Vec<f64> {
    let turns = solver.metric.asked[1..].iter().map(turn);
    turns.map(|turn| turn / (-RESIDUAL / LENGTH)).collect()
}

/// (JᵀWJ + λ D) y = −JᵀWr, where D is the diagonal of JᵀWJ with a floor.
///
/// The floor is a millionth of the mean.
#[test]
fn marquardts_damping_is_relative_to_the_diagonal_with_a_floor() {
    for (weak, lambda) in [(1.0, 0.5), (1.0, 3.0), (1e-9, 3e-4), (1e-9, 0.5)] {
        let system = system(1.0, weak);
        let mean = trace(1.0, weak) / 6.0;
        let h = 2.0 * weak;
        for (policy, tikhonov) in [(Degeneracy::Ignore, 0.0), (Degeneracy::Damp, 1e-6 * mean)] {
            let mut once = solver(system.with_policy(policy, 0.0), &[2.0, 1.0]);
            once.initial_damping = lambda;
            once.max_iterations = 1;
            let increment = once.step(&Correspondences::new()).unwrap().increment;
            let expected = h / (h + lambda * h.max(1e-6 * mean) + tikhonov);
            let found = turn(&increment) / (-RESIDUAL / LENGTH);
            assert!(
                (found / expected - 1.0).abs() < 1e-9,
                "{policy:?} {weak} {lambda}: {found} {expected}"
            );
        }
        // With eigenvectors, it is relative to each eigenvalue.
        let mut once = solver(system.with_policy(Degeneracy::Freeze, 0.0), &[2.0, 1.0]);
        once.initial_damping = lambda;
        once.max_iterations = 1;
        let increment = once.step(&Correspondences::new()).unwrap().increment;
        let found = turn(&increment) / (-RESIDUAL / LENGTH);
        assert!((found * (1.0 + lambda) - 1.0).abs() < 1e-9, "{found}");
    }
}

/// Divided by ten if the loss falls, otherwise multiplied by ten. A step that keeps the loss does
/// not lower it.
#[test]
fn the_damping_follows_the_loss() {
    let system = system(1.0, 1.0).with_policy(Degeneracy::Ignore, 0.0);
    let mut solver = solver(system, &[10.0, 9.0, 9.5, 9.0, 8.0, 7.0, 7.0]);
    solver.max_iterations = 6;
    let step = solver.step(&Correspondences::new()).unwrap();
    let way = |lambda: f64| 1.0 / (1.0 + lambda);
    let accepted = way(1.0) + way(10.0);
    let expected = [
        way(1.0),
        way(1.0) + way(0.1),
        way(1.0) + way(1.0),
        accepted,
        accepted + way(1.0),
        accepted + way(1.0) + way(0.1),
    ];
    let found = tried(&solver);
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
    assert_eq!(step.mean_loss, 10.0);
    let kept = turn(&step.increment) / (-RESIDUAL / LENGTH);
    assert!((kept - expected[4]).abs() < 1e-9, "{kept}");
}

#[test]
fn iterations_end_if_no_step_is_left() {
    let pairs = Correspondences::new();
    let whole = system(1.0, 1.0).with_policy(Degeneracy::Ignore, 0.0);
    // The loss never falls: the iterations end when damping leaves almost nothing of the step.
    let mut never = solver(whole, &[1.0]);
    let step = never.step(&pairs).unwrap();
    assert_eq!(step.increment, Isometry3::identity());
    let found = tried(&never);
    assert!(found.len() < 20, "{}", found.len());
    assert!(found.last().unwrap().abs() < 1e-11, "{found:?}");
    // Nothing to gain: the first step is zero, and no other is tried.
    let mut content = NormalEquations::new(center(), LENGTH);
    for _ in 0..6 {
        content.add_row(&center(), &Vector3::x(), 0.0, 1.0);
    }
    let mut content = solver(content, &[1.0]);
    let step = content.step(&pairs).unwrap();
    assert_eq!(step.increment, Isometry3::identity());
    assert_eq!(tried(&content).len(), 1);
    // A step within the tolerance is the last one, whether it lowers the loss or not. Here all are,
    // relative to L.
    for losses in [[2.0, 1.0, 0.5], [2.0, 3.0, 4.0]] {
        let mut tolerant = solver(whole, &losses);
        tolerant.tolerance = RESIDUAL / LENGTH;
        tolerant.step(&pairs).unwrap();
        assert_eq!(tried(&tolerant).len(), 1, "{losses:?}");
    }
}
