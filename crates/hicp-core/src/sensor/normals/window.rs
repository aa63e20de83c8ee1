//! Plane fits over sliding windows, one row at a time.
//!
//! Sums over the window's rows are kept per column, each in a separate array. The windows of a row
//! are differences of those sums, accumulated along the row. Several pixels are fitted at once.

use std::ops::Range;

use super::lanes::Lanes;
use super::patch::{DepthPatch, MIN_DEPTH_METERS};
use crate::internal::{VectorLoop, vectorized};

/// Smallest number of pixels that determine a plane.
// Open: fewest pixels of a normal of C: §III-A. Twice the unknowns of a plane; a pixel with fewer
// leaves C.
const MIN_SUPPORT: f64 = 6.0;
/// Number of pixels fitted at once.
const LANES: usize = 8;

/// Sums over the window's rows, one per column: n, Σv, Σv², Σw, Σvw with w = 1/z.
///
/// Columns of zeros on both sides represent the outside of the patch.
pub(super) struct ColumnSums {
    n: Vec<f64>,
    v: Vec<f64>,
    vv: Vec<f64>,
    w: Vec<f64>,
    vw: Vec<f64>,
    width: usize,
    radius: usize,
    /// 1/z of the window's rows, so that the removed bits equal the added ones. Row r is stored at
    /// r modulo the number of rows.
    inverse: Vec<f64>,
    /// The columns that those rows use.
    spans: Vec<Range<usize>>,
}

impl ColumnSums {
    pub(super) fn new(width: usize, radius: usize) -> Self {
        let rows = 2 * radius + 1;
        // A block of lanes may start at the last column.
        let columns = || vec![0.0; width + 2 * (radius + 1) + LANES];
        Self {
            n: columns(),
            v: columns(),
            vv: columns(),
            w: columns(),
            vw: columns(),
            width,
            radius,
            inverse: vec![0.0; width * rows],
            spans: vec![0..0; rows],
        }
    }

    /// Adds the next row to the window (`None` below the patch) and removes the row that leaves it.
    ///
    /// A row comes with the columns that it uses.
    pub(super) fn slide(&mut self, entering: usize, row: Option<(&Range<usize>, &[f32])>) {
        let slot = entering % self.spans.len();
        let leaving = std::mem::replace(&mut self.spans[slot], 0..0);
        if !leaving.is_empty() {
            let v = entering as f64 - self.spans.len() as f64;
            let (inverse, sums) = self.columns(slot, &leaving);
            vectorized(SlideOut { inverse, sums, v });
        }
        let Some((span, depth)) = row else { return };
        if !span.is_empty() {
            let depth = &depth[span.clone()];
            let (inverse, sums) = self.columns(slot, span);
            vectorized(SlideIn {
                depth,
                inverse,
                sums,
                v: entering as f64,
            });
        }
        self.spans[slot] = span.clone();
    }

    /// Returns the inverse depths of a kept row and the sums n, v, vv, w, vw in `span`.
    /// `span`.
    fn columns(&mut self, slot: usize, span: &Range<usize>) -> (&mut [f64], [&mut [f64]; 5]) {
        let kept = slot * self.width;
        let first = self.radius + 1;
        let sums = [
            &mut self.n,
            &mut self.v,
            &mut self.vv,
            &mut self.w,
            &mut self.vw,
        ];
        (
            &mut self.inverse[kept + span.start..kept + span.end],
            sums.map(|sums| &mut sums[first + span.start..first + span.end]),
        )
    }
}

/// The loop that removes a row from the window.
struct SlideOut<'a> {
    inverse: &'a [f64],
    sums: [&'a mut [f64]; 5],
    v: f64,
}

impl VectorLoop for SlideOut<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let [n, v, vv, w, vw] = self.sums;
        add_row(self.inverse, n, v, vv, w, vw, self.v, -1.0);
    }
}

/// The loop that adds a row to the window.
struct SlideIn<'a> {
    depth: &'a [f32],
    inverse: &'a mut [f64],
    sums: [&'a mut [f64]; 5],
    v: f64,
}

impl VectorLoop for SlideIn<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (inverse, z) in self.inverse.iter_mut().zip(self.depth) {
            let w = 1.0 / f64::from(*z);
            *inverse = if *z >= MIN_DEPTH_METERS { w } else { 0.0 };
        }
        let [n, v, vv, w, vw] = self.sums;
        add_row(self.inverse, n, v, vv, w, vw, self.v, 1.0);
    }
}

/// Adds a row of inverse depths to the sums, or removes it if the sign is −1.
///
/// The slices have one length.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // Parameters let the compiler assume no overlap.
fn add_row(
    inverse: &[f64],
    n: &mut [f64],
    v: &mut [f64],
    vv: &mut [f64],
    w: &mut [f64],
    vw: &mut [f64],
    row: f64,
    sign: f64,
) {
    let len = inverse.len();
    let (n, v, vv) = (&mut n[..len], &mut v[..len], &mut vv[..len]);
    let (w, vw) = (&mut w[..len], &mut vw[..len]);
    for u in 0..len {
        let inverse = inverse[u];
        let one = if inverse > 0.0 { sign } else { 0.0 };
        let signed = inverse * sign;
        n[u] += one;
        v[u] += one * row;
        vv[u] += one * (row * row);
        w[u] += signed;
        vw[u] += signed * row;
    }
}

/// The sums of several windows, one per lane: n, Σu, Σv, Σu², Σuv, Σv², Σw, Σuw, Σvw.
type Sums = [[f64; LANES]; 9];

/// The fits of a row.
#[derive(Default)]
pub(super) struct RowFits {
    /// Unit normals that face the camera; zero where there is none.
    pub(super) normals: Vec<[f32; 3]>,
    blocks: Vec<Sums>,
}

impl RowFits {
    /// Fits the windows around the pixels of row `v` in the columns of `span`.
    pub(super) fn fit(
        &mut self,
        columns: &ColumnSums,
        rays: &Rays,
        v: usize,
        span: Range<usize>,
        depth: &[f32],
    ) {
        let blocks = span.len().div_ceil(LANES);
        self.blocks.resize(blocks, [[0.0; LANES]; 9]);
        self.normals.resize(blocks * LANES, [0.0; 3]);
        vectorized(Fit {
            columns,
            rays,
            v,
            first: span.start,
            blocks: &mut self.blocks,
            normals: &mut self.normals,
        });
        self.normals.truncate(span.len());
        for (normal, z) in self.normals.iter_mut().zip(&depth[span]) {
            if *z < MIN_DEPTH_METERS {
                *normal = [0.0; 3];
            }
        }
    }
}

/// The loop that fits the windows around a row's pixels from column `first` on.
struct Fit<'a> {
    columns: &'a ColumnSums,
    rays: &'a Rays,
    v: usize,
    first: usize,
    blocks: &'a mut [Sums],
    normals: &'a mut [[f32; 3]],
}

impl Fit<'_> {
    /// Computes the change of the sums when each window moves right by one pixel.
    #[inline(always)]
    fn differences(&mut self) {
        let (columns, radius) = (self.columns, self.columns.radius);
        for (block, from) in self.blocks.iter_mut().zip((self.first..).step_by(LANES)) {
            // Column from + radius, and from − radius − 1. The zeros on the left place the latter
            // at index `from`.
            let (gained, lost) = (from + 2 * radius + 1, from);
            let sums = [&columns.n, &columns.v, &columns.vv, &columns.w, &columns.vw];
            let [gn, gv, gvv, gw, gvw] = sums.map(|sums| Lanes::of(sums, gained));
            let [ln, lv, lvv, lw, lvw] = sums.map(|sums| Lanes::of(sums, lost));
            let mut g = Lanes::all((from + radius) as f64);
            let mut l = Lanes::all(from as f64 - radius as f64 - 1.0);
            for lane in 0..LANES {
                g.0[lane] += lane as f64;
                l.0[lane] += lane as f64;
            }
            *block = [
                gn - ln,
                g * gn - l * ln,
                gv - lv,
                g * g * gn - l * l * ln,
                g * gv - l * lv,
                gvv - lvv,
                gw - lw,
                g * gw - l * lw,
                gvw - lvw,
            ]
            .map(|difference| difference.0);
        }
    }

    /// Returns the sums of the window around the pixel before the first one.
    #[inline(always)]
    fn window_before(&self) -> [f64; 9] {
        let (columns, radius) = (self.columns, self.columns.radius);
        let mut window = [0.0; 9];
        for index in self.first..self.first + 2 * radius + 1 {
            let u = index as f64 - radius as f64 - 1.0;
            let (n, v, w) = (columns.n[index], columns.v[index], columns.w[index]);
            let (vv, vw) = (columns.vv[index], columns.vw[index]);
            let column = [n, u * n, v, u * u * n, u * v, vv, w, u * w, vw];
            for (sum, column) in window.iter_mut().zip(column) {
                *sum += column;
            }
        }
        window
    }
}

impl VectorLoop for Fit<'_> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        self.differences();
        let mut window = self.window_before();
        for block in self.blocks.iter_mut() {
            for lane in 0..LANES {
                for (sum, lanes) in window.iter_mut().zip(block.iter_mut()) {
                    *sum += lanes[lane];
                    lanes[lane] = *sum;
                }
            }
        }
        let y = self.rays.y[self.v];
        let fits = self.blocks.iter().zip(self.normals.chunks_exact_mut(LANES));
        for ((block, normals), from) in fits.zip((self.first..).step_by(LANES)) {
            let mut u = Lanes::all(from as f64);
            for (lane, u) in u.0.iter_mut().enumerate() {
                *u += lane as f64;
            }
            let x = Lanes::of(&self.rays.x, from);
            let fit = plane_fit(block.map(Lanes), self.rays, u, self.v as f64, x, y);
            let [x, y, z] = fit.map(Lanes::single);
            for (lane, normal) in normals.iter_mut().enumerate() {
                *normal = [x[lane], y[lane], z[lane]];
            }
        }
    }
}

/// Fits 1/z = w₀ + b (u−u₀) + c (v−v₀) and returns its normal at pixel (u₀, v₀).
///
/// The normal faces the camera, and is zero if the fit is not determined. With x = (u−cx)/fx and
/// n·X = d on the plane, n·(x, y, 1) = d/z, so n ∝ (b fx, c fy, w₀ − x b fx − y c fy).
#[inline(always)]
fn plane_fit<const N: usize>(
    sums: [Lanes<N>; 9],
    rays: &Rays,
    u0: Lanes<N>,
    v0: f64,
    x: Lanes<N>,
    y: f64,
) -> [Lanes<N>; 3] {
    let [n, u, v, uu, uv, vv, w, uw, vw] = sums;
    let [v0, y, fx, fy] = [v0, y, rays.fx, rays.fy].map(Lanes::all);
    // Central moments times n: integers except for those with w, and without a division.
    let suu = n * uu - u * u;
    let suv = n * uv - u * v;
    let svv = n * vv - v * v;
    let suw = n * uw - u * w;
    let svw = n * vw - v * w;
    let determinant = suu * svv - suv * suv;
    // b, c and w₀ times n · determinant: only their ratios matter.
    let b = suw * svv - svw * suv;
    let c = svw * suu - suw * suv;
    let w0 = w * determinant + b * (n * u0 - u) + c * (n * v0 - v);
    let (nx, ny) = (n * b * fx, n * c * fy);
    let nz = w0 - x * nx - y * ny;
    // Finite: within the limits of cameras and fitted depths, the squares stay below 1e90.
    let norm = (nx * nx + ny * ny + nz * nz).map(f64::sqrt);
    let scale = norm.map(|norm| -1.0 / norm);
    let mut normal = [nx * scale, ny * scale, nz * scale];
    for lane in 0..N {
        let fitted = (n.0[lane] >= MIN_SUPPORT)
            // Pixels on one line do not determine a plane. The determinant is an integer, so it is
            // exactly 0 then.
            & (determinant.0[lane] > 0.0)
            & (w0.0[lane] > 0.0);
        for component in &mut normal {
            component.0[lane] = if fitted { component.0[lane] } else { 0.0 };
        }
    }
    normal
}

/// The sums of one window in the order of [`Sums`], with columns and rows relative to its corner.
#[derive(Clone, Copy)]
pub(super) struct WindowSums([f64; 9]);

impl WindowSums {
    /// Sums columns, given by n, Σv, Σv², Σw and Σvw of each.
    #[inline(always)]
    pub(super) fn of_columns<const N: usize>(
        n: &[u32; N],
        v: &[u32; N],
        vv: &[u32; N],
        w: &[f64; N],
        vw: &[f64; N],
    ) -> Self {
        let (mut counts, mut sums) = ([0_u32; 6], [0.0; 3]);
        for (u, column) in (0_u32..).zip(0..N) {
            let terms = [
                n[column],
                u * n[column],
                v[column],
                u * u * n[column],
                u * v[column],
                vv[column],
            ];
            for (sum, term) in counts.iter_mut().zip(terms) {
                *sum += term;
            }
            let terms = [w[column], f64::from(u) * w[column], vw[column]];
            for (sum, term) in sums.iter_mut().zip(terms) {
                *sum += term;
            }
        }
        let [n, u, v, uu, uv, vv] = counts.map(f64::from);
        let [w, uw, vw] = sums;
        Self([n, u, v, uu, uv, vv, w, uw, vw])
    }

    /// Returns the normal at pixel (u, v), which lies at `at` in the window.
    ///
    /// It faces the camera, and is zero if there is none.
    #[inline(always)]
    pub(super) fn normal(
        self,
        rays: &Rays,
        (u, v): (usize, usize),
        at: (usize, usize),
    ) -> [f32; 3] {
        let (x, y) = (Lanes([rays.x[u]]), rays.y[v]);
        let sums = self.0.map(|sum| Lanes([sum]));
        let fit = plane_fit(sums, rays, Lanes([at.0 as f64]), at.1 as f64, x, y);
        fit.map(|component| component.single()[0])
    }
}

/// Ray slopes (x/z, y/z) of the region's columns and rows.
pub(super) struct Rays {
    fx: f64,
    fy: f64,
    /// Followed by as many zeros as there are lanes.
    x: Vec<f64>,
    y: Vec<f64>,
}

impl Rays {
    pub(super) fn new(patch: &DepthPatch<'_>) -> Self {
        let (camera, region) = (patch.camera, patch.region);
        let columns =
            (region.u_min..region.u_max).map(|u| (f64::from(u) - camera.cx()) / camera.fx());
        Self {
            fx: camera.fx(),
            fy: camera.fy(),
            x: columns.chain([0.0; LANES]).collect(),
            y: (region.v_min..region.v_max)
                .map(|v| (f64::from(v) - camera.cy()) / camera.fy())
                .collect(),
        }
    }
}
