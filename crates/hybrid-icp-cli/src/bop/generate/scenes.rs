//! The scenes of a generated dataset: images, annotations and result files.

use std::collections::BTreeMap;
use std::path::PathBuf;

use hicp_bop::MIN_VISIBLE_FRACTION;
use hicp_io::bop::{
    GroundTruth, GroundTruthInfo, ResultRow, SceneCamera, Target, write_scene_camera,
    write_scene_gt, write_scene_gt_info,
};
use hicp_io::{write_depth_png, write_mask_png};
use hicp_sim::{
    Clutter, ClutterView, DepthNoise, DepthSensor, Dropout, Hand, MEAN_ROTATION_ERROR_DEGREES,
    MEAN_TRANSLATION_ERROR_METERS, MovingConfig, MovingScene, SeenObject, Trajectory, perturb,
    stream,
};
use hybrid_icp::core::{Mask, Matrix3, PinholeCamera};
use rand::RngExt as _;

use super::objects::Objects;

/// Millimeters per unit of the depth images.
pub(super) const DEPTH_SCALE: f64 = 0.1;
/// Perturbation relative to the mean one (§VI-A.4), for translation and rotation each.
const PERTURBATION: std::ops::Range<f64> = 0.5..1.5;

/// Length of a sequence in which a hand hides the whole object for a time, seconds.
const LONG_SECONDS: f64 = 5.0;

/// The annotations and result rows of an image.
pub(super) struct ImageRecord {
    scene_id: u32,
    im_id: u32,
    camera: SceneCamera,
    truths: Vec<GroundTruth>,
    infos: Vec<GroundTruthInfo>,
    /// True poses of the targets.
    pub(super) truth: Vec<ResultRow>,
    /// Perturbed poses of the targets.
    pub(super) initial: Vec<ResultRow>,
}

/// Creates the images of a split.
pub(super) struct Generator<'a> {
    /// The split's folder.
    pub(super) dir: PathBuf,
    pub(super) objects: &'a Objects,
    pub(super) camera: PinholeCamera,
    pub(super) seed: u64,
    /// Number of objects per scene.
    pub(super) instances: usize,
    /// Number of images per scene.
    pub(super) images: usize,
    /// `true` if the camera moves along a path.
    pub(super) path: bool,
    /// `true` if an object moves.
    pub(super) moving: bool,
    /// Number of perturbed poses per target.
    pub(super) starts: u32,
    /// Perturbation relative to the mean error of an estimator.
    pub(super) perturbation: f64,
}

impl Generator<'_> {
    /// Returns the folder of a scene.
    pub(super) fn scene_dir(&self, scene: u32) -> PathBuf {
        self.dir.join(format!("{scene:06}"))
    }

    /// Creates an image and writes its files.
    ///
    /// Every image has its own random streams, so images may be created in any order.
    pub(super) fn image(&self, scene_id: u32, im_id: u32) -> anyhow::Result<ImageRecord> {
        let seed = self.seed;
        let place = (u64::from(scene_id) << 32) + u64::from(im_id);
        let (models, camera, sensor) = (&self.objects.models, &self.camera, &sensor());
        let mut placing = stream(seed, &["bop", "scene"], u64::from(scene_id));
        let mut looking = stream(seed, &["bop", "view"], place);
        let view = if self.moving {
            let model = (scene_id as usize - 1) % models.len();
            let scene = MovingScene::draw(&mut placing, models, model, &self.motion(scene_id))?;
            scene.view(&mut looking, im_id as usize, models, camera, sensor)?
        } else {
            let clutter = Clutter::draw(&mut placing, models, self.instances)?;
            if self.path {
                let mut moving = stream(seed, &["bop", "path"], u64::from(scene_id));
                let path = clutter.path(&mut moving, camera, self.images);
                clutter.view_from(&mut looking, path[im_id as usize], models, camera, sensor)?
            } else {
                clutter.view(&mut looking, models, camera, sensor)?
            }
        };
        self.write_images(scene_id, im_id, &view)?;

        let mut starting = stream(seed, &["bop", "start"], place);
        let mut record = ImageRecord {
            scene_id,
            im_id,
            camera: SceneCamera {
                matrix: matrix(camera),
                image_size: None,
                depth_scale: Some(DEPTH_SCALE),
                camera_from_world: Some(view.camera_from_world),
            },
            truths: Vec::new(),
            infos: view.instances.iter().map(info).collect(),
            truth: Vec::new(),
            initial: Vec::new(),
        };
        for (instance, info) in view.instances.iter().zip(&record.infos) {
            let obj_id = self.objects.ids[instance.model];
            let truth = instance.camera_from_object;
            record.truths.push(GroundTruth {
                obj_id,
                camera_from_object: truth,
            });
            if info.visible_fraction.unwrap_or(0.0) < MIN_VISIBLE_FRACTION {
                continue;
            }
            record
                .truth
                .push(ResultRow::new(scene_id, im_id, obj_id, truth));
            for start in 1..=self.starts {
                let (low, width) = (PERTURBATION.start, PERTURBATION.end - PERTURBATION.start);
                let mut factor = || low + width * starting.random::<f64>();
                let translation = self.perturbation * MEAN_TRANSLATION_ERROR_METERS * factor();
                let degrees = self.perturbation * MEAN_ROTATION_ERROR_DEGREES * factor();
                let angle = degrees.to_radians();
                let pose = perturb(&mut starting, &truth, translation, angle);
                let mut initial = ResultRow::new(scene_id, im_id, obj_id, pose);
                initial.score = 1.0 / f64::from(start);
                record.initial.push(initial);
            }
        }
        // An evaluation takes the first pose of every instance, not all poses of one.
        record.initial.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(record)
    }

    /// Returns the moving object and the hand of a scene.
    fn motion(&self, scene_id: u32) -> MovingConfig {
        let trajectory = Trajectory::default();
        let seconds = self.images as f64 / trajectory.frames_per_second;
        let covered = scene_id.is_multiple_of(2) && seconds >= LONG_SECONDS;
        MovingConfig {
            trajectory,
            frames: self.images,
            standing: self.instances - 1,
            hand: if covered {
                Hand::Covering(1.0..3.0)
            } else {
                Hand::Passing
            },
        }
    }

    fn write_images(&self, scene_id: u32, im_id: u32, view: &ClutterView) -> anyhow::Result<()> {
        let dir = self.scene_dir(scene_id);
        let depth = dir.join(format!("depth/{im_id:06}.png"));
        write_depth_png(depth, &view.depth, DEPTH_SCALE)?;
        for (index, instance) in view.instances.iter().enumerate() {
            let name = format!("{im_id:06}_{index:06}.png");
            write_mask_png(dir.join("mask").join(&name), &instance.silhouette)?;
            write_mask_png(dir.join("mask_visib").join(&name), &instance.visible)?;
        }
        Ok(())
    }

    /// Writes the cameras and the ground truth of every scene.
    pub(super) fn write_annotations(&self, records: &[ImageRecord]) -> anyhow::Result<()> {
        for of_scene in records.chunk_by(|a, b| a.scene_id == b.scene_id) {
            let dir = self.scene_dir(of_scene[0].scene_id);
            let cameras = of_scene.iter().map(|r| (r.im_id, r.camera.clone()));
            write_scene_camera(dir.join("scene_camera.json"), &cameras.collect())?;
            let truths = of_scene.iter().map(|r| (r.im_id, r.truths.clone()));
            write_scene_gt(dir.join("scene_gt.json"), &truths.collect())?;
            let infos = of_scene.iter().map(|r| (r.im_id, r.infos.clone()));
            write_scene_gt_info(dir.join("scene_gt_info.json"), &infos.collect())?;
        }
        Ok(())
    }
}

/// Returns the targets with their numbers of instances.
pub(super) fn targets(records: &[ImageRecord]) -> Vec<Target> {
    let mut counts: BTreeMap<(u32, u32, u32), u32> = BTreeMap::new();
    for row in records.iter().flat_map(|record| &record.truth) {
        let target = (row.scene_id, row.im_id, row.obj_id);
        *counts.entry(target).or_default() += 1;
    }
    let counts = counts.into_iter();
    let targets = counts.map(|((scene_id, im_id, obj_id), inst_count)| Target {
        scene_id,
        im_id,
        obj_id,
        inst_count,
    });
    targets.collect()
}

/// Returns a sensor with the axial noise and the millimeter steps of a D435.
///
/// It measures no depth at grazing angles and edges.
fn sensor() -> DepthSensor {
    DepthSensor {
        noise: DepthNoise::D435_AHN2019_AXIAL,
        quantization_meters: Some(0.001),
        dropout: Dropout {
            max_incidence_degrees: Some(80.0),
            edge_pixels: 1,
        },
        ..DepthSensor::default()
    }
}

fn matrix(camera: &PinholeCamera) -> Matrix3<f64> {
    let (fx, fy, cx, cy) = (camera.fx(), camera.fy(), camera.cx(), camera.cy());
    Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
}

/// Returns the visibility of an instance, whose silhouette ends at the border of the image.
fn info(instance: &SeenObject) -> GroundTruthInfo {
    let (all, bbox_object) = extent(&instance.silhouette);
    let (visible, bbox_visible) = extent(&instance.visible);
    GroundTruthInfo {
        visible_fraction: Some(f64::from(visible) / f64::from(all.max(1))),
        bbox_object: Some(bbox_object),
        bbox_visible: Some(bbox_visible),
        visible_pixels: Some(visible),
    }
}

/// Returns the number of set pixels of a mask and their box: x, y, width, height.
///
/// Without set pixels, all numbers of the box are -1.
fn extent(mask: &Mask) -> (u32, [f64; 4]) {
    let pixels = mask.n_set() as u32;
    let region = mask.bounding_region();
    let (width, height) = (region.u_max - region.u_min, region.v_max - region.v_min);
    match pixels {
        0 => (0, [-1.0; 4]),
        _ => (
            pixels,
            [region.u_min, region.v_min, width, height].map(f64::from),
        ),
    }
}
