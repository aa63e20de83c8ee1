//! What a run of `bop refine` has done so far, on the disk, so that a killed run can go on.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context as _, bail};
use hicp_bop::{Fate, Fault, FrameResult, RowResult};
use hybrid_icp::{Isometry3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// A file beside the output: a line that says which run it is of, then a line for every image that is done.
///
/// A line is on the disk before the next image of the thread begins. A line that was cut off by the end of a run is dropped,
/// and its image done again. Numbers are kept as bits, so that what is read is what was written. Two runs cannot write
/// the same journal at once.
#[derive(Debug)]
pub(crate) struct Journal {
    path: PathBuf,
    file: Mutex<File>,
}

/// What a journal holds of an image.
#[derive(Debug, Serialize, Deserialize)]
struct Entry {
    /// Which image: its place among the run's.
    frame: usize,
    seconds: Option<u64>,
    rows: Vec<Row>,
    /// Whether it is only missing, and what it says.
    problems: Vec<(bool, String)>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Row {
    index: usize,
    fate: String,
    /// Bits of the translation and of the quaternion i, j, k, w.
    pose: Option<[u64; 7]>,
    mve: Option<[u64; 2]>,
}

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
        settings: &[(&str, String)],
        resume: bool,
    ) -> anyhow::Result<(Self, Vec<(usize, FrameResult)>)> {
        let cannot = |what: &str| format!("cannot {what} the journal {}", path.display());
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
        let header = serde_json::to_string(settings)? + "\n";
        let first = content
            .iter()
            .position(|byte| *byte == b'\n')
            .map(|end| end + 1);
        let mut done = Vec::new();
        match first {
            Some(_) if !resume => bail!(
                "{} holds the work of a run that did not finish: go on with it by --resume, or remove it to begin anew",
                path.display()
            ),
            Some(first) => {
                check_settings(&path, &content[..first], settings)?;
                let mut kept = first;
                for line in content[first..].split_inclusive(|byte| *byte == b'\n') {
                    let Some(entry) = read_entry(line) else {
                        break;
                    };
                    kept += line.len();
                    done.push(entry);
                }
                file.set_len(kept as u64).with_context(|| cannot("cut"))?;
                file.seek(SeekFrom::End(0))
                    .with_context(|| cannot("read"))?;
            }
            // Not even its first line is whole: nothing is lost by beginning anew.
            None => {
                file.set_len(0).with_context(|| cannot("cut"))?;
                file.seek(SeekFrom::Start(0))
                    .with_context(|| cannot("read"))?;
                file.write_all(header.as_bytes())
                    .and_then(|()| file.sync_all())
                    .with_context(|| cannot("write"))?;
            }
        }
        let file = Mutex::new(file);
        Ok((Self { path, file }, done))
    }

    /// Puts an image's results on the disk.
    pub(crate) fn append(&self, frame: usize, result: &FrameResult) -> anyhow::Result<()> {
        let line = serde_json::to_string(&Entry::of(frame, result))? + "\n";
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

/// Refuses a journal of another run, and names the first setting that differs.
fn check_settings(path: &Path, line: &[u8], settings: &[(&str, String)]) -> anyhow::Result<()> {
    let Ok(theirs) = serde_json::from_slice::<Vec<(String, String)>>(line) else {
        bail!(
            "{} is no journal of bop refine, expected one: remove it",
            path.display()
        );
    };
    for (index, (name, value)) in settings.iter().enumerate() {
        let (other, found) = theirs.get(index).map_or(("", "nothing"), |(n, v)| (n, v));
        if other != *name || found != value {
            bail!(
                "{} is of a run with {name} {found}, expected {value} as in this run: pass the same, or remove it to begin anew",
                path.display()
            );
        }
    }
    Ok(())
}

/// Reads a whole line; `None` for anything else.
fn read_entry(line: &[u8]) -> Option<(usize, FrameResult)> {
    let line = line.strip_suffix(b"\n")?;
    let entry: Entry = serde_json::from_slice(line).ok()?;
    let rows = entry.rows.iter().map(|row| {
        Some(RowResult {
            index: row.index,
            fate: Fate::parse(&row.fate)?,
            pose: row.pose.map(pose_of),
            mve: row.mve.map(|[a, b]| (f64::from_bits(a), f64::from_bits(b))),
        })
    });
    let problems = entry.problems.into_iter();
    let result = FrameResult {
        rows: rows.collect::<Option<_>>()?,
        seconds: entry.seconds.map(f64::from_bits),
        faults: problems
            .map(|(missing, text)| Fault { missing, text })
            .collect(),
        // They are told by the run that looked.
        doubts: Vec::new(),
    };
    Some((entry.frame, result))
}

impl Entry {
    fn of(frame: usize, result: &FrameResult) -> Self {
        let row = |row: &RowResult| Row {
            index: row.index,
            fate: row.fate.to_string(),
            pose: row.pose.map(|pose| bits_of(&pose)),
            mve: row.mve.map(|(a, b)| [a.to_bits(), b.to_bits()]),
        };
        let problems = result.faults.iter();
        Self {
            frame,
            seconds: result.seconds.map(f64::to_bits),
            rows: result.rows.iter().map(row).collect(),
            problems: problems.map(|p| (p.missing, p.text.clone())).collect(),
        }
    }
}

fn bits_of(pose: &Isometry3<f64>) -> [u64; 7] {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(f64::to_bits)
}

fn pose_of(bits: [u64; 7]) -> Isometry3<f64> {
    let [x, y, z, i, j, k, w] = bits.map(f64::from_bits);
    let rotation = UnitQuaternion::new_unchecked([i, j, k, w].into());
    Isometry3::from_parts(Vector3::new(x, y, z).into(), rotation)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    fn result() -> FrameResult {
        let pose = Isometry3::new(Vector3::new(0.1, -0.2, 0.7), Vector3::new(0.3, 2.0, -1.0));
        let row = |index, fate, pose, mve| RowResult {
            index,
            fate,
            pose,
            mve,
        };
        FrameResult {
            rows: vec![
                row(4, Fate::Refined, Some(pose), Some((0.1 + 0.2, 1.0 / 3.0))),
                row(9, Fate::NoMask, None, None),
            ],
            seconds: Some(0.7 / 3.0),
            faults: vec![Fault::damaged("a\n\"b\"".to_owned())],
            doubts: Vec::new(),
        }
    }

    fn settings(shard: &str) -> Vec<(&'static str, String)> {
        vec![
            ("--split", "test".to_owned()),
            ("--shard", shard.to_owned()),
        ]
    }

    #[test]
    fn what_was_appended_is_read_back_bit_for_bit_wherever_the_file_was_cut() {
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
                assert_eq!(*frame, expected);
                let same = serde_json::to_string(&Entry::of(0, read)).unwrap();
                assert_eq!(
                    same,
                    serde_json::to_string(&Entry::of(0, &result())).unwrap()
                );
                assert_eq!(read.rows[0].pose, result().rows[0].pose);
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
        std::fs::write(&path, "scene_id\n").unwrap();
        assert!(open("1/2", true).unwrap_err().contains("no journal"));
    }
}
