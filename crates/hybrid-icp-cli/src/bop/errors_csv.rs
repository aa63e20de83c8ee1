//! The errors of every estimate as comma-separated values.

use std::io::{self, Write};
use std::path::Path;

use hicp_io::IoError;
use hicp_io::bop::ResultRow;

use super::judge::Judged;

/// Writes one line per estimate and instance that were compared: lengths in millimetres, MSPD in pixels of the image.
///
/// `row` counts the result file's rows from 0, `gt` the image's ground truth.
pub(crate) fn write(path: &Path, targets: &[&Judged], rows: &[ResultRow]) -> Result<(), IoError> {
    hicp_io::write_atomically(path, |file| write_lines(file, targets, rows))
}

fn write_lines(file: &mut dyn Write, targets: &[&Judged], rows: &[ResultRow]) -> io::Result<()> {
    write!(file, "scene_id,im_id,obj_id,row,gt,score")?;
    for percent in (5..=50).step_by(5) {
        write!(file, ",vsd_{percent}")?;
    }
    writeln!(file, ",mssd_mm,mspd_px,add_mm,adi_mm,translation_mm")?;
    for target in targets {
        let (scene_id, im_id) = target.frame;
        for (row, against) in target.rows.iter().zip(&target.errors.estimates) {
            for (gt, errors) in target.truths.iter().zip(against) {
                let score = rows[*row].score;
                write!(
                    file,
                    "{scene_id},{im_id},{},{row},{gt},{score}",
                    target.obj_id
                )?;
                for error in errors.vsd {
                    write!(file, ",{error}")?;
                }
                writeln!(
                    file,
                    ",{},{},{},{},{}",
                    1e3 * errors.mssd_m,
                    errors.mspd_px,
                    1e3 * errors.add_m,
                    1e3 * errors.adi_m,
                    1e3 * errors.translation_m
                )?;
            }
        }
    }
    Ok(())
}
