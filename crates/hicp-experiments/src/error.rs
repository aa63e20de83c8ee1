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
    /// A folder without meshes.
    #[error("{} holds no mesh, expected files that end in .obj, .ply or .stl", path.display())]
    NoMeshes {
        /// The folder.
        path: PathBuf,
    },
    /// A folder that already holds the rows of a study.
    #[error("{} is there already, expected an empty folder or --resume", path.display())]
    AlreadyThere {
        /// The file.
        path: PathBuf,
    },
    /// A study that cannot continue because it was started with another configuration.
    #[error("{} was begun otherwise: {difference}; expected the same command as before, or another folder", path.display())]
    OtherConfiguration {
        /// The stored configuration.
        path: PathBuf,
        /// The first difference.
        difference: String,
    },
    /// A row that is not one of the study's.
    #[error("{}, line {line}: {what}", path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        what: String,
    },
    /// A stored configuration that cannot be read.
    #[error("{} is not the configuration of a study", path.display())]
    Configuration {
        /// The file.
        path: PathBuf,
        /// Why.
        source: serde_json::Error,
    },
    /// A field of a configuration that no study can have.
    #[error("{}, {field}: found {found}, expected {expected}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// The field, by its name in the file.
        field: String,
        /// The value found.
        found: String,
        /// The expected value.
        expected: String,
    },
    /// A study without a finished row, of which there is no report.
    #[error("{} holds no finished row, expected at least one", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The caller stopped the study.
    #[error("stopped after {cases} cases; --resume goes on from there")]
    Stopped {
        /// Number of cases whose rows are written.
        cases: usize,
    },
    /// A figure could not be drawn.
    #[error("cannot draw the figure: {0}")]
    Figure(String),
    /// The file system refused an operation.
    #[error("cannot use {}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A pipeline cannot be built.
    #[error(transparent)]
    Pipeline(Box<PipelineError>),
    /// A mesh cannot be read, or a file not written.
    #[error(transparent)]
    Io(#[from] IoError),
    /// A camera cannot be used.
    #[error(transparent)]
    Camera(#[from] hicp_core::CameraError),
    /// A simulation cannot be set up.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// A mesh cannot be used.
    #[error(transparent)]
    Mesh(#[from] hicp_core::MeshError),
}

impl From<PipelineError> for ExperimentError {
    fn from(error: PipelineError) -> Self {
        Self::Pipeline(Box::new(error))
    }
}

impl ExperimentError {
    /// Makes [`ExperimentError::File`], for `map_err`.
    pub(crate) fn file(path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::File { path, source }
    }
}
