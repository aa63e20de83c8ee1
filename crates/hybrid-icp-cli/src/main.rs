//! The program `hybrid-icp`.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(hybrid_icp_cli::run(std::env::args_os()))
}
