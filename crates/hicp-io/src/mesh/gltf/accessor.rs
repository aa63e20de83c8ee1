//! The numbers of glTF accessors: floating point, integers, quantized and sparse.

use std::borrow::Cow;

use super::schema::{Root, SparsePart};
use crate::error::{IoError, Place, quote};
use crate::limits::Limit;
use crate::mesh::raw::Reading;
use crate::number::{Kind, NumberType, whole};

#[derive(Clone, Copy, Debug)]
pub(super) struct Accessors<'a, 'r> {
    pub(super) reading: Reading<'r>,
    pub(super) root: &'a Root,
    pub(super) buffers: &'a [Cow<'a, [u8]>],
}

/// Elements in a view: offset in the view, type, components of an element, and count.
#[derive(Clone, Copy, Debug)]
struct Layout {
    offset: usize,
    kind: u32,
    components: usize,
    count: usize,
    normalized: bool,
}

impl Accessors<'_, '_> {
    /// Reads the elements of an accessor, each of one to four components, one after another.
    ///
    /// `limit` applies to the number of elements; indices are three per triangle.
    pub(super) fn read(
        &self,
        index: usize,
        components: usize,
        limit: Limit,
    ) -> Result<Vec<f64>, IoError> {
        let (reading, accessors) = (self.reading, &self.root.accessors);
        let place = Place::Field(format!("$.accessors[{index}]"));
        let Some(accessor) = accessors.get(index) else {
            let expected = format!("one of {} accessors", accessors.len());
            return Err(reading.refuse(place, "an accessor that does not exist", expected));
        };
        let shape = ["SCALAR", "VEC2", "VEC3", "VEC4"][components - 1];
        if accessor.shape != shape {
            return Err(reading.refuse(place, quote(&accessor.shape), shape));
        }
        let per_item = if components == 1 { 3 } else { 1 };
        reading.check(limit, place.clone(), accessor.count / per_item)?;
        let layout = Layout {
            offset: accessor.byte_offset,
            kind: accessor.component_type,
            components,
            count: accessor.count,
            normalized: accessor.normalized,
        };
        let mut numbers = match accessor.buffer_view {
            Some(view) => self.elements(&place, view, layout)?,
            None => vec![0.0; accessor.count * components],
        };
        if let Some(sparse) = &accessor.sparse {
            let part = |part: &SparsePart, layout| {
                let layout = Layout {
                    offset: part.byte_offset,
                    count: sparse.count,
                    ..layout
                };
                self.elements(&place, part.buffer_view, layout)
            };
            let plain = Layout {
                kind: sparse.indices.component_type.unwrap_or(0),
                components: 1,
                normalized: false,
                ..layout
            };
            let indices = part(&sparse.indices, plain)?;
            let values = part(&sparse.values, layout)?;
            for (index, value) in indices.iter().zip(values.chunks_exact(components)) {
                let at = whole(*index) as usize * components;
                let Some(element) = numbers.get_mut(at..at + components) else {
                    let found = format!("sparse index {index}");
                    let expected = format!("below {}", accessor.count);
                    return Err(reading.refuse(place, found, expected));
                };
                element.copy_from_slice(value);
            }
        }
        Ok(numbers)
    }

    /// Returns the bytes of a buffer view, if it is inside of its buffer.
    pub(super) fn view(&self, index: usize) -> Option<&[u8]> {
        let view = self.root.buffer_views.get(index)?;
        let end = view.byte_offset.checked_add(view.byte_length)?;
        let bytes = self.buffers.get(view.buffer)?;
        bytes.get(view.byte_offset..end)
    }

    fn elements(&self, place: &Place, view: usize, layout: Layout) -> Result<Vec<f64>, IoError> {
        let refuse = |found: String, expected: &str| {
            Err(self.reading.refuse(place.clone(), found, expected))
        };
        let Some(found) = self.root.buffer_views.get(view) else {
            return refuse(format!("buffer view {view}"), "one that exists");
        };
        let mut extensions = found.extensions.keys();
        if let Some(name) = extensions.find(|name| name.contains("meshopt")) {
            let expected = "a file without meshopt compression: gltf-transform copy writes one";
            return refuse(format!("meshopt compression ({name})"), expected);
        }
        let Some((number, largest)) = component(layout.kind) else {
            return refuse(format!("component type {}", layout.kind), "5120 to 5126");
        };
        let element = number.bytes * layout.components;
        let stride = found.byte_stride.unwrap_or(element);
        let bytes = self.view(view);
        let used = bytes.and_then(|bytes| {
            let before = stride.checked_mul(layout.count.saturating_sub(1))?;
            let last = layout.offset.checked_add(before)?.checked_add(element)?;
            bytes.get(layout.offset..last)
        });
        let Some(used) = used.filter(|_| stride >= element) else {
            if layout.count == 0 {
                return Ok(Vec::new());
            }
            let (count, size) = (layout.count, bytes.map_or(0, <[u8]>::len));
            let found = format!("{count} elements, {stride} bytes apart");
            let expected = format!("as many as the {size} bytes of view {view} hold");
            return refuse(found, &expected);
        };
        let numbers = used.chunks(stride).flat_map(|element| {
            let components = element.chunks_exact(number.bytes).take(layout.components);
            let numbers = components.filter_map(|bytes| number.read(bytes, false));
            numbers.map(|number| match largest {
                // Normalized integers are from -1 to 1.
                Some(largest) if layout.normalized => (number / largest).max(-1.0),
                _ => number,
            })
        });
        Ok(numbers.collect())
    }
}

/// Returns the type of a component, and its largest value if it may be normalized.
fn component(kind: u32) -> Option<(NumberType, Option<f64>)> {
    let (kind, bytes, largest) = match kind {
        5120 => (Kind::Signed, 1, Some(127.0)),
        5121 => (Kind::Unsigned, 1, Some(255.0)),
        5122 => (Kind::Signed, 2, Some(32767.0)),
        5123 => (Kind::Unsigned, 2, Some(65535.0)),
        5125 => (Kind::Unsigned, 4, None),
        5126 => (Kind::Float, 4, None),
        _ => return None,
    };
    Some((NumberType { kind, bytes }, largest))
}
