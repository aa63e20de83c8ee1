//! The options that choose the masks of rows.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use hicp_bop::{BoxMask, MaskSource};

use crate::limits::limits;
use crate::options::file_name;

/// The options that choose the masks of rows; those of the ground truth by default.
#[derive(Debug, Args)]
pub(crate) struct MaskOptions {
    /// Use the masks of a detections file (JSON with RLE segmentations) instead of mask_visib. A
    /// detection without a segmentation needs a bbox, as for `bop estimate`.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) detections: Option<PathBuf>,
    /// The kind of mask.
    #[arg(
        long,
        value_enum,
        value_name = "WHAT",
        default_value_t = MaskKind::Visible,
        conflicts_with = "detections"
    )]
    mask: MaskKind,
}

impl MaskOptions {
    /// Returns the choice for titles; empty if it is the default.
    pub(crate) fn label(&self) -> String {
        match (&self.detections, self.mask) {
            (Some(path), _) => format!(", masks of {}", file_name(path)),
            (None, MaskKind::Visible) => String::new(),
            (None, MaskKind::None) => ", without masks".to_owned(),
        }
    }

    /// Reads the detections, if there are any.
    pub(crate) fn source(&self) -> anyhow::Result<MaskSource> {
        Ok(match (&self.detections, self.mask) {
            (Some(path), _) => MaskSource::detections(limits().read_detections(path)?),
            (None, MaskKind::Visible) => MaskSource::Visible,
            (None, MaskKind::None) => MaskSource::Box(BoxMask::default()),
        })
    }
}

/// The kind of mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum MaskKind {
    /// The visible masks of the ground truth (mask_visib).
    Visible,
    /// No segmentation: a row uses all depth inside the model's bounding box at its pose. The box
    /// is enlarged by a twentieth of the diameter. From rough poses, use it with auto. From good
    /// ones, use projective-cascade-plane-point.
    None,
}
