//! Scores.

use hicp_score::{Doubt, MaskTrust, MeanVsd, Occlusion, SampledMve};

use crate::build::Parameters;
use crate::catalog::Catalog;
use crate::error::PipelineError;
use crate::range::Range;
use crate::work::Limited::Samples;

/// The meaning of an occlusion tolerance.
const HIDES: &str = "a rendered pixel outside the mask counts unless the measured surface is more than this in front of it; \
    below 0, it counts only if no surface is measured, or one at least that far behind it, for masks that miss a part; \
    inf counts all, as in the paper";
/// Any; a meter behind the object is nowhere near it.
const TOLERANCE: Range = Range::new(-1.0, f64::INFINITY, "m");

pub(super) fn add(catalog: &mut Catalog) {
    catalog.add_score("mve", |p| {
        p.about = "Computes the mean VSD estimate against the live image. Source: §IV-A.2. \
            Cost: a render, shared with the selection, and O(pixels).";
        let tolerance: f64 = p.number("occlusion_tolerance", TOLERANCE, 0.015, HIDES)?;
        Ok(MeanVsd {
            occlusion: Occlusion::from_tolerance(tolerance),
            mask: mask_trust(p)?,
        })
    });
    catalog.add_score("doubt", |p| {
        p.about = "Computes 1 minus the confidence: the probability that a pose is wrong. For \
            decisions, not for ranking. Cost: as the MVE, and 40 µs.";
        Ok(Doubt)
    });
    catalog.add_score("sampled-mve", |p| {
        p.about = "Computes the MVE at low resolution from points of the model instead of a \
            render, for ranking many poses. Cost: O(samples), whatever the mesh.";
        let samples = p.limited(
            Samples,
            "samples",
            0,
            600,
            "points of a side of the model, about",
        )?;
        let pixels = p.count("pixels", 1, 150, "pixels of the mask, about")?;
        let mut score = SampledMve::new(samples, pixels);
        let tolerance = p.number("occlusion_tolerance", TOLERANCE, 0.015, HIDES)?;
        score.occlusion = Occlusion::from_tolerance(tolerance);
        score.mask = mask_trust(p)?;
        Ok(score)
    });
}

fn mask_trust(p: &mut Parameters<'_>) -> Result<MaskTrust, PipelineError> {
    let about = "expects a mask that is too large, too small, soft or a box; occlusion_tolerance \
        then has no effect";
    Ok(match p.flag("imperfect_mask", false, about)? {
        true => MaskTrust::Imperfect,
        false => MaskTrust::Exact,
    })
}
