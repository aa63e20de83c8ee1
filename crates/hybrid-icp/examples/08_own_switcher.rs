//! A custom switcher: selects the stage for an estimate.
//!
//! `cargo run --release -p hybrid-icp --example 08_own_switcher`

use std::error::Error;

use hybrid_icp::Preset;
use hybrid_icp::core::{Context, Isometry3};
use hybrid_icp::icp::{Regime, RegimeEvent, Repeat};
use hybrid_icp::switch::{Switch, Switcher};

mod scene;

/// Misaligned when too many pixels of the rendered model lie next to the mask. It uses the outline
/// alone; the mean VSD estimate of the paper uses depth.
struct BesideTheMask {
    limit: f64,
}

impl Switcher for BesideTheMask {
    fn regime(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
    ) -> RegimeEvent {
        let problem = context.problem;
        // The context renders once per pose; the next stage reuses this render.
        let (Some(observation), Some(view)) =
            (problem.observation(), context.view(camera_from_object))
        else {
            return RegimeEvent {
                regime: Regime::MISALIGNED,
                score: None,
            };
        };
        let mask = observation.mask();
        let (mut rendered, mut beside) = (0_u32, 0_u32);
        for (u, v) in view.covered() {
            rendered += 1;
            beside += u32::from(mask.get(u, v) != Some(true));
        }
        let share = if rendered == 0 {
            1.0
        } else {
            f64::from(beside) / f64::from(rendered)
        };
        RegimeEvent {
            regime: if share > self.limit {
                Regime::MISALIGNED
            } else {
                Regime::ALIGNED
            },
            score: Some(share),
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    scene::Scene::new()?.refine(Repeat {
        times: 2,
        stage: Switch {
            switcher: BesideTheMask { limit: 0.2 },
            aligned: Preset::ProjectiveCascadePointPlane.build(),
            misaligned: Preset::NnPointToPoint.build(),
        },
    })
}
