//! The journal of `bop refine`, with the results of finished images.
//!
//! It allows resuming a run that was killed.

use std::path::Path;

use anyhow::bail;
use hicp_bop::{FrameResult, FrameRows};
use hicp_io::{RowLog, is_absent};

use crate::limits::limits;
use crate::terminal::warn;

/// Starts a journal for a run with these settings, or with `resume` continues an existing one.
///
/// It is a file next to the output. It has a header with the settings of the run, then a line of
/// JSON for every finished image. Returns the stored result of every image; `None` for images that
/// are not finished.
pub(super) fn open(
    path: &Path,
    settings: &str,
    resume: bool,
    frames: &[FrameRows],
) -> anyhow::Result<(RowLog, Vec<Option<FrameResult>>)> {
    if !resume && !is_absent(path) {
        bail!(
            "{} exists and may have the results of an unfinished run: continue that run with --resume, or remove the file",
            path.display()
        );
    }
    let (log, lines) = RowLog::resume(path, settings, 1, &limits())?;
    let mut results: Vec<Option<FrameResult>> = frames.iter().map(|_| None).collect();
    let mut damaged = 0;
    for line in lines {
        match serde_json::from_str::<(usize, FrameResult)>(&line) {
            Ok((place, result)) if is_of(frames.get(place), &result) => {
                results[place] = Some(result);
            }
            _ => damaged += 1,
        }
    }
    if damaged > 0 {
        warn(format_args!(
            "{}: {damaged} lines are damaged; their images are refined again",
            path.display()
        ));
    }
    Ok((log, results))
}

/// Returns whether a result has exactly the rows of an image.
fn is_of(frame: Option<&FrameRows>, result: &FrameResult) -> bool {
    let indices = result.rows.iter().map(|row| row.index);
    frame.is_some_and(|(_, expected)| indices.eq(expected.iter().copied()))
}
