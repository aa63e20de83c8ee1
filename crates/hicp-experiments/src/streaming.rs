//! Rows of cases on their way into a file: in order from any number of threads, and on from where a run ended.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

use hicp_io::{IoError, ReadLimits, is_absent, write_atomically};

use crate::error::ExperimentError;
use crate::study::{CONFIG_FILE, RunOptions};

/// Most characters of a line that a message shows.
const SHOWN: usize = 300;

/// A file of rows and the configuration beside it.
pub(crate) struct Sheet<'a> {
    /// The folder of both.
    pub(crate) folder: &'a Path,
    /// Name of the file of rows.
    pub(crate) name: &'static str,
    /// Its first line.
    pub(crate) header: Vec<u8>,
    /// Number of rows of a case.
    pub(crate) rows_per_case: usize,
    /// Number of cases.
    pub(crate) cases: usize,
    /// The configuration as text.
    pub(crate) config: String,
    /// Reads the text of a stored configuration, as this version would write it.
    pub(crate) stored: fn(&ReadLimits, &Path) -> Result<String, ExperimentError>,
    /// Counts the rows in the text of a file; rows that the study cannot have are refused.
    pub(crate) check: &'a (dyn Fn(&Path, &str) -> Result<u64, ExperimentError> + Sync),
}

impl Sheet<'_> {
    fn path(&self) -> PathBuf {
        self.folder.join(self.name)
    }

    /// Fills the file: `worker` is made once per thread, and `rows` gives the text of a case.
    pub(crate) fn fill<W>(
        &self,
        options: RunOptions,
        worker: &(dyn Fn() -> Result<W, ExperimentError> + Sync),
        rows: &(dyn Fn(&mut W, usize) -> Vec<u8> + Sync),
        progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
    ) -> Result<(), ExperimentError> {
        std::fs::create_dir_all(self.folder).map_err(ExperimentError::file(self.folder))?;
        let (mut file, first) = self.open(options)?;
        if progress(first).is_break() {
            return Err(ExperimentError::Stopped { cases: first });
        }
        let next = AtomicUsize::new(first);
        let stop = AtomicBool::new(false);
        let (sender, receiver) = mpsc::channel();
        std::thread::scope(|scope| {
            for _ in 0..options.threads.max(1) {
                let sender = sender.clone();
                let (next, stop) = (&next, &stop);
                scope.spawn(move || {
                    let mut worker = match worker() {
                        Ok(worker) => worker,
                        Err(error) => {
                            let _ = sender.send(Err(error));
                            return;
                        }
                    };
                    loop {
                        let case = next.fetch_add(1, Ordering::Relaxed);
                        if case >= self.cases || stop.load(Ordering::Relaxed) {
                            return;
                        }
                        if sender.send(Ok((case, rows(&mut worker, case)))).is_err() {
                            return;
                        }
                    }
                });
            }
            drop(sender);
            let written = self.write_in_order(&receiver, &mut file, first, progress);
            stop.store(true, Ordering::Relaxed);
            written
        })
    }

    /// Writes the rows of cases as they come, in the order of the cases.
    fn write_in_order(
        &self,
        receiver: &mpsc::Receiver<Result<(usize, Vec<u8>), ExperimentError>>,
        file: &mut File,
        first: usize,
        progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
    ) -> Result<(), ExperimentError> {
        let mut early: BTreeMap<usize, Vec<u8>> = BTreeMap::new();
        let mut next = first;
        for message in receiver {
            let (case, text) = message?;
            early.insert(case, text);
            while let Some(text) = early.remove(&next) {
                file.write_all(&text)
                    .map_err(ExperimentError::file(self.path()))?;
                next += 1;
                if progress(next).is_break() {
                    return Err(ExperimentError::Stopped { cases: next });
                }
            }
        }
        file.sync_all().map_err(ExperimentError::file(self.path()))
    }

    /// Opens the file of rows at its end; returns the first case that is not in it.
    fn open(&self, options: RunOptions) -> Result<(File, usize), ExperimentError> {
        let (path, stored) = (self.path(), self.folder.join(CONFIG_FILE));
        if is_absent(&path) {
            write_atomically(&stored, |w| w.write_all(self.config.as_bytes()))?;
            let mut file = File::create(&path).map_err(ExperimentError::file(&path))?;
            file.write_all(&self.header)
                .map_err(ExperimentError::file(&path))?;
            return Ok((file, 0));
        }
        if !options.resume {
            return Err(ExperimentError::AlreadyThere { path });
        }
        if let Some(difference) =
            difference(&self.config, &(self.stored)(&options.limits, &stored)?)
        {
            return Err(ExperimentError::OtherConfiguration {
                path: stored,
                difference,
            });
        }
        let bytes = options.limits.read_bytes(&path)?;
        if let Err(foreign) = self.check_header(&bytes) {
            // Text in another encoding is told as such.
            return match options.limits.read_text(&path) {
                Err(error @ IoError::Encoding { .. }) => Err(error.into()),
                _ => Err(foreign),
            };
        }
        let (whole, cases) = self.whole_cases(&bytes);
        self.check_rows(&bytes[..whole], cases)?;
        let mut file = OpenOptions::new()
            .write(true)
            .open(&path)
            .map_err(ExperimentError::file(&path))?;
        file.set_len(whole as u64)
            .map_err(ExperimentError::file(&path))?;
        if whole == 0 {
            file.write_all(&self.header)
                .map_err(ExperimentError::file(&path))?;
        }
        file.seek(SeekFrom::End(0))
            .map_err(ExperimentError::file(&path))?;
        Ok((file, cases))
    }

    /// Refuses a file that does not begin as the rows do, unless its end cut off the first line: it is not of this study, and would be
    /// written over. A machine that failed may leave zeros in what was cut off.
    fn check_header(&self, bytes: &[u8]) -> Result<(), ExperimentError> {
        let zeros = bytes.iter().rev().take_while(|byte| **byte == 0).count();
        let written = &bytes[..bytes.len() - zeros];
        if written.starts_with(&self.header) || self.header.starts_with(written) {
            return Ok(());
        }
        let first_line = |bytes: &[u8]| {
            let line = bytes.split(|byte| *byte == b'\n').next();
            let text = String::from_utf8_lossy(line.unwrap_or_default()).into_owned();
            let shown: String = text.chars().take(SHOWN).collect();
            match shown.len() < text.len() {
                true => shown + "…",
                false => shown,
            }
        };
        Err(ExperimentError::Row {
            path: self.path(),
            line: 1,
            what: format!(
                "found {:?}, expected {:?}: it is not of this study, and is not written over",
                first_line(bytes),
                first_line(&self.header)
            ),
        })
    }

    /// Refuses rows that the study cannot have, before anything is computed: they would be kept.
    fn check_rows(&self, whole: &[u8], cases: usize) -> Result<(), ExperimentError> {
        if whole.is_empty() {
            return Ok(());
        }
        let path = self.path();
        let lines = |bytes: &[u8]| bytes.iter().filter(|byte| **byte == b'\n').count();
        let (line, what) = match std::str::from_utf8(whole) {
            Ok(text) => {
                let rows = (self.check)(&path, text)?;
                let expected = cases.saturating_mul(self.rows_per_case) as u64;
                if rows == expected {
                    return Ok(());
                }
                let what =
                    format!("found {rows} rows up to here, expected {expected}: one per line");
                (lines(whole), what)
            }
            Err(error) => {
                let before = &whole[..error.valid_up_to()];
                let what = "found a byte that is not UTF-8, expected text in UTF-8".to_owned();
                (1 + lines(before), what)
            }
        };
        Err(ExperimentError::Row { path, line, what })
    }

    /// Returns where the last whole case ends, and how many cases are whole; 0 bytes when not even the header is.
    fn whole_cases(&self, bytes: &[u8]) -> (usize, usize) {
        if !bytes.starts_with(&self.header) {
            return (0, 0);
        }
        let mut end = self.header.len();
        let (mut cases, mut rows) = (0, 0);
        let mut quoted = false;
        for (position, byte) in bytes.iter().enumerate().skip(self.header.len()) {
            match byte {
                b'"' => quoted = !quoted,
                b'\n' if !quoted => {
                    rows += 1;
                    if rows % self.rows_per_case == 0 {
                        (end, cases) = (position + 1, cases + 1);
                    }
                }
                _ => {}
            }
        }
        (end, cases)
    }
}

/// Says what differs first between two configurations as text; `None` when nothing does.
fn difference(ours: &str, theirs: &str) -> Option<String> {
    let (mut ours, mut theirs) = (ours.lines(), theirs.lines());
    loop {
        match (ours.next(), theirs.next()) {
            (None, None) => return None,
            (a, b) if a == b => {}
            (a, b) => {
                let text = |line: Option<&str>| {
                    line.unwrap_or("nothing")
                        .trim()
                        .trim_end_matches(',')
                        .to_owned()
                };
                return Some(format!("{} there, {} now", text(b), text(a)));
            }
        }
    }
}
