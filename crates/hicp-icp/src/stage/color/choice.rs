//! The choice by color among poses that depth cannot tell apart.

use std::time::Duration;

use hicp_core::{Isometry3, Model, Observation, Problem, se3};
use hicp_score::{ColorAgreement, SampledColor, Score};

use crate::alternative::Alternative;
use crate::outcome::{Outcome, Termination, Verdict};
use crate::session::Session;
use crate::stage::color::tried::{Measured, Tried};
use crate::stage::search::distinct::Distinct;
use crate::stage::search::turns::Turns;
use crate::stage::stage_trait::Stage;

/// Runs a stage, and lets color decide between its pose and others that explain the depth as well.
///
/// 1. **Candidates** are the alternatives that the stage found, and poses at which the model nearly
///    covers itself: a box rotated end over end, a can rotated around its axis. Poses that the
///    depth image can tell apart, for example by the handle of a mug, are not candidates.
/// 2. **Polish**: the candidates are ranked by the colors of samples, and `polish` refines the best
///    three. With a [`Photometric`](hicp_metric::Photometric) metric, it also finds a rotation that
///    the depth does not determine.
/// 3. **Neighbors**: if the colors still agree only roughly, [`ColorAgreement`] is measured at the
///    candidates near the stage's pose, and at those near the best other pose. `polish` refines the
///    best of each.
/// 4. **Decision**: by [`ColorAgreement`]. Another pose replaces the stage's pose only if its score
///    in depth is nearly as good, its colors agree clearly better, and no pose near the stage's
///    pose agrees as well.
///
/// [`Alternative::color_gap`] then has the margin of each alternative that is nearly as good in
/// depth.
///
/// Without colors, or without a contrast, the result is that of the stage, bit for bit. A bound of
/// the stage does not limit the choice. Within a [`HypothesisSearch`](crate::HypothesisSearch), it
/// only runs its stage: put it around the search.
///
/// Cost: nothing without colors, or with a model of one color. Otherwise some 20 µs if depth leaves
/// no choice, 1 ms if it does but the colors agree at the pose of the stage, and 2 to 15 ms if they
/// do not.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorChoice<S, P, C> {
    /// Finds a pose.
    pub stage: S,
    /// Moves poses to the measured depth and colors.
    pub polish: P,
    /// Scores the depth; lower is better.
    pub score: C,
    /// Another pose is a choice if its score is at most 1.2 times that of the stage's pose, plus
    /// this.
    pub tolerance: f64,
    /// The smallest correlation of colors at which they agree.
    pub least_correlation: f64,
    /// The gain in correlation by which another pose must beat that of the stage.
    pub min_gain: f64,
    color: SampledColor,
    agreement: ColorAgreement,
    motions: Vec<Isometry3<f64>>,
    ranked: Vec<(f64, Isometry3<f64>)>,
}

/// Number of alternatives that take part.
const ALTERNATIVES: usize = 4;
/// Correlation at which a pose is not even polished.
const PERFECT: f64 = 0.95;
/// Share of the depth's score that another pose may add to it.
const TOLERANCE: f64 = 0.2;
/// Largest MSSD of a base from a pose that is ranked already, as a share of the diameter.
const SAME_BASE: f64 = 0.04;
/// Number of poses that are polished.
const POLISHED: usize = 3;
/// Largest number of candidates near a pose whose colors are compared.
const NEARBY: usize = 12;

impl<S, P, C> ColorChoice<S, P, C> {
    /// Creates the stage with the default conditions.
    #[must_use]
    pub fn new(stage: S, polish: P, score: C) -> Self {
        Self {
            stage,
            polish,
            score,
            tolerance: 0.02,
            least_correlation: 0.3,
            min_gain: 0.12,
            color: SampledColor::new(600),
            agreement: ColorAgreement::default(),
            motions: Vec::new(),
            ranked: Vec::new(),
        }
    }

    /// Lists the poses that may look the same in depth as `pose`.
    ///
    /// `pose` is the first. The list is empty if there is no other.
    fn candidates(
        &mut self,
        problem: &Problem<'_>,
        pose: &Isometry3<f64>,
        session: &Session<'_>,
    ) -> Vec<Isometry3<f64>> {
        let mut candidates = Vec::new();
        let Some((model, observation)) = problem.sides() else {
            return candidates;
        };
        let (turns, distinct) = (Turns::of(model), Distinct::of(model));
        let found = session.workspace.alternatives.iter();
        let found = found.filter(|other| other.gap < self.tolerance);
        let found = found
            .take(ALTERNATIVES)
            .map(|other| other.camera_from_object);
        let bases: Vec<_> = std::iter::once(*pose).chain(found).collect();
        let limit = SAME_BASE * model.diameter();
        for base in &bases {
            // The motions of an earlier base may contain this one.
            let same = |known: &Isometry3<f64>| distinct.mssd(known, base) < limit;
            if candidates.iter().any(same) {
                continue;
            }
            turns.undecided(model, observation, base, &mut self.motions);
            if self.motions.len() == 1 && bases.len() == 1 {
                return candidates;
            }
            candidates.extend(self.motions.iter().map(|motion| base * motion));
        }
        candidates
    }
}

impl<S, P: Stage, C: Score> ColorChoice<S, P, C> {
    /// Measures the colors and the depth at the pose of an outcome.
    fn measure(
        &mut self,
        problem: &Problem<'_>,
        outcome: Outcome,
        session: &mut Session<'_>,
    ) -> Measured {
        let mut context = session.context(problem);
        let pose = &outcome.camera_from_object;
        Measured {
            color: self.agreement.measure(&mut context, pose),
            score: self.score.score(&mut context, pose),
            outcome,
        }
    }

    /// Lets color choose between the pose of an outcome and others that explain the depth as well.
    fn choose(
        &mut self,
        problem: &Problem<'_>,
        distinct: &Distinct,
        outcome: Outcome,
        session: &mut Session<'_>,
    ) -> Outcome {
        let pose = outcome.camera_from_object;
        let candidates = self.candidates(problem, &pose, session);
        if candidates.is_empty() {
            return outcome;
        }
        let first = self.measure(problem, outcome, session);
        self.ranked.clear();
        let mut tried = Tried {
            distinct,
            least_correlation: self.least_correlation,
            min_gain: self.min_gain,
            first,
            others: Vec::new(),
        };
        let mut ranked = &candidates[..];
        if tried.is_sure() {
            // Only the pose itself is left to polish.
            ranked = &candidates[..usize::from(first.color.correlation < PERFECT)];
        }
        for pose in ranked {
            let score = self.color.score(&mut session.context(problem), pose);
            insert(&mut self.ranked, (score, *pose), distinct);
        }
        let mut iterations = outcome.iterations;
        let ranked = std::mem::take(&mut self.ranked);
        for (_, start) in &ranked {
            iterations += self.polish(problem, start, &mut tried, session);
            if tried.is_sure() {
                break;
            }
        }
        self.ranked = ranked;
        // Ranks are rough, and a polish moves a pose only a little.
        for apart in [false, true] {
            let best = if apart {
                tried.other()
            } else {
                Some(tried.own())
            };
            if let Some(best) = best.filter(|_| !tried.is_sure())
                && let Some(start) = self.nearby(problem, best, (&candidates, distinct), session)
            {
                iterations += self.polish(problem, &start, &mut tried, session);
            }
        }
        if !tried.all().any(|tried| tried.color.is_telling()) {
            return outcome;
        }
        let chosen = *tried.chosen();
        self.list(problem, &chosen, &tried, session);
        Outcome {
            iterations,
            ..chosen.outcome
        }
    }

    /// Polishes a pose, and adds it to those tried if it explains the depth.
    ///
    /// Returns the number of iterations.
    fn polish(
        &mut self,
        problem: &Problem<'_>,
        start: &Isometry3<f64>,
        tried: &mut Tried<'_>,
        session: &mut Session<'_>,
    ) -> usize {
        let mut polished = self.polish.run(problem, start, session);
        polished.verdict = Verdict::Refined;
        let found = self.measure(problem, polished, session);
        let most = (1.0 + TOLERANCE) * tried.first.score + self.tolerance;
        if found.score <= most && found.color.is_telling() {
            tried.others.push(found);
        }
        polished.iterations
    }

    /// Returns the candidate near a pose whose colors agree best, if they agree better there.
    fn nearby(
        &mut self,
        problem: &Problem<'_>,
        from: &Measured,
        (candidates, distinct): (&[Isometry3<f64>], &Distinct),
        session: &mut Session<'_>,
    ) -> Option<Isometry3<f64>> {
        let near = candidates.iter();
        let near = near.filter(|other| !distinct.apart(other, from.pose()));
        let near: Vec<_> = near.collect();
        let step = near.len().div_ceil(NEARBY).max(1);
        let mut context = session.context(problem);
        let mut best = (from.color.correlation, None);
        for pose in near.into_iter().step_by(step) {
            let color = self.agreement.measure(&mut context, pose);
            if color.correlation > best.0 {
                best = (color.correlation, Some(*pose));
            }
        }
        best.1
    }

    /// Lists the alternatives to the chosen pose, those that color does not tell apart first.
    fn list(
        &mut self,
        problem: &Problem<'_>,
        chosen: &Measured,
        tried: &Tried<'_>,
        session: &mut Session<'_>,
    ) {
        let (pose, distinct) = (chosen.pose(), tried.distinct);
        let mut list = std::mem::take(&mut session.workspace.alternatives);
        for other in tried.all() {
            let (other, score) = (*other.pose(), other.score);
            let same = |old: &Alternative| !distinct.apart(&old.camera_from_object, &other);
            if !list.iter().any(same) {
                list.push(Alternative {
                    camera_from_object: other,
                    score,
                    gap: 0.0,
                    color_gap: None,
                    mssd_meters: 0.0,
                    rotation_degrees: 0.0,
                });
            }
        }
        list.retain(|other| distinct.apart(&other.camera_from_object, pose));
        for alternative in &mut list {
            let other = &alternative.camera_from_object;
            alternative.gap = alternative.score - chosen.score;
            alternative.mssd_meters = distinct.mssd(other, pose);
            alternative.rotation_degrees = distinct.degrees(other, pose);
            if alternative.gap < self.tolerance && tried.agrees(&chosen.color) {
                let known = tried.all().find(|tried| tried.pose() == other);
                let color = match known {
                    Some(known) => known.color,
                    None => {
                        let mut context = session.context(problem);
                        self.agreement.measure(&mut context, other)
                    }
                };
                alternative.color_gap = Some(chosen.color.correlation - color.correlation);
            }
        }
        list.sort_by(|a, b| {
            let ambiguous = b.is_ambiguous().cmp(&a.is_ambiguous());
            ambiguous.then(a.score.total_cmp(&b.score))
        });
        session.workspace.alternatives = list;
    }
}

/// Adds a pose to a short list, best first. Of two that are not distinct, the better stays.
fn insert(list: &mut Vec<(f64, Isometry3<f64>)>, new: (f64, Isometry3<f64>), distinct: &Distinct) {
    let place = list.partition_point(|(score, _)| *score <= new.0);
    let same = |other: &(f64, Isometry3<f64>)| !distinct.apart(&other.1, &new.1);
    if place >= POLISHED || list[..place].iter().any(same) {
        return;
    }
    list.retain(|other| other.0 <= new.0 || !same(other));
    list.insert(place, new);
    list.truncate(POLISHED);
}

impl<S: Stage, P: Stage, C: Score> Stage for ColorChoice<S, P, C> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        let outcome = self.stage.run(problem, init, session);
        let colored = |(model, observation): &(&Model, &Observation)| {
            let seen = observation.has_surface() && observation.color().is_some();
            seen && self.color.can_tell(model)
        };
        let Some((model, _)) = problem.sides().filter(colored) else {
            return outcome;
        };
        // In a search, other poses are refined, too, and the choice follows.
        let early = session.searching || outcome.termination == Termination::Stopped;
        if early || !se3::is_finite(init) {
            return outcome;
        }
        let distinct = Distinct::of(model);
        self.choose(problem, &distinct, outcome, session)
    }

    fn time_limit(&self) -> Option<Duration> {
        self.stage.time_limit()
    }

    fn name(&self) -> &'static str {
        "color-choice"
    }
}
