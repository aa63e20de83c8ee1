//! The refinement of a result file, for every command that needs one.

use std::path::Path;

use hicp_bop::{MaskSource, Rescore};

use super::row_options::RowOptions;
use crate::bop::options::{DatasetOptions, ThreadOptions};
use crate::choice::Pipeline;

/// A refinement of the rows of a result file.
pub(crate) struct RefineJob<'a> {
    /// The dataset whose images the rows are refined in.
    pub(crate) dataset: &'a DatasetOptions,
    /// The result file, for messages.
    pub(crate) results: &'a Path,
    /// How the rows were chosen from the file.
    pub(crate) choice: RowOptions,
    pub(crate) masks: MaskSource,
    pub(crate) pipeline: Pipeline,
    /// Where the result file goes.
    pub(crate) output: &'a Path,
    /// Where the status of every row goes.
    pub(crate) rows: Option<&'a Path>,
    pub(crate) threads: ThreadOptions,
    /// Whether to write times.
    pub(crate) timed: bool,
    pub(crate) rescore: Rescore,
    /// Whether to continue with a journal that is there.
    pub(crate) resume: bool,
    /// Names what continues an interrupted run, for messages.
    pub(crate) resumed_by: &'static str,
    /// Names the option that lists the status of every row, for messages.
    pub(crate) listed_by: Option<&'static str>,
}
