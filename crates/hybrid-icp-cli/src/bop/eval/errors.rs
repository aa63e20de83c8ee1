//! Writes the errors of every estimate as comma-separated values.

use std::path::Path;

use hicp_bop::Judged;
use hicp_io::IoError;
use hicp_io::bop::ResultRow;

const IDS: [&str; 6] = ["scene_id", "im_id", "obj_id", "row", "gt", "score"];
const ERRORS: [&str; 5] = ["mssd_mm", "mspd_px", "add_mm", "adi_mm", "translation_mm"];

/// Writes one line per compared estimate and instance.
///
/// Lengths are in millimeters, and MSPD is in pixels of the image. `row` is the index of a row of
/// the result file, `gt` that of an instance in the image's ground truth; both count from 0.
pub(super) fn write(path: &Path, targets: &[&Judged], rows: &[ResultRow]) -> Result<(), IoError> {
    hicp_io::write_atomically(path, |file| {
        let mut lines = csv::Writer::from_writer(file);
        let vsd = (5..=50).step_by(5).map(|percent| format!("vsd_{percent}"));
        let heads = IDS.map(str::to_owned).into_iter().chain(vsd);
        lines.write_record(heads.chain(ERRORS.map(str::to_owned)))?;
        for target in targets {
            let (scene_id, im_id) = target.frame;
            for (row, against) in target.rows.iter().zip(&target.errors.estimates) {
                for (gt, e) in target.truths.iter().zip(against) {
                    let places = [*row, *gt].map(|place| place.to_string());
                    let ids = [scene_id, im_id, target.obj_id].map(|id| id.to_string());
                    let lengths = [e.add_m, e.adi_m, e.translation_m].map(|m| 1e3 * m);
                    let errors = [1e3 * e.mssd_m, e.mspd_px].into_iter().chain(lengths);
                    let numbers = [rows[*row].score].into_iter().chain(e.vsd).chain(errors);
                    let numbers = numbers.map(|number| number.to_string());
                    lines.write_record(ids.into_iter().chain(places).chain(numbers))?;
                }
            }
        }
        lines.flush()
    })
}
