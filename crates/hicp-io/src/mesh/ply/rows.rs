//! The elements that are kept: vertices and faces.

use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult, PropertyDef, PropertyType};

use super::header::is_face_list;
use crate::error::{IoError, Place};
use crate::mesh::Reading;

/// An element that a file holds one of per row.
pub(super) trait Row: PropertyAccess {
    /// Returns whether a property is read. Of the others nothing is asked but that they can be read past.
    fn keeps(_: &PropertyDef) -> bool {
        false
    }

    /// Refuses what was read where it stands.
    fn check(&self, _: &Reading<'_>, _: Place) -> Result<(), IoError> {
        Ok(())
    }
}

impl<const N: usize> Row for Vertex<N> {
    fn keeps(property: &PropertyDef) -> bool {
        let named = VERTEX_NAMES[..N].contains(&property.name.as_str());
        named && matches!(property.data_type, PropertyType::Scalar(_))
    }

    fn check(&self, reading: &Reading<'_>, place: Place) -> Result<(), IoError> {
        reading.check_position(place, &self.value[..3])
    }
}

impl Row for Face {
    fn keeps(property: &PropertyDef) -> bool {
        is_face_list(&property.name)
    }
}

impl Row for Skipped {}

/// What is read of a vertex, in the order of [`Vertex::value`].
pub(super) const VERTEX_NAMES: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

/// A vertex: x, y, z, and nx, ny, nz if N is 6; NaN where the file says nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vertex<const N: usize> {
    pub(crate) value: [f64; N],
}

impl<const N: usize> PropertyAccess for Vertex<N> {
    fn new() -> Self {
        Self {
            value: [f64::NAN; N],
        }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let index = VERTEX_NAMES[..N].iter().position(|n| *n == name);
        match (index, scalar(&property)) {
            (Some(index), Some(number)) => {
                self.value[index] = number;
                PropertyAccessResult::Set
            }
            _ => PropertyAccessResult::Ignored,
        }
    }
}

/// A face: indices of its corners.
#[derive(Clone, Debug)]
pub(crate) struct Face {
    pub(super) corners: Vec<i64>,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self {
            corners: Vec::new(),
        }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !is_face_list(name) {
            return PropertyAccessResult::Ignored;
        }
        match integers(property) {
            Some(corners) => {
                self.corners = corners;
                PropertyAccessResult::Set
            }
            None => PropertyAccessResult::UnsupportedType,
        }
    }
}

/// An element that is read past.
#[derive(Debug)]
pub(super) struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

fn scalar(property: &Property) -> Option<f64> {
    match *property {
        Property::Char(v) => Some(v.into()),
        Property::UChar(v) => Some(v.into()),
        Property::Short(v) => Some(v.into()),
        Property::UShort(v) => Some(v.into()),
        Property::Int(v) => Some(v.into()),
        Property::UInt(v) => Some(v.into()),
        Property::Float(v) => Some(v.into()),
        Property::Double(v) => Some(v),
        _ => None,
    }
}

fn integers(property: Property) -> Option<Vec<i64>> {
    fn widen<T: Into<i64>>(list: Vec<T>) -> Option<Vec<i64>> {
        Some(list.into_iter().map(Into::into).collect())
    }
    match property {
        Property::ListChar(list) => widen(list),
        Property::ListUChar(list) => widen(list),
        Property::ListShort(list) => widen(list),
        Property::ListUShort(list) => widen(list),
        Property::ListInt(list) => widen(list),
        Property::ListUInt(list) => widen(list),
        _ => None,
    }
}
