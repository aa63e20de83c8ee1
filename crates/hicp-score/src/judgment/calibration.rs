//! Measures of how well a score separates correct poses from wrong ones: ROC area and reliability.

/// The score of an estimate, labeled with whether the estimate is correct.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LabeledScore {
    /// Confidence; higher is better.
    pub score: f64,
    /// `true` if the estimate is correct, by any rule.
    pub correct: bool,
}

/// Returns the area under the ROC curve; `None` unless there are correct and wrong estimates.
///
/// The area is the probability that a correct estimate has a higher score than a wrong one, where
/// equal scores count half (the Mann-Whitney statistic, exact with ties). ½ means that the score
/// has no information; 1 means that some threshold separates correct from wrong. Cost: O(n log n).
///
/// ```
/// use hicp_score::{LabeledScore, roc_area};
/// let labeled = [(0.9, true), (0.8, true), (0.8, false), (0.3, false)];
/// let labeled = labeled.map(|(score, correct)| LabeledScore { score, correct });
/// // Of the four pairs of a correct and a wrong one, three are in order and one is a tie.
/// assert_eq!(roc_area(&labeled), Some(0.875));
/// assert_eq!(roc_area(&labeled[..2]), None);
/// ```
#[must_use]
pub fn roc_area(labeled: &[LabeledScore]) -> Option<f64> {
    let mut sorted: Vec<&LabeledScore> = labeled.iter().collect();
    sorted.sort_by(|a, b| a.score.total_cmp(&b.score));
    // Counted in halves of pairs, so that all numbers are integers.
    let (mut wrong_below, mut right, mut won) = (0_u128, 0_u128, 0_u128);
    #[allow(clippy::float_cmp, reason = "ties are equal scores")]
    for tied in sorted.chunk_by(|a, b| a.score == b.score) {
        let right_here = tied.iter().filter(|j| j.correct).count() as u128;
        let wrong_here = tied.len() as u128 - right_here;
        won += right_here * (2 * wrong_below + wrong_here);
        wrong_below += wrong_here;
        right += right_here;
    }
    let pairs = 2 * right * wrong_below;
    (pairs > 0).then(|| won as f64 / pairs as f64)
}

/// The estimates with scores in one range: a row of a reliability table.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct ReliabilityBin {
    /// Lower bound of the scores, included.
    pub lower: f64,
    /// Upper bound of the scores, excluded except in the last bin.
    pub upper: f64,
    /// Number of estimates with such a score.
    pub count: usize,
    /// Number of correct estimates among them.
    pub correct: usize,
    /// Sum of their scores.
    score_sum: f64,
}

impl ReliabilityBin {
    /// Share of the estimates that are correct; `None` without estimates.
    #[must_use]
    pub fn share_correct(&self) -> Option<f64> {
        (self.count > 0).then(|| self.correct as f64 / self.count as f64)
    }

    /// Mean of the scores; `None` without estimates.
    ///
    /// If the score is a probability of being correct, it equals the share of correct estimates.
    #[must_use]
    pub fn mean_score(&self) -> Option<f64> {
        (self.count > 0).then(|| self.score_sum / self.count as f64)
    }
}

/// Returns the reliability table of scores from 0 to 1: `bins` ranges of equal width, lowest first.
///
/// Scores outside are counted in the nearest range, and NaN in the lowest. Cost: O(n + bins).
#[must_use]
pub fn reliability(labeled: &[LabeledScore], bins: usize) -> Vec<ReliabilityBin> {
    let bound = |index: usize| index as f64 / bins as f64;
    let mut table: Vec<ReliabilityBin> = (0..bins)
        .map(|index| ReliabilityBin {
            lower: bound(index),
            upper: bound(index + 1),
            ..ReliabilityBin::default()
        })
        .collect();
    for LabeledScore { score, correct } in labeled {
        // Compares with the bounds themselves, so that a score equal to a bound is in the bin that
        // starts there.
        let above = table.partition_point(|bin| bin.lower <= *score);
        let Some(bin) = table.get_mut(above.saturating_sub(1)) else {
            continue;
        };
        bin.count += 1;
        bin.correct += usize::from(*correct);
        bin.score_sum += score;
    }
    table
}
