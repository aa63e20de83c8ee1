//! Prints how far `nn-point-to-point` pulls an object toward the camera under depth noise.
//!
//! It explains the curve of nearest neighbors over depth noise (§VI-B.2), which first rises and
//! then falls: `cargo run --release -p hicp-experiments --example pull`. The cases are those of the
//! study of depth noise: 40 per test object, 6.2 mm and 9.5° off.
#![allow(clippy::print_stdout, reason = "an example shows its results")]

use hicp_core::{Observation, PinholeCamera, Problem};
use hicp_experiments::Subject;
use hicp_sim::RelativeGaussian;
use hicp_sim::{CaseConfig, CaseMaker, Corruption, DepthNoise, Household, InitialPose};
use hybrid_icp::Preset;
use hybrid_icp::icp::{Session, Stage as _, Workspace};
use hybrid_icp::raster::Rasterizer;

const SEED: u64 = 1;
const CASES: u64 = 40;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let camera = PinholeCamera::new(572.4, 573.6, 325.3, 242.0, 640, 480)?;
    let mut maker = CaseMaker::new(CaseConfig::new(camera, InitialPose::mean_error()))?;
    let subjects = Subject::household(&Household::TEST)?;
    let (mut stage, mut workspace) = (
        Preset::NnPointToPoint.build(),
        Workspace::new(Rasterizer::default()),
    );
    println!("| depth noise | toward the camera, radii | across, radii | turned | mean VSD |");
    println!("|---|---|---|---|---|");
    for percent in 0..=5 {
        let mut image = Corruption::default();
        let percent = f64::from(percent);
        image.sensor.noise = DepthNoise::Relative(RelativeGaussian { percent });
        let mut sums = [0.0; 4];
        for subject in &subjects {
            let (model, radius) = (&subject.model, subject.model.radius());
            for index in 0..CASES {
                let case = maker.case(model, &subject.name, SEED, index)?;
                let (depth, mask) = image.apply(&case)?;
                let observation = Observation::new(depth, mask, camera)?;
                let problem = Problem::new(model, &observation);
                let mut observer = ();
                let mut session = Session::new(&mut workspace, &mut observer);
                let outcome = stage.run(&problem, &case.init, &mut session);
                let pose = outcome.camera_from_object;
                let truth = case.camera_from_object;
                let center = (truth * model.center()).coords;
                let error = (pose * model.center()).coords - center;
                let along = error.dot(&center.normalize());
                let figures = [
                    -along / radius,
                    (error.norm_squared() - along * along).max(0.0).sqrt() / radius,
                    pose.rotation.angle_to(&truth.rotation).to_degrees(),
                    maker.vsd(model, &truth, &pose),
                ];
                sums = std::array::from_fn(|i| sums[i] + figures[i]);
            }
        }
        let n = CASES as f64 * subjects.len() as f64;
        let [pulled, across, turned, vsd] = sums.map(|sum| sum / n);
        println!("| {percent} % | {pulled:.3} | {across:.3} | {turned:.1}° | {vsd:.3} |");
    }
    Ok(())
}
