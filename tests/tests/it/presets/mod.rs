//! The presets on simulated and real scenes.

mod beyond;
mod changed;
mod estimate;
mod look_alikes;
mod metrics;
mod ray_shift;
mod resolution;
mod starts;
mod ycbv;
