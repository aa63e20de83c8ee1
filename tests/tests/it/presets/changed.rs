//! Presets that are changed in Rust.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use hicp_sim::{Household, rng};
use hicp_tests::perturbed_scene;
use hybrid_icp::core::{Isometry3, PinholeCamera, PixelRegion, RenderedView, Renderer, TriMesh};
use hybrid_icp::pipeline::PipelineFile;
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::{Preset, Refiner, presets};

#[test]
fn a_preset_changed_in_rust_equals_its_file_with_the_same_override() {
    let (scene, init) = perturbed_scene(Household::Mug, 0.5, &mut rng(31), (0.05, 1.5));
    let mut file = PipelineFile::parse(Preset::Local.toml(), "local").unwrap();
    // Without it, a sure pose would end the preset before the steps.
    file.set("stages.1.switcher.alpha=0").unwrap();
    file.set("stages.1.misaligned.stages.1.max_steps=1")
        .unwrap();
    file.set("stages.1.misaligned.stages.1.misaligned.stages.1.association.points=200")
        .unwrap();
    let expected =
        Refiner::new(file.build().unwrap()).refine(&scene.model, &scene.observation, &init);

    let mut refiner = Refiner::new(presets::local());
    let unchanged = refiner.refine(&scene.model, &scene.observation, &init);
    let unless = &mut refiner.stage_mut().0.1;
    unless.switcher.alpha = 0.0;
    let steps = &mut unless.misaligned.0.1;
    steps.max_steps = 1;
    steps.misaligned.0.0.0.1.association.stride = hybrid_icp::association::Stride::AboutPoints(200);
    let changed = refiner.refine(&scene.model, &scene.observation, &init);
    assert_eq!(changed, expected);
    assert_ne!(changed, unchanged);

    let stage = refiner.into_stage();
    assert_eq!(stage.0.1.misaligned.0.1.max_steps, 1);
    let again = Refiner::new(stage).refine(&scene.model, &scene.observation, &init);
    assert_eq!(again, expected);
}

/// Counts the renders of a rasterizer.
struct Counted(Rasterizer, Arc<AtomicUsize>);

impl Renderer for Counted {
    fn render(
        &mut self,
        mesh: &TriMesh,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
        region: &PixelRegion,
        view: &mut RenderedView,
    ) {
        self.1.fetch_add(1, Ordering::Relaxed);
        self.0
            .render(mesh, camera, camera_from_object, region, view);
    }
}

#[test]
fn a_refiner_uses_the_given_renderer() {
    let (scene, init) = perturbed_scene(Household::Mug, 0.5, &mut rng(32), (0.005, 0.1));
    let renders = Arc::new(AtomicUsize::new(0));
    let renderer = Counted(Rasterizer::default(), Arc::clone(&renders));
    let mut refiner = Refiner::with_renderer(presets::hybrid(), renderer);
    let found = refiner.refine(&scene.model, &scene.observation, &init);
    assert!(renders.load(Ordering::Relaxed) > 0);
    let expected = Refiner::preset(Preset::Hybrid).refine(&scene.model, &scene.observation, &init);
    assert_eq!(found, expected);
}
