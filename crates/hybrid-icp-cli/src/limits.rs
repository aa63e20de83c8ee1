//! How much the program reads, and how much work it takes on, before it refuses a file.

use std::sync::OnceLock;

use clap::Args;
use hicp_io::ReadLimits;
use hybrid_icp::PipelineLimits;

/// Limits on what is read, and on the work that pipelines ask for.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = "Limits on what is read and asked for")]
pub(crate) struct Limits {
    /// Bytes of a file; of JSON files too where it is larger than their limit of 256 MiB. 1 GiB if not given.
    #[arg(long, value_name = "N", global = true, hide_short_help = true)]
    max_file_bytes: Option<u64>,
    /// Bytes of a JSON file, of which several dozen times as many are needed in memory. 256 MiB if not given.
    #[arg(long, value_name = "N", global = true, hide_short_help = true)]
    max_json_bytes: Option<u64>,
    /// Bytes of a JSON file that states one pose, one camera or the configuration of a study. 16 MiB if not given.
    #[arg(long, value_name = "N", global = true, hide_short_help = true)]
    max_small_json_bytes: Option<u64>,
    /// Vertices of a mesh. 10 million if not given; never more than 50 million.
    #[arg(long, value_name = "N", global = true, hide_short_help = true)]
    max_vertices: Option<u64>,
    /// Triangles of a mesh, after polygons are cut. 10 million if not given; never more than 50 million.
    #[arg(long, value_name = "N", global = true, hide_short_help = true)]
    max_triangles: Option<u64>,
    /// Pixels of an image. 2^25 if not given; sides are never longer than 32768.
    #[arg(long, value_name = "N", global = true, hide_short_help = true)]
    max_pixels: Option<u64>,
    /// Rows of a result file or of a study. 10 million if not given.
    #[arg(long, value_name = "N", global = true, hide_short_help = true)]
    max_rows: Option<u64>,
    /// Iterations that a pipeline may ask for in all, at worst; ranked hypotheses and steps of a solver count. 1 million if not given.
    #[arg(long, value_name = "N", global = true, hide_short_help = true)]
    max_iterations: Option<u64>,
    /// Hypotheses that a search in a pipeline may ask for. 100 000 if not given.
    #[arg(long, value_name = "N", global = true, hide_short_help = true)]
    max_hypotheses: Option<u64>,
    /// Points that a part of a pipeline may sample on the model. 1 million if not given.
    #[arg(long, value_name = "N", global = true, hide_short_help = true)]
    max_samples: Option<u64>,
    /// Neighbors of a point that a part of a pipeline may look at. 100 if not given.
    #[arg(long, value_name = "N", global = true, hide_short_help = true)]
    max_neighbors: Option<u64>,
}

static CHOSEN: OnceLock<(ReadLimits, PipelineLimits)> = OnceLock::new();

impl Limits {
    /// Sets the limits of this run of the program.
    pub(crate) fn choose(&self) {
        let default = ReadLimits::DEFAULT;
        let max_file_bytes = self.max_file_bytes.unwrap_or(default.max_file_bytes);
        let chosen = ReadLimits {
            max_file_bytes,
            max_json_bytes: self.max_json_bytes.unwrap_or(match self.max_file_bytes {
                Some(bytes) => default.max_json_bytes.max(bytes),
                None => default.max_json_bytes,
            }),
            max_small_json_bytes: self
                .max_small_json_bytes
                .unwrap_or(default.max_small_json_bytes),
            max_vertices: self.max_vertices.unwrap_or(default.max_vertices),
            max_triangles: self.max_triangles.unwrap_or(default.max_triangles),
            max_pixels: self.max_pixels.unwrap_or(default.max_pixels),
            max_rows: self.max_rows.unwrap_or(default.max_rows),
        };
        let default = PipelineLimits::DEFAULT;
        let work = PipelineLimits {
            max_iterations: self.max_iterations.unwrap_or(default.max_iterations),
            max_hypotheses: self.max_hypotheses.unwrap_or(default.max_hypotheses),
            max_samples: self.max_samples.unwrap_or(default.max_samples),
            max_neighbors: self.max_neighbors.unwrap_or(default.max_neighbors),
        };
        // Once per run of the program: nothing was set before.
        let _ = CHOSEN.set((chosen, work));
    }
}

/// The limits of this run of the program on what is read.
pub(crate) fn limits() -> ReadLimits {
    CHOSEN.get().copied().unwrap_or_default().0
}

/// Those on the work that a pipeline asks for.
pub(crate) fn pipeline_limits() -> PipelineLimits {
    CHOSEN.get().copied().unwrap_or_default().1
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    /// What a help text says that holds if nothing is given.
    fn stated(help: &str) -> u64 {
        let words: Vec<&str> = help
            .split(" if not given")
            .next()
            .unwrap()
            .split(' ')
            .collect();
        let number = |word: &str| word.parse::<u64>().ok();
        match words[..] {
            [.., n, "GiB"] => number(n).unwrap() << 30,
            [.., n, "MiB"] => number(n).unwrap() << 20,
            [.., n, "million"] => number(n).unwrap() * 1_000_000,
            [.., power] if power.starts_with("2^") => 1 << number(&power[2..]).unwrap(),
            [.., thousands, n] if number(thousands).is_some() => {
                1000 * number(thousands).unwrap() + number(n).unwrap()
            }
            [.., n] => number(n).unwrap(),
            [] => unreachable!(),
        }
    }

    #[test]
    fn the_help_states_the_defaults() {
        let (read, work) = (ReadLimits::DEFAULT, PipelineLimits::DEFAULT);
        let command = Limits::augment_args(clap::Command::new("limits"));
        let found: Vec<(String, u64)> = command
            .get_arguments()
            .map(|argument| {
                let help = argument.get_help().unwrap().to_string();
                (argument.get_id().to_string(), stated(&help))
            })
            .collect();
        let expected = [
            ("max_file_bytes", read.max_file_bytes),
            ("max_json_bytes", read.max_json_bytes),
            ("max_small_json_bytes", read.max_small_json_bytes),
            ("max_vertices", read.max_vertices),
            ("max_triangles", read.max_triangles),
            ("max_pixels", read.max_pixels),
            ("max_rows", read.max_rows),
            ("max_iterations", work.max_iterations),
            ("max_hypotheses", work.max_hypotheses),
            ("max_samples", work.max_samples),
            ("max_neighbors", work.max_neighbors),
        ];
        let expected = expected.map(|(name, value)| (name.to_owned(), value));
        assert_eq!(found, expected);
    }
}
