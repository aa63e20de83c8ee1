//! The parts that ship with the library. Each is declared in one place: its name in files, what it
//! does, its parameters with their ranges and defaults, and its constructor.

mod associations;
mod common;
mod filters;
mod metrics;
mod scores;
mod selections;
mod stages;
mod stop_rules;

use std::sync::LazyLock;

use crate::catalog::Catalog;

impl Catalog {
    /// Returns the parts that ship with the library.
    #[must_use]
    pub fn built_in() -> &'static Self {
        static BUILT_IN: LazyLock<Catalog> = LazyLock::new(|| {
            let mut catalog = Catalog::default();
            stages::add(&mut catalog);
            selections::add(&mut catalog);
            associations::add(&mut catalog);
            filters::add(&mut catalog);
            metrics::add(&mut catalog);
            stop_rules::add(&mut catalog);
            scores::add(&mut catalog);
            catalog
        });
        &BUILT_IN
    }
}
