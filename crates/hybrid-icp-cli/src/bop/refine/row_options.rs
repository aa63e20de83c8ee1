//! The options that choose rows of a result file, or detections.

use std::borrow::Borrow;
use std::path::{Path, PathBuf};

use clap::Args;
use hicp_bop::{Shard, best_rows};
use hicp_io::bop::ResultRow;

use crate::bop::targets;
use crate::terminal::warn;

/// The options that choose the rows or detections to process; all by default.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct RowOptions {
    /// Process and write only part I of N, counted from 1. Images are never split. If the rows of
    /// each image are contiguous, the concatenated outputs of all parts, with one header line,
    /// equal the output of one run (without --hypotheses, whose rows end each output).
    #[arg(long, value_name = "I/N", allow_hyphen_values = true)]
    shard: Option<Shard>,
    /// Read only the first N rows or detections of the input. --top-k and --targets choose among
    /// these, and --shard divides the rest.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    limit: Option<u32>,
    /// Process and write only the K rows or detections with the best scores of every object in
    /// every image. Of equal scores, the first ones are used.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    top_k: Option<u32>,
    /// Process and write only the rows or detections of the targets in this file. Of each target,
    /// these are the inst_count with the best scores, which an evaluation uses.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) targets: Option<PathBuf>,
}

impl RowOptions {
    /// Returns the options with their values.
    pub(super) fn settings(&self) -> [(&'static str, Option<String>); 4] {
        let targets = self.targets.as_ref();
        [
            ("--limit", self.limit.map(|n| n.to_string())),
            ("--top-k", self.top_k.map(|k| k.to_string())),
            ("--targets", targets.map(|path| path.display().to_string())),
            ("--shard", self.shard.map(|shard| shard.to_string())),
        ]
    }

    /// Returns the options that are given.
    pub(super) fn given(&self) -> Vec<&'static str> {
        let given = self.settings().into_iter();
        given
            .filter_map(|(option, value)| value.map(|_| option))
            .collect()
    }

    /// Keeps the chosen rows of `file`, or values that contain rows.
    pub(crate) fn choose<T: Borrow<ResultRow>>(
        &self,
        mut rows: Vec<T>,
        file: &Path,
    ) -> anyhow::Result<Vec<T>> {
        let count = rows.len();
        rows.truncate(self.limit.map_or(usize::MAX, |limit| limit as usize));
        let targets = self.targets.as_deref().map(targets::read).transpose()?;
        let rows = best_rows(rows, self.top_k.map(|top| top as usize), targets.as_ref());
        if rows.is_empty() {
            let file = file.display();
            match count {
                0 => warn(format_args!("{file} has no rows")),
                _ => warn(format_args!(
                    "{file}: none of its {count} rows is in --targets"
                )),
            }
        }
        let Some(shard) = self.shard else {
            return Ok(rows);
        };
        let part = shard.take(rows);
        if !part.contiguous {
            warn(format_args!(
                "{}: the rows of an image are not contiguous, so the concatenated outputs of all shards have another order than one run",
                file.display()
            ));
        }
        Ok(part.rows)
    }
}
