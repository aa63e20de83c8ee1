//! Cameras and objects that move.

mod hidden_handle;
mod nees;
mod sequential;
mod tracker;
