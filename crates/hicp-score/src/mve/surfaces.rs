//! The surfaces in an imperfect mask, separated by steps in depth.

use hicp_core::internal::DisjointSets;

use crate::mve::cells::Cells;

/// Share of its contact with the border of the mask over which another object continues.
const CONTINUES: f32 = 0.5;
/// Smallest share of the cells that the other surfaces must have.
const LEAST_KEPT: f32 = 0.15;
/// Smallest share of these that a surface needs to gain trust.
const LEAST_SURFACE: f32 = 0.1;

/// The number of cells of a surface, of its contacts with the border of the mask, and of those over
/// which it continues.
#[derive(Clone, Copy, Default)]
struct Surface {
    cells: f32,
    contacts: f32,
    crossings: f32,
}

impl Surface {
    fn continues(&self) -> bool {
        self.crossings > CONTINUES * self.contacts
    }
}

/// Corrects the trust in cells by the surfaces that they belong to.
///
/// `stands_out` is the certainty that a cell does not show the background, and surfaces end at a
/// `step` in depth, meters. A surface that continues outside the mask is another object and loses
/// its trust. If the others are small, the mask is too small instead, and nothing changes. The
/// border of a box is not that of the object, so the others are then trusted up to the border.
///
/// Cost: O(cells).
pub(crate) fn trust_surfaces(
    trust: &mut [f32],
    cells: &Cells,
    stands_out: impl Fn(usize) -> f32,
    step: f32,
) {
    let Cells { masked, depths, .. } = cells;
    // NaN is connected to nothing.
    let shown: Vec<f32> = (0..masked.len())
        .map(|cell| {
            if stands_out(cell) > 0.5 {
                depths[cell]
            } else {
                f32::NAN
            }
        })
        .collect();
    let connected = |a: usize, b: usize| (shown[a] - shown[b]).abs() < step;
    let mut parts = DisjointSets::new(vec![0; masked.len()]);
    cells.for_pairs(|a, b| {
        if connected(a, b) & masked[a] & masked[b] {
            parts.join(a, b);
        }
    });
    let mut surfaces = vec![Surface::default(); masked.len()];
    let in_mask = || (0..masked.len()).filter(|cell| masked[*cell] & !shown[*cell].is_nan());
    let mut all = 0.0;
    for cell in in_mask() {
        surfaces[parts.find(cell)].cells += 1.0;
        all += 1.0;
    }
    cells.for_pairs(|a, b| {
        let inner = if masked[a] { a } else { b };
        if masked[a] != masked[b] && !shown[inner].is_nan() {
            let surface = &mut surfaces[parts.find(inner)];
            surface.contacts += 1.0;
            surface.crossings += f32::from(u8::from(connected(a, b)));
        }
    });
    let ending = surfaces.iter().filter(|surface| !surface.continues());
    let kept: f32 = ending.map(|surface| surface.cells).sum();
    if kept <= LEAST_KEPT * all {
        return;
    }
    let boxed = cells.mask_is_box();
    for cell in in_mask() {
        let surface = surfaces[parts.find(cell)];
        if surface.continues() {
            trust[cell] = 0.0;
        } else if boxed && surface.cells > LEAST_SURFACE * kept {
            trust[cell] = trust[cell].max(stands_out(cell));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 12;

    /// Returns the trust in a row of cells, all of them first trusted by a half.
    ///
    /// The letters are surfaces, at least a meter apart; a dot is background. The mask is a box in
    /// all rows, but for their ends. If it is not `boxed`, a cell is missing in the last row.
    fn trust(row: &str, boxed: bool) -> Vec<f32> {
        let letters = row.bytes().cycle().take(8 * WIDTH);
        let depths: Vec<f32> = letters.map(f32::from).collect();
        let inner = |cell: usize| (1..WIDTH - 1).contains(&(cell % WIDTH));
        let mut masked: Vec<bool> = (0..depths.len()).map(inner).collect();
        masked[8 * WIDTH - 2] = boxed;
        let cells = Cells {
            width: WIDTH,
            step: 1,
            masked,
            depths: depths.clone(),
        };
        let mut trust = vec![0.5; depths.len()];
        let stands_out = |cell: usize| f32::from(u8::from(depths[cell] != f32::from(b'.')));
        trust_surfaces(&mut trust, &cells, stands_out, 0.5);
        trust[..WIDTH].to_vec()
    }

    #[test]
    fn a_surface_that_continues_outside_the_mask_loses_its_trust() {
        for (boxed, kept) in [(true, 1.0), (false, 0.5)] {
            let found = trust("..AAAAAaabbb", boxed);
            assert_eq!(found[2..7], [kept; 5]);
            assert_eq!(found[9..11], [0.0; 2]);
            // Cells of the background and outside the mask stay.
            assert_eq!([found[0], found[1], found[11]], [0.5; 3]);
        }
    }

    #[test]
    fn nothing_changes_if_every_surface_continues() {
        assert_eq!(trust("AAAAAAAAAAAA", true), [0.5; WIDTH]);
        assert_eq!(trust("AAAAAABBBBBB", true), [0.5; WIDTH]);
    }
}
