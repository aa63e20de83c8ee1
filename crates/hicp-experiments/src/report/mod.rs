//! Reports: figures, tables, and one page that holds everything.

mod curve;
mod figure;
mod html;
mod page;
mod tables;

pub use curve::{Curve, Panel};
pub use figure::Figure;
pub use html::{Table, escaped as html_escaped, page as html_page};
pub use page::{Document, Entry, ReportOf, Reported};
pub(crate) use tables::{ends, fixed, means, texts};
