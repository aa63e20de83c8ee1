//! Checks that types can be shared and sent between threads, and that threads do not change
//! results.

use std::num::NonZeroUsize;

use hicp_sim::{Household, perturb, rng};
use hicp_tests::render;
use hybrid_icp::core::{
    DepthImage, Derived, Isometry3, Mask, Model, Observation, PinholeCamera, Symmetries, TriMesh,
};
use hybrid_icp::fusion::{BoxedFuser, Fusion, PoseEstimate};
use hybrid_icp::icp::Workspace;
use hybrid_icp::pipeline::PipelineFile;
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::{
    BoxedStage, Preset, Refinement, Refiner, SequentialEstimator, presets, refine_batch,
};

/// Compiles only if the documented `Send` and `Sync` hold.
///
/// Models and observations are shared by reference. Each thread has its own workspace.
#[test]
fn data_are_send_and_sync_and_workspaces_are_send() {
    fn shared<T: Send + Sync>() {}
    fn sent<T: Send>() {}
    shared::<Model>();
    shared::<TriMesh>();
    shared::<Symmetries>();
    shared::<Observation>();
    shared::<DepthImage>();
    shared::<Mask>();
    shared::<PinholeCamera>();
    shared::<Derived>();
    shared::<PipelineFile>();
    shared::<Preset>();
    shared::<PoseEstimate>();
    shared::<Fusion>();
    shared::<hybrid_icp::score::ModelPoints>();
    shared::<hicp_io::bop::Dataset>();
    shared::<hicp_io::bop::Scene>();
    shared::<hicp_io::IoError>();
    sent::<Refiner>();
    sent::<Refiner<presets::Hybrid>>();
    sent::<Refiner<presets::Search>>();
    sent::<Workspace>();
    sent::<Rasterizer>();
    sent::<BoxedStage>();
    sent::<BoxedFuser>();
    sent::<SequentialEstimator>();
}

/// An object in a small image. Every call creates an observation without a search tree.
struct View {
    model: Model,
    camera: PinholeCamera,
    depth: DepthImage,
    mask: Mask,
    truth: Isometry3<f64>,
}

impl View {
    fn new() -> Self {
        let model = Household::Mug.model().unwrap();
        let camera = PinholeCamera::new(95.0, 95.0, 39.5, 29.5, 80, 60).unwrap();
        let truth = hicp_sim::object_pose(&mut rng(4), &model.center(), 0.45..0.5, 0.01);
        let (depth, mask) = render(&model, &camera, &truth);
        Self {
            model,
            camera,
            depth,
            mask,
            truth,
        }
    }

    fn observe(&self) -> Observation {
        Observation::new(self.depth.clone(), self.mask.clone(), self.camera).unwrap()
    }

    /// Returns starts from good to bad, so that both branches of the switch run.
    fn starts(&self, count: u32) -> Vec<Isometry3<f64>> {
        let mut rng = rng(9);
        (0..count)
            .map(|i| {
                let share = f64::from(i) / f64::from(count);
                perturb(&mut rng, &self.truth, 0.06 * share, 0.8 * share)
            })
            .collect()
    }
}

/// Refines from every start on some threads that share the model and the observation.
fn refine_all(
    model: &Model,
    observation: &Observation,
    starts: &[Isometry3<f64>],
    threads: usize,
) -> Vec<Refinement> {
    let items: Vec<_> = starts
        .iter()
        .map(|start| (model, observation, *start))
        .collect();
    let threads = NonZeroUsize::new(threads);
    refine_batch(&items, threads, || Refiner::preset(Preset::Hybrid))
}

#[test]
fn a_batch_has_the_results_of_single_calls_in_the_same_order() {
    let view = View::new();
    let (starts, observation) = (view.starts(20), view.observe());
    let mut refiner = Refiner::preset(Preset::Hybrid);
    let single = starts
        .iter()
        .map(|start| refiner.refine(&view.model, &observation, start));
    let single: Vec<_> = single.collect();
    assert_eq!(refine_all(&view.model, &observation, &starts, 3), single);
    assert_eq!(refine_all(&view.model, &observation, &starts, 0), single);
    assert!(refine_all(&view.model, &observation, &[], 2).is_empty());
}

#[test]
fn a_thousand_refinements_share_one_observation() {
    let view = View::new();
    let starts = view.starts(1000);
    // The 16 threads start before the search tree exists.
    let together = refine_all(&view.model, &view.observe(), &starts, 16);
    let alone = refine_all(&view.model, &view.observe(), &starts, 1);
    assert_eq!(together, alone);
    assert!(alone.iter().any(|r| r.mve_initial < 0.4) && alone.iter().any(|r| r.mve_initial > 0.4));
    let better = alone.iter().filter(|r| r.mve < r.mve_initial).count();
    assert!(better > 500, "{better}");
}
