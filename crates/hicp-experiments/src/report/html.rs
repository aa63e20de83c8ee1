//! Tables, and HTML pages that load nothing. Names are escaped.

use std::collections::BTreeSet;

use crate::study::to_csv;

/// A table: a heading, and rows with the same number of fields.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// The headings of the columns.
    pub head: Vec<String>,
    /// The rows.
    pub rows: Vec<Vec<String>>,
    /// The row and column of every cell that is bold in HTML.
    pub bold: BTreeSet<(usize, usize)>,
}

impl Table {
    /// Creates a table without rows.
    #[must_use]
    pub fn new(head: &[&str]) -> Self {
        Self {
            head: head.iter().map(|h| (*h).to_owned()).collect(),
            ..Self::default()
        }
    }

    /// Creates a table without rows; `|` separates the headings in `head`.
    pub(crate) fn headed(head: &str) -> Self {
        Self::new(&head.split('|').collect::<Vec<_>>())
    }

    /// Returns the table without the columns that have no value.
    pub(crate) fn without_empty_columns(mut self) -> Self {
        let has_value = |column: usize| self.rows.iter().any(|row| !row[column].is_empty());
        let kept: Vec<bool> = (0..self.head.len()).map(has_value).collect();
        for fields in std::iter::once(&mut self.head).chain(&mut self.rows) {
            let mut kept = kept.iter();
            fields.retain(|_| kept.next() == Some(&true));
        }
        self
    }

    pub(crate) fn csv(&self) -> String {
        to_csv(std::iter::once(&self.head).chain(&self.rows))
    }

    /// Returns the table as HTML, for [`html_page`](crate::html_page).
    #[must_use]
    pub fn html(&self) -> String {
        let cell = |tag: &str, text: &str| format!("<{tag}>{text}</{tag}>");
        let bold = |row, (column, text): (usize, &String)| {
            let is_bold = self.bold.contains(&(row, column));
            let text = escaped(text);
            if is_bold { cell("b", &text) } else { text }
        };
        let line = |cells: String| format!("<tr>{cells}</tr>\n");
        let head = self.head.iter().map(|text| cell("th", &escaped(text)));
        let rows = self.rows.iter().enumerate().map(|(row, fields)| {
            let cells = fields.iter().enumerate();
            line(cells.map(|field| cell("td", &bold(row, field))).collect())
        });
        let (head, rows) = (line(head.collect()), rows.collect::<String>());
        format!("<table>\n{head}{rows}</table>\n")
    }

    /// Returns the table as Markdown.
    ///
    /// The first column is left-aligned. The others contain numbers and are right-aligned.
    #[must_use]
    pub fn markdown(&self) -> String {
        let line = |fields: &[String]| {
            let fields: Vec<String> = fields.iter().map(|f| in_markdown(f)).collect();
            format!("| {} |\n", fields.join(" | "))
        };
        let numbers = "---:|".repeat(self.head.len().saturating_sub(1));
        let rows: String = self.rows.iter().map(|row| line(row)).collect();
        format!("{}|---|{numbers}\n{rows}", line(&self.head))
    }
}

/// Escapes text for HTML, between tags and in quoted attributes.
#[must_use]
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// Escapes text for a field of a Markdown table.
fn in_markdown(text: &str) -> String {
    let text = text.replace(['\n', '\r'], " ");
    let mut safe = String::with_capacity(text.len());
    for letter in text.chars() {
        if matches!(letter, '|' | '\\' | '<' | '*' | '`' | '[') {
            safe.push('\\');
        }
        safe.push(letter);
    }
    safe
}

/// Returns a page with a title, which is escaped; `body` is HTML.
#[must_use]
pub fn page(title: &str, body: &str) -> String {
    let title = escaped(title);
    format!(
        "{HEAD}<title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <h1>{title}</h1>\n{body}</body>\n</html>\n"
    )
}

const HEAD: &str = "<!DOCTYPE html>
<html lang=\"en\">
<head>
<meta charset=\"utf-8\">
";

const STYLE: &str = include_str!("page.css");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_escaped_in_tables_and_pages() {
        let mut table = Table::new(&["a<b", "n"]);
        table
            .rows
            .push(vec!["x|y & \"z\"".to_owned(), "1".to_owned()]);
        table.bold.insert((0, 1));
        assert_eq!(
            table.html(),
            "<table>\n<tr><th>a&lt;b</th><th>n</th></tr>\n<tr><td>x|y &amp; &quot;z&quot;</td><td><b>1</b></td></tr>\n</table>\n"
        );
        assert_eq!(
            table.markdown(),
            "| a\\<b | n |\n|---|---:|\n| x\\|y & \"z\" | 1 |\n"
        );
        let page = page("<script>", "<p>body</p>\n");
        assert!(page.contains("<title>&lt;script&gt;</title>") && !page.contains("<script>"));
        assert!(page.contains("<p>body</p>") && page.ends_with("</html>\n"));
        assert_eq!(table.csv(), "a<b,n\n\"x|y & \"\"z\"\"\",1\n");
    }

    #[test]
    fn escaped_names_are_not_tags() {
        assert_eq!(escaped("<b a=\"1\">&"), "&lt;b a=&quot;1&quot;&gt;&amp;");
    }
}
