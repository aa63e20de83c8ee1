//! NumPy arrays: NPY files, and the members of NPZ archives.
//!
//! The header of an NPY file is a Python dictionary of three keys, in the form that NumPy writes.
//! The crate `npyz` reads it with a parser generator, which takes longer to compile than the rest
//! of this crate.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

use flate2::bufread::DeflateDecoder;
use rawzip::{CompressionMethod, ZipArchive, ZipArchiveEntryWayfinder};

use crate::error::{IoError, Place, quote};
use crate::format::Format;
use crate::limits::ReadLimits;
use crate::number::{Kind, NumberType, whole};

/// An array of numbers.
#[derive(Debug)]
pub(crate) struct Array<'a> {
    /// The lengths of its axes.
    pub(crate) shape: Vec<usize>,
    number: NumberType,
    /// `true` if the numbers are truth values.
    is_bool: bool,
    big_endian: bool,
    /// Whether the first index varies fastest.
    by_columns: bool,
    data: Cow<'a, [u8]>,
}

impl<'a> Array<'a> {
    /// Parses the array of an NPY file, or the only array of an NPZ archive.
    ///
    /// If an archive has several arrays, the first of `names` that it has counts.
    pub(crate) fn parse(
        limits: &ReadLimits,
        path: &Path,
        content: &'a [u8],
        names: &[&str],
    ) -> Result<Self, IoError> {
        match Format::of(content) {
            Some(Format::Npz) => {
                let archive = Archive::open(path, content)?;
                let content = archive.extract(archive.find(names)?, limits.max_file_bytes)?;
                parse_npy(path, Cow::Owned(content))
            }
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
    let length = NumberType::new(Kind::Unsigned, start - 8);
    let length = length.read(content.get(8..).unwrap_or_default(), false);
    let end = start + whole(length.ok_or_else(cut)?) as usize;
    let header = String::from_utf8_lossy(content.get(start..end).ok_or_else(cut)?).into_owned();
    let value = |key: &str| {
        let (_, value) = header.split_once(&format!("'{key}':"))?;
        Some(value.trim_start())
    };
    let descr = value("descr").and_then(|descr| descr.split(',').next());
    let descr = descr.unwrap_or_default().trim_matches(['\'', ' ', '}']);
    if descr.ends_with('O') {
        let expected = "numbers: reading a pickle runs its code; in Python, \
                        np.load(FILE, allow_pickle=True) reads it and np.save writes its arrays";
        let found = "a pickled array of Python objects".to_owned();
        return Err(refuse(found, expected));
    }
    let Some(number) = number_type(descr) else {
        let found = format!("the type {}", quote(descr));
        return Err(refuse(found, "real numbers of 1, 2, 4 or 8 bytes"));
    };
    let shape = || {
        let (shape, _) = value("shape")?.strip_prefix('(')?.split_once(')')?;
        let lengths = shape.split(',').map(str::trim);
        let lengths = lengths.filter(|length| !length.is_empty());
        let lengths: Result<Vec<usize>, _> = lengths.map(str::parse).collect();
        lengths.ok()
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
    let product = |product: usize, length: &usize| product.checked_mul(*length);
    let count = shape.iter().try_fold(1, product).unwrap_or(usize::MAX);
    let needed = count.saturating_mul(number.bytes);
    let promised = (count as u64, "numbers");
    let available = (content.len() - end) as u64;
    IoError::check_promise(path, Place::Byte(0), promised, needed as u64, available)?;
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

/// The largest number of arrays of an archive that are read, which bounds the time.
const MOST_ARRAYS: usize = 256;

/// Returns the names and numbers of the arrays of an archive, unless it has a single array.
///
/// Returns `None` for that, and for other files. Arrays of more than `most` numbers, those that are
/// not numbers, and those after the first [`MOST_ARRAYS`] are left out.
pub(crate) fn small_arrays(
    path: &Path,
    content: &[u8],
    most: usize,
) -> Result<Option<BTreeMap<String, Vec<f64>>>, IoError> {
    if Format::of(content) != Some(Format::Npz) {
        return Ok(None);
    }
    let archive = Archive::open(path, content)?;
    if archive.members.len() == 1 {
        return Ok(None);
    }
    let mut arrays = BTreeMap::new();
    for member in archive.members.iter().take(MOST_ARRAYS) {
        // A header has at most 64 KiB.
        let content = archive.extract(member, (1 << 16) + 8 * most as u64)?;
        if let Ok(array) = parse_npy(path, Cow::Owned(content))
            && array.shape.iter().product::<usize>() <= most
        {
            arrays.insert(member.name.clone(), array.numbers().collect());
        }
    }
    Ok(Some(arrays))
}

/// An NPZ file: a zip archive of NPY files.
struct Archive<'a> {
    path: &'a Path,
    zip: rawzip::ZipSliceArchive<&'a [u8]>,
    members: Vec<Member>,
}

/// A file of an archive, named without `.npy`.
struct Member {
    name: String,
    place: ZipArchiveEntryWayfinder,
    method: CompressionMethod,
}

impl<'a> Archive<'a> {
    fn open(path: &'a Path, content: &'a [u8]) -> Result<Self, IoError> {
        let failed = |error| Self::not_complete(path, error);
        let zip = ZipArchive::from_slice(content).map_err(failed)?;
        let (mut entries, mut members) = (zip.entries(), Vec::new());
        while let Some(entry) = entries.next_entry().map_err(failed)? {
            let name = String::from_utf8_lossy(entry.file_path().as_ref()).into_owned();
            if let Some(name) = name.strip_suffix(".npy") {
                members.push(Member {
                    name: name.to_owned(),
                    place: entry.wayfinder(),
                    method: entry.compression_method(),
                });
            }
        }
        Ok(Self { path, zip, members })
    }

    fn not_complete(path: &Path, error: rawzip::Error) -> IoError {
        let found = "data that are not a complete zip archive";
        IoError::new(path, None, found, "an NPZ file").with_source(error)
    }

    /// Returns the only array, or the one with the first of `names` that the archive has.
    fn find(&self, names: &[&str]) -> Result<&Member, IoError> {
        if let [only] = &self.members[..] {
            return Ok(only);
        }
        let named = |name: &&str| self.members.iter().find(|member| member.name == *name);
        names.iter().find_map(named).ok_or_else(|| {
            let shown = self.members.iter().take(8);
            let shown: Vec<String> = shown.map(|member| quote(&member.name)).collect();
            let found = format!("{} arrays: {}", self.members.len(), shown.join(", "));
            let expected = format!("a single array, or one named {}", names.join(" or "));
            IoError::new(self.path, None, found, expected)
        })
    }

    /// Extracts the first `most` bytes of the NPY file of an array.
    fn extract(&self, member: &Member, most: u64) -> Result<Vec<u8>, IoError> {
        let entry = self.zip.get_entry(member.place);
        let entry = entry.map_err(|error| Self::not_complete(self.path, error))?;
        let data: Box<dyn Read> = match member.method {
            CompressionMethod::STORE => Box::new(entry.data()),
            CompressionMethod::DEFLATE => Box::new(DeflateDecoder::new(entry.data())),
            other => {
                let found = format!("{other:?} compression");
                let expected = "np.savez or np.savez_compressed";
                return Err(IoError::new(self.path, None, found, expected));
            }
        };
        // The checksum is verified at the end.
        let (mut data, mut array) = (entry.verifying_reader(data).take(most), Vec::new());
        data.read_to_end(&mut array).map_err(|error| {
            let found = format!("the damaged array {}", quote(&member.name));
            IoError::new(self.path, None, found, "an NPZ file").with_source(error)
        })?;
        Ok(array)
    }
}
