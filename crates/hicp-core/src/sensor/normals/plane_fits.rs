//! Planes through windows with unused pixels, many at a time.

use nalgebra::{Point3, UnitVector3, Vector3};

use super::lanes::{LANES, Lanes};
use super::patch::MIN_FITTED_METERS;
use super::row::{Rays, Row};
use crate::internal::{VectorLoop, vectorized};
use crate::surfel::Surfel;

/// Smallest number of pixels that determine a plane.
// Open: fewest pixels of a normal of C: §III-A. Twice the unknowns of a plane; a pixel with fewer
// leaves C.
const MIN_SUPPORT: f64 = 6.0;
/// Largest number of windows that are fitted at once. The compiler does not unroll a loop over so
/// many, and turns it into vector instructions.
const CAPACITY: usize = 64;

/// Sums over windows of one row, waiting to be fitted.
pub(super) struct PlaneFits {
    len: usize,
    /// Columns of the pixels.
    columns: [usize; CAPACITY],
    /// Places (u₀, v₀) of the pixels in the coordinates of the sums.
    at: [[f64; CAPACITY]; 2],
    /// n, Σu, Σv, Σu², Σuv, Σv², Σw, Σuw and Σvw with w = 1/z.
    sums: [[f64; CAPACITY]; 9],
    /// The slopes x/z of their rays, and their normals.
    x: [f64; CAPACITY],
    normals: [[f32; CAPACITY]; 3],
}

impl PlaneFits {
    pub(super) fn new() -> Self {
        Self {
            len: 0,
            columns: [0; CAPACITY],
            at: [[0.0; CAPACITY]; 2],
            sums: [[0.0; CAPACITY]; 9],
            x: [0.0; CAPACITY],
            normals: [[0.0; CAPACITY]; 3],
        }
    }

    /// Returns whether the next block may not fit.
    pub(super) fn is_full(&self) -> bool {
        self.len + LANES > CAPACITY
    }

    /// Adds a window around a pixel of column `u`, which lies at `at` in its coordinates.
    #[inline(always)]
    pub(super) fn push(&mut self, u: usize, at: [f64; 2], sums: [f64; 9]) {
        self.columns[self.len] = u;
        for (all, one) in self.at.iter_mut().zip(at) {
            all[self.len] = one;
        }
        for (all, one) in self.sums.iter_mut().zip(sums) {
            all[self.len] = one;
        }
        self.len += 1;
    }

    /// Adds the first `n` windows of a block, around pixels of columns from `u` on.
    #[inline(always)]
    pub(super) fn push_block(
        &mut self,
        u: usize,
        n: usize,
        places: [Lanes<f64>; 6],
        inverse: [Lanes<f64>; 3],
    ) {
        let range = self.len..self.len + LANES;
        for (lane, column) in self.columns[range.clone()].iter_mut().enumerate() {
            *column = u + lane;
        }
        for all in &mut self.at {
            all[range.clone()].copy_from_slice(&[0.0; LANES]);
        }
        for (all, one) in self.sums.iter_mut().zip(places.iter().chain(&inverse)) {
            all[range.clone()].copy_from_slice(&one.0);
        }
        self.len += n;
    }

    /// Fits the windows, stores the surfels of their pixels, and removes the windows.
    ///
    /// Other pixels of the row are not changed.
    pub(super) fn solve(&mut self, row: &mut Row<'_>) {
        vectorized(Solve { fits: self, row });
    }

    /// Fits 1/z = w₀ + b (u−u₀) + c (v−v₀) and stores its normals at the pixels (u₀, v₀).
    ///
    /// They face the camera, and are zero if the fit is not determined. With x = (u−cx)/fx and
    /// n·X = d on the plane, n·(x, y, 1) = d/z, so n ∝ (b fx, c fy, w₀ − x b fx − y c fy).
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)] // Surfels are of single precision.
    fn fit(&mut self, len: usize, rays: &Rays, y: f64) {
        let (fx, fy) = (rays.fx, rays.fy);
        let ([u0, v0], x) = (&self.at, &self.x);
        let [n, u, v, uu, uv, vv, w, uw, vw] = &self.sums;
        let [normal_x, normal_y, normal_z] = &mut self.normals;
        for i in 0..len {
            let (n, u, v, w) = (n[i], u[i], v[i], w[i]);
            // Central moments times n: integers except for those with w, and without a division.
            let suu = n * uu[i] - u * u;
            let suv = n * uv[i] - u * v;
            let svv = n * vv[i] - v * v;
            let suw = n * uw[i] - u * w;
            let svw = n * vw[i] - v * w;
            let determinant = suu * svv - suv * suv;
            // b, c and w₀ times n · determinant: only their ratios matter.
            let b = suw * svv - svw * suv;
            let c = svw * suu - suw * suv;
            let w0 = w * determinant + b * (n * u0[i] - u) + c * (n * v0[i] - v);
            let (nx, ny) = (n * b * fx, n * c * fy);
            let nz = w0 - x[i] * nx - y * ny;
            let is_fitted = (n >= MIN_SUPPORT)
                // Pixels on one line do not determine a plane. The determinant is an integer, so
                // it is exactly 0 then.
                & (determinant > 0.0)
                & (w0 > 0.0);
            // Finite: within the limits of cameras and fitted depths, the squares stay below 1e90.
            let scale = -1.0 / (nx * nx + ny * ny + nz * nz).sqrt();
            let scale = f64::from_bits(scale.to_bits() & u64::from(is_fitted).wrapping_neg());
            normal_x[i] = (nx * scale) as f32;
            normal_y[i] = (ny * scale) as f32;
            normal_z[i] = (nz * scale) as f32;
        }
    }
}

/// Returns the surfel of a point and a normal.
#[inline(always)]
pub(super) fn surfel_of([x, y, z, nx, ny, nz]: [f32; 6]) -> Surfel {
    Surfel {
        point: Point3::new(x, y, z),
        normal: UnitVector3::new_unchecked(Vector3::new(nx, ny, nz)),
    }
}

/// The loop of [`PlaneFits::solve`].
struct Solve<'a, 'b> {
    fits: &'a mut PlaneFits,
    row: &'a mut Row<'b>,
}

impl VectorLoop for Solve<'_, '_> {
    type Output = ();

    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)] // Surfels are of single precision.
    fn run(self) {
        let Self { fits, row } = self;
        // The limit is never reached, but tells the compiler that indices are in range.
        let (rays, len) = (row.rays, fits.len.min(CAPACITY));
        for (x, u) in fits.x.iter_mut().zip(&fits.columns[..len]) {
            *x = rays.x[*u];
        }
        let (depth, y) = (row.patch.row(row.v), rays.y[row.v]);
        // Whole blocks: what follows the last window is not read.
        fits.fit(len.next_multiple_of(LANES).min(CAPACITY), rays, y);
        let (y, [nx, ny, nz]) = (y as f32, &fits.normals);
        for i in 0..len {
            let u = fits.columns[i];
            let (x, z) = (fits.x[i] as f32, depth[u]);
            let (nx, ny, nz) = (nx[i], ny[i], nz[i]);
            let has_normal = (nx != 0.0) | (ny != 0.0) | (nz != 0.0);
            row.surfels[u] = if has_normal & (z >= MIN_FITTED_METERS) {
                surfel_of([x * z, y * z, z, nx, ny, nz])
            } else {
                Surfel::NOTHING
            };
        }
        fits.len = 0;
    }
}
