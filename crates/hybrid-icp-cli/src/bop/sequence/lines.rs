//! What is told of each image, as a line of JSON.

use hybrid_icp::fusion::Update;
use hybrid_icp::{Isometry3, Matrix6, Outcome, SequentialEvent, SequentialStep};
use serde_json::{Value, json};

/// What became of an image.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum What {
    /// There is no image or no mask to register in.
    Moved(&'static str),
    /// It was registered.
    Registered(SequentialEvent),
}

/// The pose from one image alone.
#[derive(Clone, Debug)]
pub(super) struct Single {
    pub(super) outcome: Outcome,
    pub(super) mve: Option<f64>,
}

/// An image of the sequence.
#[derive(Clone, Debug)]
pub(super) struct Line {
    pub(super) im_id: u32,
    /// Index of the instance whose mask it was registered in, in the ground truth of the image.
    pub(super) instance: Option<usize>,
    pub(super) fused: Isometry3<f64>,
    pub(super) covariance: Option<Matrix6<f64>>,
    pub(super) single: Option<Single>,
    pub(super) what: What,
    /// How far the object's centre is from the truth, from this image alone and fused, metres.
    pub(super) off: Option<(f64, f64)>,
}

impl What {
    /// One word, or a few joined by hyphens, for programs.
    fn name(&self) -> &'static str {
        match self {
            Self::Moved(_) => "moved",
            Self::Registered(SequentialEvent::Estimated(update)) => update.name(),
            Self::Registered(SequentialEvent::Refused(_)) => "refused",
            Self::Registered(_) => "no-estimate",
        }
    }

    /// Whether the image's own estimate was good enough to be held.
    pub(super) fn is_accepted(&self) -> bool {
        matches!(
            self,
            Self::Registered(SequentialEvent::Estimated(Update::Accepted(_)))
        )
    }

    /// The same for people.
    pub(super) fn describe(&self) -> &'static str {
        match self {
            Self::Moved(why) => why,
            Self::Registered(_) => match self.name() {
                "accepted" => "accepted",
                "provisional" => "kept until a better one comes",
                "rejected" => "rejected by the gate",
                "restarted" => "started anew: contradicted what was fused",
                "refused" => "refused: no pose or no covariance",
                "no-estimate" => "no estimate: nothing to register",
                other => other,
            },
        }
    }

    fn reason(&self) -> Option<String> {
        match self {
            Self::Moved(why) => Some((*why).to_owned()),
            Self::Registered(event) => match event {
                SequentialEvent::Estimated(update) => update.failure().map(ToString::to_string),
                SequentialEvent::NoEstimate(termination) => Some(termination.explain().to_owned()),
                SequentialEvent::Refused(error) => Some(error.to_string()),
                _ => None,
            },
        }
    }
}

impl Line {
    /// An image without an estimate: the pose moved with the camera.
    pub(super) fn moved(
        im_id: u32,
        why: &'static str,
        fused: Isometry3<f64>,
        covariance: Option<Matrix6<f64>>,
    ) -> Self {
        Self {
            im_id,
            instance: None,
            fused,
            covariance,
            single: None,
            what: What::Moved(why),
            off: None,
        }
    }

    /// An image that was registered.
    pub(super) fn registered(im_id: u32, instance: usize, step: SequentialStep) -> Self {
        Self {
            im_id,
            instance: Some(instance),
            fused: step.camera_from_object,
            covariance: step.covariance,
            single: Some(Single {
                outcome: step.outcome,
                mve: step.mve,
            }),
            what: What::Registered(step.event),
            off: None,
        }
    }

    pub(super) fn json(&self, scene_id: u32, obj_id: u32) -> Value {
        let mut line = json!({
            "scene_id": scene_id, "im_id": self.im_id, "obj_id": obj_id, "outcome": self.what.name(),
        });
        if let Some(reason) = self.what.reason() {
            line["reason"] = json!(reason);
        }
        if let Some(instance) = self.instance {
            line["instance"] = json!(instance);
        }
        state_pose(&mut line, &self.fused);
        // Symmetric: rows are columns.
        line["covariance"] = json!(self.covariance.as_ref().map(Matrix6::as_slice));
        if let Some(single) = &self.single {
            let mut value = json!({
                "mve": single.mve,
                "iterations": single.outcome.iterations,
                "termination": single.outcome.termination.name(),
            });
            state_pose(&mut value, &single.outcome.camera_from_object);
            line["single"] = value;
        }
        line
    }
}

fn state_pose(value: &mut Value, pose: &Isometry3<f64>) {
    let (rotation, translation_mm) = hicp_io::pose_to_bop(pose);
    value["cam_R_m2c"] = json!(rotation);
    value["cam_t_m2c"] = json!(translation_mm);
}
