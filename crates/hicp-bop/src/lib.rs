//! Refinement of the rows of BOP result files, image by image, as in `hybrid-icp bop refine`.
//!
//! **Should you use this crate?** Use it to refine whole result files from a custom program, a
//! queue or a cluster. It groups rows by image, assigns a mask to each row, refines, and writes the
//! results into the rows. From a shell, `hybrid-icp bop refine` does the same with threads and a
//! journal. For single poses, use `hybrid-icp`. To only read datasets, use `hicp-io`.
//!
//! ```no_run
//! use hicp_bop::{DatasetRefiner, MaskSource, ModelFolder, Models, Rescore, Scenes, frames_of};
//! use hicp_io::bop::{Dataset, read_results, write_results};
//! use hybrid_icp::{Preset, Refiner};
//! # fn main() -> Result<(), hicp_io::IoError> {
//! let mut rows = read_results("estimates_ycbv-test.csv")?;
//! let dataset = Dataset::open("bop/ycbv")?;
//! let objects = rows.iter().map(|row| row.obj_id).collect();
//! let shared = DatasetRefiner {
//!     models: Models::read(&ModelFolder::open(dataset.models_dir()?)?, &objects),
//!     scenes: Scenes::new(&dataset, "test", 2),
//!     masks: MaskSource::Visible,
//! };
//! // One refiner per thread; images may be refined in any order.
//! let mut refiner = Refiner::preset(Preset::Auto);
//! for (frame, indices) in frames_of(&rows) {
//!     let result = shared.frame(&mut refiner, frame, &rows, &indices);
//!     result.enter(&mut rows, Rescore::Mve, true);
//! }
//! write_results("refined_ycbv-test.csv", &rows)?;
//! # Ok(()) }
//! ```
//!
//! This crate does not start threads, print or write files. A missing or damaged file affects only
//! the rows that need it. The result reports it ([`RowStatus`], [`Fault`]).

// Counts of pixels are converted to floating-point numbers; all are far below 2⁵³.
#![allow(clippy::cast_precision_loss)]

mod assignment;
mod best_rows;
mod bop_image;
mod box_mask;
mod dataset_refiner;
mod fault;
mod frames;
mod judge;
mod mask_file;
mod mask_source;
mod models;
mod result;
mod row_status;
mod scenes;
mod shard;

pub use assignment::assign_masks;
pub use best_rows::best_rows;
pub use bop_image::BopImage;
pub use box_mask::BoxMask;
pub use dataset_refiner::DatasetRefiner;
pub use fault::{Fault, FaultKind, chain};
pub use frames::{FrameKey, FrameRows, Targets, detections_by_frame, frames_of};
pub use judge::{EvaluatedObject, Judge, Judged, JudgedFrame, Renders, instances};
pub use mask_source::MaskSource;
pub use models::{ModelFolder, Models};
pub use result::{FrameResult, Rescore, RowResult};
pub use row_status::RowStatus;
pub use scenes::{Image, MIN_VISIBLE_FRACTION, Scenes, states_visibility, visible_objects};
pub use shard::{Part, Shard};
