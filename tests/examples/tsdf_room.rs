//! Integrates recorded depth frames into one volume and prints the size of the surface.
//!
//! Run `cargo run --release -p hicp-tests --example tsdf_room FOLDER [VOXEL_METERS] [OUT.ply]`.
//!
//! FOLDER is a BOP scene without objects: `depth/` and a `scene_camera.json` with world-to-camera
//! poses, in millimeters.

use std::path::PathBuf;

use hicp_io::{LengthUnit, write_ply};
use hicp_sim::{EmptyPixels, TsdfConfig, TsdfVolume, Unseen, components};
use hicp_tests::room::{bounds, frames};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(
        arguments
            .next()
            .ok_or("no folder of frames: usage: tsdf_room FOLDER [VOXEL_METERS] [OUT.ply]")?,
    );
    let voxel_meters: f64 = arguments.next().map_or(Ok(0.015), |text| text.parse())?;
    let frames = frames(&folder)?;
    let (min, max) = bounds(&frames);
    let mut volume = TsdfVolume::new(TsdfConfig {
        min,
        max,
        voxel_meters,
        truncation_meters: 4.0 * voxel_meters,
    })?;
    for frame in &frames {
        volume.integrate(
            &frame.depth,
            &frame.camera,
            &frame.camera_from_world,
            EmptyPixels::Unknown,
        )?;
    }
    let [x, y, z] = volume.size();
    println!(
        "{} frames, {x} x {y} x {z} voxels of {:.1} mm",
        volume.images(),
        voxel_meters * 1e3
    );
    for (what, unseen) in [("open", Unseen::Open), ("closed", Unseen::Solid)] {
        let mesh = volume.surface(unseen)?;
        let parts = components(&mesh)?;
        println!(
            "{what}: {} triangles, {:.2} m2, {} components; the largest has {} triangles and {:.2} m2 ({:.1} % of the area)",
            mesh.triangles().len(),
            mesh.area(),
            parts.len(),
            parts[0].mesh.triangles().len(),
            parts[0].area,
            100.0 * parts[0].area / mesh.area(),
        );
        if let (Unseen::Open, Some(file)) = (unseen, arguments.next()) {
            write_ply(&file, &mesh, LengthUnit::Meters)?;
            println!("wrote {file}");
        }
    }
    Ok(())
}
