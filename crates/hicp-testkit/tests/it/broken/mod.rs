//! Tests that components with one broken law are detected, and that the message names the law.

mod metrics;
mod pairs;
mod runs;

use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs a check that must fail with a message that names the law.
fn caught(law: &str, check: impl FnOnce()) {
    let Err(payload) = catch_unwind(AssertUnwindSafe(check)) else {
        panic!("the check did not detect that {law:?} is broken");
    };
    let message = payload
        .downcast_ref::<String>()
        .expect("a message with the law, the input and the value found");
    assert!(message.contains(law), "expected {law:?} in: {message}");
    for part in ["breaks the law", "input: ", "found: "] {
        assert!(message.contains(part), "expected {part:?} in: {message}");
    }
}
