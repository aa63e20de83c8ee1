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
use crate::number::{Kind, NumberType};

/// An array of numbers.
#[derive(Debug)]
pub(crate) struct Array<'a> {
    /// The lengths of its axes.
    pub(crate) shape: Vec<usize>,
    number: NumberType,
    /// Whether the numbers are truth values.
    is_bool: bool,
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
        match self.number.kind {
            Kind::Float => None,
            _ if self.is_bool => Some(1),
            _ => u32::try_from(8 * self.number.bytes).ok(),
        }
    }

    /// Returns the size of the numbers in bytes.
    pub(crate) fn raw_bytes(&self) -> usize {
        self.data.len()
    }

    /// Returns the numbers, with the last index varying fastest.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> {
        let bytes = self.number.bytes;
        let rows = self.shape.first().copied().unwrap_or(1).max(1);
        let count = self.data.len() / bytes;
        let columns = count / rows;
        (0..count).map(move |index| {
            let index = match self.by_columns {
                true => index % columns * rows + index / columns,
                false => index,
            };
            let number = self
                .number
                .read(&self.data[index * bytes..], self.big_endian);
            number.unwrap_or(f64::NAN)
        })
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
    let number = number_type(descr).ok_or_else(|| {
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
        .and_then(|count| count.checked_mul(number.bytes))
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
        number,
        is_bool: descr.contains('b'),
        big_endian: descr.starts_with('>'),
        by_columns,
        data,
    })
}

/// Parses a type such as `<f4`.
fn number_type(descr: &str) -> Option<NumberType> {
    let text = descr.trim_start_matches(['<', '>', '|', '=']);
    let bytes = text.get(1..)?.parse().ok()?;
    let kind = match (text.as_bytes()[0], bytes) {
        (b'f', 2 | 4 | 8) => Kind::Float,
        (b'i', 1 | 2 | 4 | 8) => Kind::Signed,
        (b'u', 1 | 2 | 4 | 8) | (b'b', 1) => Kind::Unsigned,
        _ => return None,
    };
    Some(NumberType { kind, bytes })
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
