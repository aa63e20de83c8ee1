//! The errors of a frame's estimates against its ground truth.

use std::collections::BTreeMap;

use hicp_bop::{Fault, FrameKey, Image, Models, Scenes};
use hicp_io::bop::{ResultRow, Scene};
use hybrid_icp::{
    Isometry3, Model, ModelPoints, N_TOLERANCES, PoseErrors, Rasterizer, RenderedView, Renderer,
    TargetErrors, bop_vsd, most_visible, spheres_overlap, top_estimates,
};

/// An object as the errors need it.
pub(crate) struct EvaluatedObject<'a> {
    pub(crate) model: &'a Model,
    pub(crate) points: ModelPoints,
    /// Whether AD is ADI.
    pub(crate) symmetric: bool,
}

impl<'a> EvaluatedObject<'a> {
    /// Prepares models for their errors; AD is ADI for the objects named, if not given for those with declared symmetries.
    pub(crate) fn of_models(models: &'a Models, symmetric: Option<&[u32]>) -> BTreeMap<u32, Self> {
        let of = |(id, model)| {
            let points = ModelPoints::new(model);
            let symmetric = match symmetric {
                Some(ids) => ids.contains(id),
                None => points.is_symmetric(),
            };
            let object = Self {
                model,
                points,
                symmetric,
            };
            (*id, object)
        };
        models.by_id.iter().map(of).collect()
    }
}

/// A target with its errors, and which row and which instance each of them is of.
pub(crate) struct Judged {
    pub(crate) frame: FrameKey,
    pub(crate) obj_id: u32,
    pub(crate) errors: TargetErrors,
    /// The rows of the estimates, as indices into the result file.
    pub(crate) rows: Vec<usize>,
    /// The instances, as indices into the image's ground truth.
    pub(crate) truths: Vec<usize>,
}

/// All targets of a frame.
#[derive(Default)]
pub(crate) struct JudgedFrame {
    pub(crate) targets: Vec<Judged>,
    /// Instances that the targets ask for and that could not be judged.
    pub(crate) left_out: usize,
    pub(crate) faults: Vec<Fault>,
    /// What does not fit, without harm to the errors.
    pub(crate) misfits: Vec<String>,
}

/// Scratch of a thread.
#[derive(Default)]
pub(crate) struct Renders {
    rasterizer: Rasterizer,
    estimate: RenderedView,
    truths: Vec<RenderedView>,
}

/// What all frames share.
pub(crate) struct Judge<'a> {
    pub(crate) objects: BTreeMap<u32, EvaluatedObject<'a>>,
    pub(crate) scenes: &'a Scenes,
    pub(crate) rows: &'a [ResultRow],
    /// Where the rows of a frame stand.
    pub(crate) rows_of: BTreeMap<FrameKey, Vec<usize>>,
    /// Visibility tolerance of VSD, metres.
    pub(crate) delta: f64,
}

impl Judge<'_> {
    /// Judges the estimates of one frame; `wanted` is the number of instances asked for by object.
    pub(crate) fn frame(
        &self,
        renders: &mut Renders,
        frame: FrameKey,
        wanted: &BTreeMap<u32, u32>,
    ) -> JudgedFrame {
        let mut judged = JudgedFrame::default();
        let image = match self.scenes.read(frame) {
            Ok(image) => image,
            Err(fault) => {
                judged.left_out = wanted.values().map(|count| *count as usize).sum();
                judged.faults.push(fault);
                return judged;
            }
        };
        check_size(&image, &mut judged);
        for (obj_id, count) in wanted {
            let count = *count as usize;
            let Some(object) = self.objects.get(obj_id) else {
                judged.left_out += count;
                continue;
            };
            let truths = instances(&image.scene, image.im_id, *obj_id, count);
            if truths.len() < count {
                judged.misfits.push(format!(
                    "{}, $.{}: {} instances of object {obj_id}, but the targets ask for {count}; the others are left out",
                    image.scene.dir().join("scene_gt.json").display(),
                    image.im_id,
                    truths.len(),
                ));
                judged.left_out += count - truths.len();
            }
            if truths.is_empty() {
                continue;
            }
            let n_truths = truths.len();
            match self.target(renders, &image, frame, (*obj_id, object), (truths, count)) {
                Ok(target) => judged.targets.push(target),
                Err(text) => {
                    judged.left_out += n_truths;
                    judged.faults.push(Fault::damaged(text));
                }
            }
        }
        judged
    }

    /// Judges the `count` estimates of an object with the best scores against instances, given as indices into the image's
    /// ground truth.
    pub(crate) fn target(
        &self,
        renders: &mut Renders,
        image: &Image,
        frame: FrameKey,
        (obj_id, object): (u32, &EvaluatedObject<'_>),
        (truths, count): (Vec<usize>, usize),
    ) -> Result<Judged, String> {
        let of_frame = self.rows_of.get(&frame).map_or(&[][..], Vec::as_slice);
        let of_object = of_frame.iter().filter(|i| self.rows[**i].obj_id == obj_id);
        let of_object: Vec<usize> = of_object.copied().collect();
        let scores: Vec<f64> = of_object.iter().map(|i| self.rows[*i].score).collect();
        let kept = top_estimates(&scores, count);
        let rows: Vec<usize> = kept.into_iter().map(|kept| of_object[kept]).collect();

        let all = image.scene.ground_truth(image.im_id).unwrap_or_default();
        let true_poses: Vec<Isometry3<f64>> =
            truths.iter().map(|i| all[*i].camera_from_object).collect();
        let mesh = object.model.mesh();
        let region = image.camera.region();
        if renders.truths.len() < true_poses.len() {
            renders
                .truths
                .resize_with(true_poses.len(), RenderedView::default);
        }
        for (pose, view) in true_poses.iter().zip(&mut renders.truths) {
            let rasterizer = &mut renders.rasterizer;
            rasterizer.render(mesh, &image.camera, pose, &region, view);
        }
        let mut estimates = Vec::with_capacity(rows.len());
        for row in &rows {
            let pose = self.rows[*row].camera_from_object();
            let (rasterizer, view) = (&mut renders.rasterizer, &mut renders.estimate);
            rasterizer.render(mesh, &image.camera, &pose, &region, view);
            let errors = true_poses
                .iter()
                .zip(&renders.truths)
                .map(|(truth, true_view)| {
                    let vsd = if spheres_overlap(&pose, truth, object.points.diameter()) {
                        bop_vsd(
                            &image.depth,
                            &image.camera,
                            view,
                            true_view,
                            object.points.diameter(),
                            self.delta,
                        )
                        .map_err(|e| format!("object {obj_id} in image {}: {e}", image.im_id))?
                    } else {
                        [1.0; N_TOLERANCES]
                    };
                    Ok(PoseErrors {
                        vsd,
                        mssd_m: object.points.mssd(&pose, truth),
                        mspd_px: object.points.mspd(&pose, truth, &image.camera),
                        add_m: object.points.add(&pose, truth),
                        adi_m: object.points.adi(&pose, truth),
                        translation_m: (pose.translation.vector - truth.translation.vector).norm(),
                    })
                });
            estimates.push(errors.collect::<Result<Vec<_>, String>>()?);
        }
        Ok(Judged {
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
        })
    }
}

/// Returns the most visible instances of an object in an image, as indices into its ground truth.
fn instances(scene: &Scene, im_id: u32, obj_id: u32, count: usize) -> Vec<usize> {
    let truths = scene.ground_truth(im_id).unwrap_or_default();
    let infos = scene.ground_truth_info(im_id).unwrap_or_default();
    let of_object: Vec<usize> = (0..truths.len())
        .filter(|index| truths[*index].obj_id == obj_id)
        .collect();
    let fractions: Vec<f64> = of_object
        .iter()
        // Where nothing is said of it, everything is seen.
        .map(|index| {
            infos
                .get(*index)
                .and_then(|i| i.visible_fraction)
                .unwrap_or(1.0)
        })
        .collect();
    let kept = most_visible(&fractions, count);
    kept.into_iter().map(|kept| of_object[kept]).collect()
}

/// Compares the size of the depth image with those of the colour image and the masks, by their headers.
fn check_size(image: &Image, judged: &mut JudgedFrame) {
    let expected = (image.depth.width(), image.depth.height());
    let n_instances = image.scene.ground_truth(image.im_id).map_or(0, <[_]>::len);
    let masks = (0..n_instances).map(|i| image.scene.visible_mask_path(image.im_id, i));
    let color = image.scene.color_path(image.im_id);
    let color = color.filter(|path| path.extension().is_some_and(|e| e == "png"));
    for path in masks.chain(color).filter(|path| !hicp_io::is_absent(path)) {
        match hicp_io::read_png_size(&path) {
            Ok(found) if found != expected => judged.misfits.push(format!(
                "{} is {}x{} pixels, expected {}x{} as the depth image",
                path.display(),
                found.0,
                found.1,
                expected.0,
                expected.1
            )),
            Ok(_) => {}
            Err(error) => judged.misfits.push(hicp_bop::chain(&error)),
        }
    }
}
