//! Global search over hypotheses.

use std::time::{Duration, Instant};

use hicp_core::{Isometry3, Problem, se3, so3};
use hicp_score::Score;

use crate::outcome::{Outcome, Termination, Verdict};
use crate::session::Session;
use crate::stage::hypotheses::{Hypotheses, Rotations};
use crate::stage::stage_trait::Stage;
use crate::stop::motion::Bound;

/// How far, how long and when a [`HypothesisSearch`] searches. Any value is valid: what is out of range searches nothing, or
/// nothing better is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchOptions {
    /// The score above which the search begins: where the local stage ends at or below it, nothing else is tried.
    pub threshold: f64,
    /// The score at which no further hypothesis is refined.
    pub good_enough: f64,
    /// By how much a hypothesis must beat the local pose to take its place: where masks are imperfect the score is no
    /// better judge than that.
    pub min_gain: f64,
    /// Which rotations are tried, beside the neighbours of the initial pose.
    pub rotations: Rotations,
    /// How many of them.
    pub hypotheses: usize,
    /// How many of the best ranked are refined.
    pub refined: usize,
    /// How far apart the rotations of those are at least, degrees: of two that are nearer the better ranked is kept. 0 drops
    /// what is there twice alone.
    pub spacing_degrees: f64,
    /// How far from the initial pose the result may be; `None` for anywhere.
    pub bound: Option<Bound>,
    /// How long a run may take; the best pose so far is returned with [`Termination::Deadline`]. Results then depend on the
    /// clock; `hypotheses` and `refined` are the budget that does not. The clock is read between hypotheses, so that a run
    /// ends later by at most one of them.
    pub time_limit: Option<Duration>,
}

impl Default for SearchOptions {
    /// 256 rotations of SO(3), 12 refined that are at least 20° apart, above a score of 0.15, without bound; a hypothesis must be
    /// better by 0.03.
    fn default() -> Self {
        Self {
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

/// Runs a local stage, and where its score stays bad, searches: hypotheses are ranked by a cheap score, the best of them refined
/// by a cheap stage, and the one that ends with the lowest score by the local stage, which is kept if it is better.
///
/// **This is not local refinement.** Unless a bound is set it can end anywhere in the image, and on an object that looks the
/// same from several sides it can land on an equivalent pose.
///
/// Hypotheses are rotations from [`SearchOptions::rotations`] and neighbours of the initial and the local pose, each placed so
/// that what it shows lies about the centroid of what was observed. None is refined that lies near a better ranked one.
///
/// **Contract**: the score of the returned pose is never above that of the local stage's: whether that is better than the initial one
/// is the local stage's to know, see [`crate::Guard`]. With a bound no pose outside of it is returned; where the local stage's is,
/// the initial one stands in for it.
///
/// Cost: the local stage; where its score stays above the threshold, `hypotheses` × the ranking score, `refined` × the exploring
/// stage, and the local stage once more.
#[derive(Clone, Debug, PartialEq)]
pub struct HypothesisSearch<S, E, R, C> {
    /// Refines the initial pose, and the best hypothesis.
    pub stage: S,
    /// Refines hypotheses, cheaply.
    pub explore: E,
    /// Ranks hypotheses; lower is better.
    pub ranking: R,
    /// Judges poses; lower is better.
    pub score: C,
    /// How far, how long and when.
    pub options: SearchOptions,
    /// The best ranked hypotheses, best first.
    ranked: Vec<(f64, Isometry3<f64>)>,
}

impl<S, E, R, C> HypothesisSearch<S, E, R, C> {
    /// Makes the stage.
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

    /// Puts a hypothesis into the list of the best, unless it is too near to a better one; one that is too near and not better
    /// leaves the list for it.
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

/// A pose found, with its score.
#[derive(Clone, Copy)]
struct Found {
    score: f64,
    outcome: Outcome,
}

impl<S: Stage, E: Stage, R: Score, C: Score> HypothesisSearch<S, E, R, C> {
    /// Scores an outcome: `None` where it is the pose that it started from, which nobody evaluated, or outside of the bound.
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

    /// Ranks hypotheses into the list of the best, as many as there is time for.
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
        // With the one that is pushed out again.
        self.ranked.reserve(options.refined.min(MAX_REFINED) + 1);
        let hypotheses = from
            .neighbors(init)
            .chain(from.neighbors(local))
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

    /// Refines the ranked hypotheses and returns the best, after the local stage, and the iterations spent.
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

/// More hypotheses than this are never refined: their list is kept in order.
const MAX_REFINED: usize = 10_000;

/// When a run has to end.
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
        let mut local = self.stage.run(problem, init, session);
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
        let score = found.map_or_else(
            || {
                let mut context = session.workspace.context(problem);
                self.score.score(&mut context, init)
            },
            |found| found.score,
        );
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

    /// The scores and angles of what is refined, of hypotheses that are turned about one axis.
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
    fn what_is_there_twice_takes_one_place() {
        let neighbors = [(0.5, 0.0), (0.6, 5.0), (0.7, 90.0)];
        let both = [neighbors, neighbors].concat();
        assert_eq!(listed(0.0, &both), neighbors);
        assert_eq!(listed(20.0, &both), [(0.5, 0.0), (0.7, 90.0)]);
    }

    #[test]
    fn of_two_that_are_near_the_better_stays() {
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
