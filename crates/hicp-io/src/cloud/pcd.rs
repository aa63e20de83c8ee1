//! PCD files of the Point Cloud Library: text, binary and compressed.

use super::lzf;
use super::points::{PointCloud, Points};
use crate::error::{END_OF_FILE, IoError, Place, quote};
use crate::limits::Limit;
use crate::mesh::raw::Reading;
use crate::number::{Kind, NumberType};

/// The names of the fields that are read, and other names of the normals.
const NAMES: [[&str; 2]; 6] = [
    ["x", "x"],
    ["y", "y"],
    ["z", "z"],
    ["normal_x", "nx"],
    ["normal_y", "ny"],
    ["normal_z", "nz"],
];

/// The bytes that one byte of compressed data becomes at most, about.
const MAX_COMPRESSION: u64 = 100;

/// A field of a point: the place of its first number among all numbers and bytes of a point.
#[derive(Clone, Debug, Default)]
struct Field {
    name: String,
    kind: char,
    /// The size of a number, bytes.
    size: usize,
    /// The count of numbers.
    count: usize,
    first_number: usize,
    first_byte: usize,
}

/// Parses a file.
pub(super) fn parse(reading: Reading<'_>, content: &[u8]) -> Result<PointCloud, IoError> {
    let mut header = Header::default();
    let mut at = 0;
    let mut line_number = 0;
    while header.data.is_empty() {
        line_number += 1;
        let place = Place::Line(line_number);
        let rest = content.get(at..).unwrap_or_default();
        let end = rest.iter().position(|byte| *byte == b'\n');
        let Some(end) = end.filter(|_| at < 1 << 16) else {
            return Err(reading.refuse(place, END_OF_FILE, "a line `DATA` in the first 64 KiB"));
        };
        let line = String::from_utf8_lossy(&rest[..end]);
        header
            .declare(&line)
            .map_err(|expected| reading.refuse(place, quote(&line), expected))?;
        at += end + 1;
    }
    let place = Place::Line(line_number);
    let (stride, numbers) = header.place_fields().ok_or_else(|| {
        let expected = "as many SIZE, TYPE and COUNT as FIELDS";
        reading.refuse(place.clone(), "fields of unknown size", expected)
    })?;
    let fields = NAMES.map(|names| {
        let mut fields = header.fields.iter();
        fields.find(|field| names.contains(&&*field.name) && field.count > 0)
    });
    if fields[..3].iter().any(Option::is_none) {
        let names = header.fields.iter().take(12).map(|field| &*field.name);
        let names: Vec<&str> = names.collect();
        return Err(reading.refuse(place, format!("the fields {names:?}"), "x, y and z"));
    }
    let count = header.points;
    reading.check(Limit::VERTICES, place.clone(), count)?;
    let mut points = Points::new(reading);
    let body = &content[at..];
    let promise = |bytes_per_point: usize, available: u64| {
        let needed = (count as u64).saturating_mul(bytes_per_point as u64);
        let promised = (count as u64, "points");
        IoError::check_promise(reading.path, place.clone(), promised, needed, available)
    };
    match &*header.data {
        "ascii" => {
            // The last number may have no separator after it.
            promise(numbers.saturating_mul(2), body.len() as u64 + 1)?;
            let text = String::from_utf8_lossy(body);
            let lines = text.lines().zip(line_number + 1..);
            let mut lines = lines.filter(|(line, _)| !line.trim().is_empty());
            for index in 0..count {
                let (line, number) = lines.next().unwrap_or(("", line_number + 1 + index));
                let words: Vec<&str> = line.split_whitespace().collect();
                let values = fields.map(|field| match field {
                    Some(field) => words.get(field.first_number)?.parse().ok(),
                    None => Some(f64::NAN),
                });
                let [Some(x), Some(y), Some(z), Some(nx), Some(ny), Some(nz)] = values else {
                    let expected = format!("{numbers} numbers of point {index} of {count}");
                    return Err(reading.refuse(Place::Line(number), quote(line), expected));
                };
                points.add(Place::Line(number), &[x, y, z, nx, ny, nz])?;
            }
        }
        "binary" => {
            promise(stride, body.len() as u64)?;
            for index in 0..count {
                let start = index * stride;
                let values = numbers_of(fields, |field| &body[start + field.first_byte..]);
                points.add(Place::Byte((at + start) as u64), &values)?;
            }
        }
        "binary_compressed" => {
            let size = |at: usize| {
                let bytes = body.get(at..at + 4)?.try_into().ok()?;
                Some(u32::from_le_bytes(bytes) as usize)
            };
            let packed = size(0).and_then(|packed| body.get(8..)?.get(..packed));
            let (Some(packed), Some(length)) = (packed, size(4)) else {
                return Err(reading.refuse(place, END_OF_FILE, "compressed data"));
            };
            promise(stride, length as u64)?;
            let needed = length as u64 / MAX_COMPRESSION;
            let promised = (count as u64, "points");
            let available = packed.len() as u64;
            IoError::check_promise(reading.path, place.clone(), promised, needed, available)?;
            let damaged = || reading.refuse(Place::Byte(at as u64), "damaged data", "LZF data");
            let data = lzf::decompress(packed, length).ok_or_else(damaged)?;
            for index in 0..count {
                // All values of a field are together.
                let values = numbers_of(fields, |field| {
                    let of_field = index * field.size * field.count;
                    &data[field.first_byte * count + of_field..]
                });
                points.add(Place::Byte(at as u64), &values)?;
            }
        }
        other => {
            let expected = "DATA ascii, binary or binary_compressed";
            return Err(reading.refuse(place, quote(other), expected));
        }
    }
    Ok(points.finish()?.organized(header.height > 1))
}

#[derive(Debug, Default)]
struct Header {
    fields: Vec<Field>,
    width: usize,
    height: usize,
    points: usize,
    data: String,
}

impl Header {
    /// Parses a line. The error is the expected text.
    fn declare(&mut self, line: &str) -> Result<(), &'static str> {
        let mut words = line.split_whitespace();
        let key = words.next().unwrap_or_default();
        let mut count = || words.next()?.parse::<usize>().ok();
        match key {
            "WIDTH" => self.width = count().ok_or("a number")?,
            "HEIGHT" => self.height = count().ok_or("a number")?,
            "POINTS" => self.points = count().ok_or("a number")?,
            "DATA" => self.data = words.next().unwrap_or("nothing").to_owned(),
            "FIELDS" | "COLUMNS" => {
                let field = |name: &str| Field {
                    name: name.to_owned(),
                    count: 1,
                    ..Field::default()
                };
                self.fields = words.map(field).collect();
            }
            "SIZE" | "TYPE" | "COUNT" => {
                for (field, word) in self.fields.iter_mut().zip(words) {
                    match key {
                        "TYPE" => field.kind = word.chars().next().unwrap_or_default(),
                        "SIZE" => field.size = word.parse().map_err(|_| "sizes in bytes")?,
                        _ => field.count = word.parse().map_err(|_| "counts of numbers")?,
                    }
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Places the fields, and returns the bytes and the numbers of a point.
    fn place_fields(&mut self) -> Option<(usize, usize)> {
        if self.points == 0 {
            self.points = self.width.checked_mul(self.height)?;
        }
        let (mut bytes, mut numbers) = (0_usize, 0_usize);
        for field in &mut self.fields {
            field.number_type()?;
            (field.first_byte, field.first_number) = (bytes, numbers);
            bytes = bytes.checked_add(field.size.checked_mul(field.count)?)?;
            numbers = numbers.checked_add(field.count)?;
        }
        Some((bytes, numbers))
    }
}

impl Field {
    fn number_type(&self) -> Option<NumberType> {
        let kind = match (self.kind, self.size) {
            ('F', 4 | 8) => Kind::Float,
            ('I', 1 | 2 | 4 | 8) => Kind::Signed,
            ('U', 1 | 2 | 4 | 8) => Kind::Unsigned,
            _ => return None,
        };
        Some(NumberType::new(kind, self.size))
    }
}

/// Returns the first number of each field, which starts at `bytes`; NaN without a field.
fn numbers_of<'a>(fields: [Option<&Field>; 6], bytes: impl Fn(&Field) -> &'a [u8]) -> [f64; 6] {
    let number = |field: &Field| field.number_type()?.read(bytes(field), false);
    fields.map(|field| field.and_then(number).unwrap_or(f64::NAN))
}
