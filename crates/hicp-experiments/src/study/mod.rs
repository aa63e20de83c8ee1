//! A study of any kind: its configuration, its rows, and code that runs, stores and reads it.

mod design;
mod fields;
mod group;
mod layout;
mod models;
mod records;
mod row;
mod run;
mod stored;

pub use design::{Design, Worker};
pub use fields::{Fields, MAX_BINS, MAX_CELLS, MAX_OBJECTS};
pub use group::{ALL, FAULTY_MASK, Group, HIGH, LOW, NOISY, NOISY_DEPTH, NOISY_MODEL};
pub use layout::Layout;
pub use models::Models;
pub use records::ObjectRecord;
pub(crate) use records::camera;
pub use row::{Measured, Outcome, Row};
pub(crate) use row::{quoted, to_csv};
pub use run::{RunOptions, run};
pub use stored::{CONFIG_FILE, StudyOf};
