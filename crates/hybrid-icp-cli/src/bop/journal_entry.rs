//! A line of the journal of `bop refine`: what became of an image.

use hicp_bop::{Fault, FaultKind, FrameResult, RowResult, RowStatus};
use hybrid_icp::{Flatness, Isometry3, UnitQuaternion, Vector3, Warning};
use serde::{Deserialize, Serialize};

use super::digest;

/// Furthest that the length of a stored quaternion may be from 1: rounding is far below.
const UNIT: f64 = 1e-9;

/// Returns the line of an image, by its place among the run's: a digest, what it is of, and the end of the line.
pub(super) fn write(frame: usize, result: &FrameResult) -> serde_json::Result<String> {
    let text = serde_json::to_string(&Entry::of(frame, result))?;
    Ok(format!("{} {text}\n", digest::of_bytes(text.as_bytes())))
}

/// Reads a line that [`write()`] wrote; `None` for anything else: where a bit is another, the numbers are of no use.
pub(super) fn read(line: &[u8]) -> Option<(usize, FrameResult)> {
    let line = std::str::from_utf8(line).ok()?;
    let (digest, text) = line.strip_suffix('\n')?.split_once(' ')?;
    if digest != digest::of_bytes(text.as_bytes()) {
        return None;
    }
    let entry: Entry = serde_json::from_str(text).ok()?;
    Some((entry.frame, entry.result()?))
}

/// What a journal holds of an image. Numbers are kept as bits, so that what is read is what was written.
#[derive(Debug, Serialize, Deserialize)]
struct Entry {
    /// Which image: its place among the run's.
    frame: usize,
    seconds: Option<u64>,
    rows: Vec<Row>,
    /// Of which kind, and what it says.
    problems: Vec<(String, String)>,
    /// Of which object, which, and its numbers.
    warnings: Vec<(u32, String, Vec<u64>)>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Row {
    index: usize,
    status: String,
    /// Bits of the translation and of the quaternion i, j, k, w.
    pose: Option<[u64; 7]>,
    mve: Option<[u64; 2]>,
    /// Bits of the residual, the measured and the rendered flatness, and the diameter.
    flatness: Option<[u64; 4]>,
}

const KINDS: [FaultKind; 3] = [
    FaultKind::Missing,
    FaultKind::MissingMask,
    FaultKind::Damaged,
];

fn name_of(kind: FaultKind) -> &'static str {
    match kind {
        FaultKind::Missing => "missing",
        FaultKind::MissingMask => "missing mask",
        FaultKind::Damaged => "damaged",
    }
}

impl Entry {
    fn of(frame: usize, result: &FrameResult) -> Self {
        let row = |row: &RowResult| Row {
            index: row.index,
            status: row.status.to_string(),
            pose: row.pose.map(|pose| bits_of(&pose)),
            mve: row.mve.map(|(a, b)| [a, b].map(f64::to_bits)),
            flatness: row.flatness.map(bits_of_flatness),
        };
        let problems = result.faults.iter();
        let warnings = result.warnings.iter();
        Self {
            frame,
            seconds: result.seconds.map(f64::to_bits),
            rows: result.rows.iter().map(row).collect(),
            problems: problems
                .map(|p| (name_of(p.kind).to_owned(), p.text.clone()))
                .collect(),
            warnings: warnings
                .filter_map(|(object, warning)| {
                    let (name, numbers) = parts_of(warning)?;
                    Some((*object, name.to_owned(), numbers))
                })
                .collect(),
        }
    }

    /// What it was made of; `None` where that can be of no run.
    fn result(self) -> Option<FrameResult> {
        let row = |row: Row| {
            Some(RowResult {
                index: row.index,
                status: RowStatus::parse(&row.status)?,
                pose: known(row.pose, pose_of)?,
                mve: known(row.mve, |[a, b]| Some((finite(a)?, finite(b)?)))?,
                flatness: known(row.flatness, flatness_of)?,
            })
        };
        let warning = |(object, name, numbers): (u32, String, Vec<u64>)| {
            Some((object, warning_of(&name, &numbers)?))
        };
        let problems = self.problems.into_iter();
        Some(FrameResult {
            rows: self.rows.into_iter().map(row).collect::<Option<_>>()?,
            seconds: known(self.seconds, finite)?,
            faults: problems
                .map(|(kind, text)| {
                    let kind = KINDS.into_iter().find(|known| name_of(*known) == kind)?;
                    Some(Fault { kind, text })
                })
                .collect::<Option<_>>()?,
            warnings: self
                .warnings
                .into_iter()
                .map(warning)
                .collect::<Option<_>>()?,
        })
    }
}

/// Reads what may be absent: `None` only where it is there and cannot be read.
fn known<B, T>(stored: Option<B>, read: impl Fn(B) -> Option<T>) -> Option<Option<T>> {
    match stored {
        Some(bits) => read(bits).map(Some),
        None => Some(None),
    }
}

fn finite(bits: u64) -> Option<f64> {
    Some(f64::from_bits(bits)).filter(|x| x.is_finite())
}

fn bits_of(pose: &Isometry3<f64>) -> [u64; 7] {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(f64::to_bits)
}

fn bits_of_flatness(flatness: Flatness) -> [u64; 4] {
    let Flatness {
        residual,
        measured,
        rendered,
        diameter,
        ..
    } = flatness;
    [residual, measured, rendered, diameter].map(f64::to_bits)
}

fn flatness_of([residual, measured, rendered, diameter]: [u64; 4]) -> Option<Flatness> {
    Some(Flatness::new(
        finite(residual)?,
        finite(measured)?,
        finite(rendered)?,
        finite(diameter)?,
    ))
}

fn pose_of(bits: [u64; 7]) -> Option<Isometry3<f64>> {
    let [x, y, z, i, j, k, w] = bits.map(f64::from_bits);
    // Making it of length 1 again would change its last bits.
    let rotation = UnitQuaternion::new_unchecked([i, j, k, w].into());
    let unit = (rotation.coords.norm() - 1.0).abs() < UNIT;
    let finite = [x, y, z].iter().all(|x| x.is_finite());
    (finite && unit).then(|| Isometry3::from_parts(Vector3::new(x, y, z).into(), rotation))
}

/// The name and the numbers of a warning that an image is needed for; those about models are raised by every run anew.
fn parts_of(warning: &Warning) -> Option<(&'static str, Vec<u64>)> {
    let bits = |numbers: &[f64]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    let of_mask = |pixels: usize, numbers: [f64; 3]| {
        let mut all = vec![pixels as u64];
        all.extend(bits(&numbers));
        all
    };
    match *warning {
        Warning::NoDepth => Some(("no depth", Vec::new())),
        Warning::Depth { measured, expected } => Some(("depth", bits(&[measured, expected]))),
        Warning::Mask {
            pixels,
            at_most,
            diameter,
            distance,
        } => Some(("mask", of_mask(pixels, [at_most, diameter, distance]))),
        Warning::Sliver {
            pixels,
            at_least,
            diameter,
            distance,
        } => Some(("sliver", of_mask(pixels, [at_least, diameter, distance]))),
        _ => None,
    }
}

fn warning_of(name: &str, numbers: &[u64]) -> Option<Warning> {
    let real = |index: usize| numbers.get(index).map(|bits| f64::from_bits(*bits));
    let pixels = || usize::try_from(*numbers.first()?).ok();
    match name {
        "no depth" => Some(Warning::NoDepth),
        "depth" => Some(Warning::Depth {
            measured: real(0)?,
            expected: real(1)?,
        }),
        "mask" => Some(Warning::Mask {
            pixels: pixels()?,
            at_most: real(1)?,
            diameter: real(2)?,
            distance: real(3)?,
        }),
        "sliver" => Some(Warning::Sliver {
            pixels: pixels()?,
            at_least: real(1)?,
            diameter: real(2)?,
            distance: real(3)?,
        }),
        _ => None,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
pub(super) mod tests {
    use super::*;

    pub(crate) fn result() -> FrameResult {
        let pose = Isometry3::new(Vector3::new(0.1, -0.2, 0.7), Vector3::new(0.3, 2.0, -1.0));
        let flatness = Flatness::new(0.1 + 0.2, 1.0 / 3.0, 0.7 / 3.0, 1e9 / 3.0);
        let row = |index, status, pose, mve: Option<(f64, f64)>| RowResult {
            index,
            status,
            pose,
            mve,
            flatness: mve.map(|_| flatness),
        };
        let (pixels, diameter, distance) = (123_456, 0.1 + 0.2, 1.0 / 3.0);
        FrameResult {
            rows: vec![
                row(
                    4,
                    RowStatus::Refined,
                    Some(pose),
                    Some((0.1 + 0.2, 1.0 / 3.0)),
                ),
                row(9, RowStatus::NoMask, None, None),
            ],
            seconds: Some(0.7 / 3.0),
            faults: KINDS
                .map(|kind| Fault {
                    kind,
                    text: "a\n\"b\"".to_owned(),
                })
                .into(),
            warnings: vec![
                (1, Warning::NoDepth),
                (
                    1,
                    Warning::Depth {
                        measured: f64::INFINITY,
                        expected: 0.1 + 0.2,
                    },
                ),
                (
                    7,
                    Warning::Mask {
                        pixels,
                        at_most: 0.7 / 3.0,
                        diameter,
                        distance,
                    },
                ),
                (
                    7,
                    Warning::Sliver {
                        pixels,
                        at_least: 1e9 / 3.0,
                        diameter,
                        distance,
                    },
                ),
            ],
        }
    }

    #[test]
    fn what_was_written_is_read_bit_for_bit() {
        let line = write(5, &result()).unwrap();
        assert_eq!(read(line.as_bytes()), Some((5, result())));
        let empty = FrameResult::default();
        let line = write(0, &empty).unwrap();
        assert_eq!(read(line.as_bytes()), Some((0, empty)));
    }

    #[test]
    fn a_line_with_any_other_bit_is_not_read() {
        let line = write(5, &result()).unwrap().into_bytes();
        for place in 0..8 * line.len() {
            let mut other = line.clone();
            other[place / 8] ^= 1 << (place % 8);
            assert_eq!(read(&other), None, "bit {place}");
        }
        for length in 0..line.len() {
            assert_eq!(read(&line[..length]), None, "{length} bytes");
        }
    }

    #[test]
    fn numbers_that_no_run_has_are_not_read() {
        let with = |change: &dyn Fn(&mut Entry)| {
            let mut entry = Entry::of(5, &result());
            change(&mut entry);
            entry.result()
        };
        let nan = f64::NAN.to_bits();
        assert!(with(&|_| {}).is_some());
        assert!(with(&|entry| entry.seconds = Some(nan)).is_none());
        assert!(with(&|entry| entry.rows[0].mve = Some([nan, 0])).is_none());
        for number in 0..4 {
            let told = with(&|entry| entry.rows[0].flatness.as_mut().unwrap()[number] = nan);
            assert!(told.is_none(), "{number}");
        }
        assert!(with(&|entry| entry.rows[0].status = "lost".to_owned()).is_none());
        assert!(with(&|entry| entry.problems[1].0 = "lost".to_owned()).is_none());
        assert!(with(&|entry| entry.warnings[1].2.truncate(1)).is_none());
        assert!(with(&|entry| entry.warnings[1].1 = "mood".to_owned()).is_none());
        for number in 0..7 {
            for wrong in [f64::NAN, f64::INFINITY, 1e300] {
                let told = with(&|entry| {
                    let pose = entry.rows[0].pose.as_mut().unwrap();
                    pose[number] = wrong.to_bits();
                });
                assert!(
                    told.is_none() || (wrong == 1e300 && number < 3),
                    "{number} {wrong}"
                );
            }
        }
    }
}
