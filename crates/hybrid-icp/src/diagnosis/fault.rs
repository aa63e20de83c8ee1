//! The faults that a diagnosis can name.

use std::fmt;

use thiserror::Error;

/// A fault of the inputs of a refinement.
///
/// Its text ([`Display`](fmt::Display)) describes the fault; [`Fault::fix`] states the correction.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(tag = "fault", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Fault {
    /// The mask has no pixel.
    #[error("the mask is empty")]
    MaskEmpty,
    /// Nothing was measured inside the mask.
    #[error("no depth was measured inside the mask")]
    NoDepth,
    /// The triangles of the mesh face inward.
    #[error("the mesh is inside out: its triangles face inward")]
    MeshInsideOut,
    /// The mesh has the wrong unit or size.
    #[error("the mesh is {}", size(*factor))]
    MeshScale {
        /// The number by which its coordinates must be multiplied; from 0.5 to 2, it is known to a
        /// few percent.
        factor: f64,
    },
    /// The depth image has the wrong scale.
    #[error("the depth is {}", times(*factor))]
    DepthScale {
        /// The number by which its values must be multiplied.
        factor: f64,
    },
    /// The translation of the initial pose has the wrong unit.
    #[error("the translation of the pose is {}", times(*factor))]
    TranslationScale {
        /// The number by which it must be multiplied.
        factor: f64,
    },
    /// The rotation of the initial pose is transposed.
    #[error("the rotation of the pose is transposed")]
    RotationTransposed,
    /// The initial pose is object from camera.
    #[error("the pose is inverted: object from camera")]
    PoseInverted,
    /// The initial pose is in the frame of an OpenGL camera, which looks along −z with y up.
    #[error("the pose is that of an OpenGL camera, with y up and −z ahead")]
    OpenglPose,
    /// The numbers of the pose's quaternion were read in the wrong order.
    #[error("the quaternion of the pose is {}, but was read as {}", order(*w_first), order(!w_first))]
    QuaternionOrder {
        /// `true` if they are w, x, y, z, but were read as x, y, z, w; `false` for the reverse.
        w_first: bool,
    },
    /// The initial pose has the right rotation, but is that of a model with another origin.
    #[error("the pose puts the object elsewhere: its model may have another origin")]
    Origin {
        /// The vector to add to the model's vertices: x, y and z in the object frame, meters.
        shift_meters: [f64; 3],
    },
    /// The camera's intrinsics belong to images of another resolution, or are in another order.
    ///
    /// The numbers are those of this image, pixels.
    #[error("the intrinsics belong to images of another resolution, or are in another order")]
    Intrinsics {
        /// Focal length along columns.
        fx: f64,
        /// Focal length along rows.
        fy: f64,
        /// Column of the principal point.
        cx: f64,
        /// Row of the principal point.
        cy: f64,
    },
    /// The focal lengths are those of another camera.
    #[error("the focal length of the camera is {}", about(*factor))]
    FocalLength {
        /// The number by which both must be multiplied, to a few percent.
        factor: f64,
    },
    /// The depth image has distances along the viewing ray.
    #[error("the depth image has distances along the ray instead of depths")]
    RayDistance,
    /// The depth image has large values for near surfaces: a constant minus the depth.
    #[error("the depth is inverted: near surfaces have large values")]
    DepthInverted,
    /// The depth image has disparities or inverse depths.
    #[error("the depth image has disparities or inverse depths")]
    Disparity {
        /// Depth in meters times the image's value.
        product: f64,
    },
    /// The depth image and the mask are mirrored, or rotated by 180° if both values are `true`.
    #[error("depth image and mask are {}", change(*horizontally, *vertically))]
    Mirrored {
        /// Columns are in reverse order.
        horizontally: bool,
        /// Rows are in reverse order.
        vertically: bool,
    },
    /// The depth image and the mask do not belong together pixel by pixel.
    #[error(
        "depth image and mask are not aligned: the depth lies {} pixels {} of the mask and {} {}",
        right.abs(),
        if *right < 0 { "left" } else { "right" },
        down.abs(),
        if *down < 0 { "above" } else { "below" }
    )]
    Misaligned {
        /// Columns by which the depth image lies to the right of the mask.
        right: i64,
        /// Rows by which it lies below the mask.
        down: i64,
    },
    /// The mask shows everything but the object.
    #[error("the mask is inverted: it shows everything but the object")]
    MaskInverted,
    /// The mask shows surfaces outside of the object's bounding sphere.
    #[error(
        "the mask covers more than the object: {} % of its pixels are outside of the bounding sphere",
        percent(*outside)
    )]
    MaskTooLarge {
        /// Share of its pixels outside of the sphere.
        outside: f64,
    },
    /// The mask shows a part of a plane, such as a table or a wall.
    #[error("{} % of the mask show a plane, such as a table or a wall", percent(*share))]
    PlaneInMask {
        /// Share of the mask's pixels on the plane.
        share: f64,
    },
}

impl Fault {
    /// Returns the correction as one sentence.
    #[must_use]
    pub fn fix(&self) -> String {
        let fix = match *self {
            Self::MaskEmpty => "pass the mask of this object in this image",
            Self::NoDepth => "check the depth scale, and that depth and mask show the same image",
            Self::MeshInsideOut => "reverse the order of the corners of every triangle",
            Self::MeshScale { factor } if is_measured(factor) => {
                "compare a length of the object with that of the mesh"
            }
            Self::MeshScale { factor } => {
                return format!("multiply the mesh by {}", Number(factor));
            }
            Self::DepthScale { factor } => {
                return format!("multiply the depth by {}", Number(factor));
            }
            Self::TranslationScale { factor } => {
                let factor = Number(factor);
                return format!("multiply the translation of the pose by {factor}");
            }
            Self::RotationTransposed => "transpose the rotation of the pose",
            Self::PoseInverted => "invert the pose: it must take object to camera coordinates",
            Self::OpenglPose => "multiply the pose by diag(1, -1, -1, 1) from the left",
            Self::QuaternionOrder { w_first } => {
                let order = order(w_first);
                return format!(
                    "if the pose was made of a quaternion, read its numbers as {order}"
                );
            }
            Self::Origin { shift_meters } => {
                let [x, y, z] = shift_meters.map(|shift| Number((1e3 * shift).round() + 0.0));
                return format!(
                    "if other images give about the same vector, add ({x}, {y}, {z}) mm to the vertices of the mesh; otherwise correct the translation of the pose"
                );
            }
            Self::Intrinsics { fx, fy, cx, cy } => {
                let [fx, fy, cx, cy] = [fx, fy, cx, cy].map(Number);
                return format!("use fx {fx}, fy {fy}, cx {cx}, cy {cy}");
            }
            Self::FocalLength { .. } => {
                "use the intrinsics of the camera that took the depth image"
            }
            Self::RayDistance => "divide each value by √(((u − cx)/fx)² + ((v − cy)/fy)² + 1)",
            Self::DepthInverted => {
                "subtract the depth from the constant that it was subtracted from"
            }
            Self::Disparity { product } => {
                return format!("divide {} m by each value", Number(product));
            }
            Self::Mirrored { .. } => "mirror the depth image and the mask back",
            Self::Misaligned { .. } => {
                "use the mask of this depth image, or register the depth to its camera"
            }
            Self::MaskInverted => "invert the mask",
            Self::MaskTooLarge { .. } => "pass a mask of this object alone",
            Self::PlaneInMask { share } if share >= 1.0 => {
                "use the mask of the object, in this image and of this camera"
            }
            Self::PlaneInMask { .. } => "remove the plane from the mask",
        };
        fix.to_owned()
    }
}

/// Returns whether a factor of the mesh was measured, so that it is known to a few percent only.
pub(super) fn is_measured(factor: f64) -> bool {
    (0.5..=2.0).contains(&factor)
}

/// Describes the size of a mesh that must be multiplied by a factor.
fn size(factor: f64) -> String {
    match is_measured(factor) {
        true => about(factor),
        false => times(factor),
    }
}

/// Describes a quantity that must be multiplied by a factor.
fn times(factor: f64) -> String {
    match factor < 1.0 {
        true => format!("{} times too large", Number(1.0 / factor)),
        false => format!("{} times too small", Number(factor)),
    }
}

/// Describes a quantity of which a factor is known to a few percent.
fn about(factor: f64) -> String {
    match factor < 1.0 {
        true => format!("about {:.2} times too large", 1.0 / factor),
        false => format!("about {factor:.2} times too small"),
    }
}

/// Returns the order of the numbers of a quaternion.
fn order(w_first: bool) -> &'static str {
    match w_first {
        true => "w, x, y, z",
        false => "x, y, z, w",
    }
}

/// Describes a mirrored image.
fn change(horizontally: bool, vertically: bool) -> &'static str {
    match (horizontally, vertically) {
        (true, true) => "rotated by 180°",
        (true, false) => "mirrored, left to right",
        _ => "mirrored, top to bottom",
    }
}

fn percent(share: f64) -> f64 {
    (100.0 * share).round()
}

/// A number with at most four significant digits.
struct Number(f64);

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(number) = *self;
        let rounded: f64 = format!("{number:.3e}").parse().unwrap_or(number);
        write!(f, "{rounded}")
    }
}
