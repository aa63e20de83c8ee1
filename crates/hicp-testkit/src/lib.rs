//! Conformance kit of Hybrid ICP: tests custom components against the laws of their traits.
//!
//! There is one function per extension point. It runs a component on small scenes and on difficult
//! inputs. If the component breaks a law, the function panics with the law, the input and the
//! values found.
//!
//! **Should you use this crate?** Use it as a development dependency if you write a custom
//! selection, association, filter, metric, stop rule, score, switcher, stage, fuser or renderer. To
//! refine poses, use `hybrid-icp`.
//!
//! Each function takes a closure that creates a fresh component, to compare fresh instances with
//! used ones. Most also take the optional laws that this component declares. A call lasts well
//! below a second in a development profile.
//!
//! ```
//! use hicp_testkit::{MetricLaws, check_metric};
//! use hybrid_icp::core::Pair;
//! use hybrid_icp::metric::{ErrorMetric, NormalEquations};
//!
//! /// The distance of the points along the normal of the model.
//! #[derive(Debug)]
//! struct AlongModelNormal;
//!
//! impl ErrorMetric for AlongModelNormal {
//!     fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
//!         let (p, c) = (pair.source.point.cast::<f64>(), pair.target.point.cast::<f64>());
//!         let normal = pair.source.normal.cast::<f64>().into_inner();
//!         system.add_row(&c, &normal, normal.dot(&(p - c)), f64::from(pair.weight));
//!     }
//! }
//!
//! // In a test:
//! check_metric(|| AlongModelNormal, MetricLaws::default());
//! ```
//!
//! | extension point | function | optional laws |
//! |---|---|---|
//! | `PointSelection` | [`check_selection`] | – |
//! | `DataAssociation` | [`check_association`] | [`AssociationLaws`] |
//! | `OutlierFilter` | [`check_filter`] | [`FilterLaws`] |
//! | `ErrorMetric` | [`check_metric`] | [`MetricLaws`] |
//! | `Minimize` | [`check_minimize`], [`check_metric_forwards`] | [`MetricLaws`] |
//! | `StopRule` | [`check_stop_rule`] | [`StopRuleLaws`] |
//! | `Score` | [`check_score`] | [`ScoreLaws`] |
//! | `Switcher` | [`check_switcher`] | [`SwitcherLaws`] |
//! | `Stage` | [`check_stage`] | [`StageLaws`] |
//! | `Fuser` | [`check_fuser`] | [`FuserLaws`] |
//! | `Renderer` | [`check_renderer`] | [`RendererLaws`] |
//!
//! # What the kit cannot check
//!
//! *A warm run makes no heap allocation.* Counting allocations requires a global allocator, which a
//! program must choose and not a library. In a separate test binary, install an allocator that
//! counts per thread and forwards every call to `std::alloc::System`. Refine twice with one
//! `Refiner`, and compare the count before and after the second run. To start, copy
//! `tests/tests/it/custom/allocations.rs` from the repository.
//!
//! *Observers* have one law: observing changes nothing. The engine ensures it.
//!
//! `tests/tests/it/custom/*.rs` in the repository show a component for every extension point,
//! checked and used in a whole pipeline.

// A test kit reports by panicking, and its own scenes are valid by construction.
#![allow(clippy::panic, clippy::expect_used)]

mod association;
mod filter;
mod fuser;
mod law;
mod metric;
mod pairs;
mod renderer;
mod scenes;
mod score;
mod selection;
mod stage;
mod stop;

pub use association::{AssociationLaws, check_association};
pub use filter::{FilterLaws, check_filter};
pub use fuser::{FuserLaws, check_fuser};
pub use metric::{MetricLaws, check_metric, check_metric_forwards, check_minimize};
pub use renderer::{RendererLaws, check_renderer};
pub use scenes::{Scene, scenes};
pub use score::{ScoreLaws, SwitcherLaws, check_score, check_switcher};
pub use selection::check_selection;
pub use stage::{StageLaws, check_stage};
pub use stop::{StopRuleLaws, check_stop_rule};
