//! The style of comments and Markdown: sentences and lines that are hard to read, and links to
//! files that do not exist.

use std::path::Path;

use anyhow::Result;

use crate::{files, read};

/// Openings that hide the subject of a sentence, unless it is a question.
const OPENINGS: [&str; 5] = ["What ", "Which ", "Where ", "How ", "Whoever "];
/// Words with a plainer replacement, each between spaces.
const WORDS: [&str; 8] = [
    " anew ",
    " aloud ",
    " mended ",
    " whoever ",
    " of one's own ",
    " is told ",
    " are told ",
    " held to ",
];
/// The longest line of a comment or of Markdown, characters.
const COLUMNS: usize = 100;
/// Pages that a program writes.
const EXCEPT: [&str; 2] = ["docs/catalogue.md", "docs/study/"];
/// Returns the findings, each with its file and line.
pub(crate) fn check() -> Result<Vec<String>> {
    let mut findings = Vec::new();
    for path in files(Path::new("."), &["rs", "md"]) {
        let name = path.to_string_lossy().replacen("./", "", 1);
        if !EXCEPT.iter().any(|except| name.starts_with(except)) {
            let (markdown, text) = (name.ends_with(".md"), read(&path)?);
            let mut found = |line: usize, what| findings.push(format!("{name}:{line}: {what}"));
            lines(&text, markdown, &mut found);
            if markdown {
                links(&path, &text, &mut found);
            }
        }
    }
    Ok(findings)
}

/// Checks lines outside of code blocks, tables and headings.
fn lines(text: &str, markdown: bool, found: &mut impl FnMut(usize, String)) {
    let (mut in_code, mut sentence) = (false, String::new());
    for (number, line) in (1..).zip(text.lines()) {
        let comment = line.trim_start().strip_prefix("//");
        let prose = comment
            .map_or(line, |c| c.trim_start_matches(['/', '!']))
            .trim();
        in_code = (in_code ^ prose.starts_with("```")) && (markdown || comment.is_some());
        let skipped = in_code || prose.starts_with("```") || prose.starts_with(['|', '#']);
        if skipped || prose.is_empty() || !(markdown || comment.is_some()) {
            sentence.clear();
            continue;
        }
        let width = line.chars().count();
        if width > COLUMNS && !prose.contains("](") && !prose.starts_with(['<', '!']) {
            found(
                number,
                format!("{width} columns, expected at most {COLUMNS}"),
            );
        }
        let spaced = format!(
            " {} ",
            prose.to_lowercase().replace(['.', ',', ';', ':', '('], " ")
        );
        for word in WORDS.iter().filter(|word| spaced.contains(**word)) {
            found(number, format!("avoid \"{}\"", word.trim()));
        }
        for part in format!("{prose} ").split_inclusive(['.', '?', '!']) {
            sentence.push_str(part);
            if sentence.ends_with(['.', '!']) {
                let start = sentence.trim_start_matches([' ', '-', '*', '"', '(']);
                if let Some(opening) = OPENINGS.iter().find(|opening| start.starts_with(**opening))
                {
                    found(
                        number,
                        format!("a sentence opens with \"{}\"", opening.trim()),
                    );
                }
            }
            if sentence.ends_with(['.', '?', '!']) {
                sentence.clear();
            }
        }
    }
}

/// Checks that relative links lead to files.
fn links(path: &Path, text: &str, found: &mut impl FnMut(usize, String)) {
    for (number, line) in (1..).zip(text.lines()) {
        for link in line
            .split("](")
            .skip(1)
            .filter_map(|rest| rest.split([')', '#']).next())
        {
            let target = path.parent().unwrap_or(path).join(link);
            if !link.is_empty() && !link.contains(":/") && !target.exists() {
                found(number, format!("the link {link} leads nowhere"));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn findings(text: &str) -> Vec<(usize, String)> {
        let mut found = Vec::new();
        lines(text, true, &mut |line, what| found.push((line, what)));
        found
    }

    #[test]
    fn hard_sentences_words_and_lines_are_found() {
        let found = findings("A part. What it does\nis told here.\n\nWhat is ICP? Held to.");
        let expected = [
            (2, "avoid \"is told\""),
            (2, "a sentence opens with \"What\""),
            (4, "avoid \"held to\""),
        ];
        assert_eq!(found, expected.map(|(line, what)| (line, what.to_owned())));
        assert_eq!(findings(&"word ".repeat(21)).len(), 1);
    }

    #[test]
    fn code_tables_and_links_may_be_long() {
        let long = "word ".repeat(30);
        let text = format!("```text\nWhat.\n{long}\n```\n| {long} |\n[{long}](page.md)\n");
        assert!(findings(&text).is_empty());
    }
}
