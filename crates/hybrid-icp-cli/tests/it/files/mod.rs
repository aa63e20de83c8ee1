//! Files of the user survive runs that are killed or interrupted, full disks, and strange inputs.
#![cfg(unix)]

mod faults;
mod killed_generator;
mod no_regular_files;
mod outputs;
