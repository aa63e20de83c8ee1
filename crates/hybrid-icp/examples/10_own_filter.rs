//! A custom outlier filter: removes and weighs pairs.
//!
//! `cargo run --release -p hybrid-icp --example 10_own_filter`

use std::error::Error;

use hybrid_icp::association::{MaxNormalAngle, OutlierFilter};
use hybrid_icp::core::{Correspondences, Iteration};
use hybrid_icp::prelude::*;

mod scene;

/// Keeps the pairs nearer than a limit that halves with every iteration, down to a smallest one.
struct Narrowing {
    first_meters: f32,
    last_meters: f32,
}

impl OutlierFilter for Narrowing {
    // The limit depends on the index alone and not on the previous limit, because a stage goes back
    // by one iteration after a rejected pose.
    fn filter(&mut self, iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        let halvings = i32::try_from(iteration.index).unwrap_or(i32::MAX);
        let limit = (self.first_meters * 0.5_f32.powi(halvings)).max(self.last_meters);
        pairs.retain(|pair| pair.distance() < limit);
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let narrowing = Narrowing {
        first_meters: 0.02,
        last_meters: 0.005,
    };
    scene::Scene::new()?.refine(Icp {
        selection: VisibleSurface::default(),
        association: NearestNeighbor::default(),
        filter: (narrowing, MaxNormalAngle::degrees(45.0)), // Filters chain.
        metric: PointToPlane,
        // Without `Divergence`: it counts the pairs after the filters, and would end the stage when
        // the limit falls.
        stop: (SmallMotion::default(), IterationLimit(50)),
    })
}
