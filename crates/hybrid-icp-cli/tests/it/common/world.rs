//! A small BOP dataset in files, with rows of a result file.

use std::collections::BTreeMap;
use std::ops::Deref;
use std::path::PathBuf;

use hicp_io::bop::{ResultRow, Rle, read_results, write_results};
use hicp_io::{LengthUnit, read_mask_png, read_mesh};
use hicp_sim::{Household, perturb, rng};
use hybrid_icp::core::{DepthImage, Isometry3, Mask, Model, TriMesh, Vector3, se3};
use hybrid_icp::raster::render_depth_image;
use serde_json::{Value, json};

use super::folder::{Folder, Run};
use super::scene::{BOP_CAMERA, camera, car, pose_json};

pub(crate) const CAR: u32 = 1;
pub(crate) const HAMMER: u32 = 2;
/// An object without a model in the dataset.
pub(crate) const ABSENT: u32 = 9;

/// An object and its true pose.
pub(crate) type Instance = (u32, Isometry3<f64>);

/// Scenes 3 and 12 with images 0 and 40 each.
///
/// Every image shows two cars side by side. Image 40 also shows a hammer behind them.
pub(crate) struct World {
    pub(crate) folder: Folder,
    /// True poses by scene and image, in the order of the ground truth.
    pub(crate) truths: BTreeMap<(u32, u32), Vec<Instance>>,
}

impl World {
    pub(crate) fn new() -> Self {
        let mut world = Self {
            folder: Folder::new(),
            truths: BTreeMap::new(),
        };
        let meshes = BTreeMap::from([
            (CAR, car()),
            (HAMMER, Household::Hammer.solid().to_mesh().unwrap()),
        ]);
        world.create_dir("models");
        for (id, mesh) in &meshes {
            let path = world.path(format!("models/obj_{id:06}.ply"));
            hicp_io::write_ply(path, mesh, LengthUnit::Millimeters).unwrap();
        }
        world.state_diameters(1.0);
        for scene in [3, 12] {
            let mut cameras = serde_json::Map::new();
            let mut ground_truth = serde_json::Map::new();
            for folder in ["depth", "mask_visib"] {
                world.create_dir(world.scene(scene).join(folder));
            }
            for image in [0, 40] {
                let angle = f64::from(scene + image) * 0.03;
                let at = |x: f64, y: f64, z: f64, shift: f64| {
                    Isometry3::new(Vector3::new(x, y, z), Vector3::new(2.1, 0.7 + angle, shift))
                };
                let mut truths = vec![
                    (CAR, at(-0.09, -0.03, 0.5, -0.4)),
                    (CAR, at(0.08, -0.02, 0.55, 0.5)),
                ];
                if image == 40 {
                    truths.insert(1, (HAMMER, at(0.0, 0.05, 0.6, 1.0)));
                }
                let instances: Vec<_> = truths
                    .iter()
                    .map(|(id, pose)| (&meshes[id], *pose))
                    .collect();
                world.render(scene, image, &instances);
                cameras.insert(image.to_string(), serde_json::from_str(BOP_CAMERA).unwrap());
                let stated = truths.iter().map(|(id, pose)| {
                    let mut value = pose_json(pose);
                    value["obj_id"] = json!(id);
                    value
                });
                ground_truth.insert(image.to_string(), stated.collect());
                world.truths.insert((scene, image), truths);
            }
            let folder = world.scene(scene);
            let [cameras, truths] = [cameras, ground_truth].map(Value::from);
            world.write(folder.join("scene_camera.json"), cameras.to_string());
            world.write(folder.join("scene_gt.json"), truths.to_string());
        }
        world
    }

    pub(crate) fn scene(&self, scene: u32) -> PathBuf {
        self.path(format!("test/{scene:06}"))
    }

    pub(crate) fn depth_path(&self, scene: u32, image: u32) -> PathBuf {
        self.scene(scene).join(format!("depth/{image:06}.png"))
    }

    pub(crate) fn mask_path(&self, scene: u32, image: u32, instance: usize) -> PathBuf {
        self.scene(scene)
            .join(format!("mask_visib/{image:06}_{instance:06}.png"))
    }

    /// Returns the diameter of an object's mesh in millimeters.
    pub(crate) fn diameter_mm(&self, obj_id: u32) -> f64 {
        let path = self.path(format!("models/obj_{obj_id:06}.ply"));
        1e3 * Model::new(read_mesh(path, LengthUnit::Millimeters).unwrap()).diameter()
    }

    /// Writes the diameters of the models, that of the car times a factor.
    pub(crate) fn state_diameters(&self, factor: f64) {
        let info = json!({
            "1": {"diameter": factor * self.diameter_mm(CAR)},
            "2": {"diameter": self.diameter_mm(HAMMER)},
        });
        self.write("models/models_info.json", info.to_string());
    }

    /// Returns the visible masks as detections, in the order of the ground truth.
    ///
    /// Their run-length codes are compressed or not, by the index of the instance in its image.
    pub(crate) fn detections(&self, compressed: impl Fn(usize) -> bool) -> Vec<Value> {
        let mut detections = Vec::new();
        for ((scene, image), truths) in &self.truths {
            for (index, (id, _)) in truths.iter().enumerate() {
                let mask = read_mask_png(self.mask_path(*scene, *image, index)).unwrap();
                let (code, region) = (Rle::of_mask(&mask), mask.bounding_region());
                let counts = match compressed(index) {
                    true => json!(code.to_compressed()),
                    false => json!(code.counts()),
                };
                detections.push(json!({
                    "scene_id": scene, "image_id": image, "category_id": id,
                    "score": 0.5 + 0.1 * index as f64, "time": 0.25,
                    "bbox": [region.u_min, region.v_min, region.width(), region.height()],
                    "segmentation": {"size": [240, 320], "counts": counts},
                }));
            }
        }
        detections
    }

    /// Renders instances into a depth image and their visible masks.
    pub(crate) fn render(&self, scene: u32, image: u32, instances: &[(&TriMesh, Isometry3<f64>)]) {
        let (width, height) = (camera().width(), camera().height());
        let layers: Vec<DepthImage> = instances
            .iter()
            .map(|(mesh, pose)| render_depth_image(mesh, &camera(), pose))
            .collect();
        let nearest = |index: usize| {
            let seen = layers
                .iter()
                .enumerate()
                .map(|(i, layer)| (i, layer.pixels()[index]));
            seen.filter(|(_, z)| *z > 0.0)
                .min_by(|a, b| a.1.total_cmp(&b.1))
        };
        let count = layers[0].pixels().len();
        let depth = (0..count)
            .map(|i| nearest(i).map_or(0.0, |(_, z)| z))
            .collect();
        let depth = DepthImage::from_meters(width, height, depth).unwrap();
        hicp_io::write_depth_png(self.depth_path(scene, image), &depth, 0.1).unwrap();
        for instance in 0..layers.len() {
            let mask = (0..count).map(|i| nearest(i).is_some_and(|(layer, _)| layer == instance));
            let mask = Mask::new(width, height, mask.collect()).unwrap();
            assert!(mask.n_set() > 500);
            hicp_io::write_mask_png(self.mask_path(scene, image, instance), &mask).unwrap();
        }
    }

    /// Returns one row per instance, off by 3 mm and 5 degrees, not in the order of the frames.
    pub(crate) fn rows(&self) -> Vec<ResultRow> {
        let mut rows = Vec::new();
        for ((scene, image), truths) in self.truths.iter().rev() {
            for (index, (id, pose)) in truths.iter().enumerate().rev() {
                let seed = u64::from(scene + image) + index as u64;
                rows.push(ResultRow::new(*scene, *image, *id, nearby(pose, seed)));
            }
        }
        // Separate the rows of an image in the file.
        let half = rows.len() / 2;
        rows.rotate_left(half);
        rows.swap(0, 7);
        rows
    }

    /// Refines rows; returns the run and the output's rows.
    #[track_caller]
    pub(crate) fn refine(&self, rows: &[ResultRow], options: &str) -> (Run, Vec<ResultRow>) {
        write_results(self.path("in.csv"), rows).unwrap();
        let run = self.run(options);
        let refined = read_results(self.path("out.csv")).unwrap();
        assert_eq!(refined.len(), rows.len());
        for (before, after) in rows.iter().zip(&refined) {
            assert_eq!(
                (before.scene_id, before.im_id, before.obj_id, before.score),
                (after.scene_id, after.im_id, after.obj_id, after.score)
            );
        }
        (run, refined)
    }

    /// Refines rows without a fault; returns the output's rows.
    #[track_caller]
    pub(crate) fn refined(&self, rows: &[ResultRow], options: &str) -> Vec<ResultRow> {
        let (run, refined) = self.refine(rows, options);
        run.exits(0);
        refined
    }

    /// Refines the rows of `in.csv`.
    #[track_caller]
    pub(crate) fn run(&self, options: &str) -> Run {
        let fixed = "bop refine --dataset . --split test --results in.csv --output out.csv";
        self.command(format!("{fixed} {options}"))
    }

    /// Asserts that a row is near the true pose of its object that was nearest before refinement.
    #[track_caller]
    pub(crate) fn assert_refined(&self, before: &ResultRow, after: &ResultRow) {
        let truths = &self.truths[&(before.scene_id, before.im_id)];
        let of_object = truths.iter().filter(|(id, _)| *id == before.obj_id);
        let distance = |a: &Isometry3<f64>, b: &Isometry3<f64>| se3::pose_distance(a, b).1;
        let init = before.camera_from_object();
        let (_, truth) = of_object
            .min_by(|a, b| distance(&a.1, &init).total_cmp(&distance(&b.1, &init)))
            .unwrap();
        let (angle, meters) = se3::pose_distance(&after.camera_from_object(), truth);
        let degrees = angle.to_degrees();
        assert!(
            degrees < 4.0 && meters < 0.004,
            "{} {} {:?}: {degrees} deg {meters} m",
            before.scene_id,
            before.im_id,
            before.translation_mm(),
        );
    }
}

impl Deref for World {
    type Target = Folder;

    fn deref(&self) -> &Folder {
        &self.folder
    }
}

/// Returns a pose so near the truth that every pipeline converges.
///
/// These tests check the mask and the frame that a row is refined in, not the pipeline.
pub(crate) fn nearby(pose: &Isometry3<f64>, seed: u64) -> Isometry3<f64> {
    perturb(&mut rng(seed), pose, 0.003, 5.0_f64.to_radians())
}

pub(crate) fn same_pose(a: &ResultRow, b: &ResultRow) -> bool {
    a.rotation() == b.rotation() && a.translation_mm() == b.translation_mm()
}

/// Returns several rows per instance; the rows of an image are contiguous.
pub(crate) fn grouped(world: &World, per_instance: u64) -> Vec<ResultRow> {
    grouped_by(world, [per_instance; 4])
}

/// Returns rows grouped by image, most of them in the second and the third of four images.
///
/// A signal that is sent when the first image is done then arrives before the last one, also on a
/// busy machine. No image takes longer than the program waits for the current one.
pub(crate) fn grouped_for_signals(world: &World) -> Vec<ResultRow> {
    grouped_by(world, [12, 36, 30, 12])
}

fn grouped_by(world: &World, per_instance: [u64; 4]) -> Vec<ResultRow> {
    let mut rows = Vec::new();
    for (((scene, image), truths), per_instance) in world.truths.iter().rev().zip(per_instance) {
        for (id, pose) in truths {
            for seed in 0..per_instance {
                rows.push(ResultRow::new(*scene, *image, *id, nearby(pose, seed)));
            }
        }
    }
    rows
}
