//! The stage that searches.

use std::time::Duration;

use hicp_core::{Isometry3, Problem, se3};
use hicp_score::Score;

use crate::outcome::{Outcome, Termination, Verdict};
use crate::session::Session;
use crate::stage::search::distinct::Distinct;
use crate::stage::search::found::{CLEAR, Found, FoundPoses, LEAST_DOUBT, Progress};
use crate::stage::search::hypotheses::Hypotheses;
use crate::stage::search::look_alikes::{LookAlikes, is_unique, nearest_to_initial};
use crate::stage::search::options::{SearchOptions, Start};
use crate::stage::search::run::{Clock, Run};
use crate::stage::search::shortlist::Shortlist;
use crate::stage::stage_trait::Stage;

/// Runs a local stage, and searches if its score stays bad.
///
/// 1. **Rank**: hypotheses are rotations from [`SearchOptions::rotations`], and neighbors of the
///    initial and the local pose. Each is placed such that its visible centroid is the observed
///    one. The best are kept.
/// 2. **Align**: a stage that costs as much as some scores moves each to the image. The best that
///    differ are kept. If the local pose is near the initial one, a hypothesis must win by more, so
///    only a quarter of the best are aligned and refined.
/// 3. **Try**: the finishing stage fits the best of the first 32. If that is good enough, the
///    others are not aligned, and nothing is explored. A pose that other poses may look like must
///    also have a score of at most 0.005.
/// 4. **Explore**: a stage that costs some hundred scores refines each. If the best pose is still
///    bad, and the local pose is far from the initial one, [`SearchOptions::widens`] repeats steps
///    2 and 4 for all ranked hypotheses. Twice as many are then refined, and they differ by half as
///    much.
/// 5. **Look-alikes**: poses at which the model nearly covers the best pose, such as a mug that is
///    rotated around its axis, are ranked and refined in the same way. This step also runs if the
///    local pose is good, because the score of a rotated mug is good, too. Look-alikes of a good
///    pose are listed as they are. If the image shows enough of what tells the two poses apart, it
///    costs only a projection of 256 points.
/// 6. **Finish**: the finishing stage fits the two best poses that differ, and up to a half of
///    `refined` if all stay doubtful. They are compared by score + doubt / 10, before the fit and
///    after it. Then the local stage refines the best one. If the local pose is far from the
///    initial one, it also refines up to three others within 0.04. If no pose can beat the local
///    one by the gain, one fit of another pose is enough, for the list of the others.
///
/// The best pose is returned if it beats the local pose by [`SearchOptions::near_gain`], or by
/// [`SearchOptions::far_gain`] if the local pose is far from the initial one. A certain pose
/// needs no gain: it is nearly without doubt and clearly better than every other one. A look-alike
/// of the best pose replaces it if its rotation is nearer to the initial one and its score is at
/// most 0.02 higher, or 0.01 if the best pose is certain. The initial rotation then decides: that
/// of a can, for example, may be known from another source. The other poses are in
/// [`Workspace::alternatives`](crate::Workspace::alternatives).
///
/// Within another search, it only runs its local stage.
///
/// The observer receives every refined pose as a decision: it is kept if it joins the list of poses
/// found. The pose that replaces the local one is the last decision.
///
/// **This is not local refinement.** Unless a bound is set, it can end anywhere in the image, also
/// at an equivalent pose of an object that looks the same from several sides.
///
/// **Contract**: the score of the returned pose is never above that of the local stage's pose. A
/// local stage in a [`Guard`](crate::Guard) is never worse than the initial pose. With a bound, a
/// pose outside of it is never returned; the initial pose replaces a local pose that is outside.
///
/// Cost: the local stage. If doubt × score is above the threshold, a search adds:
///
/// - The ranking score, `hypotheses` times.
/// - The aligning stage, `aligned` times.
/// - The exploring stage, up to `refined` + 8 times.
/// - The finishing stage, three or four times, or up to `refined` / 2 times if all poses stay
///   doubtful.
/// - The local stage, up to four times.
///
/// If the search widens, it costs about three times as much. The near symmetries of a model are
/// found once, in some 20 ms.
#[derive(Clone, Debug, PartialEq)]
pub struct HypothesisSearch<S, A, E, F, R, C, D> {
    /// Refines the initial pose, and the pose found.
    pub stage: S,
    /// Moves many hypotheses to the image, at the cost of some scores.
    pub align: A,
    /// Refines the best hypotheses at low cost.
    pub explore: E,
    /// Fits the poses that may be the right one to all pixels.
    pub finish: F,
    /// Ranks hypotheses; lower is better.
    pub ranking: R,
    /// Compares poses; lower is better.
    pub score: C,
    /// Decides whether a pose is good enough; lower is better.
    pub doubt: D,
    /// Range, budget and conditions.
    pub options: SearchOptions,
    /// The best placed hypotheses, and the best aligned ones.
    ranked: Shortlist,
    aligned: Shortlist,
    /// The poses that were explored.
    explored: Vec<Isometry3<f64>>,
    alike: LookAlikes,
    found: FoundPoses,
}

impl<S, A, E, F, R, C, D> HypothesisSearch<S, A, E, F, R, C, D> {
    /// Creates the search from its local stage, its other stages, its scores and its options.
    #[must_use]
    pub fn new(
        stage: S,
        (align, explore, finish): (A, E, F),
        (ranking, score, doubt): (R, C, D),
        options: SearchOptions,
    ) -> Self {
        Self {
            stage,
            align,
            explore,
            finish,
            ranking,
            score,
            doubt,
            options,
            ranked: Shortlist::default(),
            aligned: Shortlist::default(),
            explored: Vec::new(),
            alike: LookAlikes::default(),
            found: FoundPoses::default(),
        }
    }

    /// Iterates over the hypotheses that the last search ranked best, with their scores.
    ///
    /// The best comes first.
    pub fn ranked(&self) -> impl Iterator<Item = &(f64, Isometry3<f64>)> {
        self.ranked.poses().iter()
    }
}

impl<S: Stage, A: Stage, E: Stage, F: Stage, R: Score, C: Score, D: Score>
    HypothesisSearch<S, A, E, F, R, C, D>
{
    /// Adds a pose to the list of those found, unless it lies outside of the bound.
    fn add(&mut self, run: &mut Run<'_, '_>, outcome: Outcome, progress: Progress) {
        let pose = &outcome.camera_from_object;
        if run.allows(pose) {
            let scored = Found {
                score: run.score(&mut self.score, pose),
                outcome,
                doubt: None,
                progress,
            };
            let found = match progress {
                Progress::Explored => scored,
                Progress::Fitted | Progress::Refined => self.judged(run, scored, progress),
            };
            let best = self.found.best().map_or(f64::INFINITY, |best| best.score);
            let kept = self.found.add(found, &run.distinct);
            run.report(pose, (found.score, best), kept);
        }
    }

    /// Returns a scored pose with its doubt and its progress.
    fn judged(&mut self, run: &mut Run<'_, '_>, scored: Found, progress: Progress) -> Found {
        let pose = scored.outcome.camera_from_object;
        let judge = || run.score(&mut self.doubt, &pose);
        Found {
            doubt: Some(scored.doubt.unwrap_or_else(judge)),
            progress,
            ..scored
        }
    }

    /// Adds a pose to the list of those found, or its fit if that costs less.
    fn fit(&mut self, run: &mut Run<'_, '_>, scored: Found) {
        let start = self.judged(run, scored, Progress::Fitted);
        let next = run.refine(&mut self.finish, &start.outcome.camera_from_object);
        self.found.add(start, &run.distinct);
        self.add(run, start.outcome.then(next), Progress::Fitted);
    }

    /// Returns the doubt in the best pose found, or infinity if there is none.
    fn doubt(&mut self, run: &mut Run<'_, '_>) -> f64 {
        let Some(best) = self.found.best() else {
            return f64::INFINITY;
        };
        let pose = best.outcome.camera_from_object;
        let judge = || run.score(&mut self.doubt, &pose);
        *best.doubt.get_or_insert_with(judge)
    }

    /// Returns whether the best pose found is bad enough to search for another one.
    fn is_bad(&mut self, run: &mut Run<'_, '_>, threshold: f64) -> bool {
        let doubt = self.doubt(run);
        let best = self.found.best();
        best.is_none_or(|best| doubt.max(LEAST_DOUBT) * best.score > threshold)
    }

    /// Returns whether no further poses are needed.
    fn is_good(&mut self, run: &mut Run<'_, '_>) -> bool {
        !self.is_bad(run, UNEXPLAINED) && self.found.best().is_some_and(|best| ends(run, best))
    }

    /// Ranks hypotheses from the whole range into the list of the best, within the time limit.
    fn rank(&mut self, run: &mut Run<'_, '_>, local: &Isometry3<f64>) {
        self.ranked.clear();
        let options = run.options;
        let Some(from) = Hypotheses::new(run.problem, run.init, options.bound) else {
            return;
        };
        let local = (options.start == Start::Refined).then_some(local);
        let kept = if options.widens {
            options.hypotheses
        } else {
            options.aligned
        };
        let hypotheses = local
            .into_iter()
            .flat_map(|local| from.around_both(local))
            .map(Some)
            .chain(from.of(options.rotations, options.hypotheses));
        for (index, pose) in hypotheses.enumerate() {
            if run.is_over_after(index) {
                break;
            }
            if let Some(pose) = pose {
                let score = run.score(&mut self.ranking, &pose);
                self.ranked.push(score, pose, kept);
            }
        }
        self.ranked.keep_best(kept);
    }

    /// Aligns poses and adds the best that differ to the list, `refined` at most.
    fn align(
        &mut self,
        run: &mut Run<'_, '_>,
        ranked: &[(f64, Isometry3<f64>)],
        (refined, spacing_degrees): (usize, f64),
    ) {
        for (index, (score, start)) in ranked.iter().enumerate() {
            if run.is_over_after(index) {
                return;
            }
            let pose = run.refine(&mut self.align, start).camera_from_object;
            let aligned = run.score(&mut self.ranking, &pose);
            let (score, pose) = if aligned < *score {
                (aligned, pose)
            } else {
                (*score, *start)
            };
            self.aligned.insert(score, pose, refined, spacing_degrees);
        }
    }

    /// Fits the best aligned pose within the bound.
    fn try_best(&mut self, run: &mut Run<'_, '_>) {
        let mut poses = self.aligned.poses().iter().map(|(_, pose)| *pose);
        if let Some(pose) = poses.find(|pose| run.allows(pose))
            && !run.is_over_after(0)
        {
            let score = run.score(&mut self.score, &pose);
            self.fit(run, Found::explored(score, pose));
        }
    }

    /// Searches the whole range for poses. A search that has failed goes on if it `widens`.
    fn search(&mut self, run: &mut Run<'_, '_>, local: &Isometry3<f64>) {
        self.rank(run, local);
        let ranked = std::mem::take(&mut self.ranked);
        let poses = ranked.poses();
        let options = run.options;
        let kept = (options.refined, options.spacing_degrees);
        let most = options.aligned.min(poses.len());
        let first = FIRST.min(most);
        self.aligned.clear();
        self.align(run, &poses[..first], kept);
        self.try_best(run);
        if !self.is_good(run) {
            self.align(run, &poses[first..most], kept);
            self.explore(run, true);
            if options.widens && self.is_bad(run, options.threshold.max(FAILED)) {
                self.aligned.clear();
                self.align(run, poses, (2 * kept.0, 0.5 * kept.1));
                self.explore(run, true);
            }
        }
        self.ranked = ranked;
    }

    /// Refines the aligned poses at low cost, and ends at a good one if asked to.
    fn explore(&mut self, run: &mut Run<'_, '_>, ends: bool) {
        let aligned = std::mem::take(&mut self.aligned);
        for (_, start) in aligned.poses() {
            if run.is_over() || ends && self.is_good(run) {
                break;
            }
            if self.explored.contains(start) {
                continue;
            }
            self.explored.push(*start);
            let outcome = run.refine(&mut self.explore, start);
            // A hypothesis that the stage keeps is still another pose than the initial one.
            let verdict = Verdict::Refined;
            self.add(run, Outcome { verdict, ..outcome }, Progress::Explored);
        }
        self.aligned = aligned;
    }

    /// Adds poses that look like the best one found. If that is bad, they are refined first.
    fn try_look_alikes(&mut self, run: &mut Run<'_, '_>, threshold: f64) {
        let Some(best) = self.found.best().copied() else {
            return;
        };
        let bad = self.is_bad(run, threshold);
        let mut alike = std::mem::take(&mut self.alike);
        let scores = (&mut self.ranking, &mut self.score);
        let listed = alike.list(run, (&best, bad), scores);
        if bad {
            self.aligned.clear();
            let kept = (run.options.refined, run.options.spacing_degrees);
            self.align(run, listed.poses(), kept);
            self.explore(run, false);
        } else {
            // A look-alike of a pose that fits may fit as it is, and the finish fits the best one.
            for (score, pose) in listed.poses() {
                self.found
                    .add(Found::explored(*score, *pose), &run.distinct);
            }
        }
        self.alike = alike;
    }

    /// Returns the pose nearest to the initial one that looks like `best` and explains the image as
    /// well, up to a gap in score, if it is another one.
    fn nearest_alike(&mut self, run: &mut Run<'_, '_>, best: &Found, gap: f64) -> Option<Found> {
        let start = nearest_to_initial(run, &best.outcome.camera_from_object)?;
        if run.is_over() || run.score(&mut self.score, &start) > best.score + FINAL_GAP {
            return None;
        }
        let next = run.refine(&mut self.stage, &start);
        let outcome = Outcome::refined(start, Termination::Converged).then(next);
        let pose = outcome.camera_from_object;
        let score = run.score(&mut self.score, &pose);
        if score > best.score + gap || !run.allows(&pose) {
            return None;
        }
        Some(Found {
            score,
            outcome,
            doubt: Some(run.score(&mut self.doubt, &pose)),
            progress: Progress::Refined,
        })
    }

    /// Fits the best of all poses found, until one is good enough. Then refines that one, and
    /// others that may be as good.
    ///
    /// If the local pose is not `beatable`, fits one other pose, for the list of alternatives.
    fn finish(&mut self, run: &mut Run<'_, '_>, beatable: bool) {
        let refined = run.options.refined;
        let (fits, refinements) = match beatable {
            true => (FINALISTS.max(refined / 2), (refined / REFINED).max(1)),
            false => (1, 0),
        };
        for finalist in 0..fits {
            let cheapest = self.found.cheapest();
            let enough = finalist >= FINALISTS && cheapest.is_some_and(|best| ends(run, &best));
            if enough || run.is_over_after(finalist) {
                break;
            }
            let Some(explored) = self.found.next_to_fit(FINAL_GAP) else {
                break;
            };
            self.fit(run, explored);
        }
        for finalist in 0..refinements {
            if run.is_over_after(finalist) {
                break;
            }
            let Some(fitted) = self.found.next_to_refine(REFINED_GAP) else {
                break;
            };
            let start = self.judged(run, fitted, Progress::Refined);
            let next = run.refine(&mut self.stage, &start.outcome.camera_from_object);
            self.found.add(start, &run.distinct);
            self.add(run, start.outcome.then(next), Progress::Refined);
        }
    }

    /// Refines the initial pose, and searches for a better one.
    fn find(
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
        self.explored.clear();
        session.workspace.alternatives.clear();
        let seen = problem.sides().filter(|(_, o)| o.has_surface());
        let Some((model, _)) = seen else {
            return local;
        };
        if !se3::is_finite(init) {
            return local;
        }
        let mut run = Run {
            problem,
            init,
            options: self.options,
            distinct: Distinct::of(model),
            clock,
            iterations: local.iterations,
            stopped: local.termination == Termination::Stopped,
            session,
        };
        if !run.allows(&local.camera_from_object) {
            local = Outcome::kept(init, Termination::OutOfBounds);
        }
        let pose = local.camera_from_object;
        let far = ignored || !run.distinct.near(init, &pose);
        let (threshold, gain) = if far {
            (self.options.far_threshold, self.options.far_gain)
        } else {
            run.options = self.options.near();
            (self.options.threshold, self.options.near_gain)
        };
        if !ignored {
            self.add(&mut run, local, Progress::Refined);
        }
        let from = self.found.cheapest();
        // No pose can win by the gain if the cost is lower.
        let beatable = from.is_none_or(|from| from.cost() > gain);
        let bad = beatable && self.is_bad(&mut run, threshold);
        if bad {
            self.search(&mut run, &pose);
        }
        self.try_look_alikes(&mut run, threshold);
        self.finish(&mut run, beatable);
        let (mut returned, mut score) = (local, from.map_or(f64::INFINITY, |from| from.score));
        let wins = |found: &Found, gain| from.is_none_or(|from| found.beats(&from, gain));
        let best = self.found.cheapest().filter(|best| wins(best, gain));
        let certain = from.and_then(|from| self.found.certain(&from));
        if let Some(best) = best.or(certain) {
            let gap = certain.map_or(UNDECIDED, |_| CLEAR);
            let nearest = if ignored {
                None
            } else {
                self.nearest_alike(&mut run, &best, gap)
            };
            let best = nearest.filter(|found| wins(found, 0.0)).unwrap_or(best);
            run.report(&best.outcome.camera_from_object, (best.score, score), true);
            (returned, score) = (best.outcome, best.score);
        }
        self.found.list_alternatives(
            &returned.camera_from_object,
            score,
            &run.distinct,
            &mut run.session.workspace.alternatives,
        );
        if run.stopped {
            returned = returned.ended_by(Termination::Stopped);
        } else if run.clock.is_over() {
            returned = returned.ended_by(Termination::Deadline);
        }
        Outcome {
            iterations: run.iterations,
            ..returned
        }
    }
}

/// Returns whether a pose has so little doubt that no other one is needed.
///
/// The doubt does not know of poses that look alike. So the image must decide among them, unless
/// none can explain it clearly better.
fn ends(run: &Run<'_, '_>, best: &Found) -> bool {
    best.doubt() <= run.options.good_enough
        && (best.score <= EXPLAINED || is_unique(run, &best.outcome.camera_from_object))
}

/// Number of best ranked hypotheses that are aligned before the best of them is tried.
const FIRST: usize = 32;
/// Product of doubt and score above which even a confident pose is not good enough: a score of .04.
const UNEXPLAINED: f64 = 0.002;
/// Score of a pose that explains so much that no other one is clearly better.
const EXPLAINED: f64 = 0.005;
/// Product of doubt and score above which the search of a part of the hypotheses has failed.
const FAILED: f64 = 0.02;
/// Number of distinct poses that are fitted, even if one is good enough.
const FINALISTS: usize = 2;
/// Largest gap in score between them and the best one.
const FINAL_GAP: f64 = 0.1;
/// Number of refined hypotheses per pose that the local stage refines at the end.
const REFINED: usize = 6;
/// Largest gap in cost between them and the best one.
const REFINED_GAP: f64 = 0.04;
/// Gap in score that errors of the sensor and the model can explain.
const UNDECIDED: f64 = 0.02;

impl<S: Stage, A: Stage, E: Stage, F: Stage, R: Score, C: Score, D: Score> Stage
    for HypothesisSearch<S, A, E, F, R, C, D>
{
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        // The outer search finds the poses, and this one only refines them.
        if session.searching {
            return self.stage.run(problem, init, session);
        }
        session.searching = true;
        let outcome = self.find(problem, init, session);
        session.searching = false;
        outcome
    }

    fn time_limit(&self) -> Option<Duration> {
        self.options.time_limit
    }

    fn name(&self) -> &'static str {
        "hypothesis-search"
    }
}
