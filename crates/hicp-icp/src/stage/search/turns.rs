//! Near symmetries as exactly as the surface determines them.

use std::sync::Arc;

use hicp_association::{AllSamples, MaxDistance, NearestNeighbor, UniformCount};
use hicp_core::{
    Cloud, Isometry3, Model, Observation, PinholeCamera, PixelRegion, Point3, Problem,
    RenderedView, Renderer, TriMesh, UnitQuaternion, UnitVector3, Vector3,
};
use hicp_metric::{Conditioned, PointToPlane};

use crate::outcome::Quality;
use crate::session::{Session, Workspace};
use crate::stage::icp::Icp;
use crate::stage::search::near_symmetries::NearSymmetries;
use crate::stage::stage_trait::Stage;
use crate::stop::{Convergence, IterationLimit};

/// Number of points that are registered with the surface.
const POINTS: usize = 300;
/// Largest distance of their pairs, as a share of the diameter.
const NEAR: f64 = 0.05;
/// Largest distance of a surface of revolution from itself after a rotation, as a share of the
/// diameter.
const SMOOTH: f64 = 0.015;
/// Information about a direction, relative to the best known one, up to which a registration does
/// not move along it. The dents of a can say something about the rotation around its axis, but too
/// little for an image to show it.
const LEAST_INFORMATION: f64 = 0.02;
/// Rotation by which the registration of a surface of revolution may change a motion, radians.
const SNAPPED: f64 = 0.15;
/// Smallest rotation that determines an axis, radians.
const LEAST_ANGLE: f64 = 0.4;
/// Least cosine of the angle between the axis of a near symmetry and the axis to be found.
const ALONG: f64 = 0.999;
/// The same for the registered motion, whose axis is less exact.
const REGISTERED_ALONG: f64 = 0.99;
/// Share of the rotations around an axis that must map the surface onto itself. The registration of
/// a few may fail.
const LEAST_FITTING: f64 = 0.8;
/// Step around an axis, degrees.
const STEP: u16 = 5;

/// An axis around which the depth hardly changes, in the object frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spin {
    axis: UnitVector3<f64>,
    point: Point3<f64>,
}

impl Spin {
    /// Returns the rotation around the axis.
    pub(crate) fn turn(&self, degrees: f64) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_axis_angle(&self.axis, degrees.to_radians());
        Isometry3::rotation_wrt_point(turn, self.point)
    }

    /// Returns whether a motion is a rotation around the axis, up to a tenth of a radian.
    fn turns(&self, motion: &Isometry3<f64>) -> bool {
        motion.rotation.angle() > 0.2 && (motion.rotation * *self.axis).dot(&self.axis) > 0.995
    }
}

/// The near symmetries of a model, each registered with the surface, and its axes.
///
/// Computed once per model, in some 50 ms.
#[derive(Debug)]
pub(crate) struct Turns {
    near: Arc<NearSymmetries>,
    motions: Vec<Isometry3<f64>>,
    spins: Vec<Spin>,
}

impl Turns {
    pub(crate) fn of(model: &Model) -> Arc<Self> {
        model.derived().get_or_build(0, || Self::find(model))
    }

    fn find(model: &Model) -> Self {
        let near = NearSymmetries::of(model);
        let cloud = Cloud::new(model.samples().iter().copied());
        let problem = Problem::new(&cloud, &cloud);
        let mut register = Icp {
            selection: UniformCount {
                selection: AllSamples,
                count: POINTS,
            },
            association: NearestNeighbor::default(),
            filter: MaxDistance::diameters(NEAR),
            metric: Conditioned {
                metric: PointToPlane,
                threshold: LEAST_INFORMATION,
                ..Conditioned::default()
            },
            stop: (Convergence::default(), IterationLimit(15)),
        };
        let mut workspace = Workspace::new(NoRenderer);
        let mut observer = ();
        let mut session = Session::new(&mut workspace, &mut observer);
        let smooth = SMOOTH * model.diameter();
        let registered: Vec<(Isometry3<f64>, bool)> = near
            .motions()
            .map(|motion| {
                let outcome = register.run(&problem, motion, &mut session);
                let fits = |quality: Quality| quality.plane_rmse < smooth && quality.fitness > 0.9;
                let moved = outcome.camera_from_object;
                let turned = moved.rotation.angle_to(&motion.rotation) > SNAPPED;
                let fits = !turned && outcome.quality.is_some_and(fits);
                (moved, fits)
            })
            .collect();
        let spins = near.spins().iter();
        let spins = spins.filter_map(|axis| spin(axis, near.motions().zip(&registered)));
        Self {
            spins: spins.collect(),
            motions: registered.iter().map(|(motion, _)| *motion).collect(),
            near,
        }
    }

    /// Lists the motions S for which the image may show the object at `pose · S` instead.
    ///
    /// The identity is the first. Around an axis they are close to each other.
    pub(crate) fn undecided(
        &self,
        model: &Model,
        observation: &Observation,
        pose: &Isometry3<f64>,
        motions: &mut Vec<Isometry3<f64>>,
    ) {
        motions.clear();
        motions.push(Isometry3::identity());
        let undecided = self.near.undecided(observation, pose, model.diameter());
        let undecided: Vec<_> = undecided.map(|index| self.motions[index]).collect();
        let turns = |spin: &&Spin| undecided.iter().any(|motion| spin.turns(motion));
        let spins: Vec<_> = self.spins.iter().filter(turns).collect();
        // An axis explains all but one of the motions that differ by a rotation around it.
        for motion in undecided {
            let same = |other: &Isometry3<f64>| {
                let between = other.inverse() * motion;
                spins.iter().any(|spin| spin.turns(&between))
            };
            if !motions.iter().any(same) {
                motions.push(motion);
            }
        }
        for index in 0..motions.len() {
            let motion = motions[index];
            for spin in &spins {
                let angles = (1..360 / STEP).map(|step| f64::from(step * STEP));
                motions.extend(angles.map(|degrees| motion * spin.turn(degrees)));
            }
        }
    }
}

/// Clouds are never rendered.
struct NoRenderer;

impl Renderer for NoRenderer {
    fn render(
        &mut self,
        _: &TriMesh,
        _: &PinholeCamera,
        _: &Isometry3<f64>,
        _: &PixelRegion,
        view: &mut RenderedView,
    ) {
        view.reset(PixelRegion::default());
    }
}

/// Returns the mean axis of the motions around `axis` that map the surface onto itself.
///
/// Each motion comes with what its registration made of it. Returns `None` if too many motions
/// around the axis do not fit.
fn spin<'a>(
    axis: &UnitVector3<f64>,
    motions: impl Iterator<Item = (&'a Isometry3<f64>, &'a (Isometry3<f64>, bool))>,
) -> Option<Spin> {
    let (mut around, mut fitting) = (0, 0);
    let (mut direction, mut point) = (Vector3::zeros(), Vector3::zeros());
    let along = |motion: &Isometry3<f64>| Some(motion.rotation.axis()?.dot(axis).abs());
    for (before, (motion, fits)) in motions {
        // A tilt that the registration removed says nothing about rotations around the axis.
        let around_it = along(before) > Some(ALONG) && along(motion) > Some(REGISTERED_ALONG);
        let Some(own) = motion.rotation.axis().filter(|_| around_it) else {
            continue;
        };
        let angle = motion.rotation.angle();
        if angle < LEAST_ANGLE {
            continue;
        }
        around += 1;
        if *fits {
            fitting += 1;
            // Half a turn determines the axis best.
            let weight = (0.5 * angle).sin();
            direction += own.into_inner() * (weight * own.dot(axis).signum());
            let shift = motion.translation.vector;
            let across = shift - own.into_inner() * own.dot(&shift);
            let cotangent = 1.0 / (0.5 * angle).tan();
            point += (across + own.cross(&across) * cotangent) * (0.5 * weight);
        }
    }
    let weight = direction.norm();
    let enough = fitting > 0 && f64::from(fitting) >= LEAST_FITTING * f64::from(around);
    enough.then(|| Spin {
        axis: UnitVector3::new_normalize(direction),
        point: Point3::from(point / weight),
    })
}
