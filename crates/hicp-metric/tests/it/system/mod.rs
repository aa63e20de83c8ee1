//! Tests of normal equations and of what they determine.

mod covariance;
mod damping;
mod degeneracy;
mod equations;
mod ratios;
mod sandwich;
