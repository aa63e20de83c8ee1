//! NumPy arrays: NPY files, and the members of NPZ archives.
//!
//! The header of an NPY file is a Python dictionary of three keys, in the form that NumPy writes.
//! The crate `npyz` reads it with a parser generator, which takes longer to compile than the rest
//! of this crate.

use std::borrow::Cow;
use std::io::Read;
use std::path::Path;

use flate2::bufread::DeflateDecoder;
use rawzip::{CompressionMethod, ZipArchive};

use crate::error::{IoError, Place, quote};
use crate::format::Format;
use crate::limits::ReadLimits;

/// The type of a number: kind (`f`, `i`, `u` or `b`) and size in bytes.
type Kind = (u8, usize);

/// An array of numbers.
#[derive(Debug)]
pub(crate) struct Array<'a> {
    /// The lengths of its axes.
    pub(crate) shape: Vec<usize>,
    kind: Kind,
    big_endian: bool,
    /// Whether the first index varies fastest.
    by_columns: bool,
    data: Cow<'a, [u8]>,
}

impl<'a> Array<'a> {
    /// Parses the array of an NPY file, or the only array of an NPZ archive.
    ///
    /// If an archive has several arrays, the one with a name of `names` counts.
    pub(crate) fn parse(
        limits: &ReadLimits,
        path: &Path,
        content: &'a [u8],
        names: &[&str],
    ) -> Result<Self, IoError> {
        match Format::of(content) {
            Some(Format::Npz) => parse_npy(path, Cow::Owned(member(limits, path, content, names)?)),
            _ => parse_npy(path, Cow::Borrowed(content)),
        }
    }

    /// Returns the bits of an integer, or `None` for floating point. A truth value has 1.
    pub(crate) fn integer_bits(&self) -> Option<u32> {
        match self.kind {
            (b'f', _) => None,
            (b'b', _) => Some(1),
            (_, bytes) => u32::try_from(8 * bytes).ok(),
        }
    }

    /// Returns the size of the numbers in bytes.
    pub(crate) fn raw_bytes(&self) -> usize {
        self.data.len()
    }

    /// Returns the numbers, with the last index varying fastest.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> {
        let (kind, bytes) = self.kind;
        let rows = self.shape.first().copied().unwrap_or(1).max(1);
        let count = self.data.len() / bytes;
        let columns = count / rows;
        (0..count).map(move |index| {
            let index = match self.by_columns {
                true => index % columns * rows + index / columns,
                false => index,
            };
            let mut number = [0; 8];
            number[..bytes].copy_from_slice(&self.data[index * bytes..][..bytes]);
            if self.big_endian {
                number[..bytes].reverse();
            }
            decode(kind, bytes, number)
        })
    }
}

/// Converts little-endian bytes to a number.
fn decode(kind: u8, bytes: usize, number: [u8; 8]) -> f64 {
    let [a, b, c, d, ..] = number;
    let unsigned = u64::from_le_bytes(number);
    match (kind, bytes) {
        (b'f', 2) => half::f16::from_le_bytes([a, b]).to_f64(),
        (b'f', 4) => f32::from_le_bytes([a, b, c, d]).into(),
        (b'f', _) => f64::from_le_bytes(number),
        (b'i', 1) => i8::from_le_bytes([a]).into(),
        (b'i', 2) => i16::from_le_bytes([a, b]).into(),
        (b'i', 4) => i32::from_le_bytes([a, b, c, d]).into(),
        (b'i', _) => i64::from_le_bytes(number) as f64,
        _ => unsigned as f64,
    }
}

fn parse_npy<'a>(path: &Path, content: Cow<'a, [u8]>) -> Result<Array<'a>, IoError> {
    let refuse =
        |found: String, expected: &str| IoError::new(path, Place::Byte(0), found, expected);
    let cut = || refuse("a header that is cut off".to_owned(), "an NPY file");
    // After the magic bytes: the version, and the length of the header in two or four bytes.
    let wide = content.get(6).is_some_and(|major| *major >= 2);
    let start = if wide { 12 } else { 10 };
    let length = content.get(8..start).ok_or_else(cut)?;
    let length = length
        .iter()
        .rev()
        .fold(0, |sum, byte| sum << 8 | usize::from(*byte));
    let end = start.saturating_add(length);
    let header = String::from_utf8_lossy(content.get(start..end).ok_or_else(cut)?).into_owned();
    let value = |key: &str| {
        let (_, value) = header.split_once(&format!("'{key}':"))?;
        Some(value.trim_start())
    };
    let descr = value("descr").unwrap_or_default();
    let descr = descr
        .split(',')
        .next()
        .unwrap_or_default()
        .trim_matches(['\'', ' ', '}']);
    if descr.ends_with('O') {
        let expected = "numbers: reading a pickle runs its code; in Python, \
                        np.load(FILE, allow_pickle=True) reads it and np.save writes its arrays";
        return Err(refuse(
            "a pickled array of Python objects".to_owned(),
            expected,
        ));
    }
    let kind = kind(descr).ok_or_else(|| {
        refuse(
            format!("the type {}", quote(descr)),
            "real numbers of 1, 2, 4 or 8 bytes",
        )
    })?;
    let shape = || {
        let (shape, _) = value("shape")?.strip_prefix('(')?.split_once(')')?;
        let lengths = shape
            .split(',')
            .map(str::trim)
            .filter(|length| !length.is_empty());
        lengths
            .map(|length| length.parse().ok())
            .collect::<Option<Vec<usize>>>()
    };
    let by_columns = value("fortran_order").map(|value| value.starts_with("True"));
    let (Some(shape), Some(by_columns)) = (shape(), by_columns) else {
        let expected = "the keys 'descr', 'fortran_order' and 'shape'";
        return Err(refuse(format!("the header {}", quote(&header)), expected));
    };
    if by_columns && shape.len() > 2 {
        let found = format!("{} axes in Fortran order", shape.len());
        return Err(refuse(found, "np.ascontiguousarray(array)"));
    }
    let count = shape
        .iter()
        .try_fold(1_usize, |product, length| product.checked_mul(*length));
    let needed = count
        .and_then(|count| count.checked_mul(kind.1))
        .unwrap_or(usize::MAX);
    let (available, promised) = (content.len() - end, count.unwrap_or(usize::MAX) as u64);
    let promise = (promised, "numbers");
    IoError::check_promise(
        path,
        Place::Byte(0),
        promise,
        needed as u64,
        available as u64,
    )?;
    let data = match content {
        Cow::Borrowed(content) => Cow::Borrowed(&content[end..end + needed]),
        Cow::Owned(mut content) => {
            content.truncate(end + needed);
            content.drain(..end);
            Cow::Owned(content)
        }
    };
    Ok(Array {
        shape,
        kind,
        big_endian: descr.starts_with('>'),
        by_columns,
        data,
    })
}

/// Parses a type such as `<f4`.
fn kind(descr: &str) -> Option<Kind> {
    let text = descr.trim_start_matches(['<', '>', '|', '=']);
    let bytes = text.get(1..)?.parse().ok()?;
    let kind = (text.as_bytes()[0], bytes);
    matches!(
        kind,
        (b'f', 2 | 4 | 8) | (b'i' | b'u', 1 | 2 | 4 | 8) | (b'b', 1)
    )
    .then_some(kind)
}

/// Extracts the NPY file of one array from an archive.
fn member(
    limits: &ReadLimits,
    path: &Path,
    content: &[u8],
    names: &[&str],
) -> Result<Vec<u8>, IoError> {
    let failed = |error: rawzip::Error| {
        let found = "data that are not a complete zip archive";
        IoError::new(path, None, found, "an NPZ file").with_source(error)
    };
    let archive = ZipArchive::from_slice(content).map_err(failed)?;
    let (mut entries, mut arrays) = (archive.entries(), Vec::new());
    while let Some(entry) = entries.next_entry().map_err(failed)? {
        let name = String::from_utf8_lossy(entry.file_path().as_ref()).into_owned();
        if let Some(name) = name.strip_suffix(".npy") {
            arrays.push((
                name.to_owned(),
                entry.wayfinder(),
                entry.compression_method(),
            ));
        }
    }
    let named = arrays.iter().find(|(name, ..)| names.contains(&&**name));
    let only = arrays.first().filter(|_| arrays.len() == 1);
    let Some((name, wayfinder, method)) = only.or(named) else {
        let shown: Vec<_> = arrays
            .iter()
            .take(8)
            .map(|(name, ..)| quote(name))
            .collect();
        let found = format!("{} arrays: {}", arrays.len(), shown.join(", "));
        let expected = format!("a single array, or one named {}", names.join(" or "));
        return Err(IoError::new(path, None, found, expected));
    };
    let entry = archive.get_entry(*wayfinder).map_err(failed)?;
    let mut array = Vec::new();
    let most = limits.max_file_bytes;
    let data = entry.data();
    let read = match *method {
        CompressionMethod::STORE => data.take(most).read_to_end(&mut array),
        CompressionMethod::DEFLATE => DeflateDecoder::new(data).take(most).read_to_end(&mut array),
        other => {
            let found = format!("{other:?} compression");
            return Err(IoError::new(
                path,
                None,
                found,
                "np.savez or np.savez_compressed",
            ));
        }
    };
    read.map_err(|error| {
        let found = format!("the damaged array {}", quote(name));
        IoError::new(path, None, found, "an NPZ file").with_source(error)
    })?;
    Ok(array)
}
