//! A custom renderer: a sensor that returns nothing at grazing angles.

use hicp_sim::{Household, RelativeGaussian, rng};
use hicp_testkit::{RendererLaws, check_renderer};
use hicp_tests::{Scene, median, perturbed_scene};
use hybrid_icp::Preset;
use hybrid_icp::core::{
    DepthImage, Isometry3, NO_TRIANGLE, Observation, PinholeCamera, PixelRegion, RenderedView,
    Renderer, TriMesh,
};
use hybrid_icp::icp::{Session, Stage, Workspace};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::{MeanVsd, Score};

// --- The component ---

/// Renders, and removes surfaces that are seen at a grazing angle.
///
/// Structured light and time of flight return nothing there. Points should not be selected there,
/// and missing depth there should not count against a pose.
#[derive(Debug, Default)]
struct Grazing {
    inner: Rasterizer,
    /// Cosine of the largest angle between ray and normal that returns light.
    min_cosine: f64,
}

impl Renderer for Grazing {
    fn render(
        &mut self,
        mesh: &TriMesh,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
        region: &PixelRegion,
        view: &mut RenderedView,
    ) {
        self.inner
            .render(mesh, camera, camera_from_object, region, view);
        let drawn = view.region();
        let (depth, triangles) = view.buffers_mut();
        for (i, (u, v)) in drawn.pixels().enumerate() {
            if triangles[i] == NO_TRIANGLE {
                continue;
            }
            let Some(normal) = mesh.normal(triangles[i] as usize) else {
                continue;
            };
            let ray = camera.unproject(u.into(), v.into(), 1.0).coords.normalize();
            let normal = camera_from_object.rotation * normal.cast::<f64>().into_inner();
            if normal.dot(&ray).abs() < self.min_cosine {
                (depth[i], triangles[i]) = (0.0, NO_TRIANGLE);
            }
        }
    }
}

// --- Its tests ---

fn grazing() -> Grazing {
    Grazing {
        inner: Rasterizer::default(),
        min_cosine: 75.0_f64.to_radians().cos(),
    }
}

/// Returns the scene as such a sensor records it. The mask comes from color and includes grazing
/// angles.
fn sensed(object: Household, seed: u64) -> (Scene, Isometry3<f64>) {
    let mut rng = rng(seed);
    let (mut scene, init) = perturbed_scene(object, 0.0, &mut rng, (0.005, 0.1));
    let camera = *scene.observation.camera();
    let mut view = RenderedView::default();
    grazing().render(
        scene.model.mesh(),
        &camera,
        &scene.truth,
        &camera.region(),
        &mut view,
    );
    let pixels = camera.region().pixels();
    let depth = pixels.map(|(u, v)| view.depth_at(u, v));
    let depth = DepthImage::collect(camera.width(), camera.height(), depth).unwrap();
    let depth = RelativeGaussian { percent: 0.5 }.apply(&mut rng, &depth);
    scene.observation = Observation::new(depth, scene.observation.mask().clone(), camera).unwrap();
    (scene, init)
}

#[test]
fn it_keeps_the_laws() {
    // It omits surfaces on purpose.
    check_renderer(
        grazing,
        RendererLaws {
            differing_pixels: None,
        },
    );
}

#[test]
fn without_limit_it_is_the_rasterizer() {
    check_renderer(
        Grazing::default,
        RendererLaws {
            differing_pixels: Some(0.0),
        },
    );
}

#[test]
fn a_pipeline_selects_and_scores_what_the_sensor_returns() {
    let mut mine = Workspace::new(grazing());
    let mut plain = Workspace::new(Rasterizer::default());
    let (mut ratios, mut with_grazing) = (Vec::new(), 0);
    for (seed, object) in (0..).zip(Household::ALL) {
        let (scene, init) = sensed(object, seed);
        let problem = scene.problem();
        let shown = |workspace: &mut Workspace| {
            let mut context = workspace.context(&problem);
            let depth = context.view(&scene.truth).unwrap().depth();
            depth.iter().filter(|z| **z > 0.0).count()
        };
        let (few, all) = (shown(&mut mine), shown(&mut plain));
        // A lid that faces the camera has no grazing surface, but most objects do.
        assert!(few <= all, "{few} of {all} pixels of the {}", object.name());
        with_grazing += usize::from(few < all);
        assert_eq!(few, scene.observation.n_measured(), "{}", object.name());

        let mut stage = Preset::Hybrid.build();
        let outcome = stage.run(&problem, &init, &mut Session::new(&mut mine, &mut ()));
        let mut score = |pose| MeanVsd::default().score(&mut mine.context(&problem), pose);
        ratios.push(score(&outcome.camera_from_object) / score(&init));
    }
    assert!(2 * with_grazing > ratios.len(), "{with_grazing}");
    let ratio = median(&mut ratios);
    assert!(ratio < 0.5, "{ratios:?}");
}
