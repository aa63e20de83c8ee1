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
mod size;
mod window;

use std::ops::Range;

use edges::Edges;
use gated::FitGated;
pub(crate) use patch::DepthPatch;
pub use size::NormalWindow;
use window::{ColumnSums, Fit, Rays};

use crate::internal::vectorized;
use crate::surfel::Surfel;

/// A step is a depth edge if it is steeper than a surface at this angle, degrees off frontal …
// Open: depth edges in the normals of C: §III-A. No window mixes two sides of an edge. An edge is
// steeper than this tilt, in degrees, and larger than five standard deviations of the noise.
const EDGE_TILT_DEGREES: f64 = 85.0;
/// … and larger than this many of its standard deviations, which are √2 times those of a depth.
const EDGE_SIGMAS: f64 = 5.0;
/// Number of pixels for the noise estimate.
const NOISE_SAMPLES: usize = 4096;

/// Returns the surfels of the patch, row-major.
///
/// Points and normals are in the camera frame, and normals face the camera. Pixels without a normal
/// have [`Surfel::NOTHING`]: those without depth, and those with too few neighbors on their own
/// side of the depth edges (flying pixels, single-pixel lines).
pub(crate) fn estimate_normals(patch: &DepthPatch<'_>, window: NormalWindow) -> Vec<Surfel> {
    let mut surfels = Vec::with_capacity(patch.region.area());
    if patch.region.is_empty() {
        return surfels;
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
    for (v, span) in spans.iter().enumerate() {
        columns.slide(v + radius, patch, &spans);
        surfels.resize(v * width + span.start, Surfel::NOTHING);
        vectorized(Fit {
            columns: &columns,
            rays: &rays,
            v,
            span: span.clone(),
            depth: patch.row(v),
            surfels: &mut surfels,
        });
        if let Some(edges) = &edges {
            vectorized(FitGated {
                patch,
                edges,
                rays: &rays,
                edge_step,
                radius: edge_radius,
                v,
                surfels: &mut surfels[v * width..],
            });
        }
    }
    surfels.resize(patch.region.area(), Surfel::NOTHING);
    surfels
}

/// Returns the columns from the first pixel with depth to the last; empty if there is none.
fn used(depth: &[f32]) -> Range<usize> {
    let is_used = |z: &f32| *z > 0.0;
    match (
        depth.iter().position(is_used),
        depth.iter().rposition(is_used),
    ) {
        (Some(first), Some(last)) => first..last + 1,
        _ => 0..0,
    }
}

/// Returns the standard deviation of depth over depth, from the median second difference along
/// rows.
///
/// Second differences of a smooth surface are tiny, and those across edges are few, so their median
/// measures noise. White noise of deviation σ gives them a deviation of √6 σ.
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
