//! Surface normals from a noisy depth image.
//!
//! For a plane seen by a pinhole camera, the inverse depth is *affine* in the pixel coordinates. A
//! normal is therefore a linear least-squares fit of 1/z over a window of pixels, exact for planes
//! at any tilt. By default, the size of the window follows the noise of the image.
//!
//! Windows never mix two sides of a depth edge. Near an edge, a small window uses only the
//! neighbors that are connected to the pixel by steps that are not edges.

mod edges;
mod gated;
mod lanes;
mod patch;
mod plane_fits;
mod row;
mod size;
mod window;

use std::ops::Range;

use edges::Edges;
use gated::FitGated;
pub(crate) use patch::{DepthPatch, n_measured};
use plane_fits::PlaneFits;
use row::{Rays, Row};
pub use size::NormalWindow;
use window::{ColumnSums, Fit};

use crate::internal::{median, vectorized};
use crate::surfel::Surfel;

/// A step is a depth edge if it is steeper than a surface at this angle, degrees off frontal …
// Open: depth edges in the normals of C: §III-A. No window mixes two sides of an edge. An edge is
// steeper than this tilt, in degrees, and larger than five standard deviations of the noise.
const EDGE_TILT_DEGREES: f64 = 85.0;
/// … and larger than this many of its standard deviations, which are √2 times those of a depth.
const EDGE_SIGMAS: f64 = 5.0;
/// Number of pixels that are skipped at once where nothing is used.
const BLOCK: usize = 16;
/// Number of pixels for the noise estimate.
const NOISE_SAMPLES: usize = 4096;

/// Returns the surfels of the patch, row-major, and the number of pixels that have one.
///
/// Points and normals are in the camera frame, and normals face the camera. Pixels without a normal
/// have [`Surfel::NOTHING`]: those without depth, and those with too few neighbors on their own
/// side of the depth edges (flying pixels, single-pixel lines).
pub(crate) fn estimate_normals(
    patch: &DepthPatch<'_>,
    window: NormalWindow,
) -> (Vec<Surfel>, usize) {
    let (mut surfels, mut n_fitted) = (vec![Surfel::NOTHING; patch.region.area()], 0);
    if patch.region.is_empty() {
        return (surfels, n_fitted);
    }
    let (width, height) = (patch.region.width(), patch.region.height());
    let spans: Vec<_> = (0..height).map(|v| used(patch.row(v))).collect();
    let noise = relative_noise(patch);
    let focal = patch.camera.fx().min(patch.camera.fy());
    let (radius, edge_radius) = window.radii(focal * noise);
    #[allow(clippy::cast_possible_truncation)] // A relative step; f32 is the precision of depth.
    let edge_step = (EDGE_TILT_DEGREES.to_radians().tan() / focal)
        .max(EDGE_SIGMAS * std::f64::consts::SQRT_2 * noise) as f32;
    let edges = Edges::find(patch, &spans, edge_step, radius);
    let rays = Rays::new(patch);

    let mut columns = ColumnSums::new(width, radius);
    for v in 0..radius {
        columns.slide(v, patch, &spans);
    }
    let mut fits = PlaneFits::new();
    for (v, span) in spans.iter().enumerate() {
        columns.slide(v + radius, patch, &spans);
        let mut row = Row {
            patch,
            rays: &rays,
            v,
            surfels: &mut surfels[v * width..][..width],
        };
        vectorized(Fit {
            columns: &columns,
            span: span.clone(),
            fits: &mut fits,
            row: &mut row,
        });
        if let Some(edges) = &edges {
            vectorized(FitGated {
                edges,
                edge_step,
                radius: edge_radius,
                fits: &mut fits,
                row: &mut row,
            });
        }
        fits.solve(&mut row);
        n_fitted += n_surfels(row.surfels);
    }
    (surfels, n_fitted)
}

/// Returns the number of pixels with a surfel.
pub(crate) fn n_surfels(surfels: &[Surfel]) -> usize {
    surfels.iter().filter(|s| s.point.z > 0.0).count()
}

/// Returns the columns from the first pixel with depth to the last; empty if there is none.
fn used(depth: &[f32]) -> Range<usize> {
    let is_used = |z: &f32| *z > 0.0;
    // Empty blocks are skipped as a whole.
    let is_empty = |block: &&[f32]| block.iter().fold(0, |bits, z| bits | z.to_bits()) == 0;
    let left = BLOCK * depth.chunks_exact(BLOCK).take_while(is_empty).count();
    let right = BLOCK * depth.rchunks_exact(BLOCK).take_while(is_empty).count();
    match (
        depth[left..].iter().position(is_used),
        depth[..depth.len() - right].iter().rposition(is_used),
    ) {
        (Some(first), Some(last)) => left + first..last + 1,
        _ => 0..0,
    }
}

/// Returns the standard deviation of depth over depth, from the median second difference along
/// rows.
///
/// Second differences of a smooth surface are tiny, and those across edges are few, so their median
/// measures noise. White noise of deviation σ gives them a deviation of √6 σ.
fn relative_noise(patch: &DepthPatch<'_>) -> f64 {
    let (width, depth) = (patch.region.width(), patch.pixels());
    let step = depth.len().saturating_sub(2) / NOISE_SAMPLES + 1;
    let mut differences = Vec::with_capacity(NOISE_SAMPLES);
    for (index, z) in depth.windows(3).enumerate().step_by(step) {
        if index % width + 2 < width && z[0] > 0.0 && z[1] > 0.0 && z[2] > 0.0 {
            differences.push(((z[0] - 2.0 * z[1] + z[2]) / z[1]).abs());
        }
    }
    let median = median(&mut differences, f32::total_cmp).unwrap_or(0.0);
    f64::from(median) / (0.6745 * 6.0_f64.sqrt())
}
