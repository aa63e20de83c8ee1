//! The laws of fusers.

use hybrid_icp::core::{Isometry3, Matrix6, Vector6, se3};
use hybrid_icp::fusion::{CameraMotion, Fuser, PoseEstimate, Update};

use crate::law::{BOXED, NAMED, PURE, Subject};

/// What [`check_fuser`] may take for granted of a fuser beyond the trait's contract.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FuserLaws {
    /// The order in which estimates come does not matter, but for rounding. False by default: filters are recursive.
    pub permutation: bool,
    /// Moving the camera is the same as having seen everything from there: true when covariances are carried by the adjoint and
    /// nothing is measured in the camera's own axes.
    pub equivariant: bool,
    /// The first estimate is taken as it is, covariance and MVE included.
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

/// Some estimates of one pose, and the motion of the camera after each.
struct Course {
    name: &'static str,
    estimates: Vec<PoseEstimate>,
    /// Consistent with their covariances and small: where laws hold to a few digits.
    tame: bool,
}

/// Checks a [`Fuser`]; `make` makes a fresh one.
///
/// # Laws
///
/// - Nothing is believed before the first update nor after a reset; the first estimate as it is (see [`FuserLaws`]).
/// - Never panics, and what is returned is finite with a covariance that is one: also for estimates half a turn apart, without
///   variance, of absurd variance, and wildly wrong ones. (What is not finite cannot be given: [`PoseEstimate::new`] refuses it.)
/// - A rejected update changes nothing that is believed.
/// - Estimates that are all one are believed.
/// - `propagate` moves the pose by the motion, and by nothing without one; the covariance stays one.
/// - Equivariant: estimates from before and after a motion fuse as if all had been made after it (see [`FuserLaws`]).
/// - Permutation: see [`FuserLaws`].
/// - Pure: a reset fuser gives the bits of a fresh one, whatever it was given before; so does a boxed one. Asking changes nothing.
///
/// # Panics
///
/// Panics with the law, the input and what was found when a law is broken.
pub fn check_fuser<T: Fuser + 'static>(make: impl Fn() -> T, laws: FuserLaws) {
    let subject = Subject::new::<T>(Some(make().name()));
    let name = make().name();
    let named = !name.is_empty() && Box::new(make()).name() == name;
    subject.holds(NAMED, "a fresh fuser", named, || format!("{name:?}"));
    let courses = courses();
    for course in &courses {
        let input = course.name;
        let expected = subject.calm(input, || drive(&subject, &mut make(), course));
        subject.same(
            PURE,
            input,
            &expected,
            &drive(&subject, &mut make(), course),
        );
        for before in &courses {
            let mut used = make();
            drive(&subject, &mut used, before);
            used.reset();
            let input = format!("{input}, reset after: {}", before.name);
            let gone = used.estimate().is_none();
            let law = "reset forgets: nothing is believed after it";
            subject.holds(law, &input, gone, || format!("{:?}", used.estimate()));
            subject.same(PURE, &input, &expected, &drive(&subject, &mut used, course));
        }
        let mut boxed: Box<dyn Fuser> = Box::new(make());
        subject.same(
            BOXED,
            input,
            &expected,
            &drive(&subject, &mut boxed, course),
        );
        if laws.first_as_it_is {
            first(&subject, input, &mut make(), &course.estimates[0]);
        }
        identical(&subject, input, &mut make(), &course.estimates[0]);
        moves(&subject, input, &mut make(), course);
        if course.tame && laws.equivariant {
            equivariant(&subject, input, &make, course);
        }
        if course.tame && laws.permutation {
            permutation(&subject, input, &make, course);
        }
    }
}

/// The camera's motions between estimates.
fn motion(step: usize) -> CameraMotion {
    let sign = if step.is_multiple_of(2) { 1.0 } else { -1.0 };
    let twist = Vector6::new(0.05 * sign, -0.02, -0.1, 0.1, 0.2 * sign, -0.05);
    CameraMotion::new(se3::exp(&twist)).expect("small")
}

/// Updates and moves through a course, with the laws that hold at every step; returns all that could be seen.
fn drive<F: Fuser + ?Sized>(
    subject: &Subject,
    fuser: &mut F,
    course: &Course,
) -> Vec<(Update, Option<PoseEstimate>, Option<PoseEstimate>)> {
    let input = course.name;
    let law = "nothing is believed before the first update";
    subject.holds(law, input, fuser.estimate().is_none(), || {
        format!("{:?}", fuser.estimate())
    });
    fuser.propagate(&motion(0));
    subject.holds(law, input, fuser.estimate().is_none(), || {
        format!("{:?}", fuser.estimate())
    });
    let mut seen = Vec::new();
    for (step, estimate) in course.estimates.iter().enumerate() {
        let before = fuser.estimate();
        let update = fuser.update(estimate);
        let updated = fuser.estimate();
        if !update.is_taken() {
            let law = "a rejected update changes nothing that is believed";
            subject.same(law, input, &before, &updated);
        }
        subject.same("asking changes nothing", input, &updated, &fuser.estimate());
        healthy(subject, input, updated.as_ref());
        fuser.propagate(&motion(step));
        let propagated = fuser.estimate();
        healthy(subject, input, propagated.as_ref());
        seen.push((update, updated, propagated));
    }
    seen
}

fn healthy(subject: &Subject, input: &str, estimate: Option<&PoseEstimate>) {
    let Some(estimate) = estimate else {
        subject.broken(
            "something is believed after an update",
            input,
            "no estimate",
        )
    };
    let remade = PoseEstimate::new(*estimate.camera_from_object(), *estimate.covariance());
    subject.holds(
        "what is believed is finite, and its covariance symmetric and positive semidefinite",
        input,
        remade.is_ok(),
        || format!("{estimate:?}: {remade:?}"),
    );
}

fn first<F: Fuser>(subject: &Subject, input: &str, fuser: &mut F, estimate: &PoseEstimate) {
    fuser.update(estimate);
    subject.same(
        "the first estimate is taken as it is",
        input,
        &Some(*estimate),
        &fuser.estimate(),
    );
}

fn identical<F: Fuser>(subject: &Subject, input: &str, fuser: &mut F, estimate: &PoseEstimate) {
    for _ in 0..4 {
        fuser.update(estimate);
    }
    let found = fuser.estimate();
    let apart = found.map_or(f64::NAN, |found| {
        distance(found.camera_from_object(), estimate.camera_from_object())
    });
    subject.holds(
        "estimates that are all one are believed",
        input,
        apart < 1e-9,
        || format!("{apart} away: {found:?}"),
    );
}

fn moves<F: Fuser>(subject: &Subject, input: &str, fuser: &mut F, course: &Course) {
    fuser.update(&course.estimates[0]);
    let before = believed(subject, input, fuser);
    fuser.propagate(&CameraMotion::none());
    let still = believed(subject, input, fuser);
    fuser.propagate(&motion(3));
    let moved = believed(subject, input, fuser);
    for (law, expected, found) in [
        (
            "a camera that stands still moves nothing",
            *before.camera_from_object(),
            still,
        ),
        (
            "propagate moves the pose by the motion",
            motion(3).apply(before.camera_from_object()),
            moved,
        ),
    ] {
        let apart = distance(found.camera_from_object(), &expected);
        subject.holds(law, input, apart < 1e-9, || format!("{apart} away"));
    }
}

fn equivariant<F: Fuser>(subject: &Subject, input: &str, make: &impl Fn() -> F, course: &Course) {
    let motion = motion(5);
    let there: Vec<PoseEstimate> = course
        .estimates
        .iter()
        .map(|estimate| seen_after(&motion, estimate))
        .collect();
    let half = course.estimates.len() / 2;
    let (mut on_the_way, mut all_there) = (make(), make());
    for estimate in &course.estimates[..half] {
        on_the_way.update(estimate);
    }
    on_the_way.propagate(&motion);
    for estimate in &there[half..] {
        on_the_way.update(estimate);
    }
    for estimate in &there {
        all_there.update(estimate);
    }
    agree(
        subject,
        "equivariant: moving the camera is having seen everything from there",
        input,
        &believed(subject, input, &all_there),
        &believed(subject, input, &on_the_way),
    );
}

fn permutation<F: Fuser>(subject: &Subject, input: &str, make: &impl Fn() -> F, course: &Course) {
    let (mut forth, mut back) = (make(), make());
    for estimate in &course.estimates {
        forth.update(estimate);
    }
    for estimate in course.estimates.iter().rev() {
        back.update(estimate);
    }
    agree(
        subject,
        "permutation: the order of the estimates does not matter",
        input,
        &believed(subject, input, &forth),
        &believed(subject, input, &back),
    );
}

fn agree(subject: &Subject, law: &str, input: &str, expected: &PoseEstimate, found: &PoseEstimate) {
    let apart = distance(expected.camera_from_object(), found.camera_from_object());
    subject.holds(law, input, apart < 1e-8, || {
        format!("poses {apart} apart: {found:?}\n    not {expected:?}")
    });
    let difference = (expected.covariance() - found.covariance()).amax();
    let size = expected.covariance().amax();
    subject.holds(law, input, difference <= 1e-6 * size, || {
        format!("covariances {difference} apart, of {size}")
    });
}

fn believed<F: Fuser + ?Sized>(subject: &Subject, input: &str, fuser: &F) -> PoseEstimate {
    fuser.estimate().unwrap_or_else(|| {
        subject.broken(
            "something is believed after an update",
            input,
            "no estimate",
        )
    })
}

/// An estimate as it would have been made after a motion.
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

fn courses() -> Vec<Course> {
    let center = se3::exp(&Vector6::new(0.05, -0.03, 0.6, 0.4, -0.9, 0.3));
    // Six scattered estimates, of sizes that differ by far more than a factor.
    let scattered = |size: f64, covariance: &dyn Fn(u32) -> Matrix6<f64>| {
        (0..6)
            .map(|k: u32| {
                let phase = f64::from(k);
                let twist = Vector6::from_fn(|axis, _| {
                    let axis = u32::try_from(axis).unwrap_or(0);
                    (1.7 * phase + 2.3 * f64::from(axis)).sin()
                });
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
    wild[3] = with_mve(
        Isometry3::translation(5.0, -3.0, 9.0) * center,
        *wild[3].covariance(),
        0.9,
    );
    let turns = scattered(0.0, &sized(1e-2))
        .into_iter()
        .zip(0..)
        .map(|(estimate, k): (PoseEstimate, u32)| {
            let turn = se3::exp(&Vector6::new(
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                std::f64::consts::PI * f64::from(k % 2),
            ));
            with_mve(turn * center, *estimate.covariance(), 0.1)
        })
        .collect();
    let course = |name, estimates, tame| Course {
        name,
        estimates,
        tame,
    };
    vec![
        course(
            "estimates close together",
            scattered(0.002, &sized(1e-5)),
            true,
        ),
        course(
            "estimates some way apart",
            scattered(0.02, &sized(1e-3)),
            true,
        ),
        course("estimates far apart", scattered(0.4, &sized(0.1)), false),
        course("estimates half a turn apart", turns, false),
        course("one wild outlier", wild, false),
        course(
            "estimates without variance",
            scattered(0.01, &|_| Matrix6::zeros()),
            false,
        ),
        course(
            "estimates that know nothing",
            scattered(0.01, &|_| Matrix6::identity() * 1e30),
            false,
        ),
        course(
            "estimates that know either everything or nothing",
            scattered(0.01, &|k| {
                Matrix6::identity() * if k % 2 == 0 { 0.0 } else { 1e30 }
            }),
            false,
        ),
        course(
            "estimates that know only some directions",
            scattered(0.01, &|k| {
                let known = |i: usize| {
                    if i.is_multiple_of(2) == k.is_multiple_of(2) {
                        0.0
                    } else {
                        1e12
                    }
                };
                Matrix6::from_diagonal(&Vector6::from_fn(|i, _| known(i)))
            }),
            false,
        ),
    ]
}
