//! Checks that real depth frames integrate into one surface.

use hicp_sim::{EmptyPixels, TsdfConfig, TsdfVolume, Unseen, components};
use hicp_tests::median;
use hicp_tests::room::{bounds, frames, root};
use hybrid_icp::raster::render_depth_image;

#[test]
fn real_frames_become_one_surface() {
    let Some(folder) = root() else {
        eprintln!("SKIPPED: no recorded frames on this machine; set HICP_DATA to run this test");
        return;
    };
    let frames = frames(&folder).unwrap();
    assert_eq!(frames.len(), 50);
    let (min, max) = bounds(&frames);
    let voxel_meters = 0.02;
    let mut volume = TsdfVolume::new(TsdfConfig {
        min,
        max,
        voxel_meters,
        truncation_meters: 4.0 * voxel_meters,
    })
    .unwrap();
    for frame in frames.iter().step_by(2) {
        volume
            .integrate(
                &frame.depth,
                &frame.camera,
                &frame.camera_from_world,
                EmptyPixels::Unknown,
            )
            .unwrap();
    }
    let mesh = volume.surface(Unseen::Open).unwrap();
    let parts = components(&mesh).unwrap();
    // A reflecting worktop has no depth, so it separates the surfaces above from those below.
    let share = parts[0].area / mesh.area();
    assert!(
        share > 0.5,
        "the largest of {} parts has {share} of the area",
        parts.len()
    );
    // Frames that were not integrated must agree with the surface from the others.
    for frame in frames.iter().skip(1).step_by(12) {
        let rendered = render_depth_image(&mesh, &frame.camera, &frame.camera_from_world);
        let pixels = rendered.pixels().iter().zip(frame.depth.pixels());
        let measured = pixels.clone().filter(|(_, z)| **z > 0.0).count();
        let mut errors: Vec<f64> = pixels
            .filter(|(r, z)| **r > 0.0 && **z > 0.0)
            .map(|(r, z)| f64::from((r - z).abs()))
            .collect();
        let coverage = errors.len() as f64 / measured as f64;
        let error = median(&mut errors);
        println!(
            "{:.1} % covered, median difference {:.1} mm",
            100.0 * coverage,
            1e3 * error
        );
        assert!(
            coverage > 0.8,
            "only {coverage} of the measured pixels are covered"
        );
        assert!(error < 0.5 * voxel_meters, "median difference {error} m");
    }
}
