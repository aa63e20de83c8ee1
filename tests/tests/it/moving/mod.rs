//! Cameras and objects that move.

mod nees;
mod sequential;
mod tracker;
