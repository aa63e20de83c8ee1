//! Stop rules.

use std::time::Duration;

use hicp_icp::{
    AbsoluteLoss, Bound, Convergence, Divergence, IterationLimit, LossRule, Oscillation,
    SmallMotion, TimeLimit,
};

use crate::build::Parameters;
use crate::catalog::Catalog;
use crate::error::PipelineError;
use crate::range::{DEGREES, METERS, Range, SHARE};

/// A mean loss.
const LOSS: Range = Range::positive("m²");
/// A relative change.
const RATIO: Range = Range::positive("share");

pub(super) fn add(catalog: &mut Catalog) {
    catalog.add_stop_rule("divergence", |p| {
        p.about = "Rejects a pose that lost pairs or whose mean loss rose. Source: §IV-B. \
            Cost: O(1).";
        let rules = [
            ("strict", LossRule::Strict),
            ("count-aware", LossRule::CountAware),
        ];
        Ok(Divergence {
            pairs_lost: p.number("pairs_lost", SHARE, 0.05, "pairs that may be lost")?,
            loss_rule: p.word(
                "loss_rule",
                &rules,
                "condition under which a rising loss counts",
            )?,
            rise_tolerance: p.number("rise_tolerance", RATIO, 1e-3, "relative rise to ignore")?,
        })
    });
    catalog.add_stop_rule("convergence", |p| {
        p.about = "Ends when the mean loss stops changing, relatively. Source: §IV-B. Cost: O(1).";
        Ok(Convergence {
            relative_change: p.number("relative_change", RATIO, 1e-3, "converged below")?,
            negligible_loss: p.number("negligible_loss", LOSS, 1e-14, "converged below")?,
        })
    });
    catalog.add_stop_rule("absolute-loss", |p| {
        p.about = "Ends when the mean loss stops changing, absolutely, or is good enough. \
            Cost: O(1).";
        Ok(AbsoluteLoss {
            change: p.number("change", LOSS, 1e-12, "converged below")?,
            good_enough: p.number("good_enough", LOSS, 1e-10, "ends below")?,
        })
    });
    catalog.add_stop_rule("motion", |p| {
        p.about = "Ends when the next increment would hardly move the object. Cost: O(1).";
        let (translation_meters, rotation_degrees) = motion(p, 1e-4, 0.01)?;
        Ok(SmallMotion {
            translation_meters,
            rotation_degrees,
        })
    });
    catalog.add_stop_rule("bound", |p| {
        p.about = "Rejects a pose too far from the stage's initial one. Cost: O(1).";
        let (translation_meters, rotation_degrees) = motion(p, 0.1, 45.0)?;
        Ok(Bound {
            translation_meters,
            rotation_degrees,
        })
    });
    catalog.add_stop_rule("oscillation", |p| {
        p.about = "Ends when the pose returns to where it was two or three iterations before. \
            Cost: O(1).";
        let (translation_meters, rotation_degrees) = motion(p, 1e-5, 1e-3)?;
        Ok(Oscillation::new(translation_meters, rotation_degrees))
    });
    catalog.add_stop_rule("iteration-limit", |p| {
        p.about = "Ends after a number of evaluations. Cost: O(1).";
        let iterations = p.count("iterations", 0, 50, "largest number of evaluations")?;
        p.ends_after(iterations);
        Ok(IterationLimit(iterations))
    });
    catalog.add_stop_rule("time-limit", |p| {
        p.about = "Ends when the stage has run for a time; results depend on the clock. \
            Cost: O(1).";
        let range = Range::new(0.0, 1e9, "ms");
        let milliseconds: f64 = p.number("milliseconds", range, None, "largest duration")?;
        let time = Duration::from_secs_f64(milliseconds / 1000.0);
        Ok(TimeLimit::new(time))
    });
}

/// A distance of the object's center and an angle.
fn motion(p: &mut Parameters<'_>, meters: f64, degrees: f64) -> Result<(f64, f64), PipelineError> {
    Ok((
        p.number(
            "translation_meters",
            METERS,
            meters,
            "translation of the object's center",
        )?,
        p.number("rotation_degrees", DEGREES, degrees, "rotation angle")?,
    ))
}
