//! Checks of the result of a refinement.

use hicp_icp::Alternative;
use hicp_score::Flatness;
use hicp_switch::PAPER_ALPHA;

use crate::warning::Warning;

/// Least rise of the MVE from which a refinement made the pose worse ([`Warning::Worse`]).
///
/// The MVE of three of 71 real poses rose by less, and none of them was worse by 0.1 mm (ADI).
const WORSE: f64 = 0.01;

/// MVE at and above which an initial pose explains nothing of the mask
/// ([`Warning::FoundElsewhere`]).
///
/// Of 71 poses that four estimators gave for the right object, one is above it. All poses that were
/// found in the mask of another object are above it (`docs/robustness.md`).
pub const EXPLAINS_NOTHING: f64 = 0.9;

/// The recommended least confidence of an accepted pose. `docs/book/trust.md` states how many of
/// such poses are wrong.
pub const ACCEPTED: f64 = 0.95;

/// Returns warnings about the result of a refinement.
///
/// The arguments are [`Refinement::mve_initial`](crate::Refinement::mve_initial),
/// [`Refinement::mve`](crate::Refinement::mve),
/// [`Refinement::confidence`](crate::Refinement::confidence) and
/// [`Refinement::flatness`](crate::Refinement::flatness).
///
/// A high MVE alone is no reason for a warning, because imperfect masks raise it. Without a warning
/// the pose can still be wrong: an object that looks nearly the same from two sides explains the
/// image in both orientations.
///
/// ```
/// use hybrid_icp::{Warning, checks::warnings_of_result, score::Flatness};
/// // A rough pose that became a good one.
/// let at = |residual| Some(Flatness::new(residual, 0.0025, 0.009, 0.2));
/// assert_eq!(warnings_of_result(0.6, 0.1, 0.97, at(0.002)), []);
/// // Something was found in the mask, but nothing that the detector had seen there.
/// let found = warnings_of_result(0.95, 0.2, 0.7, None);
/// assert!(matches!(found[..], [Warning::FoundElsewhere { .. }]));
/// // Nothing was found.
/// assert!(matches!(warnings_of_result(0.95, 0.7, 0.01, None)[..], [Warning::Unexplained { .. }]));
/// // It got worse, but not bad. Less is no news.
/// assert_eq!(warnings_of_result(0.1, 0.105, 0.8, None), []);
/// assert!(matches!(warnings_of_result(0.1, 0.2, 0.8, None)[..], [Warning::Worse { .. }]));
/// // The object was found on a wall.
/// assert!(matches!(warnings_of_result(0.6, 0.1, 0.8, at(0.008))[..], [Warning::Flat { .. }]));
/// ```
#[must_use]
pub fn warnings_of_result(
    mve_initial: f64,
    mve: f64,
    confidence: f64,
    flatness: Option<Flatness>,
) -> Vec<Warning> {
    let mut warnings = Vec::new();
    if mve > mve_initial + WORSE {
        warnings.push(Warning::Worse { mve_initial, mve });
    }
    if mve >= PAPER_ALPHA && confidence < ACCEPTED {
        warnings.push(Warning::Unexplained { mve });
        return warnings;
    }
    if confidence < 0.5 {
        warnings.push(Warning::Doubtful { confidence });
    }
    if mve_initial >= EXPLAINS_NOTHING && confidence < ACCEPTED {
        warnings.push(Warning::FoundElsewhere { mve_initial, mve });
    }
    if let Some(flatness) = flatness.filter(Flatness::is_flat) {
        warnings.push(Warning::Flat { flatness });
    }
    warnings
}

/// Returns the warning about another pose that explains the image as well as the returned one.
///
/// There is none if the other pose is worse by [`Alternative::AMBIGUOUS_GAP`] or more.
#[must_use]
pub fn warning_of_runner_up(runner_up: &Alternative) -> Option<Warning> {
    runner_up.is_ambiguous().then_some(Warning::Ambiguous {
        gap: runner_up.gap,
        rotation_degrees: runner_up.rotation_degrees,
    })
}
