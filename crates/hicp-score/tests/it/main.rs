//! Integration tests of `hicp-score`: one program, so that it is linked once.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    clippy::unwrap_used,
    reason = "helpers of tests"
)]

mod bop_errors;
mod calibration;
mod confidence;
mod evidence;
mod flatness;
mod imperfect_mask;
mod pose_error;
mod recall;
mod regions;
mod rendered;
mod sampled_mve;
mod vsd;

mod support;
