//! Tests that the built-in fusers keep the laws, and that broken fusers are detected.

use std::panic::{AssertUnwindSafe, catch_unwind};

use hicp_testkit::{FuserLaws, check_fuser};
use hybrid_icp::core::{Isometry3, Matrix6, Point3, Symmetries, SymmetryAxis, Vector3};
use hybrid_icp::fusion::{
    BatchFuser, CameraMotion, Fuser, FuserConfig, FusionMethod, Gate, Gated, LastEstimate,
    MostConfident, PoseEstimate, RecursiveFuser, SymmetryAware, Transport, UnitCovariance, Update,
};

fn config() -> FuserConfig {
    FuserConfig {
        unit: UnitCovariance::about_object(Point3::new(0.01, 0.02, 0.0), 0.05).unwrap(),
        ..FuserConfig::default()
    }
}

const STRICT: FuserLaws = FuserLaws {
    permutation: true,
    equivariant: true,
    first_as_it_is: true,
};

const ORDERED: FuserLaws = FuserLaws {
    permutation: false,
    ..STRICT
};

#[test]
fn the_six_methods_keep_the_laws() {
    check_fuser(|| BatchFuser::average(config()), STRICT);
    check_fuser(|| BatchFuser::weighted_average(config()), STRICT);
    check_fuser(|| MostConfident::new(Transport::Adjoint), STRICT);
    check_fuser(|| LastEstimate::new(Transport::Adjoint), ORDERED);
    check_fuser(|| RecursiveFuser::filtering(config()), ORDERED);
    check_fuser(|| RecursiveFuser::filtering_constant(config()), ORDERED);
    for method in FusionMethod::ALL {
        check_fuser(|| method.build(config()), ORDERED);
    }
}

#[test]
fn the_six_methods_of_the_paper_keep_the_laws() {
    for method in FusionMethod::ALL {
        let laws = FuserLaws {
            equivariant: false,
            ..ORDERED
        };
        check_fuser(|| method.build(FuserConfig::paper()), laws);
    }
    let window = FuserConfig {
        window: Some(2),
        ..config()
    };
    check_fuser(|| BatchFuser::weighted_average(window), ORDERED);
}

#[test]
fn gated_and_symmetry_aware_fusers_keep_the_laws() {
    for method in FusionMethod::ALL {
        let gate = Gate::default();
        check_fuser(
            || Gated::new(method.build(config()), gate).unwrap(),
            ORDERED,
        );
        let symmetries = Symmetries {
            discrete: vec![Isometry3::rotation(Vector3::x() * std::f64::consts::PI)],
            continuous: vec![SymmetryAxis::new(Vector3::z(), Point3::origin()).unwrap()],
        };
        let make = || {
            let gated = Gated::new(method.build(config()), gate).unwrap();
            SymmetryAware::new(gated, symmetries.clone(), Point3::origin(), 0.05).unwrap()
        };
        check_fuser(make, ORDERED);
    }
}

/// The fault of a custom fuser.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    None,
    ForgetsToReset,
    ForgetsToMove,
    ForgetsTheAdjoint,
    AveragesCoordinates,
    ReturnsNan,
    ChangesWhenRejecting,
}

/// A custom fuser around a recursive one, with an optional fault.
struct Custom {
    fault: Fault,
    inner: RecursiveFuser,
    count: f64,
}

impl Custom {
    fn new(fault: Fault) -> Self {
        let config = match fault {
            Fault::ForgetsTheAdjoint => FuserConfig::paper(),
            _ => config(),
        };
        Self {
            fault,
            inner: RecursiveFuser::filtering(config),
            count: 0.0,
        }
    }
}

impl Fuser for Custom {
    fn propagate(&mut self, motion: &CameraMotion) {
        if self.fault != Fault::ForgetsToMove {
            self.inner.propagate(motion);
        }
    }

    fn update(&mut self, estimate: &PoseEstimate) -> Update {
        self.count += 1.0;
        if self.fault == Fault::AveragesCoordinates
            && let Some(held) = self.inner.estimate()
        {
            let share = 1.0 / self.count;
            let mut pose = *held.camera_from_object();
            pose.translation.vector = pose
                .translation
                .vector
                .lerp(&estimate.camera_from_object().translation.vector, share);
            self.inner.reset();
            let mean = PoseEstimate::new(pose, *estimate.covariance()).unwrap();
            return self.inner.update(&mean);
        }
        let update = self.inner.update(estimate);
        if self.fault == Fault::ChangesWhenRejecting && self.count > 2.0 {
            let (found, limit) = (1.0, 0.5);
            return Update::Rejected(hybrid_icp::fusion::Failure::Mve { found, limit });
        }
        update
    }

    fn estimate(&self) -> Option<PoseEstimate> {
        let held = self.inner.estimate()?;
        if self.fault == Fault::ReturnsNan {
            // NaN is as close as a test can get, because the constructor refuses it.
            let huge = Matrix6::identity() * f64::NAN;
            return Some(PoseEstimate::new(*held.camera_from_object(), huge).unwrap());
        }
        Some(held)
    }

    fn reset(&mut self) {
        if self.fault != Fault::ForgetsToReset {
            self.inner.reset();
            self.count = 0.0;
        }
    }
}

fn report(fault: Fault, laws: FuserLaws) -> String {
    let check = || check_fuser(|| Custom::new(fault), laws);
    let payload = catch_unwind(AssertUnwindSafe(check)).expect_err("a broken law");
    payload.downcast_ref::<String>().cloned().unwrap()
}

#[test]
fn broken_fusers_are_detected() {
    check_fuser(|| Custom::new(Fault::None), ORDERED);
    for (fault, law) in [
        (Fault::ForgetsToReset, "reset forgets"),
        (Fault::ForgetsToMove, "propagate moves the pose"),
        (Fault::ForgetsTheAdjoint, "equivariant"),
        (Fault::AveragesCoordinates, "permutation"),
        (Fault::ReturnsNan, "never panics"),
        (Fault::ChangesWhenRejecting, "a rejected update changes"),
    ] {
        let laws = match fault {
            Fault::AveragesCoordinates => FuserLaws {
                equivariant: false,
                ..STRICT
            },
            _ => ORDERED,
        };
        let message = report(fault, laws);
        assert!(message.contains(law), "{fault:?}: {message}");
        assert!(message.contains("Custom"), "{message}");
    }
    // A recursive filter depends on the order of the estimates, unlike a batch.
    assert!(report(Fault::None, STRICT).contains("permutation"));
}
