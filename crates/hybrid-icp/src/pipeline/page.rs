//! The catalogue as a page.

use std::fmt::Write as _;

use super::catalog::{Accepts, Parameter, PartKind};
use super::parts::PARTS;

/// Returns the catalogue of parts as Markdown: what `docs/catalogue.md` holds, and a test holds it to.
#[must_use]
pub fn catalogue() -> String {
    let mut page = String::from(
        "# Catalogue of parts\n\n\
         Every part that a pipeline file can name, written from the code by `hybrid-icp pipelines --parts`. The names in code font \
         after a part are its types in Rust, where every one of them is public. n counts model points, m observed ones.\n",
    );
    for kind in PartKind::ALL {
        let mut name = kind.name().to_owned();
        if let Some(first) = name.get_mut(..1) {
            first.make_ascii_uppercase();
        }
        // Writing to a string cannot fail.
        let _ = write!(page, "\n## {name}s\n");
        for part in PARTS.iter().filter(|part| part.kind == kind) {
            let _ = write!(
                page,
                "\n### {} (`{}`)\n\n{}. Source: {}. Cost: {}.\n",
                part.name, part.rust, part.summary, part.source, part.cost
            );
            if !part.parameters.is_empty() {
                page.push_str("\n| parameter | takes | default | meaning |\n|---|---|---|---|\n");
            }
            for parameter in part.parameters {
                let (takes, default) = columns(parameter);
                let _ = writeln!(
                    page,
                    "| `{}` | {takes} | {default} | {} |",
                    parameter.name, parameter.meaning
                );
            }
        }
    }
    page
}

/// What a parameter takes, with its unit, and its default.
fn columns(parameter: &Parameter) -> (String, String) {
    let given = || "must be given".to_owned();
    let (takes, default) = match parameter.accepts {
        Accepts::Number { min, max, default } => (
            format!("number, {min} to {max}"),
            default.map_or_else(given, |d| format!("{d}")),
        ),
        Accepts::Count { min, default } => (
            format!("whole number, {min} or more"),
            default.map_or_else(given, |d| format!("{d}")),
        ),
        Accepts::Flag { default } => ("true or false".to_owned(), default.to_string()),
        Accepts::Word { words, default } => (words.join(", "), default.to_owned()),
        Accepts::NumberList => ("list of numbers".to_owned(), given()),
        Accepts::Flags { count } => (format!("list of {count} flags"), "all false".to_owned()),
        Accepts::Part { kind, default } => (
            kind.name().to_owned(),
            default.map_or_else(given, str::to_owned),
        ),
        Accepts::Parts { kind, default } => (
            format!("list of {}s", kind.name()),
            default.map_or_else(given, |names| match names {
                [] => "none".to_owned(),
                _ => names.join(", "),
            }),
        ),
    };
    match parameter.unit {
        "" => (takes, default),
        unit => (format!("{takes}; {unit}"), default),
    }
}
