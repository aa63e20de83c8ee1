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
    /// The options that chose the rows from the file.
    pub(crate) choice: RowOptions,
    pub(crate) masks: MaskSource,
    pub(crate) pipeline: Pipeline,
    /// The path of the refined result file.
    pub(crate) output: &'a Path,
    /// The file for the status of every row.
    pub(crate) rows: Option<&'a Path>,
    pub(crate) threads: ThreadOptions,
    /// If `true`, writes times.
    pub(crate) timed: bool,
    pub(crate) rescore: Rescore,
    /// If `true`, continues an existing journal.
    pub(crate) resume: bool,
    /// The option that continues an interrupted run, for messages.
    pub(crate) resumed_by: &'static str,
    /// The option that lists the status of every row, for messages.
    pub(crate) listed_by: Option<&'static str>,
}
