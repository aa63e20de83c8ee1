//! Tests of decorators around metrics.

mod frozen;
mod photometric;
mod prior;
mod robust;
mod solvers;
mod wrappers;
