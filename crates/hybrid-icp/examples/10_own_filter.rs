//! A custom outlier filter: removes and weighs pairs.
//!
//! `cargo run --release -p hybrid-icp --example 10_own_filter`

use std::error::Error;

use hybrid_icp::{
    Correspondences, Icp, IterationLimit, MaxNormalAngle, NearestNeighbor, OutlierFilter,
    PointToPlane, Problem, SmallMotion, VisibleSurface,
};

mod scene;

/// Keeps the pairs nearer than a limit that halves with every iteration, down to a smallest one.
struct Narrowing {
    first_meters: f32,
    last_meters: f32,
    limit: f32,
}

impl OutlierFilter for Narrowing {
    // From the iteration's number alone, not from the limit before: a stage goes back by one after a rejected pose.
    fn begin(&mut self, iteration: usize) {
        let halvings = i32::try_from(iteration).unwrap_or(i32::MAX);
        self.limit = (self.first_meters * 0.5_f32.powi(halvings)).max(self.last_meters);
    }

    fn filter(&mut self, _problem: &Problem<'_>, pairs: &mut Correspondences) {
        pairs.retain(|pair| pair.distance() < self.limit);
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let narrowing = Narrowing {
        first_meters: 0.02,
        last_meters: 0.005,
        limit: 0.02,
    };
    scene::Scene::new()?.refine(Icp {
        selection: VisibleSurface::default(),
        association: NearestNeighbor::default(),
        filter: (narrowing, MaxNormalAngle::degrees(45.0)), // Filters chain.
        metric: PointToPlane,
        stop: (SmallMotion::default(), IterationLimit(50)),
    })
}
