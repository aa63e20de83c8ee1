//! Identities of immutable inputs, for caches.

use std::sync::atomic::{AtomicU64, Ordering};

/// The identity of an immutable [`Model`](crate::Model), [`Observation`](crate::Observation) or
/// [`Cloud`](crate::Cloud) within this process.
///
/// Two values with the same id hold the same data. The number itself has no meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Id(u64);

impl Id {
    pub(crate) fn next() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        Self(NEXT.fetch_add(1, Ordering::Relaxed))
    }
}
