//! Datasets, detections and results in the formats of the BOP benchmark for 6D object pose
//! estimation.
//!
//! Files are in millimeters. All values in memory are in meters, unless their names state another
//! unit.

mod annotations;
mod dataset;
mod detections;
mod models_info;
mod result_row;
mod results;
mod rle;
mod scene;
mod targets;
mod write;

pub use annotations::{GroundTruth, GroundTruthInfo, SceneCamera};
pub use dataset::Dataset;
pub use detections::{Detection, read_detections};
pub use models_info::{ModelInfo, read_models_info};
pub use result_row::ResultRow;
pub use results::{read_results, results_from_csv, write_results};
pub use rle::{Rle, RleError};
pub use scene::Scene;
pub use targets::{Target, read_targets};
pub use write::{
    write_models_info, write_scene_camera, write_scene_gt, write_scene_gt_info, write_targets,
};
