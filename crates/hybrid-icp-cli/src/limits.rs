//! Limits on what the program reads and on the work that it accepts.

use std::sync::OnceLock;

use clap::Args;
use hicp_io::ReadLimits;
use hybrid_icp::pipeline::PipelineLimits;

const READ: ReadLimits = ReadLimits::DEFAULT;
const WORK: PipelineLimits = PipelineLimits::DEFAULT;

/// Limits on what is read and on the work that pipelines request.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = "Limits on what is read and computed")]
pub(crate) struct Limits {
    /// Bytes of a file; 1 GiB if not given. It applies to JSON files if it is above their limit.
    #[arg(long, value_name = "N", global = true, hide_short_help = true)]
    max_file_bytes: Option<u64>,
    /// Bytes of a JSON file; 256 MiB if not given. In memory, it needs several dozen times as many.
    #[arg(long, value_name = "N", global = true, hide_short_help = true)]
    max_json_bytes: Option<u64>,
    /// Bytes of a JSON file that holds one pose, one camera or the configuration of a study.
    #[arg(long, value_name = "N", global = true, hide_short_help = true, default_value_t = READ.max_small_json_bytes)]
    max_small_json_bytes: u64,
    /// Vertices of a mesh; never more than 50 million.
    #[arg(long, value_name = "N", global = true, hide_short_help = true, default_value_t = READ.max_vertices)]
    max_vertices: u64,
    /// Triangles of a mesh, after polygons are cut; never more than 50 million.
    #[arg(long, value_name = "N", global = true, hide_short_help = true, default_value_t = READ.max_triangles)]
    max_triangles: u64,
    /// Pixels of an image. Sides are never longer than 32768.
    #[arg(long, value_name = "N", global = true, hide_short_help = true, default_value_t = READ.max_pixels)]
    max_pixels: u64,
    /// Rows of a result file or of a study.
    #[arg(long, value_name = "N", global = true, hide_short_help = true, default_value_t = READ.max_rows)]
    max_rows: u64,
    /// Iterations that a pipeline may request in the worst case. Ranked hypotheses and solver steps
    /// count.
    #[arg(long, value_name = "N", global = true, hide_short_help = true, default_value_t = WORK.max_iterations)]
    max_iterations: u64,
    /// Hypotheses that a search in a pipeline may request.
    #[arg(long, value_name = "N", global = true, hide_short_help = true, default_value_t = WORK.max_hypotheses)]
    max_hypotheses: u64,
    /// Points that a part of a pipeline may sample on the model.
    #[arg(long, value_name = "N", global = true, hide_short_help = true, default_value_t = WORK.max_samples)]
    max_samples: u64,
    /// Neighbors of a point that a part of a pipeline may read.
    #[arg(long, value_name = "N", global = true, hide_short_help = true, default_value_t = WORK.max_neighbors)]
    max_neighbors: u64,
}

static CHOSEN: OnceLock<Limits> = OnceLock::new();

impl Limits {
    /// Sets the limits of this run of the program.
    pub(crate) fn choose(self) {
        // Only `main` sets them, once.
        let _ = CHOSEN.set(self);
    }
}

/// Returns the limits on what this run of the program reads.
pub(crate) fn limits() -> ReadLimits {
    let Some(chosen) = CHOSEN.get() else {
        return READ;
    };
    let raised = chosen.max_file_bytes.unwrap_or(0).max(READ.max_json_bytes);
    ReadLimits {
        max_file_bytes: chosen.max_file_bytes.unwrap_or(READ.max_file_bytes),
        max_json_bytes: chosen.max_json_bytes.unwrap_or(raised),
        max_small_json_bytes: chosen.max_small_json_bytes,
        max_vertices: chosen.max_vertices,
        max_triangles: chosen.max_triangles,
        max_pixels: chosen.max_pixels,
        max_rows: chosen.max_rows,
    }
}

/// Returns the limits on the work that a pipeline of this run requests.
pub(crate) fn pipeline_limits() -> PipelineLimits {
    CHOSEN.get().map_or(WORK, |chosen| PipelineLimits {
        max_iterations: chosen.max_iterations,
        max_hypotheses: chosen.max_hypotheses,
        max_samples: chosen.max_samples,
        max_neighbors: chosen.max_neighbors,
    })
}
