//! How a broken law is reported.

use std::fmt::{Debug, Display};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The component under test, for messages.
pub(crate) struct Subject {
    component: String,
}

impl Subject {
    /// Names a component by its type, and by its name in traces where it has one.
    pub(crate) fn new<T>(name: Option<&str>) -> Self {
        let full = std::any::type_name::<T>();
        Self {
            component: match name {
                Some(name) => format!("{full} ({name:?})"),
                None => full.to_owned(),
            },
        }
    }

    /// Reports a broken law.
    pub(crate) fn broken(&self, law: &str, input: &str, found: impl Display) -> ! {
        panic!(
            "{} breaks the law \"{law}\"\n  input: {input}\n  found: {found}",
            self.component
        )
    }

    /// Reports a broken law unless a condition holds.
    pub(crate) fn holds(
        &self,
        law: &str,
        input: &str,
        condition: bool,
        found: impl FnOnce() -> String,
    ) {
        if !condition {
            self.broken(law, input, found());
        }
    }

    /// Two results are the same to the bit.
    pub(crate) fn same<T: Debug>(&self, law: &str, input: &str, expected: &T, found: &T) {
        let (expected, found) = (bits(expected), bits(found));
        if expected != found {
            self.broken(law, input, first_difference(&expected, &found));
        }
    }

    /// Runs a component; a panic is a broken law.
    pub(crate) fn calm<R>(&self, input: &str, run: impl FnOnce() -> R) -> R {
        catch_unwind(AssertUnwindSafe(run)).unwrap_or_else(|payload| {
            let message = payload
                .downcast_ref::<&str>()
                .map(|text| (*text).to_owned())
                .or_else(|| payload.downcast_ref::<String>().cloned());
            self.broken(
                "never panics on data",
                input,
                message.as_deref().unwrap_or("a panic without a message"),
            )
        })
    }
}

/// A text that differs when the bits do: numbers are printed with all the digits that tell them apart, −0 from 0, and NaN as itself.
pub(crate) fn bits(value: &impl Debug) -> String {
    format!("{value:?}")
}

/// Where two texts part, with some of what surrounds it.
fn first_difference(expected: &str, found: &str) -> String {
    let same = expected
        .chars()
        .zip(found.chars())
        .take_while(|(a, b)| a == b)
        .count();
    let excerpt = |text: &str| {
        text.chars()
            .skip(same.saturating_sub(60))
            .take(140)
            .collect::<String>()
    };
    format!("…{}…\n    not …{}…", excerpt(found), excerpt(expected))
}

/// Purity, in messages.
pub(crate) const PURE: &str = "pure: equal inputs give equal bits, whatever ran before";
/// Boxes, in messages.
pub(crate) const BOXED: &str = "boxed = static: the same bits behind a box";
/// Names, in messages.
pub(crate) const NAMED: &str = "a name in traces that is not empty and always the same";
/// Renders, in messages.
pub(crate) const SHARED_RENDER: &str = "shares the render: asks the context for the view of a pose";
