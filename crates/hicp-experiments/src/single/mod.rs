//! Studies of single images (§VI-A, §VI-B, Table I and the tuning of α).

mod aims;
mod claims;
mod condition;
mod config;
mod design;
mod experiment;
mod report;
mod runner;
mod table_one;

pub use claims::claims;
pub use condition::Condition;
pub use config::Config;
pub use experiment::Experiment;
pub use table_one::TABLE_I;
