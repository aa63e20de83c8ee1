//! Checks of bounding boxes.

use crate::warning::Warning;

/// Returns whether a box covers pixels of an image, rounded as in
/// [`Mask::in_box`](hicp_core::Mask::in_box).
///
/// The box is x and y of its corner, width and height; the size of the image is width and height,
/// in pixels. A box of less than a pixel has none.
///
/// ```
/// use hybrid_icp::checks::box_overlaps;
/// assert!(box_overlaps([-20.0, 470.0, 30.0, 30.0], (640, 480)));
/// assert!(!box_overlaps([640.0, 10.0, 30.0, 30.0], (640, 480)));
/// ```
#[must_use]
pub fn box_overlaps([x, y, w, h]: [f64; 4], (width, height): (u32, u32)) -> bool {
    let overlaps = |start: f64, length: f64, side: u32| {
        length >= 1.0 && start.round() < f64::from(side) && (start + length).round() > 0.0
    };
    overlaps(x, w, width) && overlaps(y, h, height)
}

/// Returns [`Warning::Box`] if a bounding box is probably in another format or unit.
///
/// A box that ends outside of the image is often given by two corners. A box that ends within the
/// first pixel is often given in fractions of the image. The box is x and y of its corner, width
/// and height, as for [`Mask::in_box`](hicp_core::Mask::in_box). The size of the image is width and
/// height, in pixels. A tenth of the box may be outside.
///
/// ```
/// use hybrid_icp::{Warning, checks::warning_of_box};
/// assert_eq!(warning_of_box([300.0, 200.0, 90.0, 80.0], (640, 480)), None);
/// let corners = warning_of_box([300.0, 200.0, 390.0, 280.0], (640, 480));
/// assert!(matches!(corners, Some(Warning::Box { .. })));
/// assert!(warning_of_box([0.4, 0.3, 0.1, 0.2], (640, 480)).is_some());
/// ```
#[must_use]
pub fn warning_of_box([x, y, w, h]: [f64; 4], (width, height): (u32, u32)) -> Option<Warning> {
    let (right, bottom) = (x + w, y + h);
    let is_outside = right > f64::from(width) + 0.1 * w || bottom > f64::from(height) + 0.1 * h;
    let is_tiny = right <= 1.0 && bottom <= 1.0;
    (is_outside || is_tiny).then_some(Warning::Box {
        right,
        bottom,
        width,
        height,
    })
}
