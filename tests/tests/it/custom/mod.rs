//! Custom components, which keep the laws of their trait.

mod allocations;
mod association;
mod filter;
mod fuser;
mod metric;
mod observer;
mod part;
mod renderer;
mod score;
mod selection;
mod stage;
mod stop_rule;
mod switcher;
