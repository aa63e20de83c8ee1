//! The errors of studies.

use std::io;
use std::path::PathBuf;

use hicp_io::IoError;
use hicp_sim::SimError;
use hybrid_icp::pipeline::PipelineError;
use thiserror::Error;

/// The reason why a study could not be run, read or reported.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExperimentError {
    /// A file cannot be read or written, or its content is not that of a study.
    #[error(transparent)]
    Io(#[from] IoError),
    /// A folder cannot be read or created.
    #[error("cannot use {}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// The caller stopped the study.
    #[error("stopped after {cases} cases; --resume continues after them")]
    Stopped {
        /// Number of cases whose rows are written.
        cases: usize,
    },
    /// A figure could not be drawn.
    #[error("cannot draw the figure: {0}")]
    Figure(String),
    /// A pipeline cannot be built.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// A camera cannot be used.
    #[error(transparent)]
    Camera(#[from] hicp_core::CameraError),
    /// A mesh cannot be used.
    #[error(transparent)]
    Mesh(#[from] hicp_core::MeshError),
    /// A simulation cannot be set up.
    #[error(transparent)]
    Sim(#[from] SimError),
}

impl ExperimentError {
    /// Creates [`ExperimentError::Folder`], for `map_err`.
    pub(crate) fn folder(path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::Folder { path, source }
    }
}
