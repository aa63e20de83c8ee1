//! The fields that a file gives to a part, and their places in the file.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::value::NOWHERE;

/// A field, and the byte of the file at which it starts; `None` for what an override set.
#[derive(Clone, Debug)]
pub(crate) struct Spot {
    pub(crate) field: String,
    pub(crate) start: Option<usize>,
}

impl Spot {
    /// Returns the spot of a field or list item of this one.
    pub(crate) fn inside(&self, field: &str, start: usize) -> Self {
        Self {
            field: match self.field.as_str() {
                "" => field.to_owned(),
                outer => format!("{outer}.{field}"),
            },
            start: self.start.filter(|_| start != NOWHERE).map(|_| start),
        }
    }
}

/// The fields that a file gives to a part.
#[derive(Debug)]
pub(crate) struct Fields<'a> {
    /// `None` for a part that is given by its bare name, or by default.
    given: Option<&'a DeTable<'a>>,
    pub(crate) spot: Spot,
}

impl<'a> Fields<'a> {
    pub(crate) fn new(given: Option<&'a DeTable<'a>>, spot: Spot) -> Self {
        Self { given, spot }
    }

    /// Returns the names of the fields that are given.
    pub(crate) fn names(&self) -> impl Iterator<Item = &'a str> {
        let keys = self.given.into_iter().flat_map(|table| table.keys());
        keys.map(|key| key.get_ref().as_ref())
    }

    /// Returns the path of a field of this name in an inner part, if one is given.
    pub(crate) fn nested(&self, name: &str) -> Option<String> {
        let mut fields = self.given?.iter();
        fields.find_map(|(key, value)| find(value.get_ref(), key.get_ref(), name))
    }

    /// Returns a field, if it is given, and its place.
    ///
    /// The place of a given field is its key. Otherwise, it is the place of its part.
    pub(crate) fn field(&self, name: &str) -> (Option<&'a DeValue<'a>>, Spot) {
        let given = self.given.and_then(|table| table.get_key_value(name));
        let start = match given {
            Some((_, value)) if value.span().start == NOWHERE => NOWHERE,
            Some((key, _)) => key.span().start,
            None => self.spot.start.unwrap_or(NOWHERE),
        };
        let value = given.map(|(_, value)| Spanned::get_ref(value));
        (value, self.spot.inside(name, start))
    }
}

/// Returns the path of the first field of this name in a value at a path.
fn find(value: &DeValue<'_>, path: &str, name: &str) -> Option<String> {
    match value {
        DeValue::Table(table) if table.contains_key(name) => Some(format!("{path}.{name}")),
        DeValue::Table(table) => table.iter().find_map(|(key, value)| {
            let path = format!("{path}.{}", key.get_ref());
            find(value.get_ref(), &path, name)
        }),
        DeValue::Array(list) => list.iter().enumerate().find_map(|(index, value)| {
            let path = format!("{path}.{index}");
            find(value.get_ref(), &path, name)
        }),
        _ => None,
    }
}
