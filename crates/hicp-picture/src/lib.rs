//! Pictures of poses: depth images with the outlines of models, captions and legends.
//!
//! **Should you use this crate?** Use it to show poses in a report, a log or a window, as
//! `hybrid-icp demo`, `refine --overlay` and `bop show` do. It draws into RGB bytes, and needs no
//! display and no font of the system.
//!
//! ```
//! use std::sync::Arc;
//!
//! use hicp_core::{
//!     DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Point3, TriMesh,
//! };
//! use hicp_picture::Picture;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let corners = [[-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.0, 0.1, 0.0]].map(Point3::from);
//! let model = Model::new(TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?);
//! let camera = PinholeCamera::new(300.0, 300.0, 159.5, 119.5, 320, 240)?;
//! let depth = Arc::new(DepthImage::from_meters(320, 240, vec![0.6; 320 * 240])?);
//! let observation = Observation::new(depth, Mask::full(320, 240), camera)?;
//!
//! let before = Isometry3::translation(0.05, 0.0, 0.6);
//! let after = Isometry3::translation(0.0, 0.0, 0.6);
//! let poses = [(&before, "before".to_owned()), (&after, "after".to_owned())];
//! let picture = Picture::before_and_after(&model, &observation, &poses)?;
//! assert!(picture.png()?.starts_with(b"\x89PNG"));
//! # Ok(()) }
//! ```

// Places in pictures and colors are below 2¹⁵, and casts from floating-point numbers saturate.
#![allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss
)]

mod before_after;
mod contour;
mod error;
mod ink;
mod legend;
mod model;
mod picture;
mod text;

pub use contour::{Side, contours};
pub use error::PictureError;
pub use ink::Ink;
pub use legend::{BLACK, GRAY, LEFT, Legend, RED, WIDTH, font};
pub use picture::{AGAINST, Line, Picture, RESULT, Rgb};
pub use text::{Align, Text, fitted};
