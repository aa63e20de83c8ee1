//! Reports: figures, tables, and one page that contains everything.

mod curve;
mod figure;
mod html;
mod page;
mod panel;
mod tables;

pub use curve::{Curve, Panel};
pub use figure::Figure;
pub use html::{Table, escaped as html_escaped, page as html_page};
pub use page::{Document, Entry, ReportOf, Reported};
pub(crate) use page::{note_on_intervals, table};
pub(crate) use tables::{differences, figures, fixed, means, texts};
