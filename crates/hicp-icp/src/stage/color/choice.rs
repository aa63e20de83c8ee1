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
/// 3. **Comparison**: if the colors still agree only roughly, [`ColorAgreement`] ranks the best 24
///    candidates again, and `polish` refines the best three.
/// 4. **Decision**: by [`ColorAgreement`]. Another pose replaces the stage's pose only if its score
///    in depth is nearly as good, its colors agree clearly better, and no pose near the stage's
///    pose agrees as well.
/// 5. **Depth**: the stage refines the chosen pose, without a search, unless there are candidates
///    near it, such as the rotations of a can. An error in the alignment of the color image then
///    moves only poses that depth does not determine.
///
/// [`Alternative::color_gap`] then has the margin of each alternative that is nearly as good in
/// depth.
///
/// Without colors, or without a contrast, the result is that of the stage, bit for bit. A bound of
/// the stage does not limit the choice. Within a [`HypothesisSearch`](crate::HypothesisSearch), it
/// only runs its stage: put it around the search.
///
/// Cost: nothing without colors, or with a model of one color. Otherwise some 20 µs if depth leaves
/// no choice, 1 ms if it does but the colors agree at the pose of the stage, and 2 to 20 ms if they
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
/// MSSD up to which two candidates count as the same, as a share of the diameter.
const SAME: f64 = 0.04;
/// Number of poses of a ranking that are polished.
const POLISHED: usize = 3;
/// Number of best ranked candidates whose colors are compared in a render.
const COMPARED: usize = 24;

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
        let limit = SAME * model.diameter();
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

impl<S: Stage, P: Stage, C: Score> ColorChoice<S, P, C> {
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
        self.rank(problem, ranked, session);
        let mut starts = Vec::new();
        for ranked in &self.ranked {
            insert(&mut starts, *ranked, distinct);
        }
        let mut iterations =
            outcome.iterations + self.polish_all(problem, &starts, &mut tried, session);
        if !tried.is_sure() {
            let mut compared = self.compare(problem, distinct, session);
            compared.retain(|(_, pose)| starts.iter().all(|(_, polished)| polished != pose));
            iterations += self.polish_all(problem, &compared, &mut tried, session);
        }
        if !tried.all().any(|tried| tried.color.is_telling()) {
            return outcome;
        }
        let chosen = tried.chosen();
        let fitted = self.fit_depth(problem, chosen, (&tried, &candidates), session);
        iterations += fitted.outcome.iterations - chosen.outcome.iterations;
        self.list(problem, &fitted, &tried, session);
        Outcome {
            iterations,
            ..fitted.outcome
        }
    }

    /// Ranks poses by the colors of samples, best first.
    fn rank(&mut self, problem: &Problem<'_>, poses: &[Isometry3<f64>], session: &mut Session<'_>) {
        self.ranked.clear();
        for pose in poses {
            let score = self.color.score(&mut session.context(problem), pose);
            self.ranked.push((score, *pose));
        }
        self.ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    }

    /// Ranks the best ranked poses by renders, which average the colors of more places.
    fn compare(
        &mut self,
        problem: &Problem<'_>,
        distinct: &Distinct,
        session: &mut Session<'_>,
    ) -> Vec<(f64, Isometry3<f64>)> {
        let limit = SAME * problem.model().map_or(0.0, Model::diameter);
        let (mut compared, mut best) = (Vec::with_capacity(COMPARED), Vec::new());
        for (_, pose) in &self.ranked {
            if compared.len() == COMPARED {
                break;
            }
            let same = |other: &Isometry3<f64>| distinct.mssd(other, pose) < limit;
            if compared.iter().any(same) {
                continue;
            }
            compared.push(*pose);
            let score = self.agreement.score(&mut session.context(problem), pose);
            insert(&mut best, (score, *pose), distinct);
        }
        best
    }

    /// Refines a polished pose by depth, if depth determines it and its score is then not higher.
    fn fit_depth(
        &mut self,
        problem: &Problem<'_>,
        chosen: &Measured,
        (tried, candidates): (&Tried<'_>, &[Isometry3<f64>]),
        session: &mut Session<'_>,
    ) -> Measured {
        let (pose, distinct) = (chosen.pose(), tried.distinct);
        let same = SAME * problem.model().map_or(0.0, Model::diameter);
        let is_near = |other: &Isometry3<f64>| {
            distinct.mssd(other, pose) > same && !distinct.apart(other, pose)
        };
        if pose == tried.first.pose() || candidates.iter().any(is_near) {
            return *chosen;
        }
        session.searching = true;
        let next = self.stage.run(problem, pose, session);
        session.searching = false;
        let outcome = chosen.outcome.then(next);
        let fitted = &outcome.camera_from_object;
        let score = self.score.score(&mut session.context(problem), fitted);
        if score <= chosen.score && !distinct.apart(fitted, pose) {
            return Measured {
                score,
                outcome,
                ..*chosen
            };
        }
        // The iterations were spent.
        let outcome = Outcome {
            iterations: outcome.iterations,
            ..chosen.outcome
        };
        Measured { outcome, ..*chosen }
    }

    /// Polishes poses until the colors of one agree so well that no other is needed.
    ///
    /// Returns the number of iterations.
    fn polish_all(
        &mut self,
        problem: &Problem<'_>,
        starts: &[(f64, Isometry3<f64>)],
        tried: &mut Tried<'_>,
        session: &mut Session<'_>,
    ) -> usize {
        let mut iterations = 0;
        for (_, start) in starts {
            iterations += self.polish(problem, start, tried, session);
            if tried.is_sure() {
                break;
            }
        }
        iterations
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
