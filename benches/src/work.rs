//! Counts what a run does, from outside: through an [`Observer`] and a [`Renderer`] around the rasterizer.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use hybrid_icp::core::{Isometry3, PinholeCamera, PixelRegion, RenderedView, Renderer, TriMesh};
use hybrid_icp::icp::{IterationEvent, Observer, RegimeEvent, StageEvent, Termination};
use hybrid_icp::raster::Rasterizer;

/// What the renders of a run did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RenderWork {
    /// Renders made, hits of the cache not counted.
    pub renders: u64,
    /// Pixels of the views: what has to be cleared.
    pub pixels: u64,
    /// Pixels of them that show the object.
    pub filled: u64,
    /// Triangles that the renderer was given.
    pub triangles: u64,
}

/// A rasterizer that counts. Clones share their counts.
#[derive(Clone, Debug, Default)]
pub struct CountingRenderer {
    rasterizer: Rasterizer,
    counts: Arc<[AtomicU64; 4]>,
}

impl CountingRenderer {
    /// What was rendered since the last call.
    #[must_use]
    pub fn take(&self) -> RenderWork {
        let [renders, pixels, filled, triangles] =
            std::array::from_fn(|i| self.counts[i].swap(0, Ordering::Relaxed));
        RenderWork {
            renders,
            pixels,
            filled,
            triangles,
        }
    }
}

impl Renderer for CountingRenderer {
    fn render(
        &mut self,
        mesh: &TriMesh,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
        region: &PixelRegion,
        view: &mut RenderedView,
    ) {
        self.rasterizer
            .render(mesh, camera, camera_from_object, region, view);
        let filled = view.n_rendered();
        let counted = [1, view.depth().len(), filled, mesh.triangles().len()];
        for (count, more) in self.counts.iter().zip(counted) {
            count.fetch_add(more as u64, Ordering::Relaxed);
        }
    }
}

/// What the stages of a run did.
#[derive(Clone, Copy, Debug, Default)]
pub struct StageWork {
    /// Switches that took the aligned branch.
    pub aligned: u64,
    /// Switches that took another.
    pub misaligned: u64,
    /// ICP stages run.
    pub stages: u64,
    /// Evaluations of a pose, the rejected included.
    pub iterations: u64,
    /// Points selected, over all stages.
    pub selected: u64,
    /// Pairs that the metrics saw, over all evaluations.
    pub pairs: u64,
    /// Points that asked for their nearest neighbour: the source points of every association through a tree, the one that is
    /// made anew after a rolled-back iteration included.
    pub queries: u64,
    last_pose: Option<Isometry3<f64>>,
}

impl Observer for StageWork {
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
        self.pairs += event.evaluation.n_pairs as u64;
        self.last_pose = Some(*event.camera_from_object);
        ControlFlow::Continue(())
    }

    fn on_regime(&mut self, event: &RegimeEvent) {
        if event.regime == hybrid_icp::icp::Regime::ALIGNED {
            self.aligned += 1;
        } else {
            self.misaligned += 1;
        }
    }

    fn on_stage_end(&mut self, event: &StageEvent<'_>) {
        let outcome = event.outcome;
        self.stages += 1;
        self.iterations += outcome.iterations as u64;
        self.selected += event.n_source as u64;
        if event.association.starts_with("nearest") {
            // A stage that returns an accepted pose other than the one it evaluated last has associated there once more.
            let again = outcome.evaluation.is_some()
                && (self.last_pose != Some(outcome.camera_from_object)
                    || matches!(
                        outcome.termination,
                        Termination::NoPairs | Termination::Degenerate
                    ));
            self.queries += event.n_source as u64 * (outcome.iterations as u64 + u64::from(again));
        }
        self.last_pose = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{OBJECTS, case};
    use hicp_sim::{perturb, rng};
    use hybrid_icp::association::{DataAssociation, NearestNeighbor, VisibleSurface};
    use hybrid_icp::core::{Context, Correspondences, Problem, Surfel};
    use hybrid_icp::icp::{Icp, Session, Stage, Workspace};
    use hybrid_icp::metric::PointToPlane;
    use hybrid_icp::presets::paper_stop;

    /// Counts the points that ask.
    #[derive(Default)]
    struct Asked {
        inner: NearestNeighbor,
        points: u64,
    }

    impl DataAssociation for Asked {
        fn associate(
            &mut self,
            context: &mut Context<'_>,
            source: &[Surfel],
            camera_from_object: &Isometry3<f64>,
            pairs: &mut Correspondences,
        ) {
            self.points += source.len() as u64;
            self.inner
                .associate(context, source, camera_from_object, pairs);
        }

        fn name(&self) -> &'static str {
            self.inner.name()
        }
    }

    /// What the observer makes of a stage's end is what the association was asked, with and without a rollback.
    #[test]
    fn queries_are_those_that_an_association_counts_itself() {
        let (mut rolled_back, mut others) = (0, 0);
        for object in OBJECTS {
            let case = case(object);
            let problem = Problem::new(&case.scene.model, &case.scene.observation);
            let mut rng = rng(3);
            for _ in 0..8 {
                let init = perturb(&mut rng, &case.scene.truth, 0.01, 0.2);
                let mut stage = Icp {
                    selection: VisibleSurface::default(),
                    association: Asked::default(),
                    filter: (),
                    metric: PointToPlane,
                    stop: paper_stop(),
                };
                let renderer = CountingRenderer::default();
                let mut workspace = Workspace::new(renderer.clone());
                let mut work = StageWork::default();
                let outcome = stage.run(
                    &problem,
                    &init,
                    &mut Session::new(&mut workspace, &mut work),
                );
                assert_eq!(work.queries, stage.association.points, "{outcome:?}");
                assert!(work.queries > 0);
                assert_eq!(renderer.take().renders, workspace.renders());
                if matches!(
                    outcome.termination,
                    Termination::PairsLost | Termination::LossIncreased
                ) {
                    rolled_back += 1;
                } else {
                    others += 1;
                }
            }
        }
        assert!(rolled_back > 0 && others > 0, "{rolled_back} {others}");
    }
}
