//! Pairs of files of a crate that import each other, by their `use` declarations.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::Result;

use crate::{read, rust_files};

/// The modules of a crate that are files, by path (empty for the root), with their imports.
type Modules = BTreeMap<String, Vec<Import>>;

/// One imported path.
#[derive(Debug, PartialEq)]
struct Import {
    path: String,
    /// The name that it has in the importing module.
    name: String,
    /// Re-exports are not dependencies.
    reexport: bool,
}

/// Returns a message for each pair below a source folder.
pub(crate) fn find(source: &Path) -> Result<Vec<String>> {
    let mut modules = Modules::new();
    for file in rust_files(source) {
        let path = file.strip_prefix(source)?.with_extension("");
        let names = path.iter().map(|name| name.to_string_lossy());
        let names: Vec<_> = names
            .filter(|n| !["lib", "main", "mod"].contains(&&**n))
            .collect();
        modules
            .entry(names.join("::"))
            .or_default()
            .extend(imports(&read(&file)?));
    }
    let pairs = pairs(&modules).into_iter();
    Ok(pairs
        .map(|(a, b)| {
            format!(
                "{}: modules `{a}` and `{b}` import each other",
                source.display()
            )
        })
        .collect())
}

fn pairs(modules: &Modules) -> Vec<(&str, &str)> {
    let mut edges = BTreeSet::new();
    for (module, imports) in modules {
        for import in imports.iter().filter(|import| !import.reexport) {
            let target = resolve(modules, module, &import.path, 0);
            edges.extend(target.map(|target| (module.as_str(), target)));
        }
    }
    let pairs = edges
        .iter()
        .filter(|(a, b)| a < b && edges.contains(&(*b, *a)));
    pairs.copied().collect()
}

/// Returns the module whose file defines the item at a path, or `None` if it is in another crate.
fn resolve<'a>(modules: &'a Modules, from: &str, path: &str, depth: u32) -> Option<&'a str> {
    let mut at = from.to_owned();
    for (index, segment) in path.split("::").enumerate() {
        let child = if at.is_empty() {
            segment.to_owned()
        } else {
            format!("{at}::{segment}")
        };
        let import = modules
            .get(&at)?
            .iter()
            .find(|import| import.name == segment);
        match segment {
            "crate" => at.clear(),
            "self" => {}
            "super" => at.truncate(at.rfind("::").unwrap_or(0)),
            _ if modules.contains_key(&child) => at = child,
            _ if index == 0 => return None,
            _ => {
                // A name that the module itself imports is followed; circles end at some depth.
                let import = import.filter(|_| depth < 8);
                let followed = import.and_then(|i| resolve(modules, &at, &i.path, depth + 1));
                return followed.or_else(|| Some(modules.get_key_value(&at)?.0));
            }
        }
    }
    Some(modules.get_key_value(&at)?.0)
}

/// Returns the imports of a file, without those of its inline tests.
fn imports(text: &str) -> Vec<Import> {
    let text = text.split("\nmod tests {").next().unwrap_or(text);
    let mut found = Vec::new();
    for (start, _) in text.match_indices("use ") {
        let line = text[..start].rfind('\n').map_or(0, |end| end + 1);
        let visibility = text[line..start].trim();
        let tree = text[start + 4..].split(';').next().unwrap_or_default();
        if visibility.is_empty() || visibility.starts_with("pub") {
            expand("", tree, !visibility.is_empty(), &mut found);
        }
    }
    found
}

/// Adds the paths of a tree such as `a::{b, c::d}`.
fn expand(prefix: &str, tree: &str, reexport: bool, found: &mut Vec<Import>) {
    if let Some((head, rest)) = tree.split_once('{') {
        let prefix = format!("{prefix}{}", head.trim());
        let mut depth = 0;
        let parts = rest.rsplit_once('}').map_or(rest, |(parts, _)| parts);
        let parts = parts.split(|c| {
            depth += i32::from(c == '{') - i32::from(c == '}');
            c == ',' && depth == 0
        });
        parts.for_each(|part| expand(&prefix, part, reexport, found));
    } else if !tree.trim().is_empty() {
        let path = format!("{prefix}{}", tree.trim());
        let (path, alias) = path.split_once(" as ").unwrap_or((&path, &path));
        let name = alias.rsplit("::").next().unwrap_or(alias);
        let (path, name) = (path.to_owned(), name.to_owned());
        found.push(Import {
            path,
            name,
            reexport,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn modules(files: &[(&str, &str)]) -> Modules {
        let files = files.iter();
        files
            .map(|(name, text)| ((*name).to_owned(), imports(text)))
            .collect()
    }

    #[test]
    fn two_files_that_import_each_other_are_found() {
        let direct = modules(&[
            ("", ""),
            ("a", "use crate::b::B;\n"),
            ("b", "use super::a::A;\n"),
        ]);
        assert_eq!(pairs(&direct), [("a", "b")]);
        let through_the_root = modules(&[
            (
                "",
                "mod a;\nmod b;\npub use a::A;\npub use b::{B, C as D};\n",
            ),
            ("a", "use std::fmt;\n\nuse crate::{\n    D,\n};\n"),
            ("b", "fn f() {\n    use crate::A;\n}\n"),
        ]);
        assert_eq!(pairs(&through_the_root), [("a", "b")]);
    }

    #[test]
    fn other_imports_are_fine() {
        let files = modules(&[
            ("", "pub use a::{A, c::{C, D}};\n"),
            (
                "a",
                "pub use c::C;\n// We use crate::a::c;\n#[cfg(test)]\nmod tests {\n    use crate::b;\n}\n",
            ),
            ("a::c", "use super::A;\nuse a::b;\n"),
            ("b", "use crate::a::{self, C};\n"),
        ]);
        assert!(pairs(&files).is_empty());
    }
}
