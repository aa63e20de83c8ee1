//! The report of one image as a line of JSON.

use hybrid_icp::core::{Isometry3, Matrix6};
use hybrid_icp::fusion::Update;
use hybrid_icp::icp::Outcome;
use hybrid_icp::{SequentialEvent, SequentialStep};
use serde_json::{Value, json};

use crate::pose_json::add_pose;

/// An image of the sequence.
#[derive(Clone, Debug)]
pub(super) struct Line {
    pub(super) im_id: u32,
    /// Index, in the ground truth of the image, of the instance whose mask was used.
    pub(super) instance: Option<usize>,
    pub(super) fused: Isometry3<f64>,
    covariance: Option<Matrix6<f64>>,
    /// The probability that the fused pose is right, if it was registered.
    confidence: Option<f64>,
    /// The outcome from this image alone, and its MVE.
    pub(super) single: Option<(Outcome, Option<f64>)>,
    /// The outcome for programs: words joined by hyphens.
    pub(super) outcome: &'static str,
    /// The outcome for people.
    pub(super) description: &'static str,
    reason: Option<String>,
    /// Distances of the object's center from the truth in meters, from this image alone and fused.
    pub(super) off: Option<(f64, f64)>,
}

impl Line {
    /// Creates the report of an image without an estimate, whose pose moved with the camera.
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
            confidence: None,
            single: None,
            outcome: "moved",
            description: why,
            reason: Some(why.to_owned()),
            off: None,
        }
    }

    /// Creates the report of an image that was registered.
    pub(super) fn registered(
        im_id: u32,
        instance: Option<usize>,
        step: SequentialStep,
        confidence: f64,
    ) -> Self {
        let (outcome, description) = describe(&step.event);
        Self {
            im_id,
            instance,
            fused: step.camera_from_object,
            covariance: step.covariance,
            confidence: Some(confidence),
            single: Some((step.outcome, step.mve)),
            outcome,
            description,
            reason: step.event.reason(),
            off: None,
        }
    }

    /// Returns the line of JSON.
    pub(super) fn json(&self, scene_id: u32, obj_id: u32) -> Value {
        let mut line = json!({
            "scene_id": scene_id, "im_id": self.im_id, "obj_id": obj_id, "outcome": self.outcome,
            // The matrix is symmetric, so the order of rows and columns does not matter.
            "covariance": self.covariance.as_ref().map(Matrix6::as_slice),
        });
        if let Some(reason) = &self.reason {
            line["reason"] = json!(reason);
        }
        if let Some(confidence) = self.confidence {
            line["confidence"] = json!(confidence);
        }
        if let Some(instance) = self.instance {
            line["instance"] = json!(instance);
        }
        add_pose(&mut line, &self.fused);
        if let Some((outcome, mve)) = &self.single {
            line["single"] = json!({
                "mve": mve,
                "iterations": outcome.iterations,
                "termination": outcome.termination.name(),
            });
            add_pose(&mut line["single"], &outcome.camera_from_object);
        }
        line
    }
}

/// Returns the name of an event, and a description for people.
fn describe(event: &SequentialEvent) -> (&'static str, &'static str) {
    match event {
        SequentialEvent::Estimated(update) => {
            let description = match update {
                Update::Provisional(..) => "kept until there is a better one",
                Update::Rejected(_) => "rejected by the gate",
                Update::Restarted(..) => "started again: contradicted the fused pose",
                _ => update.name(),
            };
            (update.name(), description)
        }
        SequentialEvent::Refused(_) => ("refused", "refused: no pose or no covariance"),
        SequentialEvent::NoEstimate(_) => ("no-estimate", "no estimate: nothing to register"),
        _ => ("no-estimate", "no estimate"),
    }
}
