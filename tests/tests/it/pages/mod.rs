//! Checks of the documentation.

mod book;
mod catalogue;
mod pitfalls;
