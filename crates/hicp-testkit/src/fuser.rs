//! The laws of fusers.

use hybrid_icp::core::{Isometry3, Matrix6, Vector3, Vector6, se3};
use hybrid_icp::fusion::{CameraMotion, Fuser, PoseEstimate, Update};

use crate::law::{BOXED, PURE, Subject, Trial};

/// The laws that [`check_fuser`] checks beyond the contract of the trait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FuserLaws {
    /// The order of the estimates does not matter, except for rounding. False by default, because
    /// filters are recursive.
    pub permutation: bool,
    /// Fusing and then moving the camera gives the same as observing everything from the final
    /// camera pose.
    ///
    /// True if covariances are transformed by the adjoint and nothing is measured along the
    /// camera's axes.
    pub equivariant: bool,
    /// The first estimate becomes the result unchanged, including its covariance and MVE.
    pub first_as_it_is: bool,
}

impl Default for FuserLaws {
    fn default() -> Self {
        Self {
            permutation: false,
            equivariant: true,
            first_as_it_is: true,
        }
    }
}

/// Estimates of one pose, and the motion of the camera after each.
struct Course {
    name: &'static str,
    estimates: Vec<PoseEstimate>,
    /// The estimates are close to each other and consistent with their covariances, so laws hold to
    /// several digits.
    tame: bool,
}

/// Checks a [`Fuser`]; `make` creates a fresh one.
///
/// # Laws
///
/// - There is no estimate before the first update and after a reset. The first estimate is the
///   result unchanged (see [`FuserLaws`]).
/// - Never panics, and returns finite poses with valid covariances. This also holds for estimates
///   rotated by 180°, without variance, with huge variances, and for extreme outliers. Values that
///   are not finite need no test, because [`PoseEstimate::new`] refuses them.
/// - A rejected update does not change the estimate.
/// - The result of equal estimates is that estimate.
/// - `propagate` moves the pose by the motion of the camera. Without motion, it changes nothing.
///   The covariance stays valid.
/// - Equivariant: estimates from before and after a motion fuse as if all were made after it (see
///   [`FuserLaws`]).
/// - Permutation: see [`FuserLaws`].
/// - Pure: a fuser after a reset and a boxed fuser give the same bits as a fresh one. Reading the
///   estimate changes nothing.
///
/// # Panics
///
/// Panics if a law is broken, with the law, the input and the value found.
pub fn check_fuser<T: Fuser + 'static>(make: impl Fn() -> T, laws: FuserLaws) {
    let subject = Subject::new::<T>(Some(make().name()));
    let courses = courses();
    for course in &courses {
        let trial = subject.on(course.name);
        let expected = trial.calm(|| drive(&trial, &mut make(), course));
        trial.same(PURE, &expected, &drive(&trial, &mut make(), course));
        for before in &courses {
            let mut used = make();
            drive(&trial, &mut used, before);
            used.reset();
            let input = format!("{}, reset after: {}", course.name, before.name);
            let trial = subject.on(&input);
            let law = "reset forgets: there is no estimate after it";
            trial.holds(
                law,
                used.estimate().is_none(),
                format_args!("{:?}", used.estimate()),
            );
            trial.same(PURE, &expected, &drive(&trial, &mut used, course));
        }
        let mut boxed: Box<dyn Fuser> = Box::new(make());
        trial.same(BOXED, &expected, &drive(&trial, &mut boxed, course));
        subject.named([make().name(), make().name(), boxed.name()]);
        let estimates = &course.estimates;
        if laws.first_as_it_is {
            let law = "the first estimate is the result unchanged";
            let fuser = updated(make(), &estimates[..1]);
            trial.same(law, &Some(estimates[0]), &fuser.estimate());
        }
        let repeated = updated(make(), &vec![estimates[0]; 4]);
        let law = "the result of equal estimates is that estimate";
        near(&trial, law, estimates[0].camera_from_object(), &repeated);
        moves(&trial, &mut updated(make(), &estimates[..1]));
        if course.tame && laws.equivariant {
            equivariant(&trial, &make, estimates);
        }
        if course.tame && laws.permutation {
            let law = "permutation: the order of the estimates does not matter";
            let back: Vec<_> = estimates.iter().rev().copied().collect();
            agree(
                &trial,
                law,
                &updated(make(), estimates),
                &updated(make(), &back),
            );
        }
    }
}

/// Returns the fuser after updates.
fn updated<F: Fuser>(mut fuser: F, estimates: &[PoseEstimate]) -> F {
    for estimate in estimates {
        fuser.update(estimate);
    }
    fuser
}

/// Returns the motion of the camera after an estimate.
fn motion(step: usize) -> CameraMotion {
    let sign = if step.is_multiple_of(2) { 1.0 } else { -1.0 };
    let twist = Vector6::new(0.05 * sign, -0.02, -0.1, 0.1, 0.2 * sign, -0.05);
    CameraMotion::new(se3::exp(&twist)).expect("small")
}

/// Runs a course of updates and motions, and checks the laws of every step.
///
/// Returns everything that can be observed.
fn drive(
    trial: &Trial<'_>,
    fuser: &mut dyn Fuser,
    course: &Course,
) -> Vec<(Update, PoseEstimate, PoseEstimate)> {
    for _ in 0..2 {
        let law = "there is no estimate before the first update";
        let found = fuser.estimate();
        trial.holds(law, found.is_none(), format_args!("{found:?}"));
        fuser.propagate(&motion(0));
    }
    let mut seen = Vec::new();
    for (step, estimate) in course.estimates.iter().enumerate() {
        let before = fuser.estimate();
        let update = fuser.update(estimate);
        let updated = fuser.estimate();
        if !update.is_taken() {
            let law = "a rejected update changes nothing";
            trial.same(law, &before, &updated);
        }
        let law = "reading the estimate changes nothing";
        trial.same(law, &updated, &fuser.estimate());
        let updated = healthy(trial, fuser);
        fuser.propagate(&motion(step));
        seen.push((update, updated, healthy(trial, fuser)));
    }
    seen
}

/// Returns the estimate after checking that it is valid.
fn healthy(trial: &Trial<'_>, fuser: &(impl Fuser + ?Sized)) -> PoseEstimate {
    let Some(estimate) = fuser.estimate() else {
        trial.broken("there is an estimate after an update", "no estimate")
    };
    let remade = PoseEstimate::new(*estimate.camera_from_object(), *estimate.covariance());
    trial.holds(
        "the estimate is finite, and its covariance symmetric and positive semidefinite",
        remade.is_ok(),
        format_args!("{estimate:?}: {remade:?}"),
    );
    estimate
}

fn near(trial: &Trial<'_>, law: &str, expected: &Isometry3<f64>, fuser: &impl Fuser) {
    let apart = distance(healthy(trial, fuser).camera_from_object(), expected);
    trial.holds(law, apart < 1e-9, format_args!("{apart} away"));
}

fn moves(trial: &Trial<'_>, fuser: &mut impl Fuser) {
    let before = *healthy(trial, fuser).camera_from_object();
    fuser.propagate(&CameraMotion::none());
    let law = "a camera that does not move changes nothing";
    near(trial, law, &before, fuser);
    fuser.propagate(&motion(3));
    let law = "propagate moves the pose by the motion";
    near(trial, law, &motion(3).apply(&before), fuser);
}

fn equivariant<F: Fuser>(trial: &Trial<'_>, make: &impl Fn() -> F, estimates: &[PoseEstimate]) {
    let motion = motion(5);
    let there = estimates.iter().map(|e| seen_after(&motion, e));
    let there: Vec<PoseEstimate> = there.collect();
    let half = estimates.len() / 2;
    let mut on_the_way = updated(make(), &estimates[..half]);
    on_the_way.propagate(&motion);
    agree(
        trial,
        "equivariant: moving the camera gives the same as observing everything from there",
        &updated(make(), &there),
        &updated(on_the_way, &there[half..]),
    );
}

/// Checks that two fusers have the same estimate up to rounding.
fn agree(trial: &Trial<'_>, law: &str, expected: &impl Fuser, found: &impl Fuser) {
    let (expected, found) = (healthy(trial, expected), healthy(trial, found));
    let apart = distance(expected.camera_from_object(), found.camera_from_object());
    let poses = format_args!("poses {apart} apart: {found:?}\n    not {expected:?}");
    trial.holds(law, apart < 1e-8, poses);
    let difference = (expected.covariance() - found.covariance()).amax();
    let size = expected.covariance().amax();
    let covariances = format_args!("covariances {difference} apart, of {size}");
    trial.holds(law, difference <= 1e-6 * size, covariances);
}

/// Returns the estimate as it would be after a motion of the camera.
fn seen_after(motion: &CameraMotion, estimate: &PoseEstimate) -> PoseEstimate {
    let adjoint = se3::adjoint(motion.next_camera_from_camera());
    let covariance = adjoint * estimate.covariance() * adjoint.transpose();
    let pose = motion.apply(estimate.camera_from_object());
    with_mve(pose, covariance, estimate.mve().unwrap_or(0.2))
}

fn distance(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    se3::log(&(a * b.inverse())).norm()
}

fn with_mve(pose: Isometry3<f64>, covariance: Matrix6<f64>, mve: f64) -> PoseEstimate {
    PoseEstimate::new(pose, covariance)
        .and_then(|estimate| estimate.with_mve(mve))
        .expect("valid")
}

#[allow(clippy::cast_precision_loss)] // Axes.
fn courses() -> [Course; 9] {
    let center = se3::exp(&Vector6::new(0.05, -0.03, 0.6, 0.4, -0.9, 0.3));
    // Six scattered estimates, whose covariances differ in size.
    let scattered = |size: f64, covariance: &dyn Fn(u32) -> Matrix6<f64>| {
        (0..6)
            .map(|k: u32| {
                let phase = f64::from(k);
                let twist = Vector6::from_fn(|axis, _| (1.7 * phase + 2.3 * axis as f64).sin());
                let pose = se3::exp(&(twist * size)) * center;
                with_mve(pose, covariance(k), 0.05 + 0.03 * f64::from((5 * k) % 6))
            })
            .collect::<Vec<_>>()
    };
    let sized = |variance: f64| {
        move |k: u32| {
            let skew = Matrix6::from_fn(|i, j| if i.abs_diff(j) == 1 { 0.3 } else { 0.0 });
            (Matrix6::identity() + skew) * (variance * (1.0 + f64::from((5 * k) % 6)))
        }
    };
    let mut wild = scattered(0.01, &sized(1e-4));
    let outlier = Isometry3::translation(5.0, -3.0, 9.0) * center;
    wild[3] = with_mve(outlier, *wild[3].covariance(), 0.9);
    let mut turns = scattered(0.0, &sized(1e-2));
    for estimate in turns.iter_mut().skip(1).step_by(2) {
        let half_turn = Isometry3::rotation(Vector3::z() * std::f64::consts::PI);
        *estimate = with_mve(half_turn * center, *estimate.covariance(), 0.1);
    }
    let certain = scattered(0.01, &|_| Matrix6::zeros());
    let ignorant = scattered(0.01, &|_| Matrix6::identity() * 1e30);
    let either = scattered(0.01, &|k| Matrix6::identity() * [0.0, 1e30][k as usize % 2]);
    let directions = scattered(0.01, &|k| {
        let variance = |i: usize| if i % 2 == k as usize % 2 { 0.0 } else { 1e12 };
        Matrix6::from_diagonal(&Vector6::from_fn(|i, _| variance(i)))
    });
    let near = scattered(0.002, &sized(1e-5));
    let apart = scattered(0.02, &sized(1e-3));
    [
        ("estimates close together", near, true),
        ("estimates some way apart", apart, true),
        ("estimates far apart", scattered(0.4, &sized(0.1)), false),
        ("estimates rotated by 180°", turns, false),
        ("one wild outlier", wild, false),
        ("estimates without variance", certain, false),
        ("estimates without information", ignorant, false),
        ("estimates with all information or none", either, false),
        ("estimates of some directions only", directions, false),
    ]
    .map(|(name, estimates, tame)| Course {
        name,
        estimates,
        tame,
    })
}
