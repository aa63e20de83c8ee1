//! The trait of stop rules, and their combination.

use hicp_core::internal::{for_tuples, type_label};
use hicp_core::{Correspondences, Isometry3, Iteration};

use crate::outcome::{Evaluation, Termination};

/// The results at the pose just evaluated: the input of a stop rule, next to the [`Iteration`].
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// Pairs and loss at the pose just evaluated.
    pub current: Evaluation,
    /// Pairs and loss at the first iteration.
    pub first: Evaluation,
    /// Pairs and loss at the previous iteration; `None` at the first.
    pub previous: Option<Evaluation>,
    /// The pose just evaluated.
    pub camera_from_object: &'a Isometry3<f64>,
    /// The increment that the next iteration would apply.
    pub increment: &'a Isometry3<f64>,
    /// The pairs at the pose just evaluated, after filtering.
    pub pairs: &'a Correspondences,
}

/// The decision of a stop rule about the pose just evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum Judgment {
    /// Accept the pose and continue.
    Continue,
    /// Accept the pose and end the stage for this reason.
    Accept(Termination),
    /// Reject the pose and end the stage for this reason. The stage returns the pose accepted
    /// before it.
    Reject(Termination),
}

impl Judgment {
    /// Accepts the pose, and ends the stage for a reason if a condition holds.
    pub fn accept_if(ends: bool, reason: Termination) -> Self {
        if ends {
            Self::Accept(reason)
        } else {
            Self::Continue
        }
    }

    /// Returns this judgment, or `other` if this one continues.
    fn or(self, other: Self) -> Self {
        if self == Self::Continue { other } else { self }
    }
}

/// Decides after every evaluation whether the stage continues and whether the pose is accepted.
///
/// Both decisions are one trait, because a rule that detects divergence must reject the pose that
/// revealed it. The stage then returns the pose accepted before, at no cost. A rule with memory
/// clears it in [`StopRule::start`], because one rule serves many runs.
///
/// A tuple of up to eight rules, or a `Vec` of any number, passes every iteration to all of them.
/// The first rule that does not continue decides. `()` never ends a stage, which then runs until
/// [`MAX_ITERATIONS`](crate::MAX_ITERATIONS).
///
/// A rule can end a stage for a custom reason:
///
/// ```
/// use hicp_core::Iteration;
/// use hicp_icp::{Judgment, Progress, StopRule, Termination};
///
/// /// Ends a stage once the points of every pair are within a distance of each other.
/// #[derive(Debug)]
/// struct AllClose {
///     meters: f32,
/// }
///
/// impl StopRule for AllClose {
///     fn check(&mut self, _iteration: &Iteration<'_>, progress: &Progress<'_>) -> Judgment {
///         let is_close = progress.pairs.iter().all(|pair| pair.distance() <= self.meters);
///         Judgment::accept_if(is_close, Termination::Custom("all_close"))
///     }
/// }
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a stop rule",
    label = "this must implement `StopRule`",
    note = "`Icp::stop` accepts a `StopRule`, `()`, an `Option` or a `Vec` of one type (for example `Vec<Box<dyn StopRule>>`), or a tuple of one to eight of them"
)]
pub trait StopRule {
    /// Starts a stage: rules with memory clear it.
    fn start(&mut self) {}

    /// Judges the pose that an iteration evaluated.
    fn check(&mut self, iteration: &Iteration<'_>, progress: &Progress<'_>) -> Judgment;

    /// Returns the name in traces.
    fn name(&self) -> &'static str {
        type_label::<Self>()
    }

    /// Appends the names of the rules that this one consists of, in order.
    ///
    /// A single rule appends its name; a list appends those of its members.
    fn names(&self, names: &mut Vec<&'static str>) {
        names.push(self.name());
    }
}

macro_rules! forward {
    ($($pointer:ty),+) => {$(
        impl<T: StopRule + ?Sized> StopRule for $pointer {
            fn start(&mut self) {
                (**self).start();
            }

            fn check(&mut self, iteration: &Iteration<'_>, progress: &Progress<'_>) -> Judgment {
                (**self).check(iteration, progress)
            }

            fn name(&self) -> &'static str {
                (**self).name()
            }

            fn names(&self, names: &mut Vec<&'static str>) {
                (**self).names(names);
            }
        }
    )+};
}
forward!(Box<T>, &mut T);

/// Never ends a stage.
impl StopRule for () {
    fn check(&mut self, _: &Iteration<'_>, _: &Progress<'_>) -> Judgment {
        Judgment::Continue
    }

    fn name(&self) -> &'static str {
        "none"
    }

    fn names(&self, _: &mut Vec<&'static str>) {}
}

macro_rules! list {
    ($($list:ident),+) => {$(
        /// Passes every iteration to all rules, as tuples do. The first that does not continue
        /// decides.
        impl<T: StopRule> StopRule for $list<T> {
            fn start(&mut self) {
                self.iter_mut().for_each(StopRule::start);
            }

            fn check(&mut self, iteration: &Iteration<'_>, progress: &Progress<'_>) -> Judgment {
                let rules = self.iter_mut();
                rules.fold(Judgment::Continue, |judgment, rule| {
                    judgment.or(rule.check(iteration, progress))
                })
            }

            fn name(&self) -> &'static str {
                "any-of"
            }

            fn names(&self, names: &mut Vec<&'static str>) {
                self.iter().for_each(|rule| rule.names(names));
            }
        }
    )+};
}
list!(Vec, Option);

macro_rules! any_of {
    ($($member:ident),+) => {
        impl<$($member: StopRule),+> StopRule for ($($member,)+) {
            #[allow(non_snake_case)]
            fn start(&mut self) {
                let ($($member,)+) = self;
                $($member.start();)+
            }

            #[allow(non_snake_case)]
            fn check(&mut self, iteration: &Iteration<'_>, progress: &Progress<'_>) -> Judgment {
                let ($($member,)+) = self;
                let judgment = Judgment::Continue;
                $(let judgment = judgment.or($member.check(iteration, progress));)+
                judgment
            }

            fn name(&self) -> &'static str {
                "any-of"
            }

            #[allow(non_snake_case)]
            fn names(&self, names: &mut Vec<&'static str>) {
                let ($($member,)+) = self;
                $($member.names(names);)+
            }
        }
    };
}
for_tuples!(any_of);
