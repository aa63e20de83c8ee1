//! The objects, the noisy models and the two regimes of the studies.

use std::error::Error;
use std::f64::consts::{FRAC_PI_2, PI};

use hicp_sim::{
    CaseConfig, CaseMaker, Household, InitialPose, Reconstruction, ReconstructionNoise, VsdBins,
};
use hybrid_icp::core::{Isometry3, Model, PinholeCamera, PixelRegion, UnitQuaternion, Vector3};
use hybrid_icp::{Refiner, presets};

use crate::scene::{Crop, Placed, Scene, close, outline};
use crate::svg::{AFTER, Anchor, BEFORE, GRAY, INK, Place, Svg};

type Drawn = Result<Svg, Box<dyn Error>>;

/// The seed of the studies.
const SEED: u64 = 1;
/// Width and height of a tile, pixels.
const TILE: u32 = 150;
/// Distance of the tiles' left sides.
const STEP: f64 = 166.0;

/// The camera of the studies.
fn camera() -> Result<PinholeCamera, Box<dyn Error>> {
    Ok(PinholeCamera::new(572.4, 573.6, 325.3, 242.0, 640, 480)?)
}

/// Draws a model from above, as large as the tile.
fn tile(svg: &mut Svg, at: Place, object: Household, model: Model) -> Result<(), Box<dyn Error>> {
    // The car is the only object whose wheels are not at its lowest z.
    let upright = match object {
        Household::Car => UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2),
        _ => UnitQuaternion::identity(),
    };
    let center = upright * model.center();
    let distance = 6.0 * model.radius();
    let eye = center + Vector3::new(0.45, -0.75, 0.5).normalize() * distance;
    let half_turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI);
    let camera_from_world = half_turn * Isometry3::look_at_rh(&eye, &center, &Vector3::z());
    let camera_from_object = camera_from_world * upright;
    let middle = f64::from(TILE - 1) / 2.0;
    let focal = 6.0 * middle;
    let camera = PinholeCamera::new(focal, focal, middle, middle, TILE, TILE)?;
    let scene = Scene::alone(
        camera,
        Placed {
            model,
            camera_from_object,
        },
    );
    scene.panel(svg, at, f64::from(TILE), (0, 0, TILE, TILE))?;
    close(svg);
    Ok(())
}

pub(crate) fn objects() -> Drawn {
    let mut svg = Svg::new(840.0, 790.0);
    for (title, objects, top) in [
        ("tuning", Household::TUNING, 0.0),
        ("test", Household::TEST, 395.0),
    ] {
        svg.text((10.0, top + 22.0), 17, INK, Anchor::Start, title);
        for (index, object) in objects.into_iter().enumerate() {
            let at = (
                10.0 + STEP * (index % 5) as f64,
                top + 30.0 + 180.0 * (index / 5) as f64,
            );
            tile(&mut svg, at, object, object.model()?)?;
            let below = (at.0 + f64::from(TILE) / 2.0, at.1 + f64::from(TILE) + 16.0);
            svg.text(below, 14, INK, Anchor::Middle, object.name());
        }
    }
    Ok(svg)
}

pub(crate) fn reconstructions() -> Drawn {
    let mut svg = Svg::new(840.0, 520.0);
    for level in 0..5_u32 {
        let x = 10.0 + STEP * f64::from(level);
        let title = match level {
            0 => "original".to_owned(),
            level => format!("reconstruction {level}"),
        };
        let middle = (x + f64::from(TILE) / 2.0, 22.0);
        svg.text(middle, 14, INK, Anchor::Middle, &title);
        let objects = [Household::Mug, Household::Headphones, Household::Hammer];
        for (row, object) in (0_u32..).zip(objects) {
            let mut model = object.model()?;
            if level > 0 {
                let noise = ReconstructionNoise::level(level)?;
                let settings = Reconstruction::new(camera()?, noise);
                model = settings.reconstruct(&model, object.name(), SEED)?;
            }
            let at = (x, 30.0 + 160.0 * f64::from(row));
            tile(&mut svg, at, object, model)?;
        }
    }
    Ok(svg)
}

/// Returns a part of the image around a region, with a margin for poses that are off.
fn around(region: PixelRegion) -> Crop {
    let rows = region.height().max(region.width()) as u32 + 90;
    let columns = rows * 16 / 15;
    let start = |min: u32, max: u32, side: u32, limit: u32| {
        (u32::midpoint(min, max).saturating_sub(side / 2)).min(limit.saturating_sub(side))
    };
    (
        start(region.u_min, region.u_max, columns, 640),
        start(region.v_min, region.v_max, rows, 480),
        columns,
        rows,
    )
}

/// Draws a case of each regime before Hybrid ICP, after its first and after its second iteration.
pub(crate) fn regimes() -> Drawn {
    let object = Household::Camera;
    let model = object.model()?;
    let config = CaseConfig::new(camera()?, InitialPose::Binned(VsdBins::default()));
    let mut maker = CaseMaker::new(config)?;
    let mut svg = Svg::new(840.0, 605.0);
    for (stage, index, top) in [
        ("1: projective cascade", 82, 0.0),
        ("1: nearest neighbors", 86, 310.0),
    ] {
        let case = maker.case(&model, object.name(), SEED, index)?;
        let placed = |camera_from_object| Placed {
            model: model.clone(),
            camera_from_object,
        };
        let scene = Scene::alone(case.camera, placed(case.camera_from_object));
        let observation = scene.observe(0)?;
        let crop = around(observation.region());
        let refined = |times| {
            let mut stage = presets::hybrid();
            stage.times = times;
            Refiner::new(stage).refine(&model, &observation, &case.init)
        };
        let (once, twice) = (refined(1), refined(2));
        let panels = [
            ("before", case.init, once.mve_initial, BEFORE),
            (stage, once.outcome.camera_from_object, once.mve, AFTER),
            (
                "2: projective cascade",
                twice.outcome.camera_from_object,
                twice.mve,
                AFTER,
            ),
        ];
        for (column, (title, pose, mve, color)) in (0_u32..).zip(panels) {
            let x = 10.0 + 277.0 * f64::from(column);
            scene.panel(&mut svg, (x, top + 10.0), 266.0, crop)?;
            outline(&mut svg, &scene, &placed(pose), color);
            close(&mut svg);
            svg.text((x, top + 282.0), 15, color, Anchor::Start, title);
            let score = format!("MVE {mve:.2}");
            svg.text((x + 266.0, top + 282.0), 14, GRAY, Anchor::End, &score);
        }
    }
    Ok(svg)
}
