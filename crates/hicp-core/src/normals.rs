//! Surface normals from a depth image that is not free of noise.
//!
//! A plane seen by a pinhole camera has an inverse depth that is *affine* in the pixel coordinates, so a normal is a linear
//! least-squares fit of 1/z over a window of pixels, exact for planes at any tilt. The window's sums are carried along
//! columns and rows, so the cost per pixel does not depend on its size; the size follows the noise found in the image.
//! Windows never mix two sides of a depth edge: near one, a small window takes only the neighbours that are joined to the
//! pixel by steps that are no edges.

use nalgebra::{UnitVector3, Vector3};

use crate::camera::PinholeCamera;
use crate::region::PixelRegion;

/// The window is chosen so that the standard error of the slope (tangent of the tilt) stays below this, if it can be.
const SLOPE_ERROR: f64 = 0.1;
/// Smallest and largest window half sides, pixels.
const RADIUS: std::ops::RangeInclusive<usize> = 2..=10;
/// Half side of the gated window beside depth edges, pixels. Its rows must fit [`Joined`].
const EDGE_RADIUS: usize = 3;
/// A step between neighbours steeper than a surface seen at this angle (degrees off frontal) is a depth edge …
const EDGE_TILT_DEGREES: f64 = 85.0;
/// … unless noise explains it: steps below this many of *their* standard deviations, √2 times a depth's, are not edges.
const EDGE_SIGMAS: f64 = 5.0;
/// Fewest pixels that a plane is fitted to.
const MIN_SUPPORT: f64 = 6.0;
/// Pixels examined for the noise estimate.
const NOISE_SAMPLES: usize = 4096;
/// Depths below this many metres carry no normal: their inverses would drown those of the pixels around in rounding.
const MIN_DEPTH_METERS: f32 = 1e-4;

/// Depth inside a region: metres, 0 where the pixel is not to be used. Row-major.
pub(crate) struct DepthPatch<'a> {
    pub(crate) region: PixelRegion,
    pub(crate) camera: &'a PinholeCamera,
    pub(crate) depth: &'a [f32],
}

/// Calls `found(column, row, normal)` for every pixel in row-major order; normals are in the camera frame and face the camera.
///
/// Column and row count from the region's corner. Pixels without depth have no normal, nor those with too few neighbours on
/// their own side of the depth edges (flying pixels, single-pixel lines).
pub(crate) fn estimate_normals(
    patch: &DepthPatch<'_>,
    mut found: impl FnMut(usize, usize, Option<UnitVector3<f32>>),
) {
    let (width, height) = (patch.region.width(), patch.region.height());
    if width == 0 || height == 0 {
        return;
    }
    let noise = relative_noise(patch);
    let focal = patch.camera.fx().min(patch.camera.fy());
    let radius = window_radius(focal * noise);
    #[allow(clippy::cast_possible_truncation)] // A relative step; f32 is the precision of depth.
    let edge_step = (EDGE_TILT_DEGREES.to_radians().tan() / focal)
        .max(EDGE_SIGMAS * std::f64::consts::SQRT_2 * noise) as f32;
    let edges = Edges::find(patch, edge_step, radius);
    let rays = Rays::new(patch);

    let mut columns = ColumnSums::new(width, radius);
    for row in 0..radius.min(height) {
        columns.slide(row, patch.depth.get(row * width..(row + 1) * width));
    }
    for v in 0..height {
        let entering = v + radius;
        columns.slide(
            entering,
            patch.depth.get(entering * width..(entering + 1) * width),
        );
        let mut window = WindowSums::default();
        for u in 0..radius.min(width) {
            window.add(&columns.sums[u], u as f64);
        }
        for u in 0..width {
            if let Some(column) = columns.sums.get(u + radius) {
                window.add(column, (u + radius) as f64);
            }
            if u > radius {
                let leaving = u - radius - 1;
                window.remove(&columns.sums[leaving], leaving as f64);
            }
            let index = v * width + u;
            let normal = if patch.depth[index] < MIN_DEPTH_METERS {
                None
            } else {
                match &edges {
                    Some(edges) if usize::from(edges.clearance[index]) <= radius => {
                        gated_normal(patch, edges, &rays, (u, v), edge_step)
                    }
                    _ => window.normal(&rays, u, v),
                }
            };
            found(u, v, normal);
        }
    }
}

/// Returns 1/z, or 0 where there is nothing to use.
#[inline]
fn inverse_depth(z: f32) -> f64 {
    if z >= MIN_DEPTH_METERS {
        1.0 / f64::from(z)
    } else {
        0.0
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

/// The depth edges of a patch.
struct Edges {
    /// Per pixel, the distance in pixels (larger of rows and columns) to the nearest edge, up to the window's radius + 1.
    clearance: Vec<u8>,
    /// Which pixels are joined to their right neighbour: both are used, and the step between them is no edge.
    right: BitRows,
    /// Which pixels are joined to the one below.
    below: BitRows,
}

impl Edges {
    /// `None` when there is no edge at all. Neighbours without depth are no edges; nothing is fitted to them anyway.
    fn find(patch: &DepthPatch<'_>, edge_step: f32, radius: usize) -> Option<Self> {
        let (width, height) = (patch.region.width(), patch.region.height());
        let depth = patch.depth;
        let is_edge = |za: f32, zb: f32| {
            let nearer = za.min(zb);
            (nearer > 0.0) & ((za - zb).abs() > edge_step * nearer)
        };
        // Most objects have none, and this scan without branches says so at a fraction of the cost.
        let between = |a: &[f32], b: &[f32]| {
            let pairs = a.iter().zip(b);
            pairs.fold(false, |any, (za, zb)| any | is_edge(*za, *zb))
        };
        let mut any = between(depth, depth.get(width..).unwrap_or_default());
        for row in depth.chunks_exact(width) {
            any |= between(row, &row[1..]);
        }
        if !any {
            return None;
        }
        let far = u8::try_from(radius + 1).unwrap_or(u8::MAX);
        let mut clearance = vec![far; depth.len()];
        let (mut right, mut below) = (BitRows::new(width, height), BitRows::new(width, height));
        for v in 0..height {
            for u in 0..width {
                let index = v * width + u;
                for (inside, other, joined) in [
                    (u + 1 < width, index + 1, &mut right),
                    (v + 1 < height, index + width, &mut below),
                ] {
                    if !inside || depth[index] <= 0.0 || depth[other] <= 0.0 {
                        continue;
                    }
                    if is_edge(depth[index], depth[other]) {
                        clearance[index] = 0;
                        clearance[other] = 0;
                    } else {
                        joined.set(u, v);
                    }
                }
            }
        }
        spread(&mut clearance, width);
        Some(Self {
            clearance,
            right,
            below,
        })
    }
}

/// One bit per pixel.
struct BitRows {
    words: Vec<u64>,
    words_per_row: usize,
}

impl BitRows {
    fn new(width: usize, height: usize) -> Self {
        // One word more than needed, so that any bits of a row lie in two neighbouring words.
        let words_per_row = width / 64 + 2;
        Self {
            words: vec![0; words_per_row * height],
            words_per_row,
        }
    }

    fn set(&mut self, u: usize, v: usize) {
        self.words[v * self.words_per_row + u / 64] |= 1 << (u % 64);
    }

    /// Returns the bits of `count` < 64 pixels from (u, v) to the right, the first in the lowest bit.
    fn get(&self, u: usize, v: usize, count: usize) -> u64 {
        let word = v * self.words_per_row + u / 64;
        let shift = u % 64;
        let bits = self.words[word] >> shift | (self.words[word + 1] << 1) << (63 - shift);
        bits & ((1 << count) - 1)
    }
}

/// Two-pass chessboard distance transform.
fn spread(clearance: &mut [u8], width: usize) {
    let height = clearance.len() / width;
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
}

/// A set of pixels of the gated window, one byte per row: bit `8 y + x`.
type Joined = u64;

/// Fits the neighbours that lie on the same side of the depth edges as the pixel itself: those that steps which are no
/// edges lead to without leaving the window.
#[inline(never)] // Few pixels come here; the others' sums stay in registers.
fn gated_normal(
    patch: &DepthPatch<'_>,
    edges: &Edges,
    rays: &Rays,
    (u, v): (usize, usize),
    edge_step: f32,
) -> Option<UnitVector3<f32>> {
    let (width, height) = (patch.region.width(), patch.region.height());
    let columns = u.saturating_sub(EDGE_RADIUS)..(u + EDGE_RADIUS + 1).min(width);
    let rows = v.saturating_sub(EDGE_RADIUS)..(v + EDGE_RADIUS + 1).min(height);

    // Column 7 stays empty, so that shifts do not run from one row into the next.
    let (mut right, mut below): (Joined, Joined) = (0, 0);
    for (y, row) in rows.clone().enumerate() {
        right |= edges.right.get(columns.start, row, columns.len() - 1) << (8 * y);
        if row + 1 < rows.end {
            below |= edges.below.get(columns.start, row, columns.len()) << (8 * y);
        }
    }
    let mut reached: Joined = 1 << (8 * (v - rows.start) + (u - columns.start));
    loop {
        let grown = reached
            | (reached & right) << 1
            | (reached >> 1) & right
            | (reached & below) << 8
            | (reached >> 8) & below;
        if grown == reached {
            break;
        }
        reached = grown;
    }

    let center = patch.depth[v * width + u];
    let mut sums = WindowSums::default();
    while reached != 0 {
        let bit = reached.trailing_zeros() as usize;
        reached &= reached - 1;
        let (column, row) = (columns.start + bit % 8, rows.start + bit / 8);
        let z = patch.depth[row * width + column];
        // A way around an edge's end may lead to its other side, and a slope just short of an edge may add up.
        let reach = column.abs_diff(u).max(row.abs_diff(v)).max(1) as f32;
        let gate = edge_step * center * (0.5 + 0.5 * reach);
        if z >= MIN_DEPTH_METERS && (z - center).abs() <= gate {
            sums.add_pixel(column as f64, row as f64, 1.0 / f64::from(z));
        }
    }
    sums.normal(rays, u, v)
}

/// Sums over a column of the window: n, Σv, Σv², Σw, Σvw with w = 1/z.
#[derive(Clone, Copy, Default)]
struct ColumnSum {
    n: f64,
    v: f64,
    vv: f64,
    w: f64,
    vw: f64,
}

/// Sums over the window's rows, one per column.
struct ColumnSums {
    sums: Vec<ColumnSum>,
    /// 1/z of the window's rows, so that what leaves is to the bit what entered; row r is at r modulo the number of rows.
    inverse: Vec<f64>,
    rows: usize,
}

impl ColumnSums {
    fn new(width: usize, radius: usize) -> Self {
        let rows = 2 * radius + 1;
        Self {
            sums: vec![ColumnSum::default(); width],
            inverse: vec![0.0; width * rows],
            rows,
        }
    }

    /// Takes the next row in (`None` below the patch) and the one that it pushes out of the window out.
    fn slide(&mut self, entering: usize, depth: Option<&[f32]>) {
        let width = self.sums.len();
        let slot = &mut self.inverse[entering % self.rows * width..][..width];
        let (v_in, v_out) = (entering as f64, entering as f64 - self.rows as f64);
        let update = |sum: &mut ColumnSum, kept: &mut f64, w_in: f64| {
            let w_out = std::mem::replace(kept, w_in);
            let n_in = f64::from(u8::from(w_in > 0.0));
            let n_out = f64::from(u8::from(w_out > 0.0));
            sum.n += n_in - n_out;
            sum.v += n_in * v_in - n_out * v_out;
            sum.vv += n_in * (v_in * v_in) - n_out * (v_out * v_out);
            sum.w += w_in - w_out;
            sum.vw += w_in * v_in - w_out * v_out;
        };
        let sums = self.sums.iter_mut().zip(slot);
        match depth {
            Some(depth) => {
                for ((sum, kept), z) in sums.zip(depth) {
                    update(sum, kept, inverse_depth(*z));
                }
            }
            None => sums.for_each(|(sum, kept)| update(sum, kept, 0.0)),
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
    #[inline]
    fn add(&mut self, column: &ColumnSum, u: f64) {
        self.n += column.n;
        self.u += u * column.n;
        self.uu += u * u * column.n;
        self.v += column.v;
        self.uv += u * column.v;
        self.vv += column.vv;
        self.w += column.w;
        self.uw += u * column.w;
        self.vw += column.vw;
    }

    #[inline]
    fn remove(&mut self, column: &ColumnSum, u: f64) {
        self.n -= column.n;
        self.u -= u * column.n;
        self.uu -= u * u * column.n;
        self.v -= column.v;
        self.uv -= u * column.v;
        self.vv -= column.vv;
        self.w -= column.w;
        self.uw -= u * column.w;
        self.vw -= column.vw;
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
    #[inline]
    fn normal(self, rays: &Rays, u: usize, v: usize) -> Option<UnitVector3<f32>> {
        let n = self.n;
        if n < MIN_SUPPORT {
            return None;
        }
        // Central moments times n: integers but for those with w, and no division.
        let suu = n * self.uu - self.u * self.u;
        let suv = n * self.uv - self.u * self.v;
        let svv = n * self.vv - self.v * self.v;
        let suw = n * self.uw - self.u * self.w;
        let svw = n * self.vw - self.v * self.w;
        let determinant = suu * svv - suv * suv;
        // Pixels on one line determine no plane; the determinant is an integer, so it is 0 then.
        if determinant <= 1e-3 * n * (suu + svv) {
            return None;
        }
        // b, c and w₀ times n · determinant: only their ratios matter.
        let b = suw * svv - svw * suv;
        let c = svw * suu - suw * suv;
        let w0 = self.w * determinant + b * (n * u as f64 - self.u) + c * (n * v as f64 - self.v);
        let (b, c) = (n * b, n * c);
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
