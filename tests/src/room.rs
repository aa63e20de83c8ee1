//! Recorded depth frames of a room, if the machine has them.

use std::path::{Path, PathBuf};

use hicp_io::bop::Scene;
use hybrid_icp::core::{DepthImage, Isometry3, PinholeCamera, Point3};

/// Largest depth that is used, meters. Structured light is inaccurate beyond it.
pub const MAX_DEPTH_METERS: f32 = 5.0;

/// A depth image with its camera and camera pose.
#[derive(Debug)]
pub struct Frame {
    /// The depth image.
    pub depth: DepthImage,
    /// The camera.
    pub camera: PinholeCamera,
    /// The pose of the world in the camera frame.
    pub camera_from_world: Isometry3<f64>,
}

/// Returns the folder of frames, if it exists.
///
/// It is `traj/tsdf_fusion_50` in `HICP_DATA`, or in the shared data next to the project.
pub fn root() -> Option<PathBuf> {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folders = [
        std::env::var_os("HICP_DATA").map(PathBuf::from),
        Some(shared),
    ];
    let folders = folders.into_iter().flatten();
    folders
        .map(|folder| folder.join("traj/tsdf_fusion_50"))
        .find(|folder| folder.is_dir())
}

/// Reads the frames of a folder in the layout of a BOP scene.
///
/// The folder has `depth/` and a `scene_camera.json` with world-to-camera poses.
///
/// # Errors
///
/// If a file cannot be read, or a frame has no pose.
pub fn frames(folder: &Path) -> Result<Vec<Frame>, Box<dyn std::error::Error>> {
    let scene = Scene::open(folder)?;
    let mut frames = Vec::new();
    for id in scene.image_ids() {
        let camera = scene.camera(id)?;
        let depth = scene.read_depth(id)?;
        let (width, height) = (depth.width(), depth.height());
        let near = depth
            .pixels()
            .iter()
            .map(|z| if *z <= MAX_DEPTH_METERS { *z } else { 0.0 });
        let depth = DepthImage::from_meters(width, height, near.collect())?;
        let camera_from_world = camera
            .camera_from_world
            .ok_or("a frame has no camera pose in scene_camera.json")?;
        let camera = PinholeCamera::from_matrix(&camera.matrix, width, height)?;
        frames.push(Frame {
            depth,
            camera,
            camera_from_world,
        });
    }
    Ok(frames)
}

/// Returns the corners of the bounding box of all measured points, meters, world frame.
pub fn bounds(frames: &[Frame]) -> (Point3<f64>, Point3<f64>) {
    let infinite = Point3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY);
    let mut corners = (infinite, -infinite);
    for frame in frames {
        let world_from_camera = frame.camera_from_world.inverse();
        for v in (0..frame.depth.height()).step_by(4) {
            for u in (0..frame.depth.width()).step_by(4) {
                let z = f64::from(frame.depth.get(u, v).unwrap_or(0.0));
                if z > 0.0 {
                    let p =
                        world_from_camera * frame.camera.unproject(f64::from(u), f64::from(v), z);
                    corners = (corners.0.inf(&p), corners.1.sup(&p));
                }
            }
        }
    }
    corners
}
