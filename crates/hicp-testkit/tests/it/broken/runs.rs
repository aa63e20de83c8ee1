//! Stop rules, scores, switchers, stages and renderers with a fault.

use hicp_testkit::{
    RendererLaws, ScoreLaws, StageLaws, StopRuleLaws, SwitcherLaws, check_renderer, check_score,
    check_stage, check_stop_rule, check_switcher,
};
use hybrid_icp::core::{
    Context, Isometry3, Iteration, Observation, PinholeCamera, PixelRegion, Problem, RenderedView,
    Renderer, TriMesh,
};
use hybrid_icp::icp::{
    Judgment, Outcome, Progress, Regime, RegimeEvent, Session, Stage, StopRule, Termination,
};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::Score;
use hybrid_icp::switch::Switcher;

use super::caught;

/// A rule that counts iterations and does not reset the count.
struct Forgets(usize);

impl StopRule for Forgets {
    fn check(&mut self, _iteration: &Iteration<'_>, _progress: &Progress<'_>) -> Judgment {
        self.0 += 1;
        if self.0 > 4 {
            Judgment::Accept(Termination::Converged)
        } else {
            Judgment::Continue
        }
    }
}

#[test]
fn a_stop_rule_that_does_not_reset_is_detected() {
    caught("start forgets", || {
        check_stop_rule(|| Forgets(0), StopRuleLaws::default());
    });
}

/// A score that is NaN if nothing is observed, or that renders another pose.
struct Share {
    elsewhere: bool,
}

impl Score for Share {
    fn score(&mut self, context: &mut Context<'_>, pose: &Isometry3<f64>) -> f64 {
        let n = context
            .problem
            .observation()
            .map_or(0, Observation::n_surfels) as f64;
        if self.elsewhere {
            context.view(&(Isometry3::translation(0.0, 0.0, 1e-9) * pose));
            return 0.5;
        }
        0.0 / n
    }
}

impl Switcher for Share {
    fn regime(&mut self, context: &mut Context<'_>, pose: &Isometry3<f64>) -> RegimeEvent {
        RegimeEvent {
            regime: Regime(if self.elsewhere { 2 } else { 0 }),
            score: Some(self.score(context, pose)),
        }
    }
}

#[test]
fn broken_scores_and_switchers_are_detected() {
    let share = |elsewhere| move || Share { elsewhere };
    let laws = ScoreLaws::default();
    caught("never NaN", || check_score(share(false), laws));
    caught("shares the render", || check_score(share(true), laws));
    let laws = SwitcherLaws::default();
    caught("never NaN", || check_switcher(share(false), laws));
    caught("regime", || check_switcher(share(true), laws));
}

/// A stage that loses the initial pose if nothing is observed, or returns a pose without
/// evaluation.
struct Rash {
    kept: bool,
}

impl Stage for Rash {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        _: &mut Session<'_>,
    ) -> Outcome {
        let nothing = problem
            .observation()
            .is_none_or(|seen| seen.n_surfels() == 0);
        let pose = match (self.kept, nothing) {
            (true, true) => Isometry3::identity(),
            (false, false) => Isometry3::translation(0.0, 0.0, 1e-3) * init,
            _ => *init,
        };
        if self.kept {
            Outcome::kept(&pose, Termination::NoPairs)
        } else {
            Outcome::refined(pose, Termination::NoPairs)
        }
    }
}

#[test]
fn broken_stages_are_detected() {
    let laws = StageLaws::default();
    caught("a kept pose", || check_stage(|| Rash { kept: true }, laws));
    caught("accept after evaluation", || {
        check_stage(|| Rash { kept: false }, laws);
    });
}

/// A renderer that sets a triangle for pixels without depth.
#[derive(Default)]
struct NoTriangles(Rasterizer);

impl Renderer for NoTriangles {
    fn render(
        &mut self,
        mesh: &TriMesh,
        camera: &PinholeCamera,
        pose: &Isometry3<f64>,
        region: &PixelRegion,
        view: &mut RenderedView,
    ) {
        self.0.render(mesh, camera, pose, region, view);
        view.buffers_mut().1.fill(0);
    }
}

#[test]
fn broken_renderers_are_detected() {
    caught("if and only if it has a triangle", || {
        check_renderer(NoTriangles::default, RendererLaws::default());
    });
}
