//! The protocol of the programs that are compared with other libraries.

use std::io::{BufRead as _, Write as _};
use std::path::Path;

use hybrid_icp::core::Isometry3;
use serde_json::{Value, json};

/// Any failure.
pub type Failure = Box<dyn std::error::Error>;

/// Answers each line of the standard input with a line of JSON.
///
/// # Errors
///
/// If a line cannot be read, answered or printed.
pub fn serve(mut answer: impl FnMut(&str) -> Result<Value, Failure>) -> Result<(), Failure> {
    let mut output = std::io::stdout();
    for line in std::io::stdin().lock().lines() {
        writeln!(output, "{}", answer(&line?)?)?;
        output.flush()?;
    }
    Ok(())
}

/// Returns the matrix of a pose, row by row.
#[must_use]
pub fn matrix(pose: &Isometry3<f64>) -> Value {
    json!(pose.to_homogeneous().transpose().as_slice())
}

/// Writes numbers to the file `NAME.f32`, little-endian.
///
/// # Errors
///
/// If the file cannot be written.
pub fn write_floats(
    folder: &Path,
    name: &str,
    numbers: impl Iterator<Item = f32>,
) -> Result<(), Failure> {
    let bytes: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
    Ok(std::fs::write(folder.join(format!("{name}.f32")), bytes)?)
}
