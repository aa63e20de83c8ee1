//! The errors of an image's estimates against its ground truth.

use std::collections::BTreeMap;

use hicp_io::bop::ResultRow;
use hybrid_icp::core::{Isometry3, Model, RenderedView, Renderer};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::{
    ModelPoints, N_TOLERANCES, PoseErrors, ScoreError, TargetErrors, bop_vsd, most_visible,
    spheres_overlap, top_estimates,
};

use crate::fault::{Fault, chain};
use crate::frames::{FrameKey, frames_of};
use crate::mask_source::no_ground_truth;
use crate::models::Models;
use crate::scenes::{Image, Scenes, states_visibility};

/// A model with the data for its errors.
#[derive(Debug)]
pub struct EvaluatedObject<'a> {
    /// The model.
    pub model: &'a Model,
    /// Its vertices and symmetries.
    pub points: ModelPoints,
    /// `true` if the error AD is ADI, the error for symmetric objects.
    pub symmetric: bool,
}

impl<'a> EvaluatedObject<'a> {
    /// Prepares the models for evaluation.
    ///
    /// AD is ADI for the objects in `symmetric`, or if it is `None`, for those with declared
    /// symmetries.
    #[must_use]
    pub fn of_models(models: &'a Models, symmetric: Option<&[u32]>) -> BTreeMap<u32, Self> {
        let of = |(id, model)| {
            let points = ModelPoints::new(model);
            let declared = points.is_symmetric();
            let object = Self {
                model,
                points,
                symmetric: symmetric.map_or(declared, |ids| ids.contains(id)),
            };
            (*id, object)
        };
        models.by_id.iter().map(of).collect()
    }
}

/// The errors of the estimates of one target.
#[derive(Debug)]
pub struct Judged {
    /// The image.
    pub frame: FrameKey,
    /// The object.
    pub obj_id: u32,
    /// The errors, by estimate and instance.
    pub errors: TargetErrors,
    /// The rows of the estimates, as indices into the result file.
    pub rows: Vec<usize>,
    /// The instances, as indices into the image's ground truth.
    pub truths: Vec<usize>,
}

/// The errors of all targets of an image.
#[derive(Debug, Default)]
pub struct JudgedFrame {
    /// The targets that could be evaluated.
    pub targets: Vec<Judged>,
    /// Number of requested instances that could not be evaluated.
    pub left_out: usize,
    /// Files that were missing or damaged.
    pub faults: Vec<Fault>,
    /// Messages about inconsistent files that do not change the errors.
    pub misfits: Vec<String>,
}

/// The buffers of one thread.
#[derive(Debug, Default)]
pub struct Renders {
    rasterizer: Rasterizer,
    estimate: RenderedView,
    truths: Vec<RenderedView>,
}

/// The evaluation of a result file's rows, image by image.
///
/// Threads may share it; each thread needs separate [`Renders`].
#[derive(Debug)]
pub struct Judge<'a> {
    /// The objects that can be evaluated, by id.
    pub objects: BTreeMap<u32, EvaluatedObject<'a>>,
    scenes: &'a Scenes,
    rows: &'a [ResultRow],
    rows_of: BTreeMap<FrameKey, Vec<usize>>,
    delta_meters: f64,
}

impl<'a> Judge<'a> {
    /// Creates an evaluation of a result file's rows.
    ///
    /// `delta_meters` is the visibility tolerance of VSD.
    #[must_use]
    pub fn new(
        objects: BTreeMap<u32, EvaluatedObject<'a>>,
        scenes: &'a Scenes,
        rows: &'a [ResultRow],
        delta_meters: f64,
    ) -> Self {
        Self {
            objects,
            scenes,
            rows,
            rows_of: frames_of(rows).into_iter().collect(),
            delta_meters,
        }
    }

    /// Computes the errors of an image's estimates. `wanted` is the number of instances per object.
    ///
    /// Never fails: missing and damaged files are listed in the result.
    pub fn frame(
        &self,
        renders: &mut Renders,
        frame: FrameKey,
        wanted: &BTreeMap<u32, u32>,
    ) -> JudgedFrame {
        let mut judged = JudgedFrame::default();
        let image = self.scenes.read(frame);
        let image = image.and_then(|image| match image.scene.ground_truth(image.im_id) {
            Some(_) => Ok(image),
            None => Err(no_ground_truth(&image)),
        });
        let image = match image {
            Ok(image) => image,
            Err(fault) => {
                judged.left_out = wanted.values().map(|count| *count as usize).sum();
                judged.faults.push(fault);
                return judged;
            }
        };
        judged.misfits = wrong_sizes(&image);
        let chooses = |(obj_id, count): (&u32, &u32)| {
            instances(&image, *obj_id, usize::MAX).len() > *count as usize
        };
        if !states_visibility(&image.scene, image.im_id) && wanted.iter().any(chooses) {
            judged.misfits.push(format!(
                "{}: no visib_fract of some instances, which count as fully visible: if a target has fewer instances than the image, the evaluated ones may be others than those of the benchmark",
                image.scene.file("scene_gt_info").display(),
            ));
        }
        for (obj_id, count) in wanted {
            let count = *count as usize;
            if !self.objects.contains_key(obj_id) {
                judged.left_out += count;
                continue;
            }
            let truths = instances(&image, *obj_id, count);
            let n_truths = truths.len();
            if n_truths < count {
                judged.misfits.push(format!(
                    "{}, $.{}: {n_truths} instances of object {obj_id}, but the targets request {count}; the missing instances are left out",
                    image.scene.file("scene_gt").display(),
                    image.im_id,
                ));
                judged.left_out += count - n_truths;
            }
            if n_truths == 0 {
                continue;
            }
            match self.target(renders, &image, frame, *obj_id, truths, count) {
                Ok(target) => judged.targets.extend(target),
                Err(fault) => {
                    judged.left_out += n_truths;
                    judged.faults.push(fault);
                }
            }
        }
        judged
    }

    /// Computes the errors of an object's best `count` estimates against instances of an image.
    ///
    /// The estimates are those with the highest scores. `frame` is the image's key, and `truths`
    /// are indices into its ground truth. Returns `None` if the object has no model.
    ///
    /// # Errors
    ///
    /// A [`Fault`] if VSD is not defined for the image's camera and depth.
    pub fn target(
        &self,
        renders: &mut Renders,
        image: &Image,
        frame: FrameKey,
        obj_id: u32,
        truths: Vec<usize>,
        count: usize,
    ) -> Result<Option<Judged>, Fault> {
        let Some(object) = self.objects.get(&obj_id) else {
            return Ok(None);
        };
        let of_object = self.rows_of(frame, obj_id);
        let scores: Vec<f64> = of_object.iter().map(|i| self.rows[*i].score).collect();
        let kept = top_estimates(&scores, count).into_iter();
        let rows: Vec<usize> = kept.map(|kept| of_object[kept]).collect();

        let all = image.scene.ground_truth(image.im_id).unwrap_or_default();
        let true_poses = truths.iter().map(|index| all[*index].camera_from_object);
        let true_poses: Vec<Isometry3<f64>> = true_poses.collect();
        let mesh = object.model.mesh();
        let region = image.camera.region();
        let n_views = renders.truths.len().max(true_poses.len());
        renders.truths.resize_with(n_views, RenderedView::default);
        let rasterizer = &mut renders.rasterizer;
        for (pose, view) in true_poses.iter().zip(&mut renders.truths) {
            rasterizer.render(mesh, &image.camera, pose, &region, view);
        }
        let mut estimates = Vec::with_capacity(rows.len());
        for row in &rows {
            let pose = self.rows[*row].camera_from_object();
            rasterizer.render(mesh, &image.camera, &pose, &region, &mut renders.estimate);
            let truths = true_poses.iter().zip(&renders.truths);
            let errors = truths
                .map(|truth| self.errors(image, &object.points, (&pose, &renders.estimate), truth));
            estimates.push(errors.collect::<Result<Vec<_>, _>>().map_err(|error| {
                let im_id = image.im_id;
                Fault::damaged(format!("object {obj_id} in image {im_id}: {error}"))
            })?);
        }
        Ok(Some(Judged {
            frame,
            obj_id,
            errors: TargetErrors {
                diameter_m: object.points.diameter(),
                image_width: image.depth.width(),
                symmetric: object.symmetric,
                instances: truths.len(),
                estimates,
            },
            rows,
            truths,
        }))
    }

    /// Returns the rows of an object in an image, as indices into the result file.
    #[must_use]
    pub fn rows_of(&self, frame: FrameKey, obj_id: u32) -> Vec<usize> {
        let of_frame = self.rows_of.get(&frame).map_or(&[][..], Vec::as_slice);
        let of_object = of_frame.iter().copied();
        let of_object = of_object.filter(|index| self.rows[*index].obj_id == obj_id);
        of_object.collect()
    }

    /// Computes the errors of an estimate against an instance, with the renders of both.
    fn errors(
        &self,
        image: &Image,
        points: &ModelPoints,
        (pose, view): (&Isometry3<f64>, &RenderedView),
        (truth, true_view): (&Isometry3<f64>, &RenderedView),
    ) -> Result<PoseErrors, ScoreError> {
        let (diameter, delta) = (points.diameter(), self.delta_meters);
        let (depth, camera) = (&image.depth, &image.camera);
        Ok(PoseErrors {
            vsd: match spheres_overlap(pose, truth, diameter) {
                true => bop_vsd(depth, camera, view, true_view, diameter, delta)?,
                false => [1.0; N_TOLERANCES],
            },
            mssd_m: points.mssd(pose, truth),
            mspd_px: points.mspd(pose, truth, camera),
            add_m: points.add(pose, truth),
            adi_m: points.adi(pose, truth),
            translation_m: (pose.translation.vector - truth.translation.vector).norm(),
        })
    }
}

/// Returns the `count` most visible instances of an object in an image, as indices into its ground
/// truth.
#[must_use]
pub fn instances(image: &Image, obj_id: u32, count: usize) -> Vec<usize> {
    let truths = image.scene.ground_truth(image.im_id).unwrap_or_default();
    let infos = image.scene.ground_truth_info(image.im_id);
    let infos = infos.unwrap_or_default();
    let of_object = (0..truths.len()).filter(|index| truths[*index].obj_id == obj_id);
    let of_object: Vec<usize> = of_object.collect();
    // An instance without a stated visibility counts as fully visible.
    let visible = |index: &usize| infos.get(*index)?.visible_fraction;
    let fractions = of_object.iter().map(|index| visible(index).unwrap_or(1.0));
    let kept = most_visible(&fractions.collect::<Vec<_>>(), count);
    kept.into_iter().map(|kept| of_object[kept]).collect()
}

/// Returns messages about masks and color images whose size differs from that of the depth image.
///
/// It reads only the headers of the files.
fn wrong_sizes(image: &Image) -> Vec<String> {
    let (width, height) = (image.depth.width(), image.depth.height());
    let n_instances = image.scene.ground_truth(image.im_id).map_or(0, <[_]>::len);
    let masks = (0..n_instances).map(|i| image.scene.visible_mask_path(image.im_id, i));
    let color = image.scene.color_path(image.im_id);
    let color = color.filter(|path| path.extension().is_some_and(|e| e == "png"));
    let files = masks.chain(color).filter(|path| !hicp_io::is_absent(path));
    let wrong = files.filter_map(|path| match hicp_io::read_png_size(&path) {
        Ok(found) if found == (width, height) => None,
        Ok((w, h)) => Some(format!(
            "{} is {w}x{h} pixels, expected {width}x{height} as the depth image",
            path.display()
        )),
        Err(error) => Some(chain(&error)),
    });
    wrong.collect()
}
