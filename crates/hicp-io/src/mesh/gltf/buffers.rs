//! The JSON text and the binary buffers of a glTF file.

use std::borrow::Cow;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::schema::Root;
use crate::error::{IoError, Place, quote};
use crate::mesh::raw::Reading;
use crate::mesh::texture;
use crate::source::text_bytes;

/// Splits a file into its JSON text and the binary chunk of a GLB file.
pub(super) fn split<'a>(
    reading: &Reading<'_>,
    content: &'a [u8],
) -> Result<(&'a [u8], Option<&'a [u8]>), IoError> {
    if !content.starts_with(b"glTF") {
        return Ok((text_bytes(reading.path, content)?, None));
    }
    let number = |at: usize| {
        let bytes = content
            .get(at..at + 4)
            .and_then(|bytes| bytes.try_into().ok());
        bytes.map(u32::from_le_bytes)
    };
    if number(4) != Some(2) {
        let found = number(4).map_or("no version".to_owned(), |version| {
            format!("version {version}")
        });
        return Err(reading.refuse(Place::Byte(4), found, "glTF version 2"));
    }
    // Each chunk has a length, a type and its data.
    let chunk = |at: usize, kind: &[u8; 4]| -> Option<&'a [u8]> {
        let length = number(at)? as usize;
        (content.get(at + 4..at + 8)? == kind).then_some(())?;
        content.get(at + 8..(at + 8).checked_add(length)?)
    };
    let Some(text) = chunk(12, b"JSON") else {
        let found = format!("{} bytes without a complete JSON chunk", content.len());
        return Err(reading.refuse(Place::Byte(12), found, "a JSON chunk"));
    };
    Ok((text, chunk(20 + text.len().next_multiple_of(4), b"BIN\0")))
}

/// Loads the buffers: the binary chunk, data in the JSON text, and files next to it.
pub(super) fn load<'a>(
    reading: &Reading<'_>,
    root: &Root,
    binary: Option<&'a [u8]>,
) -> Result<Vec<Cow<'a, [u8]>>, IoError> {
    let buffers = root.buffers.iter().enumerate();
    buffers
        .map(|(index, buffer)| {
            let place = || Place::Field(format!("$.buffers[{index}].uri"));
            let Some(uri) = buffer.uri.as_deref() else {
                return Ok(Cow::Borrowed(
                    binary.filter(|_| index == 0).unwrap_or_default(),
                ));
            };
            if let Some(data) = uri.strip_prefix("data:") {
                let data = decode(data).map(Cow::Owned);
                return data.ok_or_else(|| reading.refuse(place(), quote(uri), "data in base64"));
            }
            let name = uri.replace("%20", " ");
            let folder = reading.path.parent().unwrap_or(Path::new(""));
            if !texture::is_inside(&name) {
                return Err(reading.refuse(place(), quote(uri), "a file next to this one"));
            }
            let bytes = reading.limits.read_bytes(folder.join(name));
            bytes.map(Cow::Owned).map_err(|error| {
                let found = format!("the buffer {}, which cannot be read", quote(uri));
                reading
                    .refuse(place(), found, "a file next to this one")
                    .with_source(error)
            })
        })
        .collect()
}

/// Decodes the data of a URI, after `data:`.
pub(super) fn decode(data: &str) -> Option<Vec<u8>> {
    let (_, text) = data.split_once(";base64,")?;
    STANDARD.decode(text).ok()
}
