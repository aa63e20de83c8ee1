//! Writes the status of every row of a `bop refine` as comma-separated values.

use std::path::Path;

use hicp_bop::{FrameResult, RowResult};
use hicp_io::IoError;
use hicp_io::bop::ResultRow;

use super::summary::status_text;

const HEADER: &str = "scene_id,im_id,obj_id,row,status,mve_initial,mve,confidence,warnings";

/// Writes one line per row of the output, in the order of the output.
///
/// A line has the status, the MVE before and after, the confidence, and the warnings. The numbers
/// are empty for a row that did not reach the pipeline. `row` counts the rows of the output from 0,
/// as in the errors of `bop eval`. If poses are estimated, a row without a pose is not in the
/// output, and its `row` is empty.
pub(super) fn write(
    path: &Path,
    rows: &[ResultRow],
    results: &[FrameResult],
    estimated: bool,
) -> Result<(), IoError> {
    let mut of_rows: Vec<&RowResult> = results.iter().flat_map(|result| &result.rows).collect();
    of_rows.sort_by_key(|result| result.index);
    hicp_io::write_atomically(path, |file| {
        let mut lines = csv::Writer::from_writer(file);
        lines.write_record(HEADER.split(','))?;
        let mut place = 0..;
        for result in of_rows {
            let row = &rows[result.index];
            let warnings: Vec<String> = result.warnings().iter().map(ToString::to_string).collect();
            let (before, after) = result.mve.unzip();
            let is_written = !estimated || result.pose.is_some();
            let written = is_written.then(|| place.next()).flatten();
            lines.serialize((
                (row.scene_id, row.im_id, row.obj_id, written),
                status_text(result.status, estimated),
                [before, after, result.confidence].map(|number| number.map(|n| n.to_string())),
                warnings.join("; "),
            ))?;
        }
        lines.flush()
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use hicp_bop::RowStatus;
    use hybrid_icp::core::Isometry3;
    use hybrid_icp::score::Flatness;

    use super::*;

    #[test]
    fn rows_have_the_order_of_the_output_with_status_mve_and_warnings() {
        let rows: Vec<ResultRow> = (5..8)
            .map(|obj_id| ResultRow::new(1, 2, obj_id, Isometry3::identity()))
            .collect();
        let flatness = Flatness::new(0.01, 0.001, 0.01, 0.2);
        let row = |index, status, mve, flatness| RowResult {
            mve,
            confidence: mve.map(|_| 0.75),
            flatness,
            ..RowResult::unrefined(index, status)
        };
        let frame = |rows| FrameResult {
            rows,
            ..FrameResult::default()
        };
        let results = [
            frame(vec![row(
                2,
                RowStatus::Refined,
                Some((0.95, 0.1)),
                Some(flatness),
            )]),
            frame(vec![
                row(1, RowStatus::NoMask, None, None),
                row(0, RowStatus::Refined, Some((0.5, 0.25)), None),
            ]),
        ];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rows.csv");
        write(&path, &rows, &results, false).unwrap();
        assert_eq!(
            std::fs::read_to_string(path).unwrap(),
            "scene_id,im_id,obj_id,row,status,mve_initial,mve,confidence,warnings\n\
             1,2,5,0,refined,0.5,0.25,0.75,\n\
             1,2,6,1,kept: no mask of the object,,,,\n\
             1,2,7,2,refined,0.95,0.1,0.75,\"the initial pose explained nothing of the mask (MVE 0.950): what was found there (MVE 0.100) may be \
             another object; the mask may show a wall or a table: the measured surface is flat to 0.0010 m, but the model's surface there only to \
             0.0100 m, and they are 0.0100 m apart\"\n"
        );
    }
}
