//! Distances to the border of a mask.

/// Returns the distance of each cell to the nearest one outside the mask, and inside it, in pixels.
///
/// The cells are rows of `width` and `step` pixels apart. A distance is infinite if there is no
/// such cell. The error of this two-pass transform is at most 8 %.
pub(crate) fn to_border(masked: &[bool], width: usize, step: f32) -> Vec<[f32; 2]> {
    const FAR: f32 = f32::INFINITY;
    let diagonal = std::f32::consts::SQRT_2 * step;
    let start = masked
        .iter()
        .map(|on| if *on { [FAR, 0.0] } else { [0.0, FAR] });
    let mut distances: Vec<[f32; 2]> = start.collect();
    let mut above = vec![[FAR; 2]; width + 2];
    // The second pass is the first one, from the last cell to the first.
    for _ in 0..2 {
        above.fill([FAR; 2]);
        for row in distances.chunks_exact_mut(width) {
            for (cell, above) in row.iter_mut().zip(above.windows(3)) {
                for side in 0..2 {
                    let corner = least(above[0][side], above[2][side]) + diagonal;
                    cell[side] = least(cell[side], least(above[1][side] + step, corner));
                }
            }
            // The two sides are independent, so one does not wait for the other.
            let mut before = [FAR; 2];
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_to_the_nearest_cell_of_the_other_kind() {
        let (width, step) = (17, 3.0);
        let place = |cell: usize| [cell % width, cell / width].map(|x| x as f32);
        let masked: Vec<bool> = (0..17 * 11).map(|cell| cell * cell % 23 < 3).collect();
        let found = to_border(&masked, width, step);
        for (cell, distances) in found.iter().enumerate() {
            for (distance, kind) in distances.iter().zip([false, true]) {
                let cells = (0..masked.len()).filter(|other| masked[*other] == kind);
                let exact = cells.map(|other| {
                    let ([a, b], [c, d]) = (place(cell), place(other));
                    step * (a - c).hypot(b - d)
                });
                let exact = exact.fold(f32::INFINITY, f32::min);
                let range = 0.999 * exact..=1.083 * exact;
                assert!(range.contains(distance), "{cell}: {distance}, {exact}");
            }
        }
        assert_eq!(to_border(&[true; 6], 3, 1.0), [[f32::INFINITY, 0.0]; 6]);
    }
}
