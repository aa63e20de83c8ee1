//! Counts how often each registration finds the pose between two views of an object, as a table.
//!
//! Run `cargo run --release -p hicp-tests --example cloud_views [tuning|test|FOLDER] [VIEWS]`. A
//! folder contains meshes in meters.
//!
//! Both clouds are the pixels of depth images with noise of 0.2 % of the diameter. The cameras are
//! 30, 60 or 90° apart, and the start is 5, 15 or 25° and 5 % of the diameter off. Objects that
//! turn freely about an axis by their declared symmetry are left out. A pose is right if its ADD is
//! below 2 % of the diameter. It is silently wrong if no warning says not to trust it.

use hicp_io::{LengthUnit, read_mesh};
use hicp_sim::{SimRng, perturb, stream};
use hicp_tests::household;
use hybrid_icp::core::{
    Isometry3, Model, PinholeCamera, Point3, Translation3, UnitQuaternion, Vector3, rotation_grid,
};
use hybrid_icp::raster::render_depth_image;
use hybrid_icp::score::add;
use hybrid_icp::{Alignment, CloudOptions, CloudWarning, Registration, align};
use rand::RngExt as _;

type Failure = Box<dyn std::error::Error>;

fn models(set: &str) -> Result<Vec<Model>, Failure> {
    let Ok(objects) = household(set) else {
        let files = std::fs::read_dir(set)?.map(|entry| Ok(entry?.path()));
        let mut files = files.collect::<std::io::Result<Vec<_>>>()?;
        files.sort();
        let is_mesh =
            |path: &std::path::PathBuf| path.extension().is_some_and(|e| e == "obj" || e == "ply");
        let read = |path| Ok(Model::new(read_mesh(path, LengthUnit::Meters)?));
        return files.into_iter().filter(is_mesh).map(read).collect();
    };
    let models = objects.iter().map(|object| object.model());
    Ok(models.collect::<Result<_, _>>()?)
}

/// Returns the points that a camera sees of an object with some rotation, in the object frame.
fn view(
    model: &Model,
    rotation: UnitQuaternion<f64>,
    random: &mut SimRng,
) -> Result<Vec<Point3<f32>>, Failure> {
    let camera = PinholeCamera::new(300.0, 300.0, 79.5, 79.5, 160, 160)?;
    let diameter = model.diameter();
    let away = Translation3::new(0.0, 0.0, 2.5 * diameter);
    let camera_from_object = away * rotation * Translation3::from(-model.center().coords);
    let depth = render_depth_image(model.mesh(), &camera, &camera_from_object);
    let mut noise =
        || 0.002 * diameter * ((0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0);
    let mut points = Vec::new();
    for (v, u) in (0..160).flat_map(|v| (0..160).map(move |u| (v, u))) {
        let z = f64::from(depth.get(u, v).unwrap_or(0.0));
        if z > 0.0 {
            let seen = camera.unproject(u.into(), v.into(), z + noise());
            points.push((camera_from_object.inverse() * seen).cast());
        }
    }
    Ok(points)
}

fn is_silent(found: &Alignment) -> bool {
    !found.warnings.iter().any(|warning| {
        matches!(
            warning,
            CloudWarning::LittleOverlap { .. } | CloudWarning::Undetermined { .. }
        )
    })
}

fn main() -> Result<(), Failure> {
    let mut words = std::env::args().skip(1);
    let set = words.next().unwrap_or_else(|| "tuning".to_owned());
    let views: usize = words.next().map_or(Ok(4), |text| text.parse())?;
    let mut random = stream(0, &["cloud_views"], 0);
    let mut counts = Registration::ALL.map(|_| [0; 3]);
    let options = CloudOptions::default();
    let models = models(&set)?.into_iter();
    for model in models.filter(|model| model.symmetries().continuous.is_empty()) {
        let points: Vec<_> = model.samples().iter().map(|s| s.point).collect();
        let middle = Translation3::from(model.center().coords);
        for (index, degrees) in (0..views).flat_map(|i| [30.0_f64, 60.0, 90.0].map(|d| (i, d))) {
            let rotation = rotation_grid(index, views);
            let apart = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), degrees.to_radians());
            let source = view(&model, rotation, &mut random)?;
            let target = view(&model, apart * rotation, &mut random)?;
            for start in [5.0_f64, 15.0, 25.0] {
                let away = 0.05 * model.diameter();
                let init = perturb(
                    &mut random,
                    &Isometry3::identity(),
                    away,
                    start.to_radians(),
                );
                let init = middle * init * middle.inverse();
                let counts = Registration::ALL.into_iter().zip(&mut counts);
                for (registration, [all, right, silent]) in counts {
                    let source = options.for_source_of(registration).cloud(&source, None)?;
                    let target = options.target_of(registration, &target, None)?;
                    let found = align(&source, &target, &init, &mut registration.build(None));
                    let error = add(&found.target_from_source(), &Isometry3::identity(), &points);
                    let is_right = error < 0.02 * model.diameter();
                    *all += 1;
                    *right += usize::from(is_right);
                    *silent += usize::from(!is_right && is_silent(&found));
                }
            }
        }
    }
    println!("| registration | right | silently wrong |\n|---|---|---|");
    for (registration, [all, right, silent]) in Registration::ALL.iter().zip(counts) {
        println!("| {} | {right} of {all} | {silent} |", registration.name());
    }
    Ok(())
}
