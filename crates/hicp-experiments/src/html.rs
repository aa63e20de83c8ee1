//! Pages and tables that hold everything: nothing is loaded, and whatever a name contains is shown as it is.

use std::fmt::Write as _;

/// A table: a heading, and rows of as many fields.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// The headings of the columns.
    pub head: Vec<String>,
    /// The rows.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// Makes a table without rows.
    #[must_use]
    pub fn new(head: &[&str]) -> Self {
        Self {
            head: head.iter().map(|h| (*h).to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    pub(crate) fn csv(&self) -> Vec<u8> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        for row in std::iter::once(&self.head).chain(&self.rows) {
            // A vector takes everything, and all rows are of one length.
            let _ = writer.write_record(row);
        }
        writer.into_inner().unwrap_or_default()
    }

    /// Returns it as HTML, to be put into [`html_page`](crate::html_page).
    #[must_use]
    pub fn html(&self) -> String {
        let mut text = String::from("<table>\n<tr>");
        for head in &self.head {
            let _ = write!(text, "<th>{}</th>", escaped(head));
        }
        text.push_str("</tr>\n");
        for row in &self.rows {
            text.push_str("<tr>");
            for field in row {
                let _ = write!(text, "<td>{}</td>", escaped(field));
            }
            text.push_str("</tr>\n");
        }
        text.push_str("</table>\n");
        text
    }

    /// Returns it as Markdown: the first column to the left, the others, which hold numbers, to the right.
    #[must_use]
    pub fn markdown(&self) -> String {
        let line = |fields: &[String]| {
            let fields: Vec<String> = fields.iter().map(|f| in_markdown(f)).collect();
            format!("| {} |\n", fields.join(" | "))
        };
        let mut text = line(&self.head);
        let _ = writeln!(
            text,
            "|---|{}",
            "---:|".repeat(self.head.len().saturating_sub(1))
        );
        self.rows.iter().for_each(|row| text.push_str(&line(row)));
        text
    }
}

/// Text as it is written in HTML, between tags and in quoted attributes.
#[must_use]
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// Text as it is written in a field of a table in Markdown.
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

/// Returns a page under a title, which is escaped here; `body` is HTML.
#[must_use]
pub fn page(title: &str, body: &str) -> String {
    let title = escaped(title);
    format!("{HEAD}<title>{title}</title>\n{STYLE}<h1>{title}</h1>\n{body}</body>\n</html>\n")
}

const HEAD: &str = "<!DOCTYPE html>
<html lang=\"en\">
<head>
<meta charset=\"utf-8\">
";

const STYLE: &str = "<style>
body { font: 15px/1.45 sans-serif; margin: 2em auto; max-width: 1440px; padding: 0 1em; color: #222 }
table { border-collapse: collapse; margin: 1em 0; font-size: 13px; font-variant-numeric: tabular-nums }
th, td { border: 1px solid #ccc; padding: 3px 7px; text-align: left; vertical-align: top }
th { background: #f2f2f2 }
figure { margin: 0; overflow-x: auto }
</style>
</head>
<body>
";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_shown_as_they_are() {
        let mut table = Table::new(&["a<b", "n"]);
        table
            .rows
            .push(vec!["x|y & \"z\"".to_owned(), "1".to_owned()]);
        assert_eq!(
            table.html(),
            "<table>\n<tr><th>a&lt;b</th><th>n</th></tr>\n<tr><td>x|y &amp; &quot;z&quot;</td><td>1</td></tr>\n</table>\n"
        );
        assert_eq!(
            table.markdown(),
            "| a\\<b | n |\n|---|---:|\n| x\\|y & \"z\" | 1 |\n"
        );
        let page = page("<script>", "<p>body</p>\n");
        assert!(page.contains("<title>&lt;script&gt;</title>") && !page.contains("<script>"));
        assert!(page.contains("<p>body</p>") && page.ends_with("</html>\n"));
        assert_eq!(table.csv(), b"a<b,n\n\"x|y & \"\"z\"\"\",1\n");
    }

    #[test]
    fn names_do_not_become_tags() {
        assert_eq!(escaped("<b a=\"1\">&"), "&lt;b a=&quot;1&quot;&gt;&amp;");
    }
}
