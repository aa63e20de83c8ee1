//! Cameras and objects that move.

mod nees;
mod room;
mod sequential;
mod tracker;
