//! Digests of what a run depends on and of what it has done.

use std::fmt::{self, Write as _};
use std::hash::{DefaultHasher, Hasher};

/// A digest of all that the debug form of a value shows.
pub(super) fn of_value(value: &impl fmt::Debug) -> String {
    struct Digest(DefaultHasher);
    impl fmt::Write for Digest {
        fn write_str(&mut self, text: &str) -> fmt::Result {
            self.0.write(text.as_bytes());
            Ok(())
        }
    }
    let mut digest = Digest(DefaultHasher::new());
    // Nothing above fails.
    let _ = write!(digest, "{value:?}");
    in_digits(&digest.0)
}

/// A digest of bytes.
pub(super) fn of_bytes(bytes: &[u8]) -> String {
    let mut hasher = DefaultHasher::new();
    hasher.write(bytes);
    in_digits(&hasher)
}

fn in_digits(hasher: &DefaultHasher) -> String {
    format!("{:016x}", hasher.finish())
}
