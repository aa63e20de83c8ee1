//! `hybrid-icp demo`.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use hicp_picture::Picture;
use hicp_sim::{Household, RelativeGaussian, object_pose, perturb_by_mean, rng};
use hybrid_icp::Trace;
use hybrid_icp::core::{Isometry3, Mask, Observation, PinholeCamera, Problem, se3};
use hybrid_icp::raster::render_depth_image;
use hybrid_icp::score::{Score, Vsd};

use crate::choice::PipelineArguments;
use crate::outputs::{Files, check_png, write_picture};
use crate::refine::{report, warnings};
use crate::terminal::{say, table, warn};

/// Refine a synthetic object's pose, to see that it works; needs no files and writes demo.png.
///
/// Creates an object and renders a noisy depth image of it. Displaces its pose by 6.2 mm and 9.5
/// degrees, the mean error of a sampling-based estimator, and refines it. Prints the errors before
/// and after, the trace of the stages that ran, and the time. Everything except the time follows
/// from the seed.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The object: one of those that `hybrid-icp objects` writes, such as mug, teapot or laptop.
    #[arg(long, value_name = "NAME", default_value = "hammer", value_parser = object)]
    object: Household,
    /// Depth noise: standard deviation in percent of the depth.
    #[arg(long, value_name = "PERCENT", default_value_t = 0.5, value_parser = percent, allow_negative_numbers = true)]
    noise: f64,
    /// Seed of the pose, the noise and the perturbation.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    pipeline: PipelineArguments,
    /// The picture: the depth around the object, with the model's outline before (orange, dashed)
    /// and after (blue), and the errors of both poses.
    #[arg(long, value_name = "FILE", default_value = "demo.png")]
    picture: PathBuf,
}

fn object(name: &str) -> Result<Household, String> {
    Household::ALL
        .into_iter()
        .find(|object| object.name() == name)
        .ok_or_else(|| {
            let names = Household::ALL.map(Household::name).join(", ");
            format!("expected one of {names}")
        })
}

fn percent(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=50.0).contains(&value) => Ok(value),
        _ => Err("expected a number from 0 to 50".to_owned()),
    }
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let files = Files::default().writes("--picture", [&arguments.picture]);
    files.check()?;
    check_png("--picture", [&arguments.picture])?;
    let pipeline = arguments.pipeline.choose(false)?;
    let mut rng = rng(arguments.seed);
    let model = arguments.object.model()?;
    let camera = PinholeCamera::new(572.4, 573.6, 325.3, 242.0, 640, 480)?;
    let nearest = model.diameter().max(0.3);
    let truth = object_pose(&mut rng, &model.center(), nearest..0.6, 0.02);
    let clean = render_depth_image(model.mesh(), &camera, &truth);
    let mask = Mask::measured(&clean);
    let noise = RelativeGaussian {
        percent: arguments.noise,
    };
    let depth = noise.apply(&mut rng, &clean);
    let init = perturb_by_mean(&mut rng, &truth);

    let mut refiner = pipeline.refiner();
    let mut trace = Trace::new();
    let start = Instant::now();
    let observation = Observation::new(depth, mask, camera)?;
    let refined = refiner.refine_observed(&model, &observation, &init, &mut trace);
    let time_ms = start.elapsed().as_secs_f64() * 1e3;
    let pose = refined.outcome.camera_from_object;

    let mut vsd = |pose: &Isometry3<f64>| {
        let problem = Problem::new(&model, &observation);
        let mut context = refiner.workspace_mut().context(&problem);
        Vsd::new(truth).score(&mut context, pose)
    };
    let heads = ["", "rotation error", "translation error", "MVE", "VSD"];
    let mut errors = vec![heads.map(str::to_owned)];
    let poses = [
        ("before", &init, refined.mve_initial),
        ("after", &pose, refined.mve),
    ];
    let captioned = poses.map(|(when, pose, mve)| {
        let (angle, distance) = se3::pose_distance(pose, &truth);
        let (degrees, mm) = (angle.to_degrees(), distance * 1e3);
        errors.push([
            when.to_owned(),
            format!("{degrees:.3} deg"),
            format!("{mm:.3} mm"),
            format!("{mve:.3}"),
            format!("{:.3}", vsd(pose)),
        ]);
        let caption = format!("{when}: {degrees:.2} deg and {mm:.2} mm off, MVE {mve:.3}");
        (pose, caption)
    });
    let picture = Picture::before_and_after(&model, &observation, &captioned)?;
    write_picture(&arguments.picture, &picture)?;

    let reason = warnings::reason(&refined, &model, &observation, &init, false);
    say(format_args!(
        "{}: {} triangles, {:.0} mm, seen at {:.2} m on {} pixels, depth noise {} %\npipeline {}, seed {}\n",
        arguments.object.name(),
        model.mesh().triangles().len(),
        model.diameter() * 1e3,
        truth.translation.z,
        observation.n_measured(),
        arguments.noise,
        pipeline.name,
        arguments.seed,
    ))?;
    say(table(&errors, 1))?;
    say(format_args!("\n{}\n", report::trace_table(&trace.stages)))?;
    say(report::summary(&refined, &reason, false))?;
    say(format_args!(
        "{time_ms:.1} ms from depth image to pose, on one core\n{}: the model's outline before (orange, dashed) and after (blue)",
        arguments.picture.display()
    ))?;
    warnings::about_result(&refined, "").iter().for_each(warn);
    Ok(())
}
