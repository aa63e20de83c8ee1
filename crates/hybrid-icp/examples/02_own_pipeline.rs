//! A custom pipeline: the five components of an ICP stage, and stages made of stages.
//!
//! `cargo run --release -p hybrid-icp --example 02_own_pipeline`

use std::error::Error;

use hybrid_icp::association::{MaxDistance, MaxNormalAngle, Projective, VisibleSurface};
use hybrid_icp::icp::{AtResolution, Cascade, Divergence, Guard, Icp, IterationLimit, SmallMotion};
use hybrid_icp::metric::Symmetric;
use hybrid_icp::score::MeanVsd;

mod scene;

fn main() -> Result<(), Box<dyn Error>> {
    let fine = Icp {
        selection: VisibleSurface::default(),
        association: Projective,
        filter: (MaxDistance::diameters(0.25), MaxNormalAngle::degrees(60.0)),
        metric: Symmetric,
        stop: (
            Divergence::count_aware(),
            SmallMotion::default(),
            IterationLimit(50),
        ),
    };
    // From coarse to fine, and never to a pose that explains the image worse than the detected one.
    let pipeline = Guard {
        stage: Cascade((
            AtResolution {
                factor: 4,
                stage: fine,
            },
            fine,
        )),
        score: MeanVsd::default(),
    };
    scene::Scene::new()?.refine(pipeline)
}
