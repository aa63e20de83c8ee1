//! A custom switcher: selects by how well the visible normals determine a point-to-plane step.

use super::icp;
use hicp_sim::{Household, rng};
use hicp_testkit::{SwitcherLaws, check_switcher};
use hicp_tests::{Scene, camera, perturbed_scene, render};
use hybrid_icp::Refiner;
use hybrid_icp::association::{NearestNeighbor, Projective, SearchIndex, Stride, VisibleSurface};
use hybrid_icp::core::{
    Context, Isometry3, Matrix3, NO_TRIANGLE, Observation, UnitQuaternion, Vector3,
};
use hybrid_icp::icp::{Divergence, Icp, IterationLimit, Observer, Regime, RegimeEvent, Stage};
use hybrid_icp::metric::{PointToPlane, PointToPoint};
use hybrid_icp::switch::{Switch, Switcher};

// --- The component ---

/// Selects the misaligned branch if the visible normals leave a direction free.
///
/// A direction is free if the smallest eigenvalue of the mean outer product of the normals is below
/// a bound. The eigenvalue is 0 for one face of a box and at most ⅓ for a corner or a ball.
/// Point-to-plane slides along a free direction.
#[derive(Clone, Copy, Debug)]
struct Planarity {
    bound: f64,
}

impl Switcher for Planarity {
    fn regime(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
    ) -> RegimeEvent {
        let problem = context.problem;
        let (Some(model), Some(view)) = (problem.model(), context.view(camera_from_object)) else {
            return RegimeEvent {
                regime: Regime::MISALIGNED,
                score: None,
            };
        };
        let mesh = model.mesh();
        let (mut sum, mut count) = (Matrix3::zeros(), 0.0);
        for triangle in view.triangles().iter().filter(|t| **t != NO_TRIANGLE) {
            if let Some(normal) = mesh.normal(*triangle as usize) {
                let normal = normal.cast::<f64>().into_inner();
                sum += normal * normal.transpose();
                count += 1.0;
            }
        }
        let spread = (sum / f64::max(count, 1.0)).symmetric_eigenvalues().min();
        let free = spread < self.bound;
        RegimeEvent {
            regime: if free {
                Regime::MISALIGNED
            } else {
                Regime::ALIGNED
            },
            score: Some(spread),
        }
    }
}

// --- Its tests ---

const PLANARITY: Planarity = Planarity { bound: 0.02 };

fn planes() -> impl Stage + Send + 'static {
    icp(VisibleSurface::default(), Projective, PointToPlane)
}

fn switching() -> impl Stage + Send + 'static {
    Switch {
        switcher: PLANARITY,
        aligned: planes(),
        misaligned: Icp {
            selection: VisibleSurface::default(),
            association: NearestNeighbor::new(Stride::Pixels(1), SearchIndex::default()),
            filter: (),
            metric: PointToPoint,
            stop: (Divergence::count_aware(), IterationLimit(200)),
        },
    }
}

/// Records the selected regimes.
#[derive(Default)]
struct Regimes(Vec<Regime>);

impl Observer for Regimes {
    fn on_regime(&mut self, event: &RegimeEvent) {
        self.0.push(event.regime);
    }
}

/// Returns the final error of the center in meters and the selected regimes.
fn run(
    stage: impl Stage + Send + 'static,
    scene: &Scene,
    init: &Isometry3<f64>,
) -> (f64, Vec<Regime>) {
    let mut regimes = Regimes::default();
    let refined =
        Refiner::new(stage).refine_observed(&scene.model, &scene.observation, init, &mut regimes);
    let center = scene.model.center();
    let found = refined.outcome.camera_from_object * center;
    ((found - scene.truth * center).norm(), regimes.0)
}

/// A carton of which one face is seen.
fn face_on() -> Scene {
    let model = Household::Carton.model().unwrap();
    let turn = UnitQuaternion::new(Vector3::y() * std::f64::consts::FRAC_PI_2);
    let truth = Isometry3::translation(0.0, 0.0, 0.6) * turn;
    let (depth, mask) = render(&model, &camera(), &truth);
    let observation = Observation::new(depth, mask, camera()).unwrap();
    Scene {
        model,
        observation,
        truth,
    }
}

#[test]
fn it_keeps_the_laws() {
    check_switcher(|| PLANARITY, SwitcherLaws::default());
}

#[test]
fn a_face_that_point_to_plane_slides_along_is_held_by_its_outline() {
    let scene = face_on();
    let init = Isometry3::translation(0.012, -0.008, 0.01) * scene.truth;
    let (slid, _) = run(planes(), &scene, &init);
    let (held, regimes) = run(switching(), &scene, &init);
    assert_eq!(regimes, [Regime::MISALIGNED]);
    assert!(
        slid > 0.01 && held < 0.005,
        "{slid} by planes alone, {held} by switching"
    );
}

#[test]
fn an_object_that_holds_itself_is_registered_by_planes() {
    let (scene, init) = perturbed_scene(Household::Iron, 0.5, &mut rng(3), (0.005, 0.08));
    let center = scene.model.center();
    let before = (init * center - scene.truth * center).norm();
    let (distance, regimes) = run(switching(), &scene, &init);
    assert_eq!(regimes, [Regime::ALIGNED]);
    assert_eq!(distance, run(planes(), &scene, &init).0);
    assert!(distance < 0.5 * before, "{before} to {distance}");
}
