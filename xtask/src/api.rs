//! `cargo xtask api`: public functions that no test and no example names.
//!
//! A scan of the text, for rustdoc's JSON is not stable: a `pub fn` counts as named where a test, an example or a
//! documentation example has `Type::name` (associated functions), `.name` or `::name` (methods) or `name` (functions). So a
//! method that shares its name with another one, as `width` does, may pass by the other's test; that a test *checks* what it
//! names is for mutation testing to say. The lint `unreachable_pub` sees to it that every `pub fn` is public.

use std::collections::BTreeSet;
use std::path::Path;

use crate::{Findings, relative, rust_files, tidy};

/// The program has no public functions.
const PROGRAM: &str = "hybrid-icp-cli";
/// Guides whose examples are tested.
const GUIDES: [&str; 2] = ["README.md", "docs/build-your-own.md"];

/// A public function.
#[derive(Debug, PartialEq, Eq)]
struct Function {
    line: usize,
    /// The type or trait that it belongs to, where it belongs to one that the scan can see.
    owner: Option<String>,
    name: String,
    form: Form,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Free,
    Method,
    Associated,
    OfATrait,
}

/// What tests and examples name.
#[derive(Debug, Default)]
struct Named {
    words: BTreeSet<String>,
    /// After a dot or two colons.
    members: BTreeSet<String>,
    /// `Type::name`.
    paths: BTreeSet<String>,
}

/// Says which public functions nothing names.
pub(crate) fn run(root: &Path) -> Findings {
    let named = named(root);
    let (mut count, mut findings) = (0, Vec::new());
    for name in tidy::crates().filter(|name| *name != PROGRAM) {
        for file in rust_files(&root.join("crates").join(name).join("src")) {
            let text = std::fs::read_to_string(&file).unwrap_or_default();
            for function in functions(&text) {
                count += 1;
                if !named.has(&function) {
                    let owner = function.owner.map_or_else(String::new, |o| o + "::");
                    findings.push(format!(
                        "{}:{}: no test or example names {owner}{}",
                        relative(root, &file),
                        function.line,
                        function.name
                    ));
                }
            }
        }
    }
    println!(
        "xtask api: {} of {count} public functions are named by a test or an example",
        count - findings.len()
    );
    if findings.is_empty() {
        Ok(())
    } else {
        Err(findings)
    }
}

fn named(root: &Path) -> Named {
    let mut named = Named::default();
    for file in ["tests", "crates"]
        .iter()
        .flat_map(|folder| rust_files(&root.join(folder)))
    {
        let text = std::fs::read_to_string(&file).unwrap_or_default();
        let path = relative(root, &file);
        let parts: Vec<&str> = path.split('/').collect();
        // The laws of the test kit are tests of whatever they are given.
        let is_test = parts[0] == "tests"
            || matches!(parts.get(2), Some(&("tests" | "examples")))
            || parts[1] == "hicp-testkit";
        if is_test {
            text.lines().for_each(|line| named.read(line));
        } else {
            of_a_source(&text).for_each(|line| named.read(line));
        }
    }
    for guide in GUIDES {
        let text = std::fs::read_to_string(root.join(guide)).unwrap_or_default();
        text.lines().for_each(|line| named.read(line));
    }
    named
}

/// The lines of a source file that are run as tests: the unit tests at its end, and examples in its documentation.
fn of_a_source(text: &str) -> impl Iterator<Item = &str> {
    let (mut in_tests, mut in_example) = (false, false);
    text.lines().filter_map(move |line| {
        let trimmed = line.trim_start();
        in_tests |= line == "#[cfg(test)]";
        let comment = trimmed
            .strip_prefix("///")
            .or_else(|| trimmed.strip_prefix("//!"));
        match comment {
            Some(comment) if comment.trim_start().starts_with("```") => {
                in_example = !in_example;
                None
            }
            Some(comment) => in_example.then_some(comment),
            None => {
                in_example = false;
                in_tests.then_some(line)
            }
        }
    })
}

impl Named {
    fn read(&mut self, line: &str) {
        let mut before = "";
        let mut rest = line;
        // What stands between the last word and this one.
        while let Some(start) = rest.find(is_word) {
            let between = &rest[..start];
            let word = &rest[start..];
            let end = word.find(|c| !is_word(c)).unwrap_or(word.len());
            let (word, after) = word.split_at(end);
            if between.ends_with('.') || between.ends_with("::") {
                self.members.insert(word.to_owned());
            }
            // Generics between the two, as in `Vec::<f64>::new`, are not looked through.
            if between == "::" {
                self.paths.insert(format!("{before}::{word}"));
            }
            self.words.insert(word.to_owned());
            (before, rest) = (word, after);
        }
    }

    fn has(&self, function: &Function) -> bool {
        match (function.form, &function.owner) {
            (Form::Free | Form::OfATrait, _) => self.words.contains(&function.name),
            (Form::Associated, Some(owner)) => {
                self.paths.contains(&format!("{owner}::{}", function.name))
            }
            (Form::Method | Form::Associated, _) => self.members.contains(&function.name),
        }
    }
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// The public functions of a file, as rustfmt lays it out: items at the margin, members four columns in.
fn functions(text: &str) -> Vec<Function> {
    let lines: Vec<&str> = text.lines().take_while(|l| *l != "#[cfg(test)]").collect();
    let mut functions = Vec::new();
    let (mut owner, mut is_trait) = (None, false);
    for (index, line) in lines.iter().enumerate() {
        if line.starts_with("impl") {
            (owner, is_trait) = (inherent(line), false);
        } else if let Some(rest) = line.strip_prefix("pub trait ") {
            (owner, is_trait) = (first_word(rest), true);
        } else if line.starts_with('}') {
            (owner, is_trait) = (None, false);
        }
        let member = line.starts_with(' ');
        let declared = line.trim_start();
        let declared = if member && is_trait && line.starts_with("    fn ") {
            Some(declared)
        } else {
            declared.strip_prefix("pub ")
        };
        let name = declared
            .map(|d| d.trim_start_matches("const "))
            .and_then(|d| d.strip_prefix("fn "))
            .and_then(first_word);
        if let Some(name) = name {
            // The receiver may stand on the next line.
            let signature = format!("{line}{}", lines.get(index + 1).unwrap_or(&"").trim_start());
            let receiver = signature.split_once('(').map_or("", |(_, rest)| rest);
            let receives = receiver
                .split([',', ')', ':'])
                .next()
                .is_some_and(|first| first.ends_with("self"));
            let form = match (member, receives) {
                // A test may also implement what a trait asks for.
                _ if is_trait => Form::OfATrait,
                (false, _) => Form::Free,
                (true, true) => Form::Method,
                (true, false) => Form::Associated,
            };
            functions.push(Function {
                line: index + 1,
                owner: owner.clone().filter(|_| member),
                name,
                form,
            });
        }
    }
    functions
}

/// The type of `impl<…> Type<…> {`; nothing for an implementation of a trait.
fn inherent(line: &str) -> Option<String> {
    let mut rest = line.strip_prefix("impl")?;
    if rest.starts_with('<') {
        let mut depth = 0;
        let end = rest.find(|c| {
            depth += i32::from(c == '<') - i32::from(c == '>');
            depth == 0
        })?;
        rest = &rest[end + 1..];
    }
    (!rest.contains(" for ")).then(|| first_word(rest.trim_start()))?
}

fn first_word(text: &str) -> Option<String> {
    let word: String = text.chars().take_while(|c| is_word(*c)).collect();
    (!word.is_empty()).then_some(word)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: &str = "\
/// Makes one.
///
/// ```
/// let a = A::new().twice();
/// ```
pub fn free(a: f64) {}
fn private() {}
impl<T: Into<f64>> A<T> {
    pub fn new() -> Self {}
    pub const fn twice(&self) {}
    pub(crate) fn hidden(&self) {}
}
impl Clone for A {
    fn clone(&self) {}
}
pub trait B {
    fn law(
        &mut self,
    );
}
#[cfg(test)]
mod tests {
    fn x() { free(1.0); }
    pub fn helper() {}
}
";

    #[test]
    fn public_functions_are_found_with_their_owners() {
        let found: Vec<(Option<String>, String, Form)> = functions(SOURCE)
            .into_iter()
            .map(|f| (f.owner, f.name, f.form))
            .collect();
        let of = |owner: &str, name: &str, form| (Some(owner.to_owned()), name.to_owned(), form);
        assert_eq!(
            found,
            [
                (None, "free".to_owned(), Form::Free),
                of("A", "new", Form::Associated),
                of("A", "twice", Form::Method),
                of("B", "law", Form::OfATrait),
            ]
        );
    }

    #[test]
    fn examples_and_unit_tests_name_what_they_call() {
        let mut named = Named::default();
        of_a_source(SOURCE).for_each(|line| named.read(line));
        let has: Vec<bool> = functions(SOURCE).iter().map(|f| named.has(f)).collect();
        assert_eq!(has, [true, true, true, false]);
    }
}
