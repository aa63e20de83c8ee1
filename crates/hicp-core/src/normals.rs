//! Surface normals from a depth image that is not free of noise.
//!
//! A plane seen by a pinhole camera has an inverse depth that is *affine* in the pixel coordinates, so a normal is a linear
//! least-squares fit of 1/z over a window of pixels, exact for planes at any tilt. The window's sums are carried along
//! columns and rows, so the cost per pixel does not depend on its size; the size follows the noise found in the image.
//! Windows never mix two sides of a depth edge: near one, a small window takes only the neighbours on the pixel's own side.

use nalgebra::{UnitVector3, Vector3};

use crate::camera::PinholeCamera;
use crate::region::PixelRegion;

/// The window is chosen so that the standard error of the slope (tangent of the tilt) stays below this, if it can be.
const SLOPE_ERROR: f64 = 0.1;
/// Smallest and largest window half sides, pixels.
const RADIUS: std::ops::RangeInclusive<usize> = 2..=10;
/// Half side of the gated window beside depth edges, pixels.
const EDGE_RADIUS: usize = 3;
/// A step between neighbours steeper than a surface seen at this angle (degrees off frontal) is a depth edge …
const EDGE_TILT_DEGREES: f64 = 85.0;
/// … unless noise explains it: steps below this many standard deviations are not edges.
const EDGE_SIGMAS: f64 = 5.0;
/// Fewest pixels that a plane is fitted to.
const MIN_SUPPORT: f64 = 6.0;
/// Pixels examined for the noise estimate.
const NOISE_SAMPLES: usize = 4096;

/// Depth inside a region: metres, 0 where the pixel is not to be used. Row-major.
pub(crate) struct DepthPatch<'a> {
    pub(crate) region: PixelRegion,
    pub(crate) camera: &'a PinholeCamera,
    pub(crate) depth: &'a [f32],
}

/// Calls `found(index, normal)` for every used pixel that has a normal; normals are in the camera frame and face the camera.
///
/// Pixels with too few neighbours on their own side of the depth edges (flying pixels, single-pixel lines) have none.
pub(crate) fn estimate_normals(
    patch: &DepthPatch<'_>,
    mut found: impl FnMut(usize, UnitVector3<f32>),
) {
    let (width, height) = (patch.region.width(), patch.region.height());
    if width == 0 || height == 0 {
        return;
    }
    let noise = relative_noise(patch);
    let focal = patch.camera.fx().min(patch.camera.fy());
    let radius = window_radius(focal * noise);
    #[allow(clippy::cast_possible_truncation)] // A relative step; f32 is the precision of depth.
    let edge_step = (EDGE_TILT_DEGREES.to_radians().tan() / focal).max(EDGE_SIGMAS * noise) as f32;
    let clearance = edge_clearance(patch, edge_step, radius);
    let rays = Rays::new(patch);

    let mut columns = ColumnSums::new(width);
    for v in 0..height {
        let entering = if v == 0 {
            0..radius.min(height - 1) + 1
        } else {
            v + radius..v + radius + 1
        };
        for row in entering.filter(|row| *row < height) {
            columns.add(row, &patch.depth[row * width..][..width]);
        }
        if v > radius {
            let row = v - radius - 1;
            columns.remove(row, &patch.depth[row * width..][..width]);
        }
        let mut window = WindowSums::default();
        for u in 0..radius.min(width) {
            window.add(&columns, u);
        }
        for u in 0..width {
            if u + radius < width {
                window.add(&columns, u + radius);
            }
            if u > radius {
                window.remove(&columns, u - radius - 1);
            }
            let index = v * width + u;
            if patch.depth[index] <= 0.0 {
                continue;
            }
            let near_edge = clearance
                .as_ref()
                .is_some_and(|c| usize::from(c[index]) <= radius);
            let normal = if near_edge {
                gated_window(patch, u, v, radius.min(EDGE_RADIUS), edge_step).normal(&rays, u, v)
            } else {
                window.normal(&rays, u, v)
            };
            if let Some(normal) = normal {
                found(index, normal);
            }
        }
    }
}

/// Standard deviation of depth over depth, from the median second difference along rows.
///
/// Second differences of a smooth surface are tiny and those across edges few, so their median is noise:
/// for white noise of deviation σ they are spread by √6 σ.
fn relative_noise(patch: &DepthPatch<'_>) -> f64 {
    let width = patch.region.width();
    let triples = patch.depth.len().saturating_sub(2);
    let step = triples / NOISE_SAMPLES + 1;
    let mut differences: Vec<f32> = (0..triples)
        .step_by(step)
        .filter(|i| i % width + 2 < width)
        .filter_map(|i| {
            let z = &patch.depth[i..i + 3];
            (z[0] > 0.0 && z[1] > 0.0 && z[2] > 0.0)
                .then(|| ((z[0] - 2.0 * z[1] + z[2]) / z[1]).abs())
        })
        .collect();
    if differences.is_empty() {
        return 0.0;
    }
    let middle = differences.len() / 2;
    let (_, median, _) = differences.select_nth_unstable_by(middle, f32::total_cmp);
    f64::from(*median) / (0.6745 * 6.0_f64.sqrt())
}

/// The smallest half side at which the slope's standard error, noise/√Σu², is within [`SLOPE_ERROR`].
fn window_radius(slope_noise_per_pixel: f64) -> usize {
    let needed = (slope_noise_per_pixel / SLOPE_ERROR).powi(2);
    RADIUS
        .clone()
        .find(|r| {
            let (side, r) = ((2 * r + 1) as f64, *r as f64);
            // Σu² over a full (2r+1)² window.
            side * side * r * (r + 1.0) / 3.0 >= needed
        })
        .unwrap_or(*RADIUS.end())
}

/// Returns, per pixel, the distance in pixels (larger of rows and columns) to the nearest depth edge, up to `radius` + 1;
/// `None` when there is no edge at all.
fn edge_clearance(patch: &DepthPatch<'_>, edge_step: f32, radius: usize) -> Option<Vec<u8>> {
    let (width, height) = (patch.region.width(), patch.region.height());
    let depth = patch.depth;
    let far = u8::try_from(radius + 1).unwrap_or(u8::MAX);
    let mut clearance = vec![far; depth.len()];
    let mut any = false;
    let mut mark = |a: usize, b: usize, clearance: &mut [u8]| {
        let (za, zb) = (depth[a], depth[b]);
        if za > 0.0 && zb > 0.0 && (za - zb).abs() > edge_step * za.min(zb) {
            clearance[a] = 0;
            clearance[b] = 0;
            any = true;
        }
    };
    for v in 0..height {
        for index in v * width..(v + 1) * width {
            if index + 1 < (v + 1) * width {
                mark(index, index + 1, &mut clearance);
            }
            if v + 1 < height {
                mark(index, index + width, &mut clearance);
            }
        }
    }
    if !any {
        return None;
    }
    // Two-pass chessboard distance transform.
    for v in 0..height {
        for u in 0..width {
            let index = v * width + u;
            let mut nearest = clearance[index];
            let mut look = |i: usize| nearest = nearest.min(clearance[i].saturating_add(1));
            if u > 0 {
                look(index - 1);
            }
            if v > 0 {
                look(index - width);
                if u > 0 {
                    look(index - width - 1);
                }
                if u + 1 < width {
                    look(index - width + 1);
                }
            }
            clearance[index] = nearest;
        }
    }
    for v in (0..height).rev() {
        for u in (0..width).rev() {
            let index = v * width + u;
            let mut nearest = clearance[index];
            let mut look = |i: usize| nearest = nearest.min(clearance[i].saturating_add(1));
            if u + 1 < width {
                look(index + 1);
            }
            if v + 1 < height {
                look(index + width);
                if u > 0 {
                    look(index + width - 1);
                }
                if u + 1 < width {
                    look(index + width + 1);
                }
            }
            clearance[index] = nearest;
        }
    }
    Some(clearance)
}

/// Sums over the neighbours that lie on the same side of the depth edges as the pixel itself.
fn gated_window(
    patch: &DepthPatch<'_>,
    u: usize,
    v: usize,
    radius: usize,
    edge_step: f32,
) -> WindowSums {
    let (width, height) = (patch.region.width(), patch.region.height());
    let center = patch.depth[v * width + u];
    let mut sums = WindowSums::default();
    for y in v.saturating_sub(radius)..(v + radius + 1).min(height) {
        for x in u.saturating_sub(radius)..(u + radius + 1).min(width) {
            let z = patch.depth[y * width + x];
            // A slope just short of an edge may add up over the window, so the gate widens with the distance.
            let reach = x.abs_diff(u).max(y.abs_diff(v)).max(1) as f32;
            let gate = edge_step * center * (0.5 + 0.5 * reach);
            if z > 0.0 && (z - center).abs() <= gate {
                sums.add_pixel(x as f64, y as f64, 1.0 / f64::from(z));
            }
        }
    }
    sums
}

/// Sums over the window's rows, one per column: n, Σv, Σv², Σw, Σvw with w = 1/z.
struct ColumnSums {
    n: Vec<f64>,
    v: Vec<f64>,
    vv: Vec<f64>,
    w: Vec<f64>,
    vw: Vec<f64>,
}

impl ColumnSums {
    fn new(width: usize) -> Self {
        let zeros = || vec![0.0; width];
        Self {
            n: zeros(),
            v: zeros(),
            vv: zeros(),
            w: zeros(),
            vw: zeros(),
        }
    }

    fn add(&mut self, row: usize, depth: &[f32]) {
        self.accumulate(row, depth, 1.0);
    }

    fn remove(&mut self, row: usize, depth: &[f32]) {
        self.accumulate(row, depth, -1.0);
    }

    fn accumulate(&mut self, row: usize, depth: &[f32], sign: f64) {
        let v = row as f64;
        let sums = self.n.iter_mut().zip(&mut self.v).zip(&mut self.vv);
        let sums = sums.zip(self.w.iter_mut().zip(&mut self.vw));
        for (((n, sv), svv), ((sw, svw), z)) in sums.zip(depth).map(|((a, b), z)| (a, (b, z))) {
            let used = if *z > 0.0 { sign } else { 0.0 };
            let w = if *z > 0.0 { sign / f64::from(*z) } else { 0.0 };
            *n += used;
            *sv += used * v;
            *svv += used * v * v;
            *sw += w;
            *svw += w * v;
        }
    }
}

/// The sums of a window: what the plane fit needs.
#[derive(Clone, Copy, Default)]
struct WindowSums {
    n: f64,
    u: f64,
    v: f64,
    uu: f64,
    uv: f64,
    vv: f64,
    w: f64,
    uw: f64,
    vw: f64,
}

impl WindowSums {
    fn add(&mut self, columns: &ColumnSums, column: usize) {
        self.accumulate(columns, column, 1.0);
    }

    fn remove(&mut self, columns: &ColumnSums, column: usize) {
        self.accumulate(columns, column, -1.0);
    }

    fn accumulate(&mut self, columns: &ColumnSums, column: usize, sign: f64) {
        let u = column as f64 * sign;
        let (n, v, w) = (columns.n[column], columns.v[column], columns.w[column]);
        self.n += sign * n;
        self.u += u * n;
        self.uu += u * column as f64 * n;
        self.v += sign * v;
        self.uv += u * v;
        self.vv += sign * columns.vv[column];
        self.w += sign * w;
        self.uw += u * w;
        self.vw += sign * columns.vw[column];
    }

    fn add_pixel(&mut self, u: f64, v: f64, w: f64) {
        self.n += 1.0;
        self.u += u;
        self.v += v;
        self.uu += u * u;
        self.uv += u * v;
        self.vv += v * v;
        self.w += w;
        self.uw += u * w;
        self.vw += v * w;
    }

    /// Fits 1/z = w₀ + b (u−u₀) + c (v−v₀) and returns its normal at pixel (u₀, v₀), facing the camera.
    ///
    /// With x = (u−cx)/fx and n·X = d on the plane, n·(x, y, 1) = d/z, so n ∝ (b fx, c fy, w₀ − x b fx − y c fy).
    fn normal(&self, rays: &Rays, u: usize, v: usize) -> Option<UnitVector3<f32>> {
        if self.n < MIN_SUPPORT {
            return None;
        }
        let scale = 1.0 / self.n;
        let (mean_u, mean_v, mean_w) = (self.u * scale, self.v * scale, self.w * scale);
        let suu = self.uu - self.u * mean_u;
        let suv = self.uv - self.u * mean_v;
        let svv = self.vv - self.v * mean_v;
        let suw = self.uw - self.w * mean_u;
        let svw = self.vw - self.w * mean_v;
        let determinant = suu * svv - suv * suv;
        // Pixels on one line determine no plane. Coordinates are integers, so one row's determinant is exactly 0 up to rounding.
        if determinant <= 1e-3 * (suu + svv) {
            return None;
        }
        let b = (suw * svv - svw * suv) / determinant;
        let c = (svw * suu - suw * suv) / determinant;
        let w0 = mean_w + b * (u as f64 - mean_u) + c * (v as f64 - mean_v);
        let (x, y) = (rays.x[u], rays.y[v]);
        let (nx, ny) = (b * rays.fx, c * rays.fy);
        let away = Vector3::new(nx, ny, w0 - x * nx - y * ny);
        let norm = away.norm();
        (w0 > 0.0 && norm.is_finite())
            .then(|| UnitVector3::new_unchecked((away * (-1.0 / norm)).cast::<f32>()))
    }
}

/// Ray slopes (x/z, y/z) of the region's columns and rows.
struct Rays {
    fx: f64,
    fy: f64,
    x: Vec<f64>,
    y: Vec<f64>,
}

impl Rays {
    fn new(patch: &DepthPatch<'_>) -> Self {
        let (camera, region) = (patch.camera, patch.region);
        Self {
            fx: camera.fx(),
            fy: camera.fy(),
            x: (region.u_min..region.u_max)
                .map(|u| (f64::from(u) - camera.cx()) / camera.fx())
                .collect(),
            y: (region.v_min..region.v_max)
                .map(|v| (f64::from(v) - camera.cy()) / camera.fy())
                .collect(),
        }
    }
}
