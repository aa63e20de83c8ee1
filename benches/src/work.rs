//! Counts the work of a run with an [`Observer`] and a [`Renderer`] around the rasterizer.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use hybrid_icp::core::{Isometry3, PinholeCamera, PixelRegion, RenderedView, Renderer, TriMesh};
use hybrid_icp::icp::{IterationEvent, Observer, RegimeEvent, StageEvent, Termination};
use hybrid_icp::raster::Rasterizer;

/// The work of the renders of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RenderWork {
    /// Number of renders, without cache hits.
    pub renders: u64,
    /// Number of pixels of the views, all of which are cleared.
    pub pixels: u64,
    /// Number of pixels that show the object.
    pub filled: u64,
    /// Number of triangles passed to the renderer.
    pub triangles: u64,
}

/// A rasterizer that counts. Clones share their counts.
#[derive(Clone, Debug, Default)]
pub struct CountingRenderer {
    rasterizer: Rasterizer,
    counts: Arc<[AtomicU64; 4]>,
}

impl CountingRenderer {
    /// Returns the work since the last call.
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

/// The work of the stages of a run.
#[derive(Clone, Copy, Debug, Default)]
pub struct StageWork {
    /// Number of switches that selected the aligned branch.
    pub aligned: u64,
    /// Number of switches that selected another branch.
    pub misaligned: u64,
    /// Number of ICP stages.
    pub stages: u64,
    /// Number of evaluations of a pose, including rejected poses.
    pub iterations: u64,
    /// Number of selected points, over all stages.
    pub selected: u64,
    /// Number of pairs passed to the metrics, over all evaluations.
    pub pairs: u64,
    /// Number of nearest-neighbor queries.
    ///
    /// These are the source points of every association that uses a tree. The association after a
    /// rolled-back iteration counts again.
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
            // If a stage returns a pose other than the one it evaluated last, it has associated
            // there again.
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

    /// Counts the points that are associated.
    #[derive(Default)]
    struct CountedPoints {
        inner: NearestNeighbor,
        points: u64,
    }

    impl DataAssociation for CountedPoints {
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

    /// The observer's count equals the association's own count, with and without a rollback.
    #[test]
    fn the_observer_counts_as_many_queries_as_the_association() {
        let (mut rolled_back, mut others) = (0, 0);
        for object in OBJECTS {
            let case = case(object);
            let problem = Problem::new(&case.scene.model, &case.scene.observation);
            let mut rng = rng(3);
            for _ in 0..8 {
                let init = perturb(&mut rng, &case.scene.truth, 0.01, 0.2);
                let mut stage = Icp {
                    selection: VisibleSurface::default(),
                    association: CountedPoints::default(),
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
