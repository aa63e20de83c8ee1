//! A diagnosis of the inputs of a refinement.

mod fault;
mod hypotheses;
mod images;
mod inputs;
mod scales;

use std::borrow::Cow;
use std::sync::Arc;

use hicp_core::{Facing, Isometry3, Model, Observation, Problem, Translation3, TriMesh};
use hicp_icp::{Session, Stage, Workspace};
use hicp_raster::Rasterizer;
use hicp_score::{Flatness, MeanVsd, Score};

pub use fault::Fault;

use self::inputs::Inputs;
use crate::checks::warnings;
use crate::presets::{self, Local};
use crate::warning::Warning;

/// Smallest improvement of the score that names a fault.
const CLEAR: f64 = 0.05;
/// The same for distances along the ray, which differ little from depths.
const CLEAR_RAY: f64 = 0.03;
/// A corrected score from which on the correction explains nothing. With the model or the mask of
/// another object, most corrections improve the score, but no score is good.
const UNEXPLAINED: f64 = 0.5;
/// Share of the distance: a move by it is as costly as a move by the diameter.
const DISTANCE: f64 = 0.2;

/// Number of corrections that are refined: those with the lowest MVE at the initial pose.
const TRIALS: usize = 8;
/// A corrected score below which a flat measured surface is no reason to doubt the mask.
const EXPLAINED: f64 = 0.15;
/// The same as a share of the score of the inputs as they are.
const MUCH_BETTER: f64 = 0.4;

/// A fault, and the evidence for it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Finding {
    /// The fault.
    pub fault: Fault,
    /// The score of the corrected inputs, to compare with [`Diagnosis::score`]. `None` if the fault
    /// is a fact that needs no comparison.
    pub score: Option<f64>,
}

/// The probable faults of the inputs of a refinement.
///
/// Each of some 30 hypotheses corrects the inputs as if they had one fault. The eight whose initial
/// pose explains the image best are refined and scored. A fault is named if its correction lowers
/// the score clearly, to below 0.5. A correction that bends the measured surface, such as that of
/// distances along the ray, must also lower the MVE of the refined pose. A plane in the mask and
/// the faults of [`Diagnosis::facts`] are named without such a comparison.
///
/// The score is the MVE of the refined pose, plus the mean distance by which the refinement moved
/// the object's points. That distance is relative to the diameter, or to a fifth of the object's
/// distance if that is shorter. If the MVE of the initial pose is lower, the score is that MVE. It
/// is 1 if the inputs contradict each other ([`warnings`](crate::warnings)).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Diagnosis {
    /// The faults, the most probable one first. Empty if none is probable.
    pub findings: Vec<Finding>,
    /// The score of the inputs as they are: 0 is perfect, 1 the worst.
    pub score: f64,
}

impl Diagnosis {
    /// Examines inputs; `init` is camera from object, meters.
    ///
    /// The pose may be off by some millimeters and degrees, as those of detectors are. Inputs
    /// without a fault can still give a bad pose. Deterministic. Cost: about 10 refinements and 30
    /// scores.
    ///
    /// ```
    /// use hybrid_icp::{Diagnosis, Fault, core::*};
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let corners = [[-0.1, -0.1, 0.], [0.1, -0.1, 0.], [0.1, 0.1, 0.], [-0.1, 0.1, 0.]].map(Point3::from);
    /// # let model = Model::new(TriMesh::new(corners.to_vec(), vec![[0, 2, 1], [0, 3, 2]])?);
    /// # let camera = PinholeCamera::new(100.0, 100.0, 31.5, 31.5, 64, 64)?;
    /// // A plate half a meter away, but the depth was read at ten times its scale.
    /// let shown = |i: usize| (12..52).contains(&(i % 64)) && (12..52).contains(&(i / 64));
    /// let depth = (0..64 * 64).map(|i| if shown(i) { 5.0 } else { 0.0 }).collect();
    /// let depth = DepthImage::from_meters(64, 64, depth)?;
    /// let mask = Mask::new(64, 64, (0..64 * 64).map(shown).collect())?;
    /// let observation = Observation::new(depth, mask, camera)?;
    /// let init = Isometry3::translation(0.0, 0.0, 0.503);
    /// let diagnosis = Diagnosis::of(&model, &observation, &init);
    /// assert_eq!(diagnosis.fault(), Some(&Fault::DepthScale { factor: 0.1 }));
    /// # Ok(()) }
    /// ```
    #[must_use]
    pub fn of(model: &Model, observation: &Observation, init: &Isometry3<f64>) -> Self {
        let inputs = Inputs {
            model: Cow::Borrowed(model),
            depth: Arc::clone(observation.shared_depth()),
            mask: Cow::Borrowed(observation.mask()),
            camera: *observation.camera(),
            init: *init,
        };
        let facts = Self::facts(model, observation);
        let fact = |fault| Finding { fault, score: None };
        if facts.contains(&Fault::MaskEmpty) {
            let findings = facts.into_iter().map(fact).collect();
            return Self {
                findings,
                score: 1.0,
            };
        }
        let mut judge = Judge::default();
        let Judged {
            score, mve, flat, ..
        } = judge.refined(&inputs);
        let mut trials = Vec::new();
        for (fault, inputs) in hypotheses::all(&inputs) {
            trials.push((judge.initial(&inputs), fault, inputs));
        }
        trials.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut found = Vec::new();
        for (_, mut fault, inputs) in trials.into_iter().take(TRIALS) {
            let handicap = hypotheses::handicap(&fault);
            let mut trial = judge.refined(&inputs);
            if let Fault::Origin { shift_meters } = &mut fault {
                // The first refinement finds the shift, and the second one judges it.
                let center = model.center();
                let shift = init.inverse() * (trial.pose * center) - center;
                *shift_meters = shift.into();
                trial = judge.refined(&inputs.with_init(init * Translation3::from(shift)));
            }
            let corrected = trial.score;
            // These bend the image. A rough pose may be nearer to a bent object, but the right
            // object fits better after both are refined.
            let is_bent = matches!(
                fault,
                Fault::RayDistance | Fault::DepthInverted | Fault::Disparity { .. }
            );
            if is_bent && trial.mve >= mve {
                continue;
            }
            let is_named = match fault {
                // Pixels without a measurement have no effect on the score.
                Fault::MaskTooLarge { outside } if outside > 0.5 => true,
                Fault::RayDistance => corrected + CLEAR_RAY < score,
                _ => corrected + handicap + CLEAR < score,
            };
            if is_named && corrected + handicap < UNEXPLAINED {
                let score = Some(corrected);
                found.push((corrected + handicap, Finding { fault, score }));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        let best = found.first().map(|(score, _)| *score);
        let mut findings: Vec<_> = found.into_iter().map(|(_, finding)| finding).collect();
        let explained = best.is_some_and(|best| best < EXPLAINED.max(MUCH_BETTER * score));
        if flat && !explained {
            findings.insert(0, fact(Fault::PlaneInMask { share: 1.0 }));
        }
        findings.extend(facts.into_iter().map(fact));
        Self { findings, score }
    }

    /// Returns the faults that need no comparison: an empty mask, a mask without depth, and a mesh
    /// that is inside out.
    ///
    /// Cost: O(triangles).
    #[must_use]
    pub fn facts(model: &Model, observation: &Observation) -> Vec<Fault> {
        let mut facts = Vec::new();
        if observation.region().is_empty() {
            facts.push(Fault::MaskEmpty);
        } else if observation.n_measured() == 0 {
            facts.push(Fault::NoDepth);
        }
        if is_inside_out(model.mesh()) {
            facts.push(Fault::MeshInsideOut);
        }
        facts
    }

    /// Returns the most probable fault.
    #[must_use]
    pub fn fault(&self) -> Option<&Fault> {
        self.findings.first().map(|finding| &finding.fault)
    }
}

/// The result of a short refinement.
struct Judged {
    /// Camera from object.
    pose: Isometry3<f64>,
    score: f64,
    /// The MVE of the refined pose, however far it moved.
    mve: f64,
    /// `true` if a plane explains the depth better than the model does.
    flat: bool,
}

/// Scores inputs.
struct Judge {
    stage: Local,
    workspace: Workspace,
}

impl Default for Judge {
    fn default() -> Self {
        Self {
            stage: presets::local(),
            workspace: Workspace::new(Rasterizer::default()),
        }
    }
}

impl Judge {
    /// Returns the observation, or `None` if the numbers of the inputs exclude each other.
    fn observation(inputs: &Inputs<'_>) -> Option<Observation> {
        let depth = Arc::clone(&inputs.depth);
        let observation = Observation::new(depth, inputs.mask.as_ref().clone(), inputs.camera);
        let observation = observation.ok()?;
        let excluded = |warning: &Warning| {
            !matches!(
                warning,
                Warning::CoarseCoordinates { .. }
                    | Warning::Center { .. }
                    | Warning::Symmetry { .. }
            )
        };
        let warnings = warnings(&inputs.model, &observation, &inputs.init);
        (!warnings.iter().any(excluded)).then_some(observation)
    }

    /// Returns the MVE of the initial pose.
    fn initial(&mut self, inputs: &Inputs<'_>) -> f64 {
        let Some(observation) = Self::observation(inputs) else {
            return 1.0;
        };
        let problem = Problem::new(inputs.model.as_ref(), &observation);
        let mut context = self.workspace.context(&problem);
        MeanVsd::default().score(&mut context, &inputs.init)
    }

    /// Refines the initial pose of inputs.
    fn refined(&mut self, inputs: &Inputs<'_>) -> Judged {
        let (model, init) = (inputs.model.as_ref(), &inputs.init);
        let Some(observation) = Self::observation(inputs) else {
            return Judged {
                pose: *init,
                score: 1.0,
                mve: 1.0,
                flat: false,
            };
        };
        let problem = Problem::new(model, &observation);
        let (stage, observer) = (&mut self.stage, &mut ());
        let mut session = Session::new(&mut self.workspace, observer);
        let refined = stage.run(&problem, init, &mut session).camera_from_object;
        let mut context = self.workspace.context(&problem);
        let mut mve = |pose| MeanVsd::default().score(&mut context, pose);
        let samples = model.samples().iter();
        let samples = samples.map(|sample| sample.point.cast::<f64>());
        let moved: f64 = samples.map(|p| (refined * p - init * p).norm()).sum();
        let length = model.diameter().min(DISTANCE * (init * model.center()).z);
        let moved = moved / (model.samples().len().max(1) as f64 * length);
        let (of_init, of_refined) = (mve(init), mve(&refined));
        Judged {
            pose: refined,
            score: of_init.min(of_refined + moved),
            mve: of_refined,
            flat: Flatness::at(&mut context, &refined).is_some_and(|flat| flat.is_flat()),
        }
    }
}

/// Returns whether the triangles of a mesh face inward.
///
/// An open mesh is judged by the volume that it would enclose.
fn is_inside_out(mesh: &TriMesh) -> bool {
    if mesh.is_closed() {
        return mesh.facing() == Facing::Inward;
    }
    let Some(origin) = mesh.used_points().next() else {
        return false;
    };
    let corners = (0..mesh.triangles().len()).map(|triangle| mesh.corners(triangle));
    let volumes = corners.map(|corners| {
        let [a, b, c] = corners.map(|p| (p - origin).cast::<f64>());
        a.dot(&b.cross(&c))
    });
    let (sum, size) = volumes.fold((0.0, 0.0), |(sum, size), v| (sum + v, size + v.abs()));
    sum < -0.2 * size
}
