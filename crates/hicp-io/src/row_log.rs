//! Row files that a killed run can resume.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::error::{IoError, Place, quote};
use crate::limits::{Limit, ReadLimits};
use crate::source::check_regular;

/// A text file of rows for a long run, so that a killed run can resume.
///
/// The first line is a header. It states everything that the rows depend on: the columns, and the
/// settings of the run or a hash of them. [`RowLog::resume`] refuses a file with another header, so
/// rows of different runs never mix.
///
/// - A row is one line, or a fixed number of lines that belong together. One `write` call appends
///   it. A kill can cut off only the last row; `resume` drops it, and the run computes it again.
/// - Rows have no checksums. A damaged row is a row that the caller cannot parse.
/// - Threads may append at the same time. Rows are in the order of the calls. A caller that needs a
///   fixed order appends from one thread, as `hicp-experiments` does, or writes an index into each
///   row, as `bop refine` does.
/// - Appended rows survive the end of the process. [`RowLog::sync`] makes them survive a power
///   failure, too.
/// - The file is locked while it is open if the file system supports locks, so two runs never write
///   to the same file.
///
/// ```
/// use hicp_io::{ReadLimits, RowLog};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let dir = tempfile::tempdir()?;
/// let path = dir.path().join("rows.csv");
/// let (log, _) = RowLog::resume(&path, "case,seconds", 1, &ReadLimits::DEFAULT)?;
/// log.append("0,1.5")?;
/// drop(log); // The run is killed here.
///
/// let (log, rows) = RowLog::resume(&path, "case,seconds", 1, &ReadLimits::DEFAULT)?;
/// assert_eq!(rows, ["0,1.5"]);
/// log.append("1,2.5")?;
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct RowLog {
    path: PathBuf,
    /// The file, positioned at its end, and its length in bytes.
    file: Mutex<(File, u64)>,
}

impl RowLog {
    /// Opens a log and returns its complete rows, each without its last line break.
    ///
    /// Creates the log if there is no file. The header is one line, without a line break. An
    /// incomplete row at the end is removed from the file. Bytes that are not UTF-8 are replaced by
    /// U+FFFD, so that the caller's parser reports them.
    ///
    /// # Errors
    ///
    /// [`IoError`] in these cases, which leave the file unchanged:
    ///
    /// - The headers differ; the error names both.
    /// - Another run has the file open.
    /// - The file is not a regular file or is above [`ReadLimits::max_file_bytes`].
    /// - The file cannot be read or written.
    pub fn resume(
        path: impl AsRef<Path>,
        header: &str,
        lines_per_row: usize,
        limits: &ReadLimits,
    ) -> Result<(Self, Vec<String>), IoError> {
        let path = path.as_ref();
        let failed = |e| IoError::write(path, e);
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(failed)?;
        let metadata = file.metadata().map_err(failed)?;
        check_regular(path, &metadata)?;
        // Other errors mean that the file system does not support locks.
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            let text = "another run has the file open, expected one run at a time";
            return Err(failed(io::Error::new(io::ErrorKind::ResourceBusy, text)));
        }
        limits.check(Limit::FILE_BYTES, path, None, metadata.len())?;
        let mut content = Vec::new();
        file.read_to_end(&mut content)
            .map_err(|e| IoError::read(path, e))?;

        let head = format!("{header}\n");
        let Some(body) = content.strip_prefix(head.as_bytes()) else {
            // A run killed at its start or a power failure leaves a part of the header or zeros.
            let zeros = content.iter().rev().take_while(|byte| **byte == 0).count();
            if !head
                .as_bytes()
                .starts_with(&content[..content.len() - zeros])
            {
                return Err(other_header(path, &content, header));
            }
            let log = Self::cut(path, file, 0).map_err(failed)?;
            log.append(header)?;
            return Ok((log, Vec::new()));
        };
        let lines = body.split_inclusive(|byte| *byte == b'\n');
        let lines: Vec<&[u8]> = lines.filter(|line| line.ends_with(b"\n")).collect();
        let mut length = head.len();
        let mut rows = Vec::new();
        for lines in lines.chunks_exact(lines_per_row.max(1)) {
            let row = lines.concat();
            length += row.len();
            rows.push(String::from_utf8_lossy(&row[..row.len() - 1]).into_owned());
        }
        let log = Self::cut(path, file, length as u64).map_err(failed)?;
        Ok((log, rows))
    }

    /// Removes everything after the first `length` bytes of the file.
    fn cut(path: &Path, mut file: File, length: u64) -> io::Result<Self> {
        file.set_len(length)?;
        file.seek(SeekFrom::End(0))?;
        let (path, file) = (path.to_owned(), Mutex::new((file, length)));
        Ok(Self { path, file })
    }

    /// Appends a row, without a line break at its end.
    ///
    /// The row must have the number of lines given to [`RowLog::resume`].
    ///
    /// # Errors
    ///
    /// [`IoError`] if the row cannot be written. In that case, no part of it stays in the file.
    pub fn append(&self, row: &str) -> Result<(), IoError> {
        let mut guard = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let (file, length) = &mut *guard;
        let line = format!("{row}\n");
        if let Err(error) = file.write_all(line.as_bytes()) {
            // A full disk may hold a part of the row; without this, the next row would continue its
            // line.
            let _ = file.set_len(*length);
            let _ = file.seek(SeekFrom::End(0));
            return Err(IoError::write(&self.path, error));
        }
        *length += line.len() as u64;
        Ok(())
    }

    /// Waits until the rows are on the disk, typically for a few milliseconds.
    ///
    /// # Errors
    ///
    /// [`IoError`] if the system cannot write them.
    pub fn sync(&self) -> Result<(), IoError> {
        let guard = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let synced = guard.0.sync_data();
        synced.map_err(|e| IoError::write(&self.path, e))
    }

    /// Removes the file of a run that has finished.
    ///
    /// # Errors
    ///
    /// [`IoError`] if the file cannot be removed.
    pub fn remove(self) -> Result<(), IoError> {
        std::fs::remove_file(&self.path).map_err(|e| IoError::write(&self.path, e))
    }
}

/// Returns an error that shows both headers from the first word in which they differ.
fn other_header(path: &Path, content: &[u8], header: &str) -> IoError {
    let line = content.split(|byte| *byte == b'\n').next();
    let found = String::from_utf8_lossy(line.unwrap_or_default()).into_owned();
    let pairs = found.char_indices().zip(header.chars());
    let same = pairs.take_while(|((_, a), b)| a == b).last();
    let start = same.map_or(0, |((at, c), _)| at + c.len_utf8());
    let start = found[..start].rfind([' ', ',']).map_or(0, |at| at + 1);
    let expected = format!(
        "{} as in this run: use the same settings, or move the file away",
        quote(&header[start..])
    );
    IoError::new(path, Place::Line(1), quote(&found[start..]), expected)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resume(path: &Path, header: &str) -> Result<(RowLog, Vec<String>), IoError> {
        RowLog::resume(path, header, 1, &ReadLimits::DEFAULT)
    }

    #[test]
    fn a_killed_run_resumes_with_its_complete_rows() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log");
        let (log, _) = resume(&path, "h").unwrap();
        log.append("a").unwrap();
        log.append("b\nc").unwrap();
        log.sync().unwrap();
        drop(log);
        let whole = std::fs::read(&path).unwrap();
        assert_eq!(whole, b"h\na\nb\nc\n");
        for end in 0..=whole.len() {
            for zeros in [0, 3] {
                let mut cut = whole[..end].to_vec();
                cut.resize(end + zeros, 0);
                std::fs::write(&path, cut).unwrap();
                let (log, rows) = resume(&path, "h").unwrap();
                assert_eq!(rows.len(), end.saturating_sub(2) / 2, "{end}");
                log.append("next").unwrap();
                drop(log);
                let (_, again) = resume(&path, "h").unwrap();
                assert_eq!(again, [rows, vec!["next".to_owned()]].concat());
            }
        }
        std::fs::write(&path, &whole).unwrap();
        let (_, rows) = RowLog::resume(&path, "h", 2, &ReadLimits::DEFAULT).unwrap();
        assert_eq!(rows, ["a\nb"]);
        assert_eq!(std::fs::read(&path).unwrap(), b"h\na\nb\n");
    }

    #[test]
    fn another_header_is_refused_and_the_error_shows_both() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log");
        for (content, found) in [
            ("runs seed=1 n=5\nx\n", "\"seed=1 n=5\""),
            ("runs seed=22\n", "\"seed=22\""),
            ("my notes", "\"my notes\""),
            ("\u{e9}\n", "\"\u{e9}\""),
        ] {
            std::fs::write(&path, content).unwrap();
            let error = resume(&path, "runs seed=2 n=5").unwrap_err().to_string();
            let expected = format!("line 1: found {found}, expected \"");
            assert!(error.contains(&expected), "{error}");
            assert!(error.contains("seed=2 n=5\" as in this run"), "{error}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), content);
        }
    }

    #[test]
    fn a_log_has_one_writer_and_a_size_limit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log");
        let (log, _) = resume(&path, "h").unwrap();
        let error = resume(&path, "h").unwrap_err();
        let source = std::error::Error::source(&error).unwrap().to_string();
        assert!(source.contains("another run has the file open"), "{source}");
        log.remove().unwrap();
        assert!(!path.exists());
        std::fs::write(&path, "h\nrow\n").unwrap();
        let mut limits = ReadLimits::DEFAULT;
        limits.max_file_bytes = 5;
        let error = RowLog::resume(&path, "h", 1, &limits).unwrap_err();
        assert!(error.to_string().contains("6 bytes"), "{error}");
        assert!(resume(dir.path(), "h").is_err());
    }
}
