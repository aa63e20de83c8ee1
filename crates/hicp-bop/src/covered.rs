//! The pixels that a rendered model covers.

use hybrid_icp::core::RenderedView;

/// Returns the pixels of the image that a rendered model covers, row by row.
pub fn covered_pixels(view: &RenderedView) -> impl Iterator<Item = (u32, u32)> {
    let region = view.region();
    let columns = region.u_min..region.u_max;
    let pixels =
        (region.v_min..region.v_max).flat_map(move |v| columns.clone().map(move |u| (u, v)));
    let covered = pixels.zip(view.depth()).filter(|(_, z)| **z > 0.0);
    covered.map(|(pixel, _)| pixel)
}
