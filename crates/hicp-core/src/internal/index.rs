//! Indices of pixels, points and triangles.

/// Returns an index as the `u32` that buffers hold.
///
/// Images, meshes and samples have fewer than 2³² elements, checked on creation. An index that does
/// not fit is therefore a broken invariant of this library, and not a condition of the data.
#[must_use]
#[inline]
pub fn index(index: usize) -> u32 {
    let Ok(index) = u32::try_from(index) else {
        unreachable!("index {index} is beyond the limits of images and meshes");
    };
    index
}
