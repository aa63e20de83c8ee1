//! Writes a synthetic BOP dataset with a result file to refine: frames of ten objects, so many hypotheses of each.
//!
//! `bop_frame FOLDER FRAMES OBJECTS HYPOTHESES`. `benches/peers/scaling.py` measures `bop refine` on it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use hicp_io::LengthUnit;
use hicp_io::bop::{
    GroundTruth, ModelInfo, ResultRow, SceneCamera, write_models_info, write_results,
    write_scene_camera, write_scene_gt,
};
use hicp_io::{write_depth_png, write_mask_png, write_ply};
use hicp_sim::{
    Household, MEAN_ROTATION_ERROR_DEGREES, MEAN_TRANSLATION_ERROR_METERS, RelativeGaussian,
    perturb, rng, rotation,
};
use hicp_tests::{camera, render};
use hybrid_icp::core::{DepthImage, Isometry3, Mask, Matrix3, Model, Translation3, Vector3};

type Failure = Box<dyn std::error::Error>;

/// Millimetres per unit of the depth images.
const DEPTH_SCALE: f64 = 0.1;
const SCENE: u32 = 1;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, frames, objects, hypotheses] = &arguments[..] else {
        return Err("expected FOLDER FRAMES OBJECTS HYPOTHESES".into());
    };
    let folder = PathBuf::from(folder);
    let (frames, objects): (u32, usize) = (frames.parse()?, objects.parse()?);
    let hypotheses: usize = hypotheses.parse()?;
    if objects == 0 || objects > Household::ALL.len() {
        return Err(format!("{objects} objects, expected 1 to {}", Household::ALL.len()).into());
    }
    let models = write_models(&folder, objects)?;
    let camera = camera();
    let scene = folder.join(format!("test/{SCENE:06}"));
    for name in ["depth", "mask_visib"] {
        std::fs::create_dir_all(scene.join(name))?;
    }
    let matrix = Matrix3::new(
        camera.fx(),
        0.0,
        camera.cx(),
        0.0,
        camera.fy(),
        camera.cy(),
        0.0,
        0.0,
        1.0,
    );
    let mut cameras = BTreeMap::new();
    let mut truths = BTreeMap::new();
    let mut rows = Vec::new();
    for frame in 0..frames {
        let poses = write_frame(&scene, frame, &models)?;
        let mut rng = rng(u64::from(frame) + 500);
        for (obj_id, truth) in (1..).zip(&poses) {
            for _ in 0..hypotheses {
                let start = perturb(
                    &mut rng,
                    truth,
                    MEAN_TRANSLATION_ERROR_METERS,
                    MEAN_ROTATION_ERROR_DEGREES.to_radians(),
                );
                rows.push(ResultRow::new(SCENE, frame, obj_id, start));
            }
        }
        let of_frame = (1..).zip(&poses).map(|(obj_id, pose)| GroundTruth {
            obj_id,
            camera_from_object: *pose,
        });
        truths.insert(frame, of_frame.collect());
        cameras.insert(
            frame,
            SceneCamera {
                matrix,
                image_size: None,
                depth_scale: Some(DEPTH_SCALE),
                camera_from_world: None,
            },
        );
    }
    write_scene_camera(scene.join("scene_camera.json"), &cameras)?;
    write_scene_gt(scene.join("scene_gt.json"), &truths)?;
    write_results(folder.join("starts_synthetic-test.csv"), &rows)?;
    Ok(())
}

fn write_models(folder: &Path, objects: usize) -> Result<Vec<Model>, Failure> {
    let dir = folder.join("models");
    std::fs::create_dir_all(&dir)?;
    let mut models = Vec::new();
    let mut infos = BTreeMap::new();
    for (id, object) in (1..).zip(&Household::ALL[..objects]) {
        let model = object.model()?;
        write_ply(
            dir.join(format!("obj_{id:06}.ply")),
            model.mesh(),
            LengthUnit::Millimeters,
        )?;
        let info = ModelInfo {
            diameter_m: model.diameter(),
            symmetries: model.symmetries().clone(),
        };
        infos.insert(id, info);
        models.push(model);
    }
    write_models_info(dir.join("models_info.json"), &infos)?;
    Ok(models)
}

/// Writes depth and masks of a frame: the objects on a grid of five by two, each by itself. Returns the poses.
fn write_frame(scene: &Path, frame: u32, models: &[Model]) -> Result<Vec<Isometry3<f64>>, Failure> {
    let camera = camera();
    let mut rng = rng(u64::from(frame) + 100);
    let mut nearest = vec![f32::INFINITY; (camera.width() * camera.height()) as usize];
    let mut owner = vec![usize::MAX; nearest.len()];
    let mut poses = Vec::new();
    for (index, model) in models.iter().enumerate() {
        let (column, line) = ((index % 5) as f64, (index / 5) as f64);
        // Far enough away that the largest fits between its neighbours.
        let distance = 1.2;
        let place = Vector3::new((column - 2.0) * 0.24, (line - 0.5) * 0.36, distance);
        let turn = rotation(&mut rng);
        let pose = Isometry3::from_parts(
            Translation3::from(place - turn * model.center().coords),
            turn,
        );
        let (depth, _) = render(model, &camera, &pose);
        for (pixel, z) in depth.pixels().iter().enumerate() {
            if *z > 0.0 && *z < nearest[pixel] {
                nearest[pixel] = *z;
                owner[pixel] = index;
            }
        }
        poses.push(pose);
    }
    let depths = nearest.iter().map(|z| if z.is_finite() { *z } else { 1.6 });
    let depth = DepthImage::from_meters(camera.width(), camera.height(), depths.collect())?;
    let depth = RelativeGaussian { percent: 0.3 }.apply(&mut rng, &depth);
    write_depth_png(
        scene.join(format!("depth/{frame:06}.png")),
        &depth,
        DEPTH_SCALE,
    )?;
    for index in 0..models.len() {
        let pixels = owner.iter().map(|o| *o == index).collect();
        let mask = Mask::new(camera.width(), camera.height(), pixels)?;
        write_mask_png(
            scene.join(format!("mask_visib/{frame:06}_{index:06}.png")),
            &mask,
        )?;
    }
    Ok(poses)
}
