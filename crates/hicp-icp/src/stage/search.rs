//! Global search over hypotheses.

use std::time::{Duration, Instant};

use hicp_core::{Isometry3, Problem, se3, so3};
use hicp_score::Score;

use crate::outcome::{Outcome, Termination, Verdict};
use crate::session::Session;
use crate::stage::hypotheses::{Hypotheses, Rotations};
use crate::stage::stage_trait::Stage;
use crate::stop::motion::Bound;

/// The use of the initial pose by a [`HypothesisSearch`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Start {
    /// The local stage refines it, and the search starts if the score stays bad.
    #[default]
    Refined,
    /// It is ignored: the search always runs, and all hypotheses come from the image.
    ///
    /// It may be any finite pose, for example the identity. It is returned only if nothing was
    /// observed or nothing was found. A bound, and other rotations than [`Rotations::Even`], still
    /// refer to it.
    Ignored,
}

/// The range, budget and conditions of a [`HypothesisSearch`].
///
/// Any value is valid: with a value out of range, nothing is searched or nothing better is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchOptions {
    /// The use of the initial pose.
    pub start: Start,
    /// The score above which the search starts.
    ///
    /// If the local stage ends at or below it, no hypotheses are tried.
    pub threshold: f64,
    /// The score at which no further hypotheses are refined.
    pub good_enough: f64,
    /// The gain in score by which a hypothesis must beat the local pose to replace it.
    ///
    /// With imperfect masks, the score does not separate poses better than that.
    pub min_gain: f64,
    /// The rotations to try, next to the neighbors of the initial pose.
    pub rotations: Rotations,
    /// Number of these rotations.
    pub hypotheses: usize,
    /// Number of best ranked hypotheses to refine.
    pub refined: usize,
    /// The smallest angle between the rotations of refined hypotheses, degrees.
    ///
    /// Of two that are nearer, the better ranked one is kept. 0 removes only exact duplicates.
    pub spacing_degrees: f64,
    /// The largest distance of the result from the initial pose; `None` for no limit.
    pub bound: Option<Bound>,
    /// The longest time of a run. At the limit, the best pose so far is returned with
    /// [`Termination::Deadline`].
    ///
    /// Results then depend on the clock; `hypotheses` and `refined` are budgets that do not. The
    /// clock is read between hypotheses, so a run exceeds the limit by at most one of them.
    pub time_limit: Option<Duration>,
}

impl Default for SearchOptions {
    /// 256 rotations of SO(3), of which 12 at least 20° apart are refined, without a bound.
    ///
    /// The search starts above a score of 0.15, and a hypothesis must be better by 0.03.
    fn default() -> Self {
        Self {
            start: Start::Refined,
            threshold: 0.15,
            good_enough: 0.05,
            min_gain: 0.03,
            rotations: Rotations::Even,
            hypotheses: 256,
            refined: 12,
            spacing_degrees: 20.0,
            bound: None,
            time_limit: None,
        }
    }
}

/// Runs a local stage, and searches if its score stays bad.
///
/// The search ranks hypotheses by a cheap score and refines the best of them by a cheap stage. The
/// local stage then refines the one with the lowest score, which is returned if it is better.
///
/// **This is not local refinement.** Unless a bound is set, it can end anywhere in the image. On an
/// object that looks the same from several sides, it can return an equivalent pose.
///
/// Hypotheses are rotations from [`SearchOptions::rotations`], and neighbors of the initial and the
/// local pose. Each is placed such that its visible centroid is the observed one. A hypothesis near
/// a better ranked one is not refined.
///
/// **Contract**: the score of the returned pose is never above that of the local stage's pose. A
/// local stage in a [`Guard`](crate::Guard) is never worse than the initial pose. With a bound, a
/// pose outside of it is never returned; the initial pose replaces a local pose that is outside.
///
/// Cost: the local stage. If its score stays above the threshold, also `hypotheses` × the ranking
/// score, `refined` × the exploring stage, and the local stage once more.
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
    /// The best ranked hypotheses, best first.
    ranked: Vec<(f64, Isometry3<f64>)>,
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
            ranked: Vec::new(),
        }
    }

    /// Inserts a hypothesis into the list of the best, unless it is too near to a better one.
    ///
    /// Hypotheses that are too near and not better leave the list.
    fn list(&mut self, score: f64, pose: Isometry3<f64>) {
        let SearchOptions {
            refined,
            spacing_degrees,
            ..
        } = self.options;
        let place = self.ranked.partition_point(|(other, _)| *other <= score);
        if place >= refined.min(MAX_REFINED) {
            return;
        }
        let near = |other: &(f64, Isometry3<f64>)| {
            let turn = other.1.rotation * pose.rotation.inverse();
            other.1.rotation == pose.rotation || so3::angle(&turn).to_degrees() < spacing_degrees
        };
        if self.ranked[..place].iter().any(near) {
            return;
        }
        let mut index = 0;
        self.ranked.retain(|other| {
            index += 1;
            index <= place || !near(other)
        });
        self.ranked.insert(place, (score, pose));
        self.ranked.truncate(refined.min(MAX_REFINED));
    }
}

/// A refined pose with its score.
#[derive(Clone, Copy)]
struct Found {
    score: f64,
    outcome: Outcome,
}

impl<S: Stage, E: Stage, R: Score, C: Score> HypothesisSearch<S, E, R, C> {
    /// Scores an outcome, or returns `None` if it kept its start or lies outside of the bound.
    fn found(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        outcome: Outcome,
        session: &mut Session<'_>,
    ) -> Option<Found> {
        let pose = &outcome.camera_from_object;
        let allowed = self.options.bound.is_none_or(|b| b.contains(init, pose));
        (outcome.verdict == Verdict::Refined && allowed).then(|| {
            let mut context = session.workspace.context(problem);
            let score = self.score.score(&mut context, pose);
            Found { score, outcome }
        })
    }

    /// Ranks hypotheses into the list of the best, within the time limit.
    fn rank(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        local: &Isometry3<f64>,
        clock: &Clock,
        session: &mut Session<'_>,
    ) {
        self.ranked.clear();
        let Some(from) = Hypotheses::new(problem, init, self.options.bound) else {
            return;
        };
        let options = self.options;
        // One more, for the hypothesis that is removed again.
        self.ranked.reserve(options.refined.min(MAX_REFINED) + 1);
        let near = match options.start {
            Start::Refined => [Some(init), Some(local)],
            Start::Ignored => [None; 2],
        };
        let hypotheses = near
            .into_iter()
            .flatten()
            .flat_map(|pose| from.neighbors(pose))
            .map(Some)
            .chain(from.of(options.rotations, options.hypotheses));
        for pose in hypotheses {
            if clock.is_over() {
                return;
            }
            let Some(pose) = pose else {
                continue;
            };
            let mut context = session.workspace.context(problem);
            let score = self.ranking.score(&mut context, &pose);
            self.list(score, pose);
        }
    }

    /// Refines the ranked hypotheses.
    ///
    /// Returns the best after the local stage, and the number of iterations.
    fn explore(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        clock: &Clock,
        session: &mut Session<'_>,
    ) -> (Option<Found>, usize) {
        let mut best: Option<Found> = None;
        let mut iterations = 0;
        for index in 0..self.ranked.len() {
            if clock.is_over() {
                return (best, iterations);
            }
            let (_, start) = self.ranked[index];
            let outcome = self.explore.run(problem, &start, session);
            iterations += outcome.iterations;
            // A hypothesis that the stage keeps is still another pose than the initial one.
            let outcome = Outcome {
                verdict: Verdict::Refined,
                ..outcome
            };
            if let Some(found) = self.found(problem, init, outcome, session)
                && best.is_none_or(|best| found.score < best.score)
            {
                best = Some(found);
            }
            if outcome.termination == Termination::Stopped {
                return (best, iterations);
            }
            if best.is_some_and(|best| best.score <= self.options.good_enough) {
                break;
            }
        }
        if let Some(explored) = best {
            let start = explored.outcome.camera_from_object;
            let next = self.stage.run(problem, &start, session);
            iterations += next.iterations;
            let outcome = explored.outcome.then(next);
            if let Some(found) = self.found(problem, init, outcome, session)
                && found.score <= explored.score
            {
                best = Some(found);
            }
        }
        (best, iterations)
    }
}

/// The largest number of refined hypotheses: their list is kept in order.
const MAX_REFINED: usize = 10_000;

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
        let clock = Clock::start(self.options.time_limit);
        let ignored = self.options.start == Start::Ignored;
        let mut local = if ignored {
            Outcome::kept(init, Termination::NoPairs)
        } else {
            self.stage.run(problem, init, session)
        };
        if !se3::is_finite(init)
            || problem
                .observation()
                .is_none_or(|seen| seen.n_surfels() == 0)
        {
            return local;
        }
        let stopped = local.termination == Termination::Stopped;
        let mut iterations = local.iterations;
        let found = self.found(problem, init, local, session);
        if found.is_none() && local.verdict == Verdict::Refined {
            local = Outcome::kept(init, Termination::OutOfBounds);
        }
        let score = if ignored {
            f64::INFINITY
        } else {
            found.map_or_else(
                || {
                    let mut context = session.workspace.context(problem);
                    self.score.score(&mut context, init)
                },
                |found| found.score,
            )
        };
        if score > self.options.threshold && !stopped {
            let start = local.camera_from_object;
            self.rank(problem, init, &start, &clock, session);
            let (found, spent) = self.explore(problem, init, &clock, session);
            iterations += spent;
            if let Some(found) = found
                && found.score < score - self.options.min_gain
            {
                local = found.outcome;
            }
            if clock.is_over() {
                local.termination = Termination::Deadline;
                if local.verdict != Verdict::Refined {
                    local.verdict = Verdict::KeptInitial(Termination::Deadline);
                }
            }
        }
        Outcome {
            iterations,
            ..local
        }
    }

    fn name(&self) -> &'static str {
        "hypothesis-search"
    }
}

#[cfg(test)]
mod tests {
    use hicp_core::Vector3;

    use super::*;

    /// Returns scores and angles of the refined hypotheses, for hypotheses rotated around one axis.
    fn listed(spacing_degrees: f64, hypotheses: &[(f64, f64)]) -> Vec<(f64, f64)> {
        let options = SearchOptions {
            refined: 3,
            spacing_degrees,
            ..SearchOptions::default()
        };
        let mut search = HypothesisSearch::new((), (), (), (), options);
        for (score, degrees) in hypotheses {
            search.list(
                *score,
                Isometry3::rotation(Vector3::z() * degrees.to_radians()),
            );
        }
        let turned = |pose: &Isometry3<f64>| pose.rotation.angle().to_degrees().round();
        search
            .ranked
            .iter()
            .map(|(score, pose)| (*score, turned(pose)))
            .collect()
    }

    #[test]
    fn duplicate_hypotheses_are_listed_once() {
        let neighbors = [(0.5, 0.0), (0.6, 5.0), (0.7, 90.0)];
        let both = [neighbors, neighbors].concat();
        assert_eq!(listed(0.0, &both), neighbors);
        assert_eq!(listed(20.0, &both), [(0.5, 0.0), (0.7, 90.0)]);
    }

    #[test]
    fn of_two_near_hypotheses_the_better_stays() {
        let hypotheses = [
            (0.5, 0.0),
            (0.6, 50.0),
            (0.4, 10.0),
            (0.45, 100.0),
            (0.3, 150.0),
        ];
        assert_eq!(
            listed(20.0, &hypotheses),
            [(0.3, 150.0), (0.4, 10.0), (0.45, 100.0)]
        );
        assert_eq!(
            listed(20.0, &[(0.5, 0.0), (0.6, 15.0), (0.4, 30.0)]),
            [(0.4, 30.0), (0.5, 0.0)]
        );
    }
}
