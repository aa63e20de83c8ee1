//! A custom point selection: the visible surface without occluded points.

use super::icp;
use hicp_testkit::check_selection;
use hicp_tests::starts::{Start, measure_stage, starts};
use hybrid_icp::association::{NearestNeighbor, PointSelection, VisibleSurface};
use hybrid_icp::core::{Context, Isometry3, Surfel};
use hybrid_icp::icp::Stage;
use hybrid_icp::metric::PointToPlane;

// --- The component ---

/// Drops the points of another selection that are behind a measured surface by more than a margin.
///
/// They are behind a hand, a gripper or a shelf, and every pair of them is wrong.
#[derive(Clone, Copy, Debug)]
struct Unhidden<P> {
    inner: P,
    margin_meters: f64,
}

impl<P: PointSelection> PointSelection for Unhidden<P> {
    fn select(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        self.inner.select(context, camera_from_object, source);
        let Some(observation) = context.problem.observation() else {
            return;
        };
        source.retain(|surfel| {
            let point = camera_from_object * surfel.point.cast::<f64>();
            let Some(pixel) = observation.camera().project(&point) else {
                return false; // Behind the camera.
            };
            let (u, v) = (pixel.x.round().max(0.0), pixel.y.round().max(0.0));
            let measured = observation.depth().get(u as u32, v as u32).unwrap_or(0.0);
            measured <= 0.0 || f64::from(measured) > point.z - self.margin_meters
        });
    }
}

// --- Its tests ---

fn nearest<P: PointSelection>(selection: P) -> impl Stage {
    icp(selection, NearestNeighbor::default(), PointToPlane)
}

fn unhidden() -> Unhidden<VisibleSurface> {
    Unhidden {
        inner: VisibleSurface::default(),
        margin_meters: 0.03,
    }
}

#[test]
fn it_keeps_the_laws() {
    check_selection(unhidden);
}

#[test]
fn behind_an_obstacle_it_refines_where_the_whole_visible_surface_is_misled() {
    let mut starts = starts(3, 0.5);
    for Start { scene, .. } in &mut starts {
        scene.observation = scene.behind_a_bar(0.4, 0.05, false);
    }
    let plain = measure_stage(&mut nearest(VisibleSurface::default()), &starts);
    let mine = measure_stage(&mut nearest(unhidden()), &starts);
    mine.assert_below(0.7, &plain);
}
