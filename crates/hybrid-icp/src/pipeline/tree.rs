//! A parsed TOML document whose values know their lines.

use std::ops::Range;

use toml::de::{DeTable, DeValue};

use super::error::{PipelineError, Place};

/// A value and where it stands.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Node {
    pub(crate) value: Value,
    pub(crate) line: Option<usize>,
}

/// A TOML value.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Text(String),
    Integer(i64),
    Float(f64),
    Flag(bool),
    List(Vec<Node>),
    Table(Vec<(String, Node)>),
    /// A date, which no part takes.
    Other(String),
}

impl Value {
    /// Names the value for messages.
    pub(crate) fn describe(&self) -> String {
        match self {
            Self::Text(text) => format!("the text {text:?}"),
            Self::Integer(number) => format!("{number}"),
            Self::Float(number) => format!("{number}"),
            Self::Flag(flag) => format!("{flag}"),
            Self::List(list) => format!("a list of {}", list.len()),
            Self::Table(_) => "a table".to_owned(),
            Self::Other(text) => text.clone(),
        }
    }
}

impl Node {
    /// Parses a document into a table.
    pub(crate) fn parse(text: &str, origin: &str) -> Result<Self, PipelineError> {
        let table = DeTable::parse(text).map_err(|error| PipelineError::Syntax {
            place: Place {
                origin: origin.to_owned(),
                line: error.span().map(|span| line_of(text, &span)),
                field: String::new(),
            },
            message: error.message().to_owned(),
        })?;
        let span = table.span();
        convert_table(table.get_ref(), &span, text, origin)
    }

    /// The value of a key of a table.
    pub(crate) fn get(&self, key: &str) -> Option<&Self> {
        match &self.value {
            Value::Table(entries) => entries.iter().find(|(k, _)| k == key).map(|(_, node)| node),
            _ => None,
        }
    }

    /// Sets a value at a dotted path, making the last key if it is not there: `path=value`.
    pub(crate) fn set(&mut self, assignment: &str) -> Result<(), PipelineError> {
        let refuse = |problem: String| PipelineError::Override {
            assignment: assignment.to_owned(),
            problem,
        };
        let Some((path, value)) = assignment.split_once('=') else {
            return Err(refuse("expected path=value".to_owned()));
        };
        // A bare word is a text, so that quotes need not survive a shell.
        let parse = |value: &str| Self::parse(&format!("x = {value}"), "override");
        let document = parse(value.trim())
            .or_else(|_| parse(&format!("{:?}", value.trim())))
            .map_err(|_| refuse(format!("{value:?} is no TOML value")))?;
        // A line end begins something else than the value.
        let mut value = match &document.value {
            Value::Table(entries) if entries.len() == 1 => entries[0].1.clone(),
            _ => return Err(refuse(format!("{value:?} is more than one TOML value"))),
        };
        value.forget_lines();

        let keys: Vec<&str> = path.trim().split('.').collect();
        let mut node = self;
        for (depth, key) in keys.iter().enumerate() {
            let so_far = keys[..depth].join(".");
            let last = depth + 1 == keys.len();
            // A part given by its bare name becomes a table that a field can be set in.
            if last && let Value::Text(name) = &node.value {
                let name = Self {
                    value: Value::Text(name.clone()),
                    line: node.line,
                };
                node.value = Value::Table(vec![("type".to_owned(), name)]);
            }
            node = match &mut node.value {
                Value::Table(entries) => {
                    let index = match entries.iter().position(|(k, _)| k == key) {
                        Some(index) => index,
                        None if last => {
                            entries.push(((*key).to_owned(), value.clone()));
                            entries.len() - 1
                        }
                        None => {
                            return Err(refuse(format!("there is no {key:?} in {so_far:?}")));
                        }
                    };
                    &mut entries[index].1
                }
                Value::List(list) => {
                    let count = list.len();
                    key.parse::<usize>()
                        .ok()
                        .and_then(|index| list.get_mut(index))
                        .ok_or_else(|| {
                            refuse(format!(
                                "{so_far:?} is a list of {count}, expected an index below that"
                            ))
                        })?
                }
                other => {
                    let found = other.describe();
                    return Err(refuse(format!("{so_far:?} is {found}, expected a table")));
                }
            };
        }
        *node = value;
        Ok(())
    }

    fn forget_lines(&mut self) {
        self.line = None;
        match &mut self.value {
            Value::List(list) => list.iter_mut().for_each(Self::forget_lines),
            Value::Table(entries) => entries.iter_mut().for_each(|(_, n)| n.forget_lines()),
            _ => {}
        }
    }
}

fn convert_table(
    table: &DeTable<'_>,
    span: &Range<usize>,
    text: &str,
    origin: &str,
) -> Result<Node, PipelineError> {
    let mut entries = Vec::with_capacity(table.len());
    for (key, value) in table {
        let mut node = convert(value.get_ref(), &value.span(), text, origin)?;
        // The line of the key is where a person looks.
        node.line = Some(line_of(text, &key.span()));
        entries.push((key.get_ref().to_string(), node));
    }
    Ok(Node {
        value: Value::Table(entries),
        line: Some(line_of(text, span)),
    })
}

fn convert(
    value: &DeValue<'_>,
    span: &Range<usize>,
    text: &str,
    origin: &str,
) -> Result<Node, PipelineError> {
    let line = Some(line_of(text, span));
    let unreadable = |what: &str| PipelineError::Syntax {
        place: Place {
            origin: origin.to_owned(),
            line,
            field: String::new(),
        },
        message: format!("{what} is not a number that fits"),
    };
    let value = match value {
        DeValue::String(s) => Value::Text(s.to_string()),
        DeValue::Integer(number) => Value::Integer(
            i64::from_str_radix(number.as_str(), number.radix())
                .map_err(|_| unreadable(number.as_str()))?,
        ),
        DeValue::Float(number) => Value::Float(
            number
                .as_str()
                .parse()
                .map_err(|_| unreadable(number.as_str()))?,
        ),
        DeValue::Boolean(flag) => Value::Flag(*flag),
        DeValue::Datetime(date) => Value::Other(format!("the date {date}")),
        DeValue::Array(items) => Value::List(
            items
                .iter()
                .map(|item| convert(item.get_ref(), &item.span(), text, origin))
                .collect::<Result<_, _>>()?,
        ),
        DeValue::Table(table) => return convert_table(table, span, text, origin),
    };
    Ok(Node { value, line })
}

fn line_of(text: &str, span: &Range<usize>) -> usize {
    let before = text.get(..span.start).unwrap_or(text);
    before.matches('\n').count() + 1
}
