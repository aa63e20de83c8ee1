//! Reads the fields of one part as the catalogue declares them.

use super::catalog::{Accepts, Part, PartKind};
use super::error::{PipelineError, Place};
use super::parts::PARTS;
use super::tree::{Node, Value};
use crate::suggest::nearest;

/// One part of a tree, known to the catalogue, with only fields that it has.
pub(crate) struct Reader<'a> {
    part: &'static Part,
    /// `None` for a part that the file does not name and that is there by default.
    node: Option<&'a Node>,
    place: Place,
}

impl<'a> Reader<'a> {
    /// Finds the part that a node names: by itself, or by its field `type`.
    pub(crate) fn new(node: &'a Node, kind: PartKind, place: Place) -> Result<Self, PipelineError> {
        let (name, name_place) = match &node.value {
            Value::Text(name) => (name, place.clone()),
            Value::Table(_) => match node.get("type") {
                Some(Node {
                    value: Value::Text(name),
                    line,
                }) => (name, inside(&place, "type", *line)),
                Some(other) => {
                    return Err(PipelineError::Value {
                        place: inside(&place, "type", other.line),
                        found: other.value.describe(),
                        expected: format!("the name of a {}", kind.name()),
                    });
                }
                None => {
                    return Err(PipelineError::Missing {
                        place: inside(&place, "type", node.line),
                        expected: format!(
                            "the name of a {}: {}",
                            kind.name(),
                            names(kind).join(", ")
                        ),
                    });
                }
            },
            other => {
                return Err(PipelineError::Value {
                    place,
                    found: other.describe(),
                    expected: format!("a {}: a name, or a table with `type`", kind.name()),
                });
            }
        };
        let part = find(kind, name).ok_or_else(|| PipelineError::UnknownPart {
            place: name_place,
            kind: kind.name(),
            found: name.clone(),
            suggestion: nearest(name, names(kind)).map(str::to_owned),
            known: names(kind).into_iter().map(str::to_owned).collect(),
        })?;
        if let Value::Table(entries) = &node.value {
            let known = || part.parameters.iter().map(|p| p.name);
            let stranger = entries
                .iter()
                .find(|(key, _)| key != "type" && !known().any(|name| name == key));
            if let Some((key, value)) = stranger {
                return Err(PipelineError::UnknownField {
                    place: inside(&place, key, value.line),
                    part: part.name.to_owned(),
                    suggestion: nearest(key, known()).map(str::to_owned),
                    known: known().map(str::to_owned).collect(),
                });
            }
        }
        Ok(Self {
            part,
            node: Some(node),
            place,
        })
    }

    fn by_default(kind: PartKind, name: &str, place: Place) -> Result<Self, PipelineError> {
        match find(kind, name) {
            Some(part) => Ok(Self {
                part,
                node: None,
                place,
            }),
            None => Err(PipelineError::Missing {
                place,
                expected: format!("a {}", kind.name()),
            }),
        }
    }

    pub(crate) fn name(&self) -> &'static str {
        self.part.name
    }

    /// Whether the part has a field of this name, given or not.
    pub(crate) fn has(&self, field: &str) -> bool {
        self.part.parameters.iter().any(|p| p.name == field)
    }

    /// The parts that it is made of, those that are there by default included.
    pub(crate) fn held(&self) -> Result<Vec<Reader<'a>>, PipelineError> {
        let mut held = Vec::new();
        for parameter in self.part.parameters {
            match parameter.accepts {
                Accepts::Part { .. } => held.push(self.part(parameter.name)?),
                Accepts::Parts { .. } => held.extend(self.parts(parameter.name)?),
                _ => {}
            }
        }
        Ok(held)
    }

    /// The error of a part that is in the catalogue but that nobody builds; a test holds that there is none.
    pub(crate) fn unknown(&self, kind: PartKind) -> PipelineError {
        PipelineError::UnknownPart {
            place: self.place.clone(),
            kind: kind.name(),
            found: self.part.name.to_owned(),
            suggestion: None,
            known: Vec::new(),
        }
    }

    pub(crate) fn number(&self, field: &str) -> Result<f64, PipelineError> {
        let (given, accepts) = self.field(field)?;
        let Accepts::Number { min, max, default } = accepts else {
            return Err(self.undeclared(field));
        };
        let expected = || format!("a number from {min} to {max}");
        let Some(node) = given else {
            return default.ok_or_else(|| self.missing(field, expected()));
        };
        let value = as_number(&node.value).filter(|v| (min..=max).contains(v));
        value.ok_or_else(|| self.wrong(field, node, expected()))
    }

    pub(crate) fn count(&self, field: &str) -> Result<u32, PipelineError> {
        let (given, accepts) = self.field(field)?;
        let Accepts::Count { min, default } = accepts else {
            return Err(self.undeclared(field));
        };
        let expected = || format!("a whole number of {min} or more");
        let Some(node) = given else {
            return default.ok_or_else(|| self.missing(field, expected()));
        };
        let value = match node.value {
            Value::Integer(number) => u32::try_from(number).ok().filter(|v| *v >= min),
            _ => None,
        };
        value.ok_or_else(|| self.wrong(field, node, expected()))
    }

    pub(crate) fn flag(&self, field: &str) -> Result<bool, PipelineError> {
        let (given, accepts) = self.field(field)?;
        let Accepts::Flag { default } = accepts else {
            return Err(self.undeclared(field));
        };
        match given {
            None => Ok(default),
            Some(Node {
                value: Value::Flag(flag),
                ..
            }) => Ok(*flag),
            Some(node) => Err(self.wrong(field, node, "true or false".to_owned())),
        }
    }

    pub(crate) fn word(&self, field: &str) -> Result<&'static str, PipelineError> {
        let (given, accepts) = self.field(field)?;
        let Accepts::Word { words, default } = accepts else {
            return Err(self.undeclared(field));
        };
        let Some(node) = given else {
            return Ok(default);
        };
        let found = match &node.value {
            Value::Text(text) => words.iter().copied().find(|word| word == text),
            _ => None,
        };
        found.ok_or_else(|| self.wrong(field, node, format!("one of {}", words.join(", "))))
    }

    pub(crate) fn numbers(&self, field: &str) -> Result<Vec<f64>, PipelineError> {
        let (given, accepts) = self.field(field)?;
        let Accepts::NumberList = accepts else {
            return Err(self.undeclared(field));
        };
        let expected = || "a list of numbers".to_owned();
        let node = given.ok_or_else(|| self.missing(field, expected()))?;
        let numbers = match &node.value {
            Value::List(list) => list.iter().map(|n| as_number(&n.value)).collect(),
            _ => None,
        };
        numbers.ok_or_else(|| self.wrong(field, node, expected()))
    }

    /// The flags of a field of exactly `N`; all false when it is not given.
    pub(crate) fn flags<const N: usize>(&self, field: &str) -> Result<[bool; N], PipelineError> {
        let (given, accepts) = self.field(field)?;
        if accepts != (Accepts::Flags { count: N }) {
            return Err(self.undeclared(field));
        }
        let Some(node) = given else {
            return Ok([false; N]);
        };
        let flags: Option<Vec<bool>> = match &node.value {
            Value::List(list) => list
                .iter()
                .map(|n| match n.value {
                    Value::Flag(flag) => Some(flag),
                    _ => None,
                })
                .collect(),
            _ => None,
        };
        flags
            .and_then(|flags| <[bool; N]>::try_from(flags).ok())
            .ok_or_else(|| self.wrong(field, node, format!("a list of {N} of true and false")))
    }

    pub(crate) fn part(&self, field: &str) -> Result<Reader<'a>, PipelineError> {
        let (given, accepts) = self.field(field)?;
        let Accepts::Part { kind, default } = accepts else {
            return Err(self.undeclared(field));
        };
        match (given, default) {
            (Some(node), _) => Reader::new(node, kind, inside(&self.place, field, node.line)),
            (None, Some(name)) => Reader::by_default(kind, name, self.at(field)),
            (None, None) => {
                let known = names(kind).join(", ");
                Err(self.missing(field, format!("a {}: {known}", kind.name())))
            }
        }
    }

    pub(crate) fn parts(&self, field: &str) -> Result<Vec<Reader<'a>>, PipelineError> {
        let (given, accepts) = self.field(field)?;
        let Accepts::Parts { kind, default } = accepts else {
            return Err(self.undeclared(field));
        };
        let expected = || format!("a list of {}s", kind.name());
        let Some(node) = given else {
            return default
                .ok_or_else(|| self.missing(field, expected()))?
                .iter()
                .map(|name| Reader::by_default(kind, name, self.at(field)))
                .collect();
        };
        let Value::List(list) = &node.value else {
            return Err(self.wrong(field, node, expected()));
        };
        list.iter()
            .enumerate()
            .map(|(index, item)| {
                let place = inside(&self.place, &format!("{field}.{index}"), item.line);
                Reader::new(item, kind, place)
            })
            .collect()
    }

    /// What is given for a field, and what the catalogue says it takes.
    fn field(&self, field: &str) -> Result<(Option<&'a Node>, Accepts), PipelineError> {
        let declared = self.part.parameters.iter().find(|p| p.name == field);
        let accepts = declared.ok_or_else(|| self.undeclared(field))?.accepts;
        Ok((self.node.and_then(|node| node.get(field)), accepts))
    }

    fn at(&self, field: &str) -> Place {
        inside(&self.place, field, self.node.and_then(|node| node.line))
    }

    fn missing(&self, field: &str, expected: String) -> PipelineError {
        PipelineError::Missing {
            place: self.at(field),
            expected,
        }
    }

    /// The error of a value that is wrong only together with others.
    pub(crate) fn refuse(&self, field: &str, expected: String) -> PipelineError {
        match self.node.and_then(|node| node.get(field)) {
            Some(node) => self.wrong(field, node, expected),
            None => self.missing(field, expected),
        }
    }

    /// The error of a field that asks for more work than a limit: `most` is how much that is, `limit_field` what raises the limit.
    pub(crate) fn above(
        &self,
        field: &str,
        most: String,
        limit: u64,
        limit_field: &'static str,
    ) -> PipelineError {
        let given = self.node.and_then(|node| node.get(field));
        let found = match given {
            Some(Node {
                value: value @ Value::Integer(_),
                ..
            }) => format!("{}, {most}", value.describe()),
            _ => most,
        };
        PipelineError::Limit {
            place: given.map_or_else(
                || self.at(field),
                |node| inside(&self.place, field, node.line),
            ),
            found,
            limit,
            field: limit_field,
        }
    }

    fn wrong(&self, field: &str, node: &Node, expected: String) -> PipelineError {
        PipelineError::Value {
            place: inside(&self.place, field, node.line),
            found: node.value.describe(),
            expected,
        }
    }

    /// A field that is read but not in the catalogue; a test that builds every part holds that there is none.
    fn undeclared(&self, field: &str) -> PipelineError {
        PipelineError::UnknownField {
            place: self.at(field),
            part: self.part.name.to_owned(),
            suggestion: None,
            known: self
                .part
                .parameters
                .iter()
                .map(|p| p.name.to_owned())
                .collect(),
        }
    }
}

#[allow(clippy::cast_precision_loss)] // A number in a file.
fn as_number(value: &Value) -> Option<f64> {
    match value {
        Value::Integer(number) => Some(*number as f64),
        Value::Float(number) => Some(*number),
        _ => None,
    }
}

fn find(kind: PartKind, name: &str) -> Option<&'static Part> {
    PARTS
        .iter()
        .find(|part| part.kind == kind && part.name == name)
}

fn names(kind: PartKind) -> Vec<&'static str> {
    PARTS
        .iter()
        .filter(|part| part.kind == kind)
        .map(|part| part.name)
        .collect()
}

fn inside(place: &Place, field: &str, line: Option<usize>) -> Place {
    Place {
        origin: place.origin.clone(),
        line,
        field: if place.field.is_empty() {
            field.to_owned()
        } else {
            format!("{}.{field}", place.field)
        },
    }
}
