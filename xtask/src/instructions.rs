//! `cargo xtask instructions`: instruction counts.
use crate::Findings;
use std::path::Path;
pub(crate) fn check(_root: &Path) -> Findings {
    Ok(())
}
pub(crate) fn bless(_root: &Path) -> Findings {
    Ok(())
}
