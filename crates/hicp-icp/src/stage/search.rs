//! Global search over hypotheses.

use std::sync::Arc;
use std::time::{Duration, Instant};

use hicp_core::{Isometry3, Model, Observation, Problem, Vector3, se3, so3};
use hicp_score::Score;

use crate::alternative::Alternative;
use crate::outcome::{Outcome, Termination, Verdict};
use crate::session::Session;
use crate::stage::distinct::Distinct;
use crate::stage::hypotheses::Hypotheses;
use crate::stage::near_symmetries::NearSymmetries;
use crate::stage::search_options::{SearchOptions, Start};
use crate::stage::shortlist::Shortlist;
use crate::stage::stage_trait::Stage;

/// Runs a local stage, and searches if its score stays bad.
///
/// 1. **Rank**: hypotheses are rotations from [`SearchOptions::rotations`], and neighbors of the
///    initial and the local pose. Each is placed such that its visible centroid is the observed
///    one. The best that differ are kept.
/// 2. **Refine**: small rotations and shifts lower the ranking score of each, and the exploring
///    stage refines it.
/// 3. **Look-alikes**: poses at which the model nearly covers the best pose, such as a mug that is
///    rotated around its axis, are ranked and refined in the same way. This step also runs if the
///    local pose is good, because the score of a rotated mug is good, too. If the image shows
///    enough of what tells the two poses apart, it costs only a projection of 256 points.
/// 4. **Finish**: the local stage refines the two best poses that differ.
///
/// The best pose is returned if it beats the local pose. The others are in
/// [`Workspace::alternatives`](crate::Workspace::alternatives).
///
/// **This is not local refinement.** Unless a bound is set, it can end anywhere in the image. On an
/// object that looks the same from several sides, it can return an equivalent pose.
///
/// **Contract**: the score of the returned pose is never above that of the local stage's pose. A
/// local stage in a [`Guard`](crate::Guard) is never worse than the initial pose. With a bound, a
/// pose outside of it is never returned; the initial pose replaces a local pose that is outside.
///
/// Cost: the local stage. If its score stays above the threshold, also `hypotheses` × the ranking
/// score, 4/3 `refined` × the exploring stage and 40 ranking scores, and the local stage twice. The
/// near symmetries of a model are found once, in some 10 ms.
#[derive(Clone, Debug, PartialEq)]
pub struct HypothesisSearch<S, E, R, C> {
    /// Refines the initial pose, and the best hypothesis.
    pub stage: S,
    /// Refines hypotheses at low cost.
    pub explore: E,
    /// Ranks hypotheses; lower is better.
    pub ranking: R,
    /// Scores poses; lower is better.
    pub score: C,
    /// Range, budget and conditions.
    pub options: SearchOptions,
    /// The best ranked hypotheses.
    ranked: Shortlist,
    /// The best ranked poses that look like the best pose found.
    ranked_alike: Shortlist,
    /// Those of them that are refined.
    alike: Shortlist,
    /// The distinct poses that were found, best first.
    found: Vec<Found>,
}

impl<S, E, R, C> HypothesisSearch<S, E, R, C> {
    /// Creates the stage.
    #[must_use]
    pub fn new(stage: S, explore: E, ranking: R, score: C, options: SearchOptions) -> Self {
        Self {
            stage,
            explore,
            ranking,
            score,
            options,
            ranked: Shortlist::default(),
            ranked_alike: Shortlist::default(),
            alike: Shortlist::default(),
            found: Vec::new(),
        }
    }

    /// Iterates over the hypotheses that the last search ranked best, with their scores.
    ///
    /// The best comes first. Their number is at most [`SearchOptions::refined`].
    pub fn ranked(&self) -> impl Iterator<Item = &(f64, Isometry3<f64>)> {
        self.ranked.iter()
    }
}

/// A refined pose with its score.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Found {
    score: f64,
    outcome: Outcome,
    /// `true` if the local stage refined it.
    finished: bool,
}

/// A search in progress.
struct Run<'a, 's> {
    problem: &'a Problem<'a>,
    init: &'a Isometry3<f64>,
    distinct: Arc<Distinct>,
    clock: Clock,
    session: &'a mut Session<'s>,
    iterations: usize,
    /// `true` if the observer requested the end.
    stopped: bool,
}

impl Run<'_, '_> {
    fn score(&mut self, score: &mut impl Score, pose: &Isometry3<f64>) -> f64 {
        score.score(&mut self.session.workspace.context(self.problem), pose)
    }

    fn is_over(&self) -> bool {
        self.stopped || self.clock.is_over()
    }
}

impl<S: Stage, E: Stage, R: Score, C: Score> HypothesisSearch<S, E, R, C> {
    /// Adds a pose to the list of those found, unless it lies outside of the bound.
    ///
    /// Of two poses that are not distinct, the one with the lower score stays.
    fn add(&mut self, run: &mut Run<'_, '_>, outcome: Outcome, finished: bool) {
        let pose = &outcome.camera_from_object;
        if self
            .options
            .bound
            .is_some_and(|b| !b.contains(run.init, pose))
        {
            return;
        }
        let score = run.score(&mut self.score, pose);
        let same = |found: &Found| !run.distinct.apart(&found.outcome.camera_from_object, pose);
        if self
            .found
            .iter()
            .any(|found| found.score <= score && same(found))
        {
            return;
        }
        self.found
            .retain(|found| found.score <= score || !same(found));
        let place = self.found.partition_point(|found| found.score <= score);
        let found = Found {
            score,
            outcome,
            finished,
        };
        self.found.insert(place, found);
    }

    /// Ranks hypotheses from the whole range into the list of the best, within the time limit.
    fn rank(&mut self, run: &mut Run<'_, '_>, local: &Isometry3<f64>) {
        self.ranked.clear();
        let options = self.options;
        let Some(from) = Hypotheses::new(run.problem, run.init, options.bound) else {
            return;
        };
        let near = match options.start {
            Start::Refined => [Some(run.init), Some(local)],
            Start::Ignored => [None; 2],
        };
        let hypotheses = near
            .into_iter()
            .flatten()
            .flat_map(|pose| from.neighbors(pose))
            .chain(near[1].copied())
            .map(Some)
            .chain(from.of(options.rotations, options.hypotheses));
        for pose in hypotheses {
            if run.is_over() {
                return;
            }
            let Some(pose) = pose else {
                continue;
            };
            let score = run.score(&mut self.ranking, &pose);
            self.ranked
                .insert(score, pose, options.refined, options.spacing_degrees);
        }
    }

    /// Lists the poses that look like the best one and may explain the image better or as well.
    fn rank_alike(&mut self, run: &mut Run<'_, '_>, best: &Found, bad: bool) {
        self.alike.clear();
        self.ranked_alike.clear();
        let base = &best.outcome.camera_from_object;
        let Some((model, observation)) = run.problem.sides() else {
            return;
        };
        let near = NearSymmetries::of(model);
        if near.is_empty() {
            return;
        }
        let gap = if bad { f64::INFINITY } else { MAX_GAP };
        let limit = run.score(&mut self.ranking, base) + gap;
        let spacing = self.options.spacing_degrees;
        let refined = self.options.refined.div_ceil(3);
        for motion in near.undecided(observation, base, model.diameter()) {
            if run.is_over() {
                return;
            }
            let pose = base * motion;
            let bound = self.options.bound;
            if bound.is_none_or(|b| b.contains(run.init, &pose)) {
                let score = run.score(&mut self.ranking, &pose);
                if score < limit {
                    self.ranked_alike.insert(score, pose, refined, spacing);
                }
            }
        }
        for (ranked, pose) in self.ranked_alike.iter() {
            // The score decides which look-alikes of a good pose are worth refining.
            let (score, count) = if bad {
                (*ranked, usize::MAX)
            } else {
                (run.score(&mut self.score, pose), ALIKE_OF_GOOD)
            };
            if score < best.score + gap {
                self.alike.insert(score, *pose, refined.min(count), spacing);
            }
        }
    }

    /// Moves a pose in smaller and smaller steps while its ranking score falls.
    fn climb(&mut self, run: &mut Run<'_, '_>, start: &Isometry3<f64>) -> Isometry3<f64> {
        let Some(model) = run.problem.model() else {
            return *start;
        };
        let mut best = (run.score(&mut self.ranking, start), *start);
        let mut size = 1.0;
        for _ in 0..CLIMBS {
            let before = best.0;
            for index in 0..12 {
                let pose = moved(&best.1, index, model, size);
                let score = run.score(&mut self.ranking, &pose);
                if score < best.0 {
                    best = (score, pose);
                }
            }
            if best.0 == before {
                size *= 0.5;
            }
        }
        best.1
    }

    /// Refines ranked hypotheses at low cost, until one is good enough.
    fn refine(&mut self, run: &mut Run<'_, '_>, ranked: &Shortlist, enough: f64) {
        for (_, start) in ranked.iter() {
            if run.is_over() {
                return;
            }
            let start = self.climb(run, start);
            let outcome = self.explore.run(run.problem, &start, run.session);
            run.iterations += outcome.iterations;
            run.stopped = outcome.termination == Termination::Stopped;
            // A hypothesis that the stage keeps is still another pose than the initial one.
            let verdict = Verdict::Refined;
            self.add(run, Outcome { verdict, ..outcome }, false);
            let good = |found: &Found| found.score <= enough;
            if self.found.first().is_some_and(good) {
                return;
            }
        }
    }

    /// Refines the best of all poses found by the local stage.
    fn finish(&mut self, run: &mut Run<'_, '_>) {
        let Some(best) = self.found.first().map(|found| found.score) else {
            return;
        };
        for _ in 0..FINALISTS {
            let next = |found: &&Found| !found.finished && found.score <= best + FINAL_GAP;
            let Some(explored) = self.found.iter().find(next).copied() else {
                return;
            };
            if run.is_over() {
                return;
            }
            let start = explored.outcome.camera_from_object;
            let next = self.stage.run(run.problem, &start, run.session);
            run.iterations += next.iterations;
            run.stopped = next.termination == Termination::Stopped;
            self.add(run, explored.outcome.then(next), true);
            for other in &mut self.found {
                other.finished |= other.outcome == explored.outcome;
            }
        }
    }

    /// Writes the poses found apart from the returned one into the workspace.
    fn write_alternatives(&self, run: &mut Run<'_, '_>, pose: &Isometry3<f64>, score: f64) {
        let alternatives = &mut run.session.workspace.alternatives;
        alternatives.reserve(self.found.len());
        for found in &self.found {
            let other = found.outcome.camera_from_object;
            if run.distinct.apart(&other, pose) {
                alternatives.push(Alternative {
                    camera_from_object: other,
                    score: found.score,
                    gap: found.score - score,
                    mssd_meters: run.distinct.mssd(&other, pose),
                    rotation_degrees: run.distinct.degrees(&other, pose),
                });
            }
        }
    }
}

/// Number of distinct poses that the local stage refines, and the largest gap in score between them
/// and the best one.
const FINALISTS: usize = 2;
const FINAL_GAP: f64 = 0.05;
/// Number of refined poses that look like a good pose.
const ALIKE_OF_GOOD: usize = 2;
/// Gap in score up to which a pose looks like a good one before it is refined.
const MAX_GAP: f64 = 0.05;

/// Number of rounds of a climb, its first rotations, degrees, and its first shifts, as a share of
/// the diameter.
const CLIMBS: usize = 3;
const CLIMB_DEGREES: f64 = 20.0;
const CLIMB_DIAMETERS: f64 = 0.1;

/// Returns a pose that is rotated around the object's center or shifted along an axis.
///
/// Of the twelve moves, the first six are rotations.
fn moved(pose: &Isometry3<f64>, index: usize, model: &Model, size: f64) -> Isometry3<f64> {
    let mut axis = Vector3::zeros();
    axis[index / 2 % 3] = if index.is_multiple_of(2) { size } else { -size };
    let motion = if index < 6 {
        let (turn, center) = (
            so3::exp(&(axis * CLIMB_DEGREES.to_radians())),
            model.center().coords,
        );
        Isometry3::from_parts((center - turn * center).into(), turn)
    } else {
        let shift = axis * CLIMB_DIAMETERS * model.diameter();
        Isometry3::translation(shift.x, shift.y, shift.z)
    };
    pose * motion
}

/// The deadline of a run.
struct Clock(Option<(Instant, Duration)>);

impl Clock {
    fn start(limit: Option<Duration>) -> Self {
        Self(limit.map(|limit| (Instant::now(), limit)))
    }

    fn is_over(&self) -> bool {
        self.0
            .is_some_and(|(begun, limit)| begun.elapsed() >= limit)
    }
}

impl<S: Stage, E: Stage, R: Score, C: Score> Stage for HypothesisSearch<S, E, R, C> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        if let Some(part) = self.score.unsupported(problem) {
            return Outcome::kept(init, Termination::Unsupported(part));
        }
        let clock = Clock::start(self.options.time_limit);
        let ignored = self.options.start == Start::Ignored;
        let mut local = match self.options.start {
            Start::Refined => self.stage.run(problem, init, session),
            Start::Ignored => Outcome::kept(init, Termination::NoPairs),
        };
        self.found.clear();
        session.workspace.alternatives.clear();
        let seen = |(_, observation): (_, &Observation)| observation.n_surfels() > 0;
        let Some((model, _)) = problem.sides().filter(|sides| seen(*sides)) else {
            return local;
        };
        if !se3::is_finite(init) {
            return local;
        }
        let mut run = Run {
            problem,
            init,
            distinct: Distinct::of(model),
            clock,
            iterations: local.iterations,
            stopped: local.termination == Termination::Stopped,
            session,
        };
        let allowed = self
            .options
            .bound
            .is_none_or(|b| b.contains(init, &local.camera_from_object));
        if !allowed {
            local = Outcome::kept(init, Termination::OutOfBounds);
        }
        let mut score = f64::INFINITY;
        if !ignored {
            self.add(&mut run, local, true);
            score = self.found.first().map_or(score, |found| found.score);
        }
        let bad = score > self.options.threshold;
        if bad {
            self.rank(&mut run, &local.camera_from_object);
            let ranked = std::mem::take(&mut self.ranked);
            self.refine(&mut run, &ranked, self.options.good_enough);
            self.ranked = ranked;
        }
        if let Some(best) = self.found.first().copied() {
            self.rank_alike(&mut run, &best, bad);
            let alike = std::mem::take(&mut self.alike);
            self.refine(&mut run, &alike, f64::NEG_INFINITY);
            self.alike = alike;
        }
        self.finish(&mut run);
        let mut returned = local;
        if let Some(best) = self.found.first()
            && best.score < score - self.options.min_gain
        {
            (returned, score) = (best.outcome, best.score);
        }
        self.write_alternatives(&mut run, &returned.camera_from_object, score);
        if bad && run.clock.is_over() {
            returned.termination = Termination::Deadline;
            if returned.verdict != Verdict::Refined {
                returned.verdict = Verdict::KeptInitial(Termination::Deadline);
            }
        }
        Outcome {
            iterations: run.iterations,
            ..returned
        }
    }

    fn name(&self) -> &'static str {
        "hypothesis-search"
    }
}
