//! What a run of `bop refine` has done so far, on the disk, so that a killed run can go on.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context as _, anyhow, bail};
use hicp_bop::FrameResult;

use super::journal_entry;
use super::refine_settings::Setting;
use crate::terminal::warn;

/// A file beside the output: a line that says which run it is of, then a line for every image that is done.
///
/// A line is on the disk before the next image of the thread begins. A line that was cut off by the end of a run is dropped,
/// and its image done again; so is a line with another digest than it states, whose bits have changed since. Two runs cannot
/// write the same journal at once.
#[derive(Debug)]
pub(crate) struct Journal {
    path: PathBuf,
    file: Mutex<File>,
}

/// What the first setting of every journal says: what the file is, and the form of its lines.
const FORM: (&str, &str) = ("journal of bop refine", "3");

/// How every journal begins.
const OPENING: &[u8] = b"[[\"journal of bop refine\",";

impl Journal {
    /// The journal of an output file: beside it, its name with `.journal` at the end.
    pub(crate) fn path_of(output: &Path) -> PathBuf {
        let mut name = output.as_os_str().to_owned();
        name.push(".journal");
        name.into()
    }

    /// Begins a journal for a run that is known by its settings, or with `resume` goes on with the one that is there.
    ///
    /// Returns what it holds of images, by their place among the run's.
    pub(crate) fn open(
        path: PathBuf,
        settings: &[Setting],
        resume: bool,
    ) -> anyhow::Result<(Self, Vec<(usize, FrameResult)>)> {
        let cannot = |what: &str| format!("cannot {what} the journal {}", path.display());
        // Reading a pipe or a device need not come to an end.
        if std::fs::metadata(&path).is_ok_and(|found| !found.is_file()) {
            bail!(
                "the journal {} is no regular file, expected one or none",
                path.display()
            );
        }
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .with_context(|| cannot("open"))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => bail!(
                "the journal {} is in use, expected one run at a time per --output",
                path.display()
            ),
            // A file system without locks: then nobody can hold one.
            Err(TryLockError::Error(_)) => {}
        }
        let mut content = Vec::new();
        file.read_to_end(&mut content)
            .with_context(|| cannot("read"))?;
        let first = content
            .iter()
            .position(|byte| *byte == b'\n')
            .map(|end| end + 1);
        let mut done = Vec::new();
        match first {
            Some(first) => {
                let theirs = read_header(&path, &content[..first])?;
                if !resume {
                    bail!(
                        "{} holds the work of a run that did not finish: go on with it by --resume, or remove it to begin anew",
                        path.display()
                    );
                }
                check_settings(&path, &theirs, settings)?;
                let (mut kept, mut damaged) = (first, 0);
                for line in content[first..].split_inclusive(|byte| *byte == b'\n') {
                    if !line.ends_with(b"\n") {
                        break;
                    }
                    kept += line.len();
                    match journal_entry::read(line) {
                        Some(entry) => done.push(entry),
                        None => damaged += 1,
                    }
                }
                if damaged > 0 {
                    warn(format_args!(
                        "{}: {damaged} lines have changed since they were written; their images are done again",
                        path.display()
                    ));
                }
                file.set_len(kept as u64).with_context(|| cannot("cut"))?;
                file.seek(SeekFrom::End(0))
                    .with_context(|| cannot("read"))?;
            }
            // Not even its first line is whole: nothing is lost by beginning anew.
            None if is_begun(&content) => {
                let header = serde_json::to_string(&with_form(settings))? + "\n";
                file.set_len(0).with_context(|| cannot("cut"))?;
                file.seek(SeekFrom::Start(0))
                    .with_context(|| cannot("read"))?;
                file.write_all(header.as_bytes())
                    .and_then(|()| file.sync_all())
                    .with_context(|| cannot("write"))?;
            }
            None => return Err(no_journal(&path)),
        }
        let file = Mutex::new(file);
        Ok((Self { path, file }, done))
    }

    /// Puts an image's results on the disk.
    pub(crate) fn append(&self, frame: usize, result: &FrameResult) -> anyhow::Result<()> {
        let line = journal_entry::write(frame, result)?;
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(line.as_bytes())
            .and_then(|()| file.sync_data())
            .with_context(|| format!("cannot write the journal {}", self.path.display()))
    }

    /// Removes the journal of a run whose output is written.
    pub(crate) fn remove(self) -> anyhow::Result<()> {
        std::fs::remove_file(&self.path)
            .with_context(|| format!("cannot remove the journal {}", self.path.display()))
    }
}

/// The settings as they are written.
fn with_form(settings: &[Setting]) -> Vec<(&str, &str)> {
    let settings = settings.iter().map(|(name, value)| (&**name, &**value));
    std::iter::once(FORM).chain(settings).collect()
}

/// Whether a file without a whole line is one that a run left as it began; a machine that failed may leave zeros in it.
fn is_begun(content: &[u8]) -> bool {
    let zeros = content.iter().rev().take_while(|byte| **byte == 0).count();
    let written = &content[..content.len() - zeros];
    written.starts_with(OPENING) || OPENING.starts_with(written)
}

/// It is somebody else's file, and stays as it is.
fn no_journal(path: &Path) -> anyhow::Error {
    anyhow!(
        "{} is no journal of bop refine, expected one or no such file: it would be overwritten; move it, or choose another --output",
        path.display()
    )
}

/// Reads the settings of a journal; refuses what is none, and one of another form.
fn read_header(path: &Path, line: &[u8]) -> anyhow::Result<Vec<Setting>> {
    let Ok(mut theirs) = serde_json::from_slice::<Vec<Setting>>(line) else {
        return Err(no_journal(path));
    };
    let form = match theirs.first() {
        Some((name, form)) if *name == FORM.0 => form.as_str(),
        // The first form did not say so.
        Some((name, _)) if name == "hybrid-icp" => "1",
        _ => return Err(no_journal(path)),
    };
    if form != FORM.1 {
        bail!(
            "{} is a journal of form {form}, expected {}: finish that run with the version of hybrid-icp that began it, or remove it to begin anew",
            path.display(),
            FORM.1
        );
    }
    theirs.remove(0);
    Ok(theirs)
}

/// Refuses a journal of another run, and names the first setting that differs.
fn check_settings(path: &Path, theirs: &[Setting], settings: &[Setting]) -> anyhow::Result<()> {
    for (index, (name, value)) in settings.iter().enumerate() {
        let (other, found) = theirs.get(index).map_or(("", "nothing"), |(n, v)| (n, v));
        if other != name || found != value {
            bail!(
                "{} is of a run with {name} {found}, expected {value} as in this run: make it the same, or remove the journal to begin anew",
                path.display()
            );
        }
    }
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::super::journal_entry::tests::result;
    use super::*;

    fn settings(shard: &str) -> Vec<Setting> {
        [("--split", "test"), ("--shard", shard)]
            .map(|(name, value)| (name.to_owned(), value.to_owned()))
            .to_vec()
    }

    #[test]
    fn what_was_appended_is_read_back_bit_for_bit_wherever_the_file_was_cut() {
        // The fewer bytes, the fewer places to cut.
        let result = || FrameResult {
            warnings: Vec::new(),
            ..result()
        };
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.csv.journal");
        let (journal, done) = Journal::open(path.clone(), &settings("1/2"), false).unwrap();
        assert!(done.is_empty());
        let header = std::fs::metadata(&path).unwrap().len();
        for frame in [3, 1] {
            journal.append(frame, &result()).unwrap();
        }
        drop(journal);
        let whole = std::fs::read(&path).unwrap();
        let line = (whole.len() as u64 - header) / 2;
        for length in 0..=whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            let (journal, done) = Journal::open(path.clone(), &settings("1/2"), true).unwrap();
            let expected = (length as u64).saturating_sub(header) / line;
            assert_eq!(done.len() as u64, expected, "{length}");
            for ((frame, read), expected) in done.iter().zip([3, 1]) {
                assert_eq!((*frame, read), (expected, &result()));
            }
            // What is appended now follows whole lines.
            journal.append(7, &result()).unwrap();
            drop(journal);
            let (_, done) = Journal::open(path.clone(), &settings("1/2"), true).unwrap();
            assert_eq!(done.len() as u64, expected + 1);
        }
    }

    #[test]
    fn journals_of_other_runs_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.csv.journal");
        let open = |shard: &str, resume: bool| {
            let opened = Journal::open(path.clone(), &settings(shard), resume);
            opened.map(|_| ()).map_err(|error| error.to_string())
        };
        open("1/2", false).unwrap();
        assert!(open("1/2", false).unwrap_err().contains("--resume"));
        let told = open("2/2", true).unwrap_err();
        assert!(told.contains("--shard 1/2, expected 2/2"), "{told}");
        let running = Journal::open(path.clone(), &settings("1/2"), true).unwrap();
        assert!(open("1/2", true).unwrap_err().contains("in use"));
        drop(running);
        let forms = [
            ("1", "[[\"hybrid-icp\",\"0.1.0\"],[\"--split\",\"test\"]]\n"),
            ("2", "[[\"journal of bop refine\",\"2\"]]\n"),
        ];
        for (form, older) in forms {
            std::fs::write(&path, older).unwrap();
            for resume in [false, true] {
                let told = open("1/2", resume).unwrap_err();
                let expected = format!("form {form}, expected {}", FORM.1);
                assert!(told.contains(&expected), "{told}");
            }
            assert_eq!(std::fs::read_to_string(&path).unwrap(), older);
        }
    }

    #[test]
    fn a_line_that_changed_is_dropped_and_those_after_it_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.csv.journal");
        let open = || Journal::open(path.clone(), &settings("1/2"), true).unwrap();
        let (journal, _) = open();
        let frames = |done: Vec<(usize, FrameResult)>| -> Vec<usize> {
            assert!(done.iter().all(|(_, read)| *read == result()));
            done.into_iter().map(|(frame, _)| frame).collect()
        };
        let header = std::fs::metadata(&path).unwrap().len() as usize;
        for frame in [3, 1, 2] {
            journal.append(frame, &result()).unwrap();
        }
        drop(journal);
        let whole = std::fs::read(&path).unwrap();
        let line = (whole.len() - header) / 3;
        let middle = header + line..header + 2 * line;
        for (changed, left) in [
            (middle.start, &[3, 2][..]),
            (middle.start + line / 2, &[3, 2]),
            // The end of a line: two are one now.
            (middle.end - 1, &[3]),
            (middle.start - 1, &[2]),
        ] {
            let mut content = whole.clone();
            content[changed] ^= 1;
            std::fs::write(&path, &content).unwrap();
            let (journal, done) = open();
            assert_eq!(frames(done), left, "byte {changed}");
            journal.append(1, &result()).unwrap();
            drop(journal);
            assert_eq!(frames(open().1), [left, &[1]].concat());
        }
    }

    #[test]
    fn a_file_that_is_no_journal_stays_as_it_is() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.csv.journal");
        let open = |resume: bool| Journal::open(path.clone(), &settings("1/2"), resume);
        for content in [
            "my notes",
            "my notes\n",
            "\n",
            " ",
            "[",
            "[[\"journal\"",
            "[[\"journal of a cat\",\"2\"]]",
            "[[\"journal of a cat\",\"2\"]]\n",
            "\0\0my notes",
        ] {
            for resume in [false, true] {
                std::fs::write(&path, content).unwrap();
                if OPENING.starts_with(content.as_bytes()) {
                    // As far as one can tell it was to be one.
                    open(resume).unwrap();
                    continue;
                }
                let told = open(resume).unwrap_err().to_string();
                assert!(told.contains("is no journal of bop refine"), "{told}");
                assert_eq!(std::fs::read_to_string(&path).unwrap(), content);
            }
        }
        // What a machine that failed leaves of a file that was begun.
        for zeros in ["\0".repeat(4096), "[[\"jour".to_owned() + &"\0".repeat(90)] {
            std::fs::write(&path, zeros).unwrap();
            assert!(open(false).unwrap().1.is_empty());
        }
        std::fs::remove_file(&path).unwrap();
        std::fs::create_dir(&path).unwrap();
        let told = open(false).unwrap_err().to_string();
        assert!(told.contains("no regular file"), "{told}");
    }
}
