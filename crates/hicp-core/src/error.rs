//! What can be wrong with the inputs. Data conditions (no overlap, degenerate geometry) are not errors: see `Outcome` in `hicp-icp`.

use thiserror::Error;

/// A camera that cannot be.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum CameraError {
    /// A focal length that is not positive or that no lens has.
    #[error(
        "focal length {name} is {}, expected a number of pixels above 0, {} to {}",
        Number(*value),
        crate::camera::MIN_FOCAL_LENGTH,
        crate::camera::MAX_FOCAL_LENGTH
    )]
    FocalLength {
        /// `fx` or `fy`.
        name: &'static str,
        /// The value given.
        value: f64,
    },
    /// A principal point that is nowhere near the image.
    #[error(
        "principal point {name} is {}, expected a number of pixels between -{1} and {1}",
        Number(*value),
        crate::camera::MAX_FOCAL_LENGTH
    )]
    PrincipalPoint {
        /// `cx` or `cy`.
        name: &'static str,
        /// The value given.
        value: f64,
    },
    /// An image side of zero or of absurd size.
    #[error(
        "image {name} is {value} pixels, expected 1 to {}",
        crate::camera::MAX_IMAGE_SIDE
    )]
    ImageSide {
        /// `width` or `height`.
        name: &'static str,
        /// The value given.
        value: u32,
    },
    /// A calibration matrix that is not of the form [fx 0 cx; 0 fy cy; 0 0 1].
    #[error(
        "camera matrix entry [{row}][{column}] is {}, expected {expected}: K must be [fx 0 cx; 0 fy cy; 0 0 1]",
        Number(*found)
    )]
    MatrixEntry {
        /// Row of the entry, from 0.
        row: usize,
        /// Column of the entry, from 0.
        column: usize,
        /// The value given.
        found: f64,
        /// The value required.
        expected: f64,
    },
}

/// An image whose size does not fit.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum ImageError {
    /// The number of values is not width × height.
    #[error("image of {width}x{height} needs {expected} values, found {found}")]
    PixelCount {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// width × height.
        expected: usize,
        /// The number of values given.
        found: usize,
    },
    /// Two things that must be of one size are not.
    #[error(
        "{first} is {first_width}x{first_height} but {second} is {second_width}x{second_height}: expected the same size"
    )]
    SizeMismatch {
        /// What the first size belongs to.
        first: &'static str,
        /// Width of the first.
        first_width: u32,
        /// Height of the first.
        first_height: u32,
        /// What the second size belongs to.
        second: &'static str,
        /// Width of the second.
        second_width: u32,
        /// Height of the second.
        second_height: u32,
    },
}

/// A mesh that cannot be registered.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum MeshError {
    /// No triangle.
    #[error("mesh has {vertices} vertices but no triangle")]
    NoTriangles {
        /// Number of vertices.
        vertices: usize,
    },
    /// More vertices or triangles than indices can address.
    #[error("mesh has {count} {what}, expected at most {limit}")]
    TooLarge {
        /// `vertices` or `triangles`.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A triangle that names a vertex that is not there.
    #[error(
        "triangle {triangle} uses vertex {index}, but there are {vertices} vertices (counted from 0)"
    )]
    IndexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// The vertex index it holds.
        index: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// A vertex, used or not, with a coordinate that is not finite, or so large that its square overflows.
    #[error("vertex {vertex} is ({x}, {y}, {z}) m, expected finite coordinates within ±{limit} m")]
    Coordinate {
        /// Index of the vertex.
        vertex: usize,
        /// x.
        x: f32,
        /// y.
        y: f32,
        /// z.
        z: f32,
        /// Largest absolute coordinate accepted.
        limit: f32,
    },
    /// Every triangle has zero area.
    #[error("all {triangles} triangles have zero area")]
    NoArea {
        /// Number of triangles.
        triangles: usize,
    },
}

/// Symmetries that are not rigid motions.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SymmetryError {
    /// An axis without direction.
    #[error("symmetry axis ({x}, {y}, {z}) has no direction, expected a finite non-zero vector")]
    Axis {
        /// x.
        x: f64,
        /// y.
        y: f64,
        /// z.
        z: f64,
    },
    /// A point on the axis that is not finite.
    #[error("symmetry offset ({x}, {y}, {z}) is not finite")]
    Offset {
        /// x.
        x: f64,
        /// y.
        y: f64,
        /// z.
        z: f64,
    },
}

/// A 3×3 matrix that is not a rotation.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum RotationError {
    /// A component is not finite.
    #[error("rotation entry [{row}][{column}] is {value}, expected a finite number")]
    NotFinite {
        /// Row from 0.
        row: usize,
        /// Column from 0.
        column: usize,
        /// The value given.
        value: f64,
    },
    /// R Rᵀ is not the identity.
    #[error(
        "rotation is not orthogonal: the largest entry of |R Rᵀ - I| is {}, expected at most {tolerance}",
        Number(*deviation)
    )]
    NotOrthogonal {
        /// max |R Rᵀ − I|.
        deviation: f64,
        /// The largest deviation accepted.
        tolerance: f64,
    },
    /// The determinant is not +1: a reflection when it is −1.
    #[error(
        "rotation has determinant {}, expected 1 within {tolerance} (-1 is a reflection)",
        Number(*determinant)
    )]
    Determinant {
        /// det R.
        determinant: f64,
        /// The largest deviation accepted.
        tolerance: f64,
    },
}

/// A number that was given, as people write it: powers of ten where digits would fill lines.
struct Number(f64);

impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self(number) = self;
        match number.abs() {
            size if size != 0.0 && !(1e-9..1e15).contains(&size) => write!(f, "{number:e}"),
            _ => write!(f, "{number}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_exact() {
        for (number, written) in [
            (0.0, "0"),
            (-1066.778, "-1066.778"),
            (1e300, "1e300"),
            (1e15, "1e15"),
            (999_999_999_999_999.0, "999999999999999"),
            (5e-324, "5e-324"),
            (1e-9, "0.000000001"),
            (9.5e-10, "9.5e-10"),
            (f64::NAN, "NaN"),
            (f64::NEG_INFINITY, "-inf"),
        ] {
            assert_eq!(Number(number).to_string(), written);
        }
        let error = CameraError::PrincipalPoint {
            name: "cx",
            value: 2e300,
        };
        assert_eq!(
            error.to_string(),
            "principal point cx is 2e300, expected a number of pixels between -1000000000 and 1000000000"
        );
    }
}
