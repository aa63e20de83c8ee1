//! Reports of broken laws.

use std::fmt::{Debug, Display};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The component under test, for messages.
pub(crate) struct Subject {
    component: String,
}

impl Subject {
    /// Creates a subject from a component's type, and from its name in traces if it has one.
    pub(crate) fn new<T>(name: Option<&str>) -> Self {
        let full = std::any::type_name::<T>();
        Self {
            component: match name {
                Some(name) => format!("{full} ({name:?})"),
                None => full.to_owned(),
            },
        }
    }

    /// Starts a trial of the component on an input.
    pub(crate) fn on<'a>(&'a self, input: &'a str) -> Trial<'a> {
        let component = &self.component;
        Trial { component, input }
    }

    /// Checks the names of a fresh, a used and a boxed instance.
    pub(crate) fn named(&self, [fresh, used, boxed]: [&str; 3]) {
        let trial = self.on("any");
        let law = "a name in traces that is not empty and always the same";
        trial.holds(law, !fresh.is_empty(), "an empty name");
        trial.same(law, &fresh, &used);
        trial.same(BOXED, &fresh, &boxed);
    }
}

/// A component and the input of a trial.
#[derive(Clone, Copy)]
pub(crate) struct Trial<'a> {
    component: &'a str,
    input: &'a str,
}

impl Trial<'_> {
    /// Panics with a report of a broken law.
    pub(crate) fn broken(&self, law: &str, found: impl Display) -> ! {
        panic!(
            "{} breaks the law \"{law}\"\n  input: {}\n  found: {found}",
            self.component, self.input
        )
    }

    /// Reports a broken law if a condition is false.
    pub(crate) fn holds(&self, law: &str, condition: bool, found: impl Display) {
        if !condition {
            self.broken(law, found);
        }
    }

    /// Checks that two results have the same bits.
    pub(crate) fn same<T: Debug>(&self, law: &str, expected: &T, found: &T) {
        let (expected, found) = (bits(expected), bits(found));
        if expected != found {
            self.broken(law, first_difference(&expected, &found));
        }
    }

    /// Runs a component, and reports a panic as a broken law.
    pub(crate) fn calm<R>(&self, run: impl FnOnce() -> R) -> R {
        catch_unwind(AssertUnwindSafe(run)).unwrap_or_else(|payload| {
            let message = payload
                .downcast_ref::<&str>()
                .map(|text| (*text).to_owned())
                .or_else(|| payload.downcast_ref::<String>().cloned());
            self.broken(
                "never panics on data",
                message.as_deref().unwrap_or("a panic without a message"),
            )
        })
    }

    /// Checks the number of renders that a component added to the one of its pose.
    pub(crate) fn shares_the_render(&self, renders: u64, allowed: u64) {
        self.holds(
            "shares the render: uses the view of a pose from the context",
            renders <= allowed,
            format_args!("{renders} more renders of a pose already rendered"),
        );
    }

    /// Checks that a used instance (twice) and a boxed one give the same bits as a fresh one.
    pub(crate) fn pure<C: ?Sized, R: Debug>(
        &self,
        of_fresh: &R,
        [used, boxed]: [&mut C; 2],
        run: impl Fn(&mut C) -> R,
    ) {
        for _ in 0..2 {
            self.same(PURE, of_fresh, &self.calm(|| run(used)));
        }
        self.same(BOXED, of_fresh, &self.calm(|| run(boxed)));
    }
}

/// Returns a text that differs if the bits differ.
///
/// Numbers are printed with all digits that distinguish them. −0 differs from 0, and NaN equals
/// itself.
pub(crate) fn bits(value: &impl Debug) -> String {
    format!("{value:?}")
}

/// Returns an excerpt of two texts around their first difference.
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

/// The law of purity.
pub(crate) const PURE: &str = "pure: equal inputs give equal bits, regardless of earlier calls";
/// The law of boxed components.
pub(crate) const BOXED: &str = "boxed = static: the same bits behind a box";
