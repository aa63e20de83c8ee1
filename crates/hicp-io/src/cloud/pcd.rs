//! PCD files of the Point Cloud Library: text, binary and compressed.

use super::lzf;
use super::points::{PointCloud, Points};
use crate::error::{END_OF_FILE, IoError, Place, quote};
use crate::limits::Limit;
use crate::mesh::raw::Reading;

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
        let Some(end) = rest
            .iter()
            .position(|byte| *byte == b'\n')
            .filter(|_| at < 1 << 16)
        else {
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
        header
            .fields
            .iter()
            .find(|field| names.contains(&&*field.name) && field.count > 0)
    });
    if fields[..3].iter().any(Option::is_none) {
        let names: Vec<_> = header
            .fields
            .iter()
            .take(12)
            .map(|field| &*field.name)
            .collect();
        return Err(reading.refuse(place, format!("the fields {names:?}"), "x, y and z"));
    }
    let count = header.points;
    reading.check(Limit::VERTICES, place.clone(), count)?;
    let mut points = Points::new(reading, fields.iter().all(Option::is_some));
    let body = &content[at..];
    let promise = |needed: u64, available: u64| {
        IoError::check_promise(
            reading.path,
            place.clone(),
            (count as u64, "points"),
            needed,
            available,
        )
    };
    let needed = (count as u64).saturating_mul(stride as u64);
    match &*header.data {
        "ascii" => {
            promise(
                (count as u64).saturating_mul(2 * numbers as u64),
                body.len() as u64 + 1,
            )?;
            let text = String::from_utf8_lossy(body);
            let mut lines = text
                .lines()
                .zip(line_number + 1..)
                .filter(|(line, _)| !line.trim().is_empty());
            for index in 0..count {
                let (line, number) = lines.next().unwrap_or(("", line_number + 1 + index));
                let words: Vec<&str> = line.split_whitespace().collect();
                let values = fields.map(|field| match field {
                    Some(field) => words
                        .get(field.first_number)
                        .and_then(|word| word.parse().ok()),
                    None => Some(f64::NAN),
                });
                if values.contains(&None) {
                    let expected = format!("{numbers} numbers of point {index} of {count}");
                    return Err(reading.refuse(Place::Line(number), quote(line), expected));
                }
                points.add(
                    Place::Line(number),
                    &values.map(|value| value.unwrap_or(f64::NAN)),
                )?;
            }
        }
        "binary" => {
            promise(needed, body.len() as u64)?;
            for (index, point) in body.chunks_exact(stride.max(1)).take(count).enumerate() {
                let values = fields.map(|field| {
                    field.map_or(f64::NAN, |field| field.number(&point[field.first_byte..]))
                });
                points.add(Place::Byte((at + index * stride) as u64), &values)?;
            }
        }
        "binary_compressed" => {
            let sizes = body.first_chunk::<8>().map(|bytes| {
                let number = |at: usize| u32::from_le_bytes([0, 1, 2, 3].map(|i| bytes[at + i]));
                (number(0) as usize, number(4) as usize)
            });
            let packed = sizes.and_then(|(packed, _)| body[8..].get(..packed));
            let (Some(packed), Some((_, length))) = (packed, sizes) else {
                return Err(reading.refuse(place, END_OF_FILE, "compressed data"));
            };
            promise(needed, length as u64)?;
            promise(length as u64 / MAX_COMPRESSION, packed.len() as u64)?;
            let damaged = || reading.refuse(Place::Byte(at as u64), "damaged data", "LZF data");
            let data = lzf::decompress(packed, length).ok_or_else(damaged)?;
            for index in 0..count {
                // All values of a field are together.
                let values = fields.map(|field| {
                    field.map_or(f64::NAN, |field| {
                        let start = field.first_byte * count + index * field.size * field.count;
                        field.number(&data[start..])
                    })
                });
                points.add(Place::Byte(at as u64), &values)?;
            }
        }
        other => {
            let expected = "DATA ascii, binary or binary_compressed";
            return Err(reading.refuse(place, quote(other), expected));
        }
    }
    points.finish()
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
            field.kind_is_known().then_some(())?;
            (field.first_byte, field.first_number) = (bytes, numbers);
            bytes = bytes.checked_add(field.size.checked_mul(field.count)?)?;
            numbers = numbers.checked_add(field.count)?;
        }
        Some((bytes, numbers))
    }
}

impl Field {
    fn kind_is_known(&self) -> bool {
        matches!(
            (self.kind, self.size),
            ('F', 4 | 8) | ('I' | 'U', 1 | 2 | 4 | 8)
        )
    }

    /// Returns the number at the start of the bytes.
    fn number(&self, bytes: &[u8]) -> f64 {
        let mut number = [0; 8];
        number
            .iter_mut()
            .zip(&bytes[..self.size.min(bytes.len())])
            .for_each(|(to, from)| *to = *from);
        let [a, b, c, d, ..] = number;
        match (self.kind, self.size) {
            ('F', 4) => f32::from_le_bytes([a, b, c, d]).into(),
            ('F', _) => f64::from_le_bytes(number),
            ('I', 1) => i8::from_le_bytes([a]).into(),
            ('I', 2) => i16::from_le_bytes([a, b]).into(),
            ('I', 4) => i32::from_le_bytes([a, b, c, d]).into(),
            ('I', _) => i64::from_le_bytes(number) as f64,
            _ => u64::from_le_bytes(number) as f64,
        }
    }
}
