//! Distances to the nearest zero of a grid.

/// Replaces infinite values by the distances, in pixels, to the nearest zero.
///
/// The values are `step` pixels apart. The error of this two-pass transform is at most 8 %.
pub(crate) fn to_zero(distances: &mut [f32], width: usize, step: f32) {
    let diagonal = std::f32::consts::SQRT_2 * step;
    // The second pass is the first one, from the last pixel to the first.
    for _ in 0..2 {
        for index in 0..distances.len() {
            let column = index % width;
            let mut least = distances[index];
            if column > 0 {
                least = least.min(distances[index - 1] + step);
            }
            if index >= width {
                least = least.min(distances[index - width] + step);
                if column > 0 {
                    least = least.min(distances[index - width - 1] + diagonal);
                }
                if column + 1 < width {
                    least = least.min(distances[index - width + 1] + diagonal);
                }
            }
            distances[index] = least;
        }
        distances.reverse();
    }
}
