//! Poses to judge: results of pipelines, with the truth.

use std::error::Error;

use hicp_sim::{Household, Proportions, SimError, SimRng, invented, stream};
use hicp_tests::symmetric_pose_distance;
use hicp_tests::tabletop::{MaskKind, Seen, Tabletop};
use hybrid_icp::core::{DepthImage, Isometry3, Model, Observation, Problem};
use hybrid_icp::icp::{Repeat, Stage, is_near};
use hybrid_icp::score::{Confidence, Misfit, ModelPoints, N_FEATURES};
use hybrid_icp::{Preset, Refinement, Refiner, presets};
use rand::RngExt;

/// The pipelines whose results are judged.
const PRESETS: [Preset; 3] = [Preset::Local, Preset::Auto, Preset::Search];

/// A judged pose.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// The features of the confidence.
    pub features: [f64; N_FEATURES],
    /// The number of poses that look alike, if the pose is near the initial one. The features have
    /// 0 then.
    pub near: Option<f64>,
    /// The stated confidence.
    pub confidence: f64,
    /// The stated errors: the largest of a surface point in diameters, and the rotation in degrees.
    pub expected: [f64; 2],
    /// The true errors; `None` if the model is wrong.
    pub errors: Option<[f64; 2]>,
    /// Share of the object that is visible.
    pub visible: f64,
    /// The mean VSD estimate of the result, and whether a warning accompanies it.
    pub mve: f64,
    /// `true` if the result has a warning.
    pub warned: bool,
    /// The source of the pose.
    pub kind: Kind,
}

/// The source of a judged pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A refinement from a start near the truth.
    Near,
    /// A refinement from any rotation.
    Turned,
    /// A pose that was found without a start.
    Estimated,
    /// A perturbed pose that was not refined.
    Unrefined,
    /// A refinement with the model in other proportions.
    LookAlike,
    /// A refinement with the model of another object.
    OtherClass,
    /// A refinement in the image of a wall.
    Wall,
}

impl Kind {
    /// Every kind, with its name in tables.
    pub const ALL: [(Self, &str); 7] = [
        (Self::Near, "near start"),
        (Self::Turned, "any rotation"),
        (Self::Estimated, "no start"),
        (Self::Unrefined, "not refined"),
        (Self::LookAlike, "look-alike"),
        (Self::OtherClass, "other class"),
        (Self::Wall, "a wall"),
    ];
}

impl Case {
    /// Returns whether the pose is right.
    pub fn right(&self) -> bool {
        self.errors.is_some_and(|[distance, _]| distance < 0.1)
    }

    /// Judges the result of a refinement from `init`, or without it.
    ///
    /// `truth` is the true pose, if the model is that of the object.
    pub fn new(
        refiner: &mut Refiner,
        (model, observation): (&Model, &Observation),
        (init, refined): (Option<&Isometry3<f64>>, &Refinement),
        truth: Option<&Isometry3<f64>>,
        (visible, kind): (f64, Kind),
    ) -> Self {
        let pose = &refined.outcome.camera_from_object;
        let problem = Problem::new(model, observation);
        let misfit = Misfit::at(&mut refiner.workspace_mut().context(&problem), pose);
        let errors = truth.map(|truth| {
            let (angle, _) = symmetric_pose_distance(pose, truth, model.symmetries());
            let distance = ModelPoints::new(model).mssd(pose, truth) / model.diameter();
            [distance, angle.to_degrees()]
        });
        let near = init.is_some_and(|init| is_near(model, init, pose));
        let near = near.then_some(refined.look_alikes);
        Self {
            features: Confidence::features(
                &refined.evidence,
                &misfit.unwrap_or_default(),
                refined.mve,
                near.map_or(refined.look_alikes, |_| 0.0),
            ),
            near,
            confidence: refined.confidence,
            expected: [
                refined.expected_error_meters / model.diameter(),
                refined.expected_error_degrees,
            ],
            errors,
            visible,
            mve: refined.mve,
            warned: !refined.warnings().is_empty(),
            kind,
        }
    }
}

/// Factors of width and height by which the objects of the fit are stretched.
const STRETCHES: [(f64, f64); 3] = [(1.0, 1.0), (0.8, 1.2), (1.25, 0.85)];

/// Sets of ten invented objects for the fit.
const SETS: u64 = 20;

/// The objects of the simulated scenes.
pub enum Objects {
    /// Household objects.
    Household(&'static [Household; 10]),
    /// The tuning objects in three proportions, and invented objects from a seed.
    ForFit(u64),
}

impl Objects {
    /// Returns the scenes of these objects, wider and higher by factors.
    fn scenes(&self, (width, height): (f64, f64)) -> Result<Vec<Tabletop>, SimError> {
        let household = |objects, (w, h): (f64, f64)| {
            let (width, height) = (width * w, height * h);
            Tabletop::stretched(objects, Proportions { width, height })
        };
        let invent = |seed: u64| {
            let model = invented(seed, Proportions { width, height })?;
            Ok((format!("invented {seed}"), model))
        };
        match *self {
            Self::Household(objects) => Ok(vec![household(objects, (1.0, 1.0))?]),
            Self::ForFit(seed) => {
                let stretched = STRETCHES.map(|stretch| household(&Household::TUNING, stretch));
                let invented = (0..SETS).map(|set| {
                    let seeds = (0..10).map(|k| 10 * (seed * SETS + set) + k);
                    Ok(Tabletop::of(
                        seeds.map(invent).collect::<Result<_, SimError>>()?,
                    ))
                });
                stretched.into_iter().chain(invented).collect()
            }
        }
    }
}

/// The images of simulated cases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Images {
    /// White noise.
    Noisy,
    /// The same in images of any size.
    Resized,
    /// Systematic errors of the sensor, and a model that is not quite that of the object.
    Distorted,
    /// The same in images of any size.
    ResizedDistorted,
    /// White noise, and nothing measured outside of the mask.
    Cropped,
}

/// Factors of width and height of models that do not quite fit.
const ROUGH: (f64, f64) = (1.015, 0.985);

/// Simulates cases of some objects until there are `count`.
///
/// Every visible object gets several poses, each with another random kind of mask.
pub fn simulate(
    objects: &Objects,
    images: Images,
    seed: u64,
    count: usize,
) -> Result<Vec<Case>, Box<dyn Error>> {
    let distorted = matches!(images, Images::Distorted | Images::ResizedDistorted);
    let mut all = objects.scenes((1.0, 1.0))?;
    if matches!(images, Images::Resized | Images::ResizedDistorted) {
        all = all.into_iter().map(Tabletop::resized).collect();
    }
    let all_rough = objects.scenes(ROUGH)?;
    let all_alike = objects.scenes((1.12, 0.92))?;
    let mut refiners = PRESETS.map(Refiner::preset);
    let mut cases = Vec::new();
    let models = all.iter().zip(&all_rough).zip(&all_alike);
    for (scene, ((exact, rough), alike)) in (seed..).zip(models.cycle()) {
        let (scenes, visible) = if distorted {
            (rough, exact.distorted_scene(scene)?)
        } else {
            (exact, exact.scene(scene)?)
        };
        for (place, seen) in (0..).zip(visible) {
            let mut random = stream(scene, &["confidence"], place);
            let others = scenes.objects.len();
            let other = (seen.model + random.random_range(1..others)) % others;
            let own = &scenes.objects[seen.model].1;
            let alike = &alike.objects[seen.model].1;
            let kinds = [
                (Kind::Near, own),
                (Kind::Near, own),
                (Kind::Turned, own),
                (Kind::Estimated, own),
                (Kind::OtherClass, &scenes.objects[other].1),
                match place % 4 {
                    0 | 2 => (Kind::Unrefined, own),
                    1 => (Kind::LookAlike, alike),
                    _ => (Kind::Wall, own),
                },
            ];
            for (kind, model) in kinds {
                let refiner = &mut refiners[random.random_range(0..PRESETS.len())];
                cases.push(case(
                    refiner,
                    &seen,
                    (kind, images),
                    (own, model),
                    &mut random,
                )?);
            }
        }
        if cases.len() >= count {
            break;
        }
    }
    cases.truncate(count);
    Ok(cases)
}

/// Returns a refiner that only judges the initial pose.
fn unrefined() -> Refiner<impl Stage> {
    Refiner::new(Repeat {
        times: 0,
        stage: presets::local(),
    })
}

/// Returns an observation without the measurements outside of its mask.
fn cropped(observation: &Observation) -> Result<Observation, Box<dyn Error>> {
    let (depth, mask) = (observation.depth(), observation.mask());
    let pixels = depth.pixels().iter().zip(mask.pixels());
    let meters = pixels.map(|(z, masked)| if *masked { *z } else { 0.0 });
    let depth = DepthImage::from_meters(depth.width(), depth.height(), meters.collect())?;
    let camera = *observation.camera();
    Ok(Observation::new(depth, mask.clone(), camera)?)
}

fn case(
    refiner: &mut Refiner,
    seen: &Seen,
    (kind, images): (Kind, Images),
    (own, model): (&Model, &Model),
    random: &mut SimRng,
) -> Result<Case, Box<dyn Error>> {
    let masks = MaskKind::fitted();
    let mask = masks[random.random_range(0..masks.len())];
    let observation = match kind {
        Kind::Wall => seen.walled(random)?.observe(mask)?,
        _ => seen.observe(mask)?,
    };
    let observation = if images == Images::Cropped {
        cropped(&observation)?
    } else {
        observation
    };
    let factor = 2.0 * random.random::<f64>();
    let init = match kind {
        Kind::Near | Kind::Unrefined | Kind::LookAlike | Kind::Wall => seen.near(random, factor),
        _ => seen.turned(random, own, model),
    };
    let refined = match kind {
        Kind::Estimated => refiner.estimate(model, &observation),
        Kind::Unrefined => unrefined().refine(model, &observation, &init),
        _ => refiner.refine(model, &observation, &init),
    };
    let truth = match kind {
        Kind::LookAlike | Kind::OtherClass | Kind::Wall => None,
        _ => Some(&seen.truth),
    };
    let sides = (model, &observation);
    Ok(Case::new(
        refiner,
        sides,
        ((kind != Kind::Estimated).then_some(&init), &refined),
        truth,
        (seen.visible_share, kind),
    ))
}
