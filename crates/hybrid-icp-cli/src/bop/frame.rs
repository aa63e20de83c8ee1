//! A frame whose rows are refined, and what becomes of them.

use hicp_io::bop::{Detection, Rle};
use hybrid_icp::{Isometry3, Model, Observation, Refiner};

use super::images::Image;
use super::problem::Problem;

/// What became of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Fate {
    Refined,
    MissingModel,
    MissingFrame,
    NoMask,
    NoOverlap,
    Damaged,
    /// The pipeline kept the initial pose, and this is why.
    Kept(&'static str),
}

impl Fate {
    pub(crate) fn describe(self) -> String {
        match self {
            Self::Refined => "refined".to_owned(),
            Self::MissingModel => "kept: missing model".to_owned(),
            Self::MissingFrame => "kept: missing frame".to_owned(),
            Self::NoMask => "kept: no mask of the object".to_owned(),
            Self::NoOverlap => "kept: no overlap with a mask of the object".to_owned(),
            Self::Damaged => "kept: damaged file".to_owned(),
            Self::Kept(reason) => format!("kept by the pipeline: {reason}"),
        }
    }
}

impl From<&Problem> for Fate {
    fn from(problem: &Problem) -> Self {
        if problem.missing {
            Self::MissingFrame
        } else {
            Self::Damaged
        }
    }
}

/// A frame while its rows are refined: depth read once, an observation made once per mask that is asked for.
pub(crate) struct Frame<'a> {
    image: Image<'a>,
    masks: Vec<Candidate<'a>>,
    /// Masks that could not be used.
    pub(crate) problems: Vec<Problem>,
}

/// A mask that a row may be refined in.
struct Candidate<'a> {
    obj_id: u32,
    source: MaskSource<'a>,
    seen: Seen,
}

/// What a mask cuts out of the frame.
enum Seen {
    /// Nobody asked for it yet.
    Unread,
    /// Its file is not there or cannot be used.
    Unusable(Fate),
    Observed(Box<Observation>),
}

#[derive(Clone, Copy)]
enum MaskSource<'a> {
    /// The visible mask of an instance, by its index in the ground truth.
    Instance(usize),
    /// A detection's run-length code.
    Code(&'a Rle),
}

impl<'a> Candidate<'a> {
    fn new(obj_id: u32, source: MaskSource<'a>) -> Self {
        Self {
            obj_id,
            source,
            seen: Seen::Unread,
        }
    }
}

impl<'a> Frame<'a> {
    /// Finds the masks of an image: of its ground truth, or of the detections where there are any.
    pub(crate) fn new(image: Image<'a>, detections: Option<&'a [Detection]>) -> Self {
        let masks = match detections {
            Some(detections) => detections
                .iter()
                .filter_map(|d| d.segmentation.as_ref().map(|rle| (d.category_id, rle)))
                .map(|(obj_id, rle)| Candidate::new(obj_id, MaskSource::Code(rle)))
                .collect(),
            None => image
                .scene
                .ground_truth(image.im_id)
                .unwrap_or_default()
                .iter()
                .enumerate()
                .map(|(instance, truth)| {
                    Candidate::new(truth.obj_id, MaskSource::Instance(instance))
                })
                .collect(),
        };
        Self {
            image,
            masks,
            problems: Vec::new(),
        }
    }

    /// Returns the observation whose mask the silhouette at the initial pose overlaps most, the first among equals, or why there is none.
    pub(crate) fn choose(
        &mut self,
        refiner: &mut Refiner,
        model: &Model,
        obj_id: u32,
        init: &Isometry3<f64>,
    ) -> Result<&Observation, Fate> {
        let mut best: Option<(usize, usize)> = None;
        let mut fate = Fate::NoMask;
        for index in 0..self.masks.len() {
            if self.masks[index].obj_id != obj_id {
                continue;
            }
            match self.observation(index) {
                Ok(observation) => {
                    let overlap = overlap(refiner, model, observation, init);
                    if overlap > best.map_or(0, |(_, most)| most) {
                        best = Some((index, overlap));
                    }
                    fate = fate.max(Fate::NoOverlap);
                }
                Err(unusable) => fate = fate.max(unusable),
            }
        }
        match best {
            Some((index, _)) => self.observation(index),
            None => Err(fate),
        }
    }

    /// Returns what a mask cuts out, made when it is first asked for.
    fn observation(&mut self, index: usize) -> Result<&Observation, Fate> {
        if matches!(self.masks[index].seen, Seen::Unread) {
            let seen = match self.observe(self.masks[index].source) {
                Ok(observation) => Seen::Observed(Box::new(observation)),
                // An instance whose mask is not there is one without a mask.
                Err(problem) if problem.missing => Seen::Unusable(Fate::NoMask),
                Err(problem) => {
                    self.problems.push(problem);
                    Seen::Unusable(Fate::Damaged)
                }
            };
            self.masks[index].seen = seen;
        }
        match &self.masks[index].seen {
            Seen::Observed(observation) => Ok(observation),
            Seen::Unusable(fate) => Err(*fate),
            Seen::Unread => Err(Fate::NoMask),
        }
    }

    fn observe(&self, source: MaskSource<'_>) -> Result<Observation, Problem> {
        let (mask, name) = match source {
            MaskSource::Instance(instance) => {
                let mask = self
                    .image
                    .scene
                    .read_visible_mask(self.image.im_id, instance);
                let path = self
                    .image
                    .scene
                    .visible_mask_path(self.image.im_id, instance);
                (
                    mask.map_err(|e| Problem::of(&e))?,
                    path.display().to_string(),
                )
            }
            MaskSource::Code(code) => (
                code.to_mask(),
                format!(
                    "a segmentation of image {} in --detections",
                    self.image.im_id
                ),
            ),
        };
        let size = |width: u32, height: u32| format!("{width}x{height}");
        let mask_size = size(mask.width(), mask.height());
        Observation::new(self.image.depth.clone(), mask, self.image.camera).map_err(|_| {
            let depth = self.image.scene.depth_path(self.image.im_id);
            let depth = depth.map_or_else(|e| e.to_string(), |path| path.display().to_string());
            let depth_size = size(self.image.depth.width(), self.image.depth.height());
            Problem::damaged(format!(
                "{name} is {mask_size} pixels but {depth} is {depth_size}, expected the same size"
            ))
        })
    }
}

/// Returns how many pixels of the mask the model covers at a pose. The render is the one that the refinement begins with.
fn overlap(
    refiner: &mut Refiner,
    model: &Model,
    observation: &Observation,
    pose: &Isometry3<f64>,
) -> usize {
    let problem = hybrid_icp::Problem::new(model, observation);
    let mut context = refiner.workspace_mut().context(&problem);
    let view = context.view(pose);
    let region = view.region();
    let mask = observation.mask();
    (region.v_min..region.v_max)
        .flat_map(|v| (region.u_min..region.u_max).map(move |u| (u, v)))
        .zip(view.depth())
        .filter(|((u, v), z)| **z > 0.0 && mask.get(*u, *v) == Some(true))
        .count()
}
