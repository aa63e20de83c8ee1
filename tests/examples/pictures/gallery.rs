//! Objects before and after refinement.

use std::error::Error;

use hicp_sim::{Household, perturb, rng, rotation};
use hybrid_icp::core::{Isometry3, Observation, UnitQuaternion, Vector3};
use hybrid_icp::{ACCEPTED, Preset, Refinement, Refiner};

use crate::scene::{Crop, Placed, Scene, close, outline};
use crate::svg::{AFTER, Anchor, BAD, BEFORE, GOOD, GRAY, INK, Place, Svg};

type Drawn = Result<Svg, Box<dyn Error>>;

/// A pose to refine.
struct Try {
    scene: Scene,
    observation: Observation,
    /// The model whose pose is refined, at its initial pose.
    init: Placed,
    truth: Option<Isometry3<f64>>,
}

impl Try {
    /// The first object of a scene, its pose perturbed by meters and degrees.
    fn near(scene: Scene, meters: f64, degrees: f64, seed: u64) -> Result<Self, Box<dyn Error>> {
        let truth = scene.objects[0].camera_from_object;
        let start = perturb(&mut rng(seed), &truth, meters, degrees.to_radians());
        // Around the center of the object, not around the origin of its frame.
        let center = scene.objects[0].model.center();
        let shift = truth * center - start * center;
        let to_center = Isometry3::translation(shift.x, shift.y, shift.z);
        let off = perturb(&mut rng(seed + 1), &Isometry3::identity(), meters, 0.0);
        let start = off * to_center * start;
        let init = Placed {
            model: scene.objects[0].model.clone(),
            camera_from_object: start,
        };
        let observation = scene.observe(0)?;
        Ok(Self {
            scene,
            observation,
            init,
            truth: Some(truth),
        })
    }

    fn refine(&self, preset: Preset) -> Refinement {
        let pose = &self.init.camera_from_object;
        Refiner::preset(preset).refine(&self.init.model, &self.observation, pose)
    }

    /// Draws the initial and the refined pose in one panel.
    fn panel(
        &self,
        svg: &mut Svg,
        at: Place,
        width: f64,
        crop: Crop,
        preset: Preset,
        title: &str,
    ) -> Result<(), Box<dyn Error>> {
        let refined = self.refine(preset);
        self.scene.panel(svg, at, width, crop)?;
        outline(svg, &self.scene, &self.init, BEFORE);
        let model = self.init.model.clone();
        let camera_from_object = refined.outcome.camera_from_object;
        outline(
            svg,
            &self.scene,
            &Placed {
                model,
                camera_from_object,
            },
            AFTER,
        );
        close(svg);
        let height = width * f64::from(crop.3) / f64::from(crop.2);
        let y = at.1 + height;
        svg.text((at.0, y + 24.0), 15, INK, Anchor::Start, title);
        let mve = format!("MVE {:.2} → {:.2}", refined.mve_initial, refined.mve);
        svg.text((at.0, y + 46.0), 14, GRAY, Anchor::Start, &mve);
        let (word, color) = if refined.confidence >= ACCEPTED {
            ("accepted", GOOD)
        } else {
            ("not accepted", BAD)
        };
        let judged = format!("confidence {:.2}: {word}", refined.confidence);
        svg.text((at.0, y + 68.0), 14, color, Anchor::Start, &judged);
        Ok(())
    }

    fn errors(&self, pose: &Isometry3<f64>) -> String {
        let truth = self.truth.unwrap_or_else(Isometry3::identity);
        let degrees = truth.rotation.angle_to(&pose.rotation).to_degrees();
        let center = self.init.model.center();
        format!(
            "{:.2} mm, {degrees:.2}°",
            (truth * center - pose * center).norm() * 1e3
        )
    }
}

/// A key of the two colors.
fn key(svg: &mut Svg, (x, y): Place) {
    for (shift, color, text) in [
        (0.0, BEFORE, "initial pose"),
        (130.0, AFTER, "refined pose"),
    ] {
        let line = format!(r#"stroke="{color}" stroke-width="4""#);
        svg.path(&[(x + shift, y), (x + shift + 22.0, y)], &line);
        svg.text((x + shift + 29.0, y + 5.0), 14, INK, Anchor::Start, text);
    }
}

pub(crate) fn before_after() -> Drawn {
    use Household::{Carton, Mug, Teapot};
    let scene = Scene::on_a_table(
        0.62,
        &[
            (Teapot, 0.0, 0.0, 25.0),
            (Mug, -0.19, 0.1, 200.0),
            (Carton, 0.17, 0.19, 20.0),
        ],
    )?;
    let case = Try::near(scene, 0.015, 20.0, 4)?;
    let refined = case.refine(Preset::Auto);
    let pose = refined.outcome.camera_from_object;
    let crop = (212, 130, 248, 200);
    let mut svg = Svg::new(840.0, 400.0);
    let model = case.init.model.clone();
    let after = Placed {
        model,
        camera_from_object: pose,
    };
    let panels = [
        (10.0, "before", &case.init, BEFORE, refined.mve_initial),
        (425.0, "after", &after, AFTER, refined.mve),
    ];
    for (x, word, placed, color, mve) in panels {
        case.scene.panel(&mut svg, (x, 10.0), 405.0, crop)?;
        outline(&mut svg, &case.scene, placed, color);
        close(&mut svg);
        svg.text((x, 362.0), 19, color, Anchor::Start, word);
        let errors = format!("off by {}", case.errors(&placed.camera_from_object));
        svg.text((x, 386.0), 16, INK, Anchor::Start, &errors);
        svg.text(
            (x + 405.0, 386.0),
            16,
            GRAY,
            Anchor::End,
            &format!("MVE {mve:.2}"),
        );
    }
    Ok(svg)
}

/// The places of three panels, and their width.
const COLUMNS: ([f64; 3], f64) = ([10.0, 300.0, 590.0], 270.0);

pub(crate) fn successes() -> Drawn {
    use Household::{Bracket, Camera, Iron, Mug, Pan};
    let mut svg = Svg::new(870.0, 342.0);
    key(&mut svg, (10.0, 20.0));
    let (columns, width) = COLUMNS;
    let alone = |object| Scene::on_a_table(0.6, &[(object, 0.0, 0.0, 120.0)]);
    let crop = (170, 120, 300, 240);
    let bracket = Try::near(alone(Bracket)?, 0.01, 15.0, 3)?;
    bracket.panel(
        &mut svg,
        (columns[0], 40.0),
        width,
        crop,
        Preset::Auto,
        "15° off",
    )?;
    let hidden = [
        (Camera, 0.0, 0.06, 150.0),
        (Mug, 0.03, -0.07, 30.0),
        (Pan, -0.3, 0.2, 0.0),
    ];
    let camera = Try::near(Scene::on_a_table(0.6, &hidden)?, 0.01, 20.0, 5)?;
    camera.panel(
        &mut svg,
        (columns[1], 40.0),
        width,
        crop,
        Preset::Auto,
        "partly hidden",
    )?;
    let iron = Try::near(alone(Iron)?, 0.02, 150.0, 7)?;
    iron.panel(
        &mut svg,
        (columns[2], 40.0),
        width,
        crop,
        Preset::Auto,
        "150° off: auto searches",
    )?;
    Ok(svg)
}

pub(crate) fn failures() -> Drawn {
    use Household::{Bottle, Can, Iron, Mug};
    let mut svg = Svg::new(870.0, 342.0);
    key(&mut svg, (10.0, 20.0));
    let (columns, width) = COLUMNS;
    let crop = (170, 120, 300, 240);
    let alone = |object| Scene::on_a_table(0.6, &[(object, 0.0, 0.0, 70.0)]);

    // The handle is behind the mug.
    let scene = Scene::on_a_table(0.6, &[(Mug, 0.0, 0.0, 90.0)])?;
    let truth = scene.objects[0].camera_from_object;
    let mut flipped = Try::near(scene, 0.0, 0.0, 1)?;
    let half_turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
    let center = flipped.init.model.center().coords;
    let flip = Isometry3::translation(center.x, center.y, center.z)
        * half_turn
        * Isometry3::translation(-center.x, -center.y, -center.z);
    flipped.init.camera_from_object = truth * flip;
    flipped.panel(
        &mut svg,
        (columns[0], 40.0),
        width,
        crop,
        Preset::Local,
        "handle in front, not behind",
    )?;

    let mut masked = Try::near(alone(Iron)?, 0.01, 15.0, 3)?;
    // The box around the object.
    let seen = masked.observation.region();
    masked.observation = masked
        .scene
        .observe_where(|pixel| seen.contains(pixel as u32 % 640, pixel as u32 / 640))?;
    masked.panel(
        &mut svg,
        (columns[1], 40.0),
        width,
        crop,
        Preset::Auto,
        "wrong mask: a box with table",
    )?;

    let mut other = Try::near(alone(Can)?, 0.0, 0.0, 2)?;
    let bottle = Bottle.model()?;
    let shift = other.init.model.center() - bottle.center();
    other.init.camera_from_object *= Isometry3::translation(shift.x, shift.y, shift.z);
    other.init.camera_from_object.rotation = rotation(&mut rng(3));
    let at = other.truth.unwrap_or_default() * other.init.model.center();
    let place = other.init.camera_from_object * bottle.center();
    let back = at - place;
    other.init.camera_from_object =
        Isometry3::translation(back.x, back.y, back.z) * other.init.camera_from_object;
    other.init.model = bottle;
    other.panel(
        &mut svg,
        (columns[2], 40.0),
        width,
        crop,
        Preset::Auto,
        "wrong class: a bottle for a can",
    )?;
    Ok(svg)
}
