//! The body is in `tests/src/fuzz`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| hicp_tests::fuzz::run("cloud", data));
