//! The faults that a diagnosis can name.

use std::fmt;

/// A fault of the inputs of a refinement.
///
/// Its text ([`Display`](fmt::Display)) describes the fault; [`Fault::fix`] states the correction.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(tag = "fault", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Fault {
    /// The mask has no pixel.
    MaskEmpty,
    /// Nothing was measured inside the mask.
    NoDepth,
    /// The triangles of the mesh face inward.
    MeshInsideOut,
    /// The mesh has the wrong unit or size.
    MeshScale {
        /// The number by which its coordinates must be multiplied; from 0.5 to 2, it is known to a
        /// few percent.
        factor: f64,
    },
    /// The depth image has the wrong scale.
    DepthScale {
        /// The number by which its values must be multiplied.
        factor: f64,
    },
    /// The translation of the initial pose has the wrong unit.
    TranslationScale {
        /// The number by which it must be multiplied.
        factor: f64,
    },
    /// The rotation of the initial pose is transposed.
    RotationTransposed,
    /// The initial pose is object from camera.
    PoseInverted,
    /// The initial pose is in the frame of an OpenGL camera, which looks along −z with y up.
    OpenglPose,
    /// The numbers of the pose's quaternion were read in the wrong order.
    QuaternionOrder {
        /// `true` if they are w, x, y, z, but were read as x, y, z, w; `false` for the reverse.
        w_first: bool,
    },
    /// The initial pose has the right rotation, but is that of a model with another origin.
    Origin {
        /// The vector to add to the model's vertices: x, y and z in the object frame, meters.
        shift_meters: [f64; 3],
    },
    /// The camera's intrinsics belong to images of another resolution, or are in another order.
    ///
    /// The numbers are those of this image, pixels.
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
    FocalLength {
        /// The number by which both must be multiplied, to a few percent.
        factor: f64,
    },
    /// The depth image has distances along the viewing ray.
    RayDistance,
    /// The depth image has large values for near surfaces: a constant minus the depth.
    DepthInverted,
    /// The depth image has disparities or inverse depths.
    Disparity {
        /// Depth in meters times the image's value.
        product: f64,
    },
    /// The depth image and the mask are mirrored, or rotated by 180° if both values are `true`.
    Mirrored {
        /// Columns are in reverse order.
        horizontally: bool,
        /// Rows are in reverse order.
        vertically: bool,
    },
    /// The depth image and the mask do not belong together pixel by pixel.
    Misaligned {
        /// Columns by which the depth image lies to the right of the mask.
        right: i64,
        /// Rows by which it lies below the mask.
        down: i64,
    },
    /// The mask shows everything but the object.
    MaskInverted,
    /// The mask shows surfaces outside of the object's bounding sphere.
    MaskTooLarge {
        /// Share of its pixels outside of the sphere.
        outside: f64,
    },
    /// The mask shows a part of a plane, such as a table or a wall.
    PlaneInMask {
        /// Share of the mask's pixels on the plane.
        share: f64,
    },
}

impl Fault {
    /// Returns the correction as one sentence.
    #[must_use]
    pub fn fix(&self) -> String {
        self.texts().1
    }

    /// Returns the fault and the correction.
    fn texts(&self) -> (String, String) {
        let texts = |fault: &str, fix: &str| (fault.to_owned(), fix.to_owned());
        let scale = |what: &str, factor: f64| {
            let (times, size) = match factor < 1.0 {
                true => (Number(1.0 / factor), "large"),
                false => (Number(factor), "small"),
            };
            let fix = format!("multiply {what} by {}", Number(factor));
            (format!("{what} is {times} times too {size}"), fix)
        };
        let percent = |share: f64| (100.0 * share).round();
        match *self {
            Self::MaskEmpty => texts(
                "the mask is empty",
                "pass the mask of this object in this image",
            ),
            Self::NoDepth => texts(
                "no depth was measured inside the mask",
                "check the depth scale, and that depth and mask show the same image",
            ),
            Self::MeshInsideOut => texts(
                "the mesh is inside out: its triangles face inward",
                "reverse the order of the corners of every triangle",
            ),
            Self::MeshScale { factor } if (0.5..=2.0).contains(&factor) => (
                about("the mesh", factor),
                "compare a length of the object with that of the mesh".to_owned(),
            ),
            Self::MeshScale { factor } => scale("the mesh", factor),
            Self::DepthScale { factor } => scale("the depth", factor),
            Self::TranslationScale { factor } => scale("the translation of the pose", factor),
            Self::RotationTransposed => texts(
                "the rotation of the pose is transposed",
                "transpose the rotation of the pose",
            ),
            Self::PoseInverted => texts(
                "the pose is inverted: object from camera",
                "invert the pose: it must take object to camera coordinates",
            ),
            Self::OpenglPose => texts(
                "the pose is that of an OpenGL camera, with y up and −z ahead",
                "multiply the pose by diag(1, -1, -1, 1) from the left",
            ),
            Self::QuaternionOrder { w_first } => {
                let [right, wrong] = match w_first {
                    true => ["w, x, y, z", "x, y, z, w"],
                    false => ["x, y, z, w", "w, x, y, z"],
                };
                let fault =
                    format!("the quaternion of the pose is {right}, but was read as {wrong}");
                (
                    fault,
                    format!("if the pose was made of a quaternion, read its numbers as {right}"),
                )
            }
            Self::Origin { shift_meters } => {
                let [x, y, z] = shift_meters.map(|shift| Number((1e3 * shift).round() + 0.0));
                (
                    "the pose puts the object elsewhere: its model may have another origin"
                        .to_owned(),
                    format!(
                        "if other images give about the same vector, add ({x}, {y}, {z}) mm to the vertices of the mesh; otherwise correct the translation of the pose"
                    ),
                )
            }
            Self::Intrinsics { fx, fy, cx, cy } => {
                let [fx, fy, cx, cy] = [fx, fy, cx, cy].map(Number);
                let fault =
                    "the intrinsics belong to images of another resolution, or are in another order"
                        .to_owned();
                (fault, format!("use fx {fx}, fy {fy}, cx {cx}, cy {cy}"))
            }
            Self::FocalLength { factor } => {
                let fix = "use the intrinsics of the camera that took the depth image";
                (
                    about("the focal length of the camera", factor),
                    fix.to_owned(),
                )
            }
            Self::RayDistance => texts(
                "the depth image has distances along the ray instead of depths",
                "divide each value by √(((u − cx)/fx)² + ((v − cy)/fy)² + 1)",
            ),
            Self::DepthInverted => texts(
                "the depth is inverted: near surfaces have large values",
                "subtract the depth from the constant that it was subtracted from",
            ),
            Self::Disparity { product } => (
                "the depth image has disparities or inverse depths".to_owned(),
                format!("divide {} m by each value", Number(product)),
            ),
            Self::Mirrored {
                horizontally,
                vertically,
            } => {
                let change = match (horizontally, vertically) {
                    (true, true) => "rotated by 180°",
                    (true, false) => "mirrored, left to right",
                    _ => "mirrored, top to bottom",
                };
                let fault = format!("depth image and mask are {change}");
                (fault, "mirror the depth image and the mask back".to_owned())
            }
            Self::Misaligned { right, down } => (
                format!(
                    "depth image and mask are not aligned: the depth lies {} pixels {} of the mask and {} {}",
                    right.abs(),
                    if right < 0 { "left" } else { "right" },
                    down.abs(),
                    if down < 0 { "above" } else { "below" }
                ),
                "use the mask of this depth image, or register the depth to its camera".to_owned(),
            ),
            Self::MaskInverted => texts(
                "the mask is inverted: it shows everything but the object",
                "invert the mask",
            ),
            Self::MaskTooLarge { outside } => (
                format!(
                    "the mask covers more than the object: {} % of its pixels are outside of the bounding sphere",
                    percent(outside)
                ),
                "pass a mask of this object alone".to_owned(),
            ),
            Self::PlaneInMask { share } => (
                format!(
                    "{} % of the mask show a plane, such as a table or a wall",
                    percent(share)
                ),
                "remove the plane from the mask".to_owned(),
            ),
        }
    }
}

/// Returns the fault of a quantity of which a factor is known to a few percent.
fn about(what: &str, factor: f64) -> String {
    let (times, size) = match factor < 1.0 {
        true => (1.0 / factor, "large"),
        false => (factor, "small"),
    };
    format!("{what} is about {times:.2} times too {size}")
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.texts().0)
    }
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
