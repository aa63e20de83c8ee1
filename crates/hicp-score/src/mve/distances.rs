//! Distances to the border of a mask.

/// Returns the distance of each cell to the nearest one outside the mask, and inside it, in pixels.
///
/// The cells are rows of `width` and `step` pixels apart. A distance is infinite if there is no
/// such cell. The error of this two-pass transform is at most 8 %.
pub(crate) fn to_border(masked: &[bool], width: usize, step: f32) -> Vec<[f32; 2]> {
    const FAR: [f32; 2] = [f32::INFINITY; 2];
    let diagonal = std::f32::consts::SQRT_2 * step;
    let start = masked
        .iter()
        .map(|on| if *on { [FAR[0], 0.0] } else { [0.0, FAR[0]] });
    let mut distances: Vec<[f32; 2]> = start.collect();
    let mut above = vec![FAR; width + 2];
    // The second pass is the first one, from the last cell to the first.
    for _ in 0..2 {
        above.fill(FAR);
        for row in distances.chunks_exact_mut(width) {
            for (cell, above) in row.iter_mut().zip(above.windows(3)) {
                for side in 0..2 {
                    let corner = least(above[0][side], above[2][side]) + diagonal;
                    cell[side] = least(cell[side], least(above[1][side] + step, corner));
                }
            }
            // The two sides are independent, so one does not wait for the other.
            let mut before = FAR;
            for cell in row.iter_mut() {
                for (before, cell) in before.iter_mut().zip(cell) {
                    *before = least(*cell, *before + step);
                    *cell = *before;
                }
            }
            above[1..=width].copy_from_slice(row);
        }
        distances.reverse();
    }
    distances
}

/// Returns the smaller number; neither is NaN.
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
