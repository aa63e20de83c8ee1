//! Real depth frames integrate into one surface.

use hicp_sim::{EmptyPixels, TsdfConfig, TsdfVolume, Unseen, components};
use hicp_tests::room::{bounds, frames, root};

#[test]
fn real_frames_become_one_surface() {
    let Some(folder) = root() else {
        eprintln!("no recorded frames on this machine: set HICP_DATA to run this test");
        return;
    };
    let frames = frames(&folder).unwrap();
    assert_eq!(frames.len(), 50);
    let (min, max) = bounds(&frames);
    let mut volume = TsdfVolume::new(TsdfConfig {
        min,
        max,
        voxel_meters: 0.03,
        truncation_meters: 0.12,
    })
    .unwrap();
    for frame in frames.iter().step_by(5) {
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
    // One surface, and specks: had the poses or the camera been misread, frames would lie beside each other.
    let share = parts[0].area / mesh.area();
    assert!(
        share > 0.9,
        "the largest of {} parts has {share} of the area",
        parts.len()
    );
    assert!(mesh.area() > 1.0, "{} m2", mesh.area());
}
