//! The agreement of colors, and the choice by color.

use std::ops::Range;
use std::sync::Arc;

use hicp_sim::{Household, Lighting, Texture, stream};
use hicp_tests::painted::Painted;
use hicp_tests::tabletop::{MaskKind, Seen, Tabletop};
use hybrid_icp::core::{
    ColorImage, Context, DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Point3,
    Problem, RenderCache, RenderedView, Renderer, SurfaceColor, TexturedTriangle, TriMesh, Vector3,
};
use hybrid_icp::pipeline::PipelineFile;
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::{ColorAgreement, ColorEvidence, ModelPoints, SampledColor, Score, Shading};
use hybrid_icp::{Preset, Refinement, Refiner};

/// A board of 0.2 m with a texture of 8 × 8 patches.
pub(crate) fn board(patch: impl Fn(u32) -> [u8; 3]) -> Model {
    let corners = [(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)];
    let vertices = corners.map(|(x, y)| Point3::new(x, y, 0.0)).to_vec();
    let places = corners.map(|(x, y)| [5.0 * x + 0.5, 5.0 * y + 0.5]);
    let triangles = vec![[0, 2, 1], [0, 3, 2]];
    let textured = triangles
        .iter()
        .map(|triangle: &[u32; 3]| TexturedTriangle {
            image: 0,
            corners: triangle.map(|index| places[index as usize]),
        });
    let pixels = (0..64 * 64).map(|i| patch(i % 64 / 8 + 8 * (i / 64 / 8)));
    let color = SurfaceColor::Textures {
        triangles: textured.collect(),
        images: vec![ColorImage::new(64, 64, pixels.collect()).unwrap()],
    };
    let mesh = TriMesh::new(vertices, triangles).unwrap();
    Model::new(mesh.with_color(color).unwrap())
}

pub(crate) fn colorful(patch: u32) -> [u8; 3] {
    let value = |factor: u32| 40 + u8::try_from((patch * factor + patch / 8 * 3) % 7).unwrap() * 20;
    [value(3), value(5), value(11)]
}

pub(crate) fn pose() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.01, 0.0, 0.6), Vector3::new(0.3, 0.2, 0.4))
}

/// An image of the board, with a change of its colors.
pub(crate) fn photograph(model: &Model, change: impl Fn([f32; 3]) -> [f32; 3]) -> Observation {
    let camera = PinholeCamera::new(300.0, 300.0, 79.5, 59.5, 160, 120).unwrap();
    let mut view = RenderedView::default();
    let mesh = model.mesh();
    Rasterizer::default().render(mesh, &camera, &pose(), &camera.region(), &mut view);
    let color = |(u, v)| {
        view.color_at(u, v, mesh, &camera, &pose())
            .unwrap_or_default()
    };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let byte = |value: f32| value.round() as u8;
    let pixels = || camera.region().pixels();
    let colors = pixels().map(|pixel| change(color(pixel)).map(byte));
    let colors = ColorImage::new(160, 120, colors.collect()).unwrap();
    let depth = pixels().map(|(u, v)| view.depth_at(u, v));
    let depth = DepthImage::collect(160, 120, depth).unwrap();
    let mask = Mask::measured(&depth);
    let observation = Observation::new(depth, mask, camera).unwrap();
    observation.with_color(colors).unwrap()
}

fn measure(model: &Model, observation: &Observation, at: &Isometry3<f64>) -> ColorEvidence {
    let mut renders = RenderCache::new(Rasterizer::default());
    let mut context = Context::new(Problem::new(model, observation), &mut renders);
    ColorAgreement::default().measure(&mut context, at)
}

#[test]
fn a_render_agrees_with_itself_and_not_with_another_rotation() {
    let model = board(colorful);
    let observation = photograph(&model, |color| color);
    let evidence = measure(&model, &observation, &pose());
    assert!(evidence.is_telling(), "{evidence:?}");
    assert!(evidence.correlation > 0.999, "{evidence:?}");
    let turned = pose() * Isometry3::rotation(Vector3::z() * std::f64::consts::PI);
    let evidence = measure(&model, &observation, &turned);
    assert!(evidence.correlation < 0.5, "{evidence:?}");
    // The samples find the same.
    let problem = Problem::new(&model, &observation);
    let mut sampled = SampledColor::default();
    assert!(sampled.measure(&problem, &pose()).correlation > 0.9);
    assert!(sampled.measure(&problem, &turned).correlation < 0.5);
}

#[test]
fn a_gain_and_an_offset_per_channel_do_not_matter() {
    let model = board(colorful);
    let same = measure(&model, &photograph(&model, |color| color), &pose());
    for (gain, offset) in [
        ([0.5, 1.2, 0.8], [0.0; 3]),
        ([1.0, 0.7, 1.1], [60.0, 5.0, 20.0]),
    ] {
        let change = |color: [f32; 3]| {
            std::array::from_fn(|channel| color[channel] * gain[channel] + offset[channel])
        };
        let found = measure(&model, &photograph(&model, change), &pose());
        assert!(
            (found.correlation - same.correlation).abs() < 0.002,
            "{found:?}"
        );
        assert_eq!(found.cells, same.cells);
    }
}

#[test]
fn one_color_overexposure_and_missing_colors_are_no_evidence() {
    let model = board(colorful);
    let gray = board(|_| [90, 100, 110]);
    let plain =
        Model::new(TriMesh::new(model.mesh().vertices().to_vec(), vec![[0, 2, 1]]).unwrap());
    let image = photograph(&model, |color| color);
    for (model, observation) in [
        (&gray, photograph(&gray, |color| color)),
        (&model, photograph(&model, |_| [255.0; 3])),
        (&plain, image.clone()),
        (&model, {
            let depth = image.shared_depth().clone();
            Observation::new(depth, image.mask().clone(), *image.camera()).unwrap()
        }),
    ] {
        let evidence = measure(model, &observation, &pose());
        assert!(!evidence.is_telling(), "{evidence:?}");
        let mut renders = RenderCache::new(Rasterizer::default());
        let mut context = Context::new(Problem::new(model, &observation), &mut renders);
        assert_eq!(ColorAgreement::default().score(&mut context, &pose()), 0.5);
        assert_eq!(SampledColor::default().score(&mut context, &pose()), 0.5);
    }
}

#[test]
fn an_image_of_one_color_agrees_with_nothing() {
    let (painted, seen) = scene(Household::Pot, Texture::Logos);
    let model = &painted.scenes.objects[seen.model].1;
    let (width, height) = seen.camera.size();
    let gray = ColorImage::new(width, height, vec![[100; 3]; (width * height) as usize]).unwrap();
    let observation = seen.observe(MaskKind::Exact).unwrap();
    let observation = observation.with_color(gray).unwrap();
    let found = measure(model, &observation, &seen.truth);
    assert!(found.is_telling() && found.correlation == 0.0, "{found:?}");
    let problem = Problem::new(model, &observation);
    let sampled = SampledColor::default().measure(&problem, &seen.truth);
    assert_eq!(sampled.correlation, 0.0);
}

#[test]
fn a_lamp_and_its_shadow_matter_least_if_the_surroundings_are_removed() {
    let model = board(colorful);
    let observation = photograph(&model, |color| color);
    // One half of the board is in a shadow.
    let dark = |(index, color): (usize, &[u8; 3])| match index % 160 < 80 {
        true => color.map(|value| value / 3),
        false => *color,
    };
    let color = observation.color().unwrap();
    let pixels = color.pixels().iter().enumerate().map(dark).collect();
    let depth = observation.shared_depth().clone();
    let shaded = Observation::new(depth, observation.mask().clone(), *observation.camera());
    let shaded = shaded
        .unwrap()
        .with_color(ColorImage::new(160, 120, pixels).unwrap())
        .unwrap();
    let [even, directional, local] =
        [Shading::Even, Shading::Directional, Shading::Local].map(|s| {
            let mut renders = RenderCache::new(Rasterizer::default());
            let mut context = Context::new(Problem::new(&model, &shaded), &mut renders);
            let mut agreement = ColorAgreement::default();
            agreement.shading = s;
            agreement.measure(&mut context, &pose()).correlation
        });
    assert!(
        even <= directional + 0.01 && directional < local,
        "{even} {directional} {local}"
    );
    assert!(local > 0.6, "{local}");
}

/// A scene of the simulation that shows one object of a texture, and its index.
pub(crate) fn scene(object: Household, texture: Texture) -> (Painted, Seen) {
    noisy_scene(object, texture, 0.0..1.0)
}

/// The same, with noise in a range, percent of the depth.
fn noisy_scene(object: Household, texture: Texture, noise: Range<f64>) -> (Painted, Seen) {
    let painted = Painted::new(&[object], &[texture]).unwrap();
    let scenes = (0..).flat_map(|seed| painted.scenes.scene(seed).unwrap());
    let good = |seen: &Seen| seen.visible_share > 0.9 && noise.contains(&seen.noise_percent());
    let seen = scenes.into_iter().find(good).unwrap();
    (painted, seen)
}

/// Ordinary light.
pub(crate) fn lighting() -> Lighting {
    Lighting::draw(&mut stream(3, &["light"], 0))
}

/// A start that is turned around the object's axis of symmetry.
pub(crate) fn turned(painted: &Painted, seen: &Seen) -> Isometry3<f64> {
    let motions = &painted.motions[seen.model];
    seen.truth * motions[motions.len() / 3]
}

#[test]
fn color_turns_a_can_around_its_axis() {
    let (painted, seen) = scene(Household::Can, Texture::Logos);
    let model = &painted.scenes.objects[seen.model].1;
    let points = ModelPoints::new(model);
    let observation = painted
        .observe(&seen, MaskKind::Exact, &lighting(), 5)
        .unwrap();
    let start = turned(&painted, &seen);
    let error = |refined: &Refinement| {
        points.mssd(&refined.outcome.camera_from_object, &seen.truth) / points.diameter()
    };
    let by_depth = Refiner::preset(Preset::Auto).refine(model, &observation, &start);
    assert!(error(&by_depth) > 0.2, "{}", error(&by_depth));
    let by_color = Refiner::preset(Preset::Color).refine(model, &observation, &start);
    assert!(error(&by_color) < 0.05, "{}", error(&by_color));
    let file = PipelineFile::parse(Preset::Color.toml(), "color").unwrap();
    let mut built = Refiner::boxed(file.build().unwrap());
    assert_eq!(built.refine(model, &observation, &start), by_color);
    let ambiguous = |refined: &Refinement| refined.runner_up.is_some_and(|r| r.is_ambiguous());
    assert!(!ambiguous(&by_color), "{:?}", by_color.runner_up);
    // An estimate uses color with every pipeline.
    let found = Refiner::preset(Preset::Local).estimate(model, &observation);
    assert!(error(&found) < 0.05, "{}", error(&found));
}

#[test]
fn color_turns_slender_objects_and_ones_with_much_noise() {
    for (object, noise) in [(Household::Bottle, 0.0..1.0), (Household::Pot, 2.0..3.0)] {
        let (painted, seen) = noisy_scene(object, Texture::Text, noise);
        let model = &painted.scenes.objects[seen.model].1;
        let points = ModelPoints::new(model);
        let observation = painted
            .observe(&seen, MaskKind::Exact, &lighting(), 5)
            .unwrap();
        let found = Refiner::preset(Preset::Local).estimate(model, &observation);
        let pose = &found.outcome.camera_from_object;
        let error = points.mssd(pose, &seen.truth) / points.diameter();
        assert!(error < 0.05, "{}: {error}", object.name());
    }
}

#[test]
fn a_color_image_off_by_two_pixels_moves_no_pose_that_depth_determines() {
    let (painted, seen) = scene(Household::Carton, Texture::Logos);
    let model = &painted.scenes.objects[seen.model].1;
    let points = ModelPoints::new(model);
    let observation = painted
        .observe(&seen, MaskKind::Exact, &lighting(), 5)
        .unwrap();
    let color = observation.color().unwrap();
    let (width, height) = (color.width(), color.height());
    let moved = |(u, v)| color.get((u + 2) % width, v).unwrap();
    let pixels = observation.camera().region().pixels().map(moved);
    let color = ColorImage::new(width, height, pixels.collect()).unwrap();
    let observation = Observation::new(
        Arc::clone(observation.shared_depth()),
        observation.mask().clone(),
        *observation.camera(),
    );
    let observation = observation.unwrap().with_color(color).unwrap();
    let start = turned(&painted, &seen);
    let error = |preset: Preset, start: &Isometry3<f64>| {
        let refined = Refiner::preset(preset).refine(model, &observation, start);
        points.mssd(&refined.outcome.camera_from_object, &seen.truth) / points.diameter()
    };
    assert!(error(Preset::Auto, &start) > 0.5);
    let (by_color, by_depth) = (
        error(Preset::Color, &start),
        error(Preset::Auto, &seen.truth),
    );
    assert!(by_color < by_depth + 0.002, "{by_color} {by_depth}");
}

/// Returns a mesh whose distance from the z-axis waves by a length in meters, as if it were dented.
fn dented(mesh: &TriMesh, meters: f32) -> TriMesh {
    let vertices = mesh.vertices().iter().map(|p| {
        let (angle, height) = (p.y.atan2(p.x), 30.0 * p.z);
        let wave = (2.0 * angle + height).cos() + (3.0 * angle - height).cos();
        let factor = 1.0 + 0.5 * meters * wave / p.x.hypot(p.y).max(0.02);
        Point3::new(factor * p.x, factor * p.y, p.z)
    });
    TriMesh::new(vertices.collect(), mesh.triangles().to_vec()).unwrap()
}

#[test]
fn color_turns_dented_objects() {
    let plain = Household::Bottle.model().unwrap();
    let mesh = dented(plain.mesh(), 0.002);
    let mesh = Texture::Text.paint(&mut stream(1, &["paint"], 0), mesh);
    let painted = Painted {
        scenes: Tabletop::of(vec![("dented bottle".into(), Model::new(mesh.unwrap()))]),
        motions: vec![plain.symmetries().motions()],
    };
    let scenes = (0..).flat_map(|seed| painted.scenes.scene(seed).unwrap());
    let model = &painted.scenes.objects[0].1;
    let points = ModelPoints::new(model);
    let (mut light, mut color) = (lighting(), Refiner::preset(Preset::Color));
    // Such a noise hides the colors from the ranks, but not from the means over cells.
    light.noise = 50.0;
    for seen in scenes.filter(|seen| seen.visible_share > 0.9).take(3) {
        let observation = painted.observe(&seen, MaskKind::Exact, &light, 5).unwrap();
        for degrees in [70.0_f64, 160.0, 250.0] {
            let turn = Isometry3::rotation(Vector3::z() * degrees.to_radians());
            let found = color.refine(model, &observation, &(seen.truth * turn));
            let pose = &found.outcome.camera_from_object;
            let error = points.mssd(pose, &seen.truth) / points.diameter();
            assert!(error < 0.05, "{degrees}°: {error}");
        }
    }
}

#[test]
fn without_a_texture_the_pose_stays_and_so_does_the_warning() {
    let (painted, seen) = scene(Household::Can, Texture::None);
    let model = &painted.scenes.objects[seen.model].1;
    let observation = painted
        .observe(&seen, MaskKind::Exact, &lighting(), 5)
        .unwrap();
    let start = turned(&painted, &seen);
    let by_depth = Refiner::preset(Preset::Auto).refine(model, &observation, &start);
    let by_color = Refiner::preset(Preset::Color).refine(model, &observation, &start);
    assert_eq!(
        by_color.outcome.camera_from_object,
        by_depth.outcome.camera_from_object
    );
    assert_eq!(by_color.runner_up, by_depth.runner_up);
}

#[test]
fn without_a_color_image_the_bits_are_those_of_auto() {
    let (painted, seen) = scene(Household::Carton, Texture::Text);
    let model = &painted.scenes.objects[seen.model].1;
    let observation = seen.observe(MaskKind::Exact).unwrap();
    let start = turned(&painted, &seen);
    let mut refiners = [Preset::Auto, Preset::Color].map(Refiner::preset);
    let [auto, color] = refiners
        .each_mut()
        .map(|r| r.refine(model, &observation, &start));
    assert_eq!(auto, color);
    let [auto, color] = &refiners;
    assert_eq!(auto.alternatives(), color.alternatives());
}
