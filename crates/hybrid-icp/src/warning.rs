//! Warnings about inputs and results.

use hicp_score::Flatness;
use thiserror::Error;

/// Smallest flatness that a message states, meters: the step of most depth images.
const FINEST: f64 = 1e-3;

/// Something that looks wrong about the inputs of a refinement or about its result.
///
/// A warning refuses nothing. Lengths are in meters.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Warning {
    /// The object is too small or too large for a depth camera: probably a wrong unit of the mesh.
    #[error("the model's diameter is {}", Meters(*diameter))]
    Diameter {
        /// Diameter of the model.
        diameter: f64,
    },
    /// The diameter that the model was given differs from that of its mesh
    /// ([`warning_of_diameter`](crate::checks::warning_of_diameter)).
    #[error("the stated diameter is {}, but that of the mesh is {}", Meters(*stated), Meters(*measured))]
    StatedDiameter {
        /// The diameter that the model was made with.
        stated: f64,
        /// Largest distance between two vertices that triangles use.
        measured: f64,
    },
    /// A declared symmetry moves the object to another place: probably a wrong unit.
    #[error(
        "a declared symmetry moves the object's center by {}, with a diameter of {}: check the unit of its translation or offset",
        Meters(*distance),
        Meters(*diameter)
    )]
    Symmetry {
        /// Distance by which it moves the center.
        distance: f64,
        /// Diameter of the model.
        diameter: f64,
    },
    /// The mesh is so far from its origin that `f32` rounds its shape.
    #[error(
        "the model's coordinates are so far from its origin that they are rounded to steps of {}, with a diameter of {}",
        Meters(*step),
        Meters(*diameter)
    )]
    CoarseCoordinates {
        /// Distance between neighboring coordinates.
        step: f64,
        /// Diameter of the model.
        diameter: f64,
    },
    /// The principal point is so far from the middle of the image that the intrinsics are doubtful.
    #[error("the principal point ({cx}, {cy}) {fault}")]
    Center {
        /// Column of the principal point, pixels.
        cx: f64,
        /// Row of the principal point, pixels.
        cy: f64,
        /// The fault.
        fault: CenterFault,
    },
    /// A box ends outside of the image or within its first pixel
    /// ([`warning_of_box`](crate::checks::warning_of_box)).
    #[error(
        "the box ends at ({right}, {bottom}) of the {width}x{height} image: check that it is x, y, width, height in pixels, and not two corners or shares of the image"
    )]
    Box {
        /// Column at which the box ends, pixels.
        right: f64,
        /// Row at which it ends, pixels.
        bottom: f64,
        /// Width of the image, pixels.
        width: u32,
        /// Height of the image, pixels.
        height: u32,
    },
    /// The object is behind the camera at the initial pose. The pose may also be invalid: not
    /// finite, or with a quaternion that is not of length 1.
    #[error("the object's center is at z = {}, behind the camera, which looks along +z", Meters(*z))]
    BehindCamera {
        /// z of the center of the object in the camera frame; NaN if the pose is invalid.
        z: f64,
    },
    /// There is a mask, but no depth inside.
    #[error("no depth inside the mask")]
    NoDepth,
    /// The surface inside the mask is much nearer or farther than the object at the initial pose:
    /// probably a wrong depth scale, or a translation in another unit.
    #[error(
        "the median depth inside the mask is {}, but the pose puts the object at {}",
        Meters(*measured),
        Meters(*expected)
    )]
    Depth {
        /// Median depth inside the mask.
        measured: f64,
        /// z of the center of the object.
        expected: f64,
    },
    /// The mask has many more pixels than the object can cover at its distance: probably a wrong
    /// unit of the mesh.
    #[error(
        "the mask has {pixels} pixels, but the model ({}) at the distance of the pose ({}) covers at most {at_most:.0}",
        Meters(*diameter),
        Meters(*distance)
    )]
    Mask {
        /// Pixels of the mask.
        pixels: usize,
        /// Pixels of a disc of the model's diameter at its distance.
        at_most: f64,
        /// Diameter of the model.
        diameter: f64,
        /// z of the center of the object.
        distance: f64,
    },
    /// The smallest side of the object covers many more pixels than the mask has: probably a wrong
    /// unit of the mesh, or a mask of something else.
    ///
    /// Masks that touch the border of the image are exempt.
    #[error(
        "the mask has {pixels} pixels, but the model ({}) at the distance of the pose ({}) covers {at_least:.0} from its smallest side",
        Meters(*diameter),
        Meters(*distance)
    )]
    Sliver {
        /// Pixels of the mask.
        pixels: usize,
        /// Pixels of the smallest side of the model's bounding box at its distance.
        at_least: f64,
        /// Diameter of the model.
        diameter: f64,
        /// z of the center of the object.
        distance: f64,
    },
    /// The refinement made the pose worse, by its score.
    #[error(
        "the returned pose explains the image worse than the initial one (MVE {mve:.3}, was {mve_initial:.3})"
    )]
    Worse {
        /// MVE of the initial pose.
        mve_initial: f64,
        /// MVE of the returned pose.
        mve: f64,
    },
    /// The returned pose has an MVE of [`PAPER_ALPHA`](hicp_switch::PAPER_ALPHA) or more, and its
    /// confidence is below [`ACCEPTED`](crate::ACCEPTED).
    #[error("MVE {mve:.3}: the pose does not explain the image, do not trust it")]
    Unexplained {
        /// MVE of the returned pose.
        mve: f64,
    },
    /// The returned pose explains most of the mask, but is more likely wrong than right.
    #[error("confidence {confidence:.2}: the pose is more likely wrong than right")]
    Doubtful {
        /// The probability that the pose is right.
        confidence: f64,
    },
    /// The initial pose explained nothing of the mask, the returned one does, and its confidence is
    /// below [`ACCEPTED`](crate::ACCEPTED).
    ///
    /// The mask may show another object that looks like this one from one side.
    #[error(
        "the initial pose explained nothing of the mask (MVE {mve_initial:.3}): what was found there (MVE {mve:.3}) may be another object"
    )]
    FoundElsewhere {
        /// MVE of the initial pose.
        mve_initial: f64,
        /// MVE of the returned pose.
        mve: f64,
    },
    /// Another pose explains the image as well as the returned one.
    ///
    /// It is not equivalent by a declared symmetry.
    #[error(
        "ambiguous: 2 poses within {:.2}, {rotation_degrees:.0}° apart{}",
        within(*gap),
        if *gap < 0.0 { ", and the other has the lower score" } else { "" }
    )]
    Ambiguous {
        /// Score of the other pose minus that of the returned one: negative if the other explains
        /// the image better, but not clearly.
        gap: f64,
        /// Angle between the two, up to declared symmetries, degrees.
        rotation_degrees: f64,
    },
    /// A plane explains the depth inside the mask better than the returned pose does, although the
    /// model is not flat there ([`Flatness::is_flat`]).
    ///
    /// The mask may show a wall, a table, a box, or something that the sensor cannot measure.
    #[error(
        "the mask may show a wall or a table: the measured surface is flat to {}, but the model's surface there only to {}, and they are {} apart",
        Meters(flatness.measured.max(FINEST)),
        Meters(flatness.rendered),
        Meters(flatness.residual)
    )]
    Flat {
        /// Flatness of the two surfaces and their distance from each other.
        flatness: Flatness,
    },
}

/// The probable fault of intrinsics whose principal point is far from the middle of the image.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum CenterFault {
    /// Its two coordinates are swapped, or the image was rotated by 90°.
    #[error(
        "would be near the middle of the image if cx and cy were swapped: they may be, or the image was rotated by 90°"
    )]
    Swapped,
    /// The focal lengths and the principal point are exchanged.
    #[error("would be near the middle of the image if cx, cy and fx, fy were exchanged")]
    Exchanged,
    /// The intrinsics are those of an image of another size.
    ///
    /// An image that was cropped to its left upper part looks the same, unless the mask has the
    /// length of the object.
    #[error(
        "is the middle of an image {factor:.2} times as large: if the image was resized, resize fx, fy, cx and cy with it"
    )]
    Resized {
        /// Size of that image relative to this one.
        factor: f64,
    },
    /// No camera without lens distortion sees so far from its optical axis.
    #[error(
        "puts a corner of the image {degrees:.0}° off the optical axis: expected fx, fy, cx and cy in pixels of this image"
    )]
    Far {
        /// Angle between the optical axis and the farthest corner, degrees.
        degrees: f64,
    },
}

/// Returns a gap in score, rounded up to hundredths and at least 0.01.
fn within(gap: f64) -> f64 {
    (gap.abs() * 100.0).ceil().max(1.0) / 100.0
}

/// A length in messages: with four digits, or in scientific notation if it is tiny or huge.
pub(crate) struct Meters(pub(crate) f64);

impl std::fmt::Display for Meters {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let length = self.0;
        match length.abs() {
            size if size != 0.0 && !(1e-3..1e5).contains(&size) => write!(f, "{length:.3e} m"),
            _ => write!(f, "{length:.4} m"),
        }
    }
}
