//! Plane fits over windows, several pixels of a row at a time.
//!
//! Sums over the window's rows are kept per column and slide down with the window. The sums of a
//! window add up its columns, with places relative to its center. If all pixels of a window are
//! used, most of them are known in advance.

use std::ops::Range;

use super::lanes::{LANES, Lanes, lanes};
use super::patch::{DepthPatch, MIN_FITTED_METERS};
use super::plane_fits::{PlaneFits, surfel_of};
use super::row::Row;
use crate::internal::{VectorLoop, vectorized};
use crate::surfel::Surfel;

/// Sums over the window's rows, one per column: n, Σv, Σv², Σw, Σvw with w = 1/z.
///
/// Zeros on both sides stand for the outside of the patch. The rows v of n, Σv and Σv² are relative
/// to the window's center: small integers, exact in single precision.
pub(super) struct ColumnSums {
    n: Vec<f32>,
    v: Vec<f32>,
    vv: Vec<f32>,
    w: Vec<f64>,
    vw: Vec<f64>,
    width: usize,
    radius: usize,
    /// 1/z of the window's rows, so that the removed bits equal the added ones. Row r is stored at
    /// r modulo the number of rows.
    inverse: Vec<f64>,
    /// A row without depth.
    nothing: Vec<f32>,
}

impl ColumnSums {
    pub(super) fn new(width: usize, radius: usize) -> Self {
        // A block of lanes may start at the last column.
        let columns = width + 2 * radius + LANES;
        Self {
            n: vec![0.0; columns],
            v: vec![0.0; columns],
            vv: vec![0.0; columns],
            w: vec![0.0; columns],
            vw: vec![0.0; columns],
            width,
            radius,
            inverse: vec![0.0; width * (2 * radius + 1)],
            nothing: vec![0.0; width],
        }
    }

    /// Moves the window down: row `entering` of the patch enters, and the last one leaves.
    ///
    /// Rows outside the patch are empty. `spans` are the columns that each row uses.
    pub(super) fn slide(
        &mut self,
        entering: usize,
        patch: &DepthPatch<'_>,
        spans: &[Range<usize>],
    ) {
        let side = 2 * self.radius + 1;
        let rows = entering.saturating_sub(side)..(entering + 1).min(spans.len());
        let used = spans[rows].iter().filter(|span| !span.is_empty());
        let Some(range) = used
            .cloned()
            .reduce(|a, b| a.start.min(b.start)..a.end.max(b.end))
        else {
            return;
        };
        let row = |v: Option<usize>| {
            let v = v.filter(|v| *v < spans.len());
            &v.map_or(&self.nothing[..], |v| patch.row(v))[range.clone()]
        };
        let leaving = entering.checked_sub(side);
        let kept = entering % side * self.width;
        let columns = self.radius + range.start..self.radius + range.end;
        vectorized(Slide {
            rows: [row(Some(entering)), row(leaving)],
            at: [entering as f64, entering as f64 - side as f64],
            radius: self.radius as f32,
            inverse: &mut self.inverse[kept + range.start..kept + range.end],
            n: &mut self.n[columns.clone()],
            v: &mut self.v[columns.clone()],
            vv: &mut self.vv[columns.clone()],
            w: &mut self.w[columns.clone()],
            vw: &mut self.vw[columns],
        });
    }
}

/// The loop that adds a row to the columns of the window and removes another.
struct Slide<'a> {
    /// The depth of the added and of the removed row.
    rows: [&'a [f32]; 2],
    /// Their places.
    at: [f64; 2],
    radius: f32,
    /// 1/z of the removed row, and afterwards of the added one.
    inverse: &'a mut [f64],
    n: &'a mut [f32],
    v: &'a mut [f32],
    vv: &'a mut [f32],
    w: &'a mut [f64],
    vw: &'a mut [f64],
}

impl VectorLoop for Slide<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        slide_places(self.rows, self.radius, self.n, self.v, self.vv);
        slide_inverse(self.rows, self.at, self.inverse, self.w, self.vw);
    }
}

/// Slides n, Σv and Σv². The slices have one length.
#[inline(always)]
fn slide_places(
    [added, removed]: [&[f32]; 2],
    radius: f32,
    n: &mut [f32],
    v: &mut [f32],
    vv: &mut [f32],
) {
    let len = added.len();
    let (removed, n) = (&removed[..len], &mut n[..len]);
    let (v, vv) = (&mut v[..len], &mut vv[..len]);
    let one = |z: f32| if z >= MIN_FITTED_METERS { 1.0 } else { 0.0 };
    // Relative to the new center, one row below the last one.
    let (new, old) = (radius, -radius - 1.0);
    for u in 0..len {
        let (add, remove) = (one(added[u]), one(removed[u]));
        vv[u] = vv[u] - 2.0 * v[u] + n[u] + add * (new * new) - remove * (old * old);
        v[u] = v[u] - n[u] + add * new - remove * old;
        n[u] = n[u] + add - remove;
    }
}

/// Slides Σw and Σvw. The slices have one length.
#[inline(always)]
fn slide_inverse(
    [added, removed]: [&[f32]; 2],
    [new, old]: [f64; 2],
    inverse: &mut [f64],
    w: &mut [f64],
    vw: &mut [f64],
) {
    let len = added.len();
    let (removed, inverse) = (&removed[..len], &mut inverse[..len]);
    let (w, vw) = (&mut w[..len], &mut vw[..len]);
    for u in 0..len {
        let quotient = 1.0 / f64::from(added[u]);
        let is_removed = removed[u] >= MIN_FITTED_METERS;
        let add = if added[u] >= MIN_FITTED_METERS {
            quotient
        } else {
            0.0
        };
        let remove = if is_removed { inverse[u] } else { 0.0 };
        inverse[u] = add;
        w[u] = w[u] + add - remove;
        vw[u] = vw[u] + add * new - remove * old;
    }
}

/// The loop that fits the windows around the pixels of a row in the columns of `span`.
///
/// Windows with unused pixels are only summed, and added to `fits`.
pub(super) struct Fit<'a, 'b> {
    pub(super) columns: &'a ColumnSums,
    pub(super) span: Range<usize>,
    pub(super) fits: &'a mut PlaneFits,
    pub(super) row: &'a mut Row<'b>,
}

impl VectorLoop for Fit<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for from in self.span.clone().step_by(LANES) {
            let n = LANES.min(self.span.end - from);
            let sums = self.inverse_sums(from);
            if self.is_full(from) {
                let block = self.full_block(from, sums);
                let surfels = &mut self.row.surfels[from..from + n];
                for (to, surfel) in surfels.iter_mut().zip(block) {
                    *to = surfel;
                }
            } else {
                self.fits.push_block(from, n, self.places(from), sums);
                if self.fits.is_full() {
                    self.fits.solve(self.row);
                }
            }
        }
    }
}

impl Fit<'_, '_> {
    /// Returns whether the windows of a block use every pixel.
    #[inline(always)]
    fn is_full(&self, from: usize) -> bool {
        let side = 2 * self.columns.radius + 1;
        let full = (side as f32).to_bits();
        let mut differ = [0; LANES];
        // The last block overlaps the one before.
        for k in 0..side.div_ceil(LANES) + 1 {
            let n = lanes(&self.columns.n, from + (k * LANES).min(side - 1));
            for (differ, n) in differ.iter_mut().zip(n.0) {
                *differ |= n.to_bits() ^ full;
            }
        }
        differ == [0; LANES]
    }

    /// Returns Σw, Σuw and Σvw of the windows from a column on, relative to their centers.
    #[inline(always)]
    fn inverse_sums(&self, from: usize) -> [Lanes<f64>; 3] {
        let (columns, radius) = (self.columns, self.columns.radius);
        let center = from + radius;
        let mut w = lanes(&columns.w, center);
        let mut vw = lanes(&columns.vw, center);
        let mut uw = Lanes::all(0.0);
        for k in 1..=radius {
            let right = lanes(&columns.w, center + k);
            let left = lanes(&columns.w, center - k);
            w = w + (left + right);
            uw = uw + (right - left) * Lanes::all(k as f64);
            let right = lanes(&columns.vw, center + k);
            vw = vw + (lanes(&columns.vw, center - k) + right);
        }
        [w, uw, vw - w * Lanes::all(self.row.v as f64)]
    }

    /// Returns the surfels of windows in which every pixel is used, given Σw, Σuw and Σvw.
    ///
    /// Then n = side², Σu = Σv = Σuv = 0, and Σu² = Σv² = n r (r + 1)/3.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)] // Surfels are of single precision.
    fn full_block(&self, from: usize, [w, b, c]: [Lanes<f64>; 3]) -> [Surfel; LANES] {
        let (rays, v) = (self.row.rays, self.row.v);
        let radius = self.columns.radius as f64;
        let (x, y) = (lanes(&rays.x, from), rays.y[v]);
        // The plane's w₀, b and c of `PlaneFits::solve`, times Σu².
        let w0 = w * Lanes::all(radius * (radius + 1.0) / 3.0);
        let (nx, ny) = (b * Lanes::all(rays.fx), c * Lanes::all(rays.fy));
        let nz = w0 - x * nx - Lanes::all(y) * ny;
        // Finite: depths from 1e-4 to 1000 m and focal lengths up to 1e9 pixels keep the squares
        // between 1e-8 and 1e30.
        let [nx, ny, nz] = [nx.single(), ny.single(), nz.single()];
        let scale = (nx * nx + ny * ny + nz * nz).map(|squared| -1.0 / squared.sqrt());
        let [nx, ny, nz] = [nx * scale, ny * scale, nz * scale];
        let z = self.row.patch.block(from, v);
        let (x, y) = (x.single() * z, Lanes::all(y as f32) * z);
        let mut surfels = [Surfel::NOTHING; LANES];
        for (lane, surfel) in surfels.iter_mut().enumerate() {
            *surfel = surfel_of([x, y, z, nx, ny, nz].map(|part| part.0[lane]));
        }
        surfels
    }

    /// Returns n, Σu, Σv, Σu², Σuv and Σv² of the windows from a column on, relative to their
    /// centers.
    #[inline(always)]
    fn places(&self, from: usize) -> [Lanes<f64>; 6] {
        let (columns, radius) = (self.columns, self.columns.radius);
        let center = from + radius;
        let mut n = lanes(&columns.n, center);
        let mut v = lanes(&columns.v, center);
        let mut vv = lanes(&columns.vv, center);
        let (mut u, mut uu, mut uv) = (Lanes::all(0.0), Lanes::all(0.0), Lanes::all(0.0));
        for k in 1..=radius {
            let away = Lanes::all(k as f32);
            let (left, right) = (lanes(&columns.n, center - k), lanes(&columns.n, center + k));
            let both = left + right;
            n = n + both;
            u = u + (right - left) * away;
            uu = uu + both * (away * away);
            let (left, right) = (lanes(&columns.v, center - k), lanes(&columns.v, center + k));
            v = v + (left + right);
            uv = uv + (right - left) * away;
            vv = vv + (lanes(&columns.vv, center - k) + lanes(&columns.vv, center + k));
        }
        [
            n.double(),
            u.double(),
            v.double(),
            uu.double(),
            uv.double(),
            vv.double(),
        ]
    }
}
