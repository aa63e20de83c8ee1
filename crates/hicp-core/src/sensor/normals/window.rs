//! Plane fits over windows, several pixels of a row at a time.
//!
//! Sums over the window's rows are kept per column and slide down with the window. The sums of a
//! window add up its columns, with places relative to its center. If all pixels of a window are
//! used, most of them are known in advance.

use std::ops::Range;

use super::lanes::Lanes;
use super::patch::{DepthPatch, MIN_DEPTH_METERS};
use crate::internal::{VectorLoop, vectorized};
use crate::surfel::Surfel;
use nalgebra::{Point3, UnitVector3, Vector3};

/// Smallest number of pixels that determine a plane.
// Open: fewest pixels of a normal of C: §III-A. Twice the unknowns of a plane; a pixel with fewer
// leaves C.
const MIN_SUPPORT: f64 = 6.0;
/// Number of pixels fitted at once.
const LANES: usize = 8;

/// Sums over the window's rows, one per column: n, Σv, Σv², Σw, Σvw with w = 1/z.
///
/// Zeros on both sides stand for the outside of the patch. Σv and Σv² wrap around: only sums
/// relative to the window's center are read, which are small.
pub(super) struct ColumnSums {
    n: Vec<i32>,
    v: Vec<i32>,
    vv: Vec<i32>,
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
            n: vec![0; columns],
            v: vec![0; columns],
            vv: vec![0; columns],
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
        let used = |v: Option<usize>| {
            let span = v.and_then(|v| spans.get(v));
            span.filter(|span| !span.is_empty()).cloned()
        };
        let leaving = entering.checked_sub(side);
        let (added, removed) = (used(Some(entering)), used(leaving));
        let range = match (&added, &removed) {
            (Some(a), Some(r)) => a.start.min(r.start)..a.end.max(r.end),
            (Some(one), None) | (None, Some(one)) => one.clone(),
            (None, None) => return,
        };
        let row = |is_used: bool, v: usize| {
            let row = if is_used { patch.row(v) } else { &self.nothing };
            &row[range.clone()]
        };
        let kept = entering % side * self.width;
        let columns = self.radius + range.start..self.radius + range.end;
        #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // Sides of images.
        vectorized(Slide {
            rows: [
                row(added.is_some(), entering),
                row(removed.is_some(), leaving.unwrap_or(0)),
            ],
            at: [entering as i32, entering as i32 - side as i32],
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
    at: [i32; 2],
    /// 1/z of the removed row, and afterwards of the added one.
    inverse: &'a mut [f64],
    n: &'a mut [i32],
    v: &'a mut [i32],
    vv: &'a mut [i32],
    w: &'a mut [f64],
    vw: &'a mut [f64],
}

impl VectorLoop for Slide<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        slide_places(self.rows, self.at, self.n, self.v, self.vv);
        slide_inverse(self.rows, self.at, self.inverse, self.w, self.vw);
    }
}

/// Slides n, Σv and Σv². The slices have one length.
#[inline(always)]
fn slide_places(
    [added, removed]: [&[f32]; 2],
    [new, old]: [i32; 2],
    n: &mut [i32],
    v: &mut [i32],
    vv: &mut [i32],
) {
    let len = added.len();
    let (removed, n) = (&removed[..len], &mut n[..len]);
    let (v, vv) = (&mut v[..len], &mut vv[..len]);
    let [new_squared, old_squared] = [new.wrapping_mul(new), old.wrapping_mul(old)];
    for u in 0..len {
        // All bits are set where the pixel is used.
        let add = -i32::from(added[u] >= MIN_DEPTH_METERS);
        let remove = -i32::from(removed[u] >= MIN_DEPTH_METERS);
        n[u] += remove - add;
        v[u] = v[u].wrapping_add((add & new).wrapping_sub(remove & old));
        vv[u] = vv[u].wrapping_add((add & new_squared).wrapping_sub(remove & old_squared));
    }
}

/// Slides Σw and Σvw. The slices have one length.
#[inline(always)]
fn slide_inverse(
    [added, removed]: [&[f32]; 2],
    at: [i32; 2],
    inverse: &mut [f64],
    w: &mut [f64],
    vw: &mut [f64],
) {
    let len = added.len();
    let (removed, inverse) = (&removed[..len], &mut inverse[..len]);
    let (w, vw) = (&mut w[..len], &mut vw[..len]);
    let [new, old] = at.map(f64::from);
    for u in 0..len {
        let quotient = 1.0 / f64::from(added[u]);
        let is_removed = removed[u] >= MIN_DEPTH_METERS;
        let add = if added[u] >= MIN_DEPTH_METERS {
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

/// The loop that fits the windows around the pixels of row `v` in the columns of `span`.
pub(super) struct Fit<'a> {
    pub(super) columns: &'a ColumnSums,
    pub(super) rays: &'a Rays,
    pub(super) v: usize,
    pub(super) span: Range<usize>,
    pub(super) depth: &'a [f32],
    /// The surfels up to `span`, to which those of `span` are appended.
    pub(super) surfels: &'a mut Vec<Surfel>,
}

impl VectorLoop for Fit<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let side = 2 * self.columns.radius + 1;
        for from in self.span.clone().step_by(LANES) {
            let mut n = [0; LANES];
            for k in 0..side {
                for (sum, n) in n.iter_mut().zip(lanes(&self.columns.n, from + k)) {
                    *sum += n;
                }
            }
            #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // At most 441.
            let normals = if n == [(side * side) as i32; LANES] {
                self.fit_full(from)
            } else {
                self.fit_any(n, from)
            };
            let pixels = (self.span.end - from).min(LANES);
            let mut surfels = [Surfel::NOTHING; LANES];
            for (lane, surfel) in surfels[..pixels].iter_mut().enumerate() {
                let [x, y, z] = &normals;
                let (pixel, normal) = ((from + lane, self.v), [x[lane], y[lane], z[lane]]);
                *surfel = self.rays.surfel(pixel, self.depth[from + lane], normal);
            }
            self.surfels.extend_from_slice(&surfels[..pixels]);
        }
    }
}

impl Fit<'_> {
    /// Returns Σw, Σuw and Σvw of the windows from a column on, relative to their centers.
    #[inline(always)]
    fn inverse_sums(&self, from: usize) -> [Lanes<LANES>; 3] {
        let (columns, radius) = (self.columns, self.columns.radius);
        let center = from + radius;
        let mut w = Lanes(*lanes(&columns.w, center));
        let mut vw = Lanes(*lanes(&columns.vw, center));
        let mut uw = Lanes::all(0.0);
        for k in 1..=radius {
            let right = Lanes(*lanes(&columns.w, center + k));
            let left = Lanes(*lanes(&columns.w, center - k));
            w = w + (left + right);
            uw = uw + (right - left) * Lanes::all(k as f64);
            let right = Lanes(*lanes(&columns.vw, center + k));
            vw = vw + (Lanes(*lanes(&columns.vw, center - k)) + right);
        }
        [w, uw, vw - w * Lanes::all(self.v as f64)]
    }

    /// Fits windows in which every pixel is used.
    ///
    /// Then n = side², Σu = Σv = Σuv = 0, and Σu² = Σv² = n r (r + 1)/3.
    #[inline(always)]
    fn fit_full(&self, from: usize) -> [[f32; LANES]; 3] {
        let (rays, radius) = (self.rays, self.columns.radius as f64);
        let [w, b, c] = self.inverse_sums(from);
        // The plane's w₀, b and c of `plane_fit`, times Σu².
        let w0 = w * Lanes::all(radius * (radius + 1.0) / 3.0);
        let (nx, ny) = (b * Lanes::all(rays.fx), c * Lanes::all(rays.fy));
        let x = Lanes(*lanes(&rays.x, from));
        let nz = w0 - x * nx - Lanes::all(rays.y[self.v]) * ny;
        // Finite: depths from 1e-4 to 1000 m and focal lengths up to 1e9 pixels keep the squares
        // between 1e-8 and 1e30.
        let [mut nx, mut ny, mut nz] = [nx.single(), ny.single(), nz.single()];
        for lane in 0..LANES {
            let (x, y, z) = (nx[lane], ny[lane], nz[lane]);
            let scale = -1.0 / (x * x + y * y + z * z).sqrt();
            (nx[lane], ny[lane], nz[lane]) = (x * scale, y * scale, z * scale);
        }
        [nx, ny, nz]
    }

    /// Fits windows with any number of pixels. Their normals are zero if these are too few.
    #[inline(always)]
    fn fit_any(&self, n: [i32; LANES], from: usize) -> [[f32; LANES]; 3] {
        let columns = self.columns;
        let (mut u, mut uu, mut uv) = ([0_i32; LANES], [0_i32; LANES], [0_i32; LANES]);
        let (mut v, mut vv) = ([0_i32; LANES], [0_i32; LANES]);
        #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // At most 10, 32768.
        let (radius, v0) = (columns.radius as i32, self.v as i32);
        for (k, at) in (-radius..=radius).zip(from..) {
            let (n, column_v) = (lanes(&columns.n, at), lanes(&columns.v, at));
            let column_vv = lanes(&columns.vv, at);
            for lane in 0..LANES {
                // Relative to the row of the center.
                let down = column_v[lane].wrapping_sub(v0.wrapping_mul(n[lane]));
                let squares = column_vv[lane]
                    .wrapping_sub(v0.wrapping_mul(column_v[lane].wrapping_add(down)));
                u[lane] += k * n[lane];
                uu[lane] += k * k * n[lane];
                v[lane] += down;
                uv[lane] += k * down;
                vv[lane] += squares;
            }
        }
        let [n, u, v] = [Lanes::of(n), Lanes::of(u), Lanes::of(v)];
        let [uu, uv, vv] = [Lanes::of(uu), Lanes::of(uv), Lanes::of(vv)];
        let [w, uw, vw] = self.inverse_sums(from);
        let sums = [n, u, v, uu, uv, vv, w, uw, vw];
        let (x, y) = (Lanes(*lanes(&self.rays.x, from)), self.rays.y[self.v]);
        let [nx, ny, nz] = plane_fit(sums, self.rays, Lanes::all(0.0), 0.0, x, y);
        [nx.single(), ny.single(), nz.single()]
    }
}

/// Returns the numbers from an index on, one per lane.
#[inline(always)]
fn lanes<T>(numbers: &[T], from: usize) -> &[T; LANES] {
    let Some(lanes) = numbers[from..].first_chunk() else {
        unreachable!("columns and rays are padded by {LANES}")
    };
    lanes
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

/// The sums of one window: n, Σu, Σv, Σu², Σuv, Σv², Σw, Σuw, Σvw.
///
/// Columns and rows are relative to its corner.
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

    /// Returns the surfel of a pixel, given its depth and normal.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)] // Surfels are of single precision.
    pub(super) fn surfel(&self, (u, v): (usize, usize), z: f32, normal: [f32; 3]) -> Surfel {
        let (x, y) = (self.x[u] as f32, self.y[v] as f32);
        if z >= MIN_DEPTH_METERS && normal != [0.0; 3] {
            Surfel {
                point: Point3::new(x * z, y * z, z),
                normal: UnitVector3::new_unchecked(Vector3::from(normal)),
            }
        } else {
            Surfel::NOTHING
        }
    }
}
