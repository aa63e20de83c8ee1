//! Points spread uniformly over a surface.

use crate::object::mesh::{Facing, TriMesh};
use crate::surfel::Surfel;

/// The largest number of samples on a surface.
pub const MAX_SAMPLES: usize = 10_000_000;

/// Returns `count` surfels, at most [`MAX_SAMPLES`], spread evenly over the area of a mesh.
///
/// Surfels are in the object frame. Normals follow the winding and are flipped if a closed mesh is
/// wound inward. The result is deterministic, and every region of the surface receives its share of
/// the samples to within one.
///
/// The method is systematic sampling. The i-th sample lies at (i + ½)/count of the accumulated
/// area; on the border of two triangles, it belongs to the later one. Its place inside the triangle
/// is the i-th point of Roberts's R₂ sequence from (½, ½), in coordinates along the edges from the
/// first corner, folded into the triangle.
///
/// Cost: O(triangles + count).
#[must_use]
pub fn sample_surface(mesh: &TriMesh, count: usize) -> Vec<Surfel> {
    sample(mesh, count, |surfel, _, _| surfel)
}

/// Returns the surfels of [`sample_surface`] with their colors: red, green and blue, 0 to 255.
///
/// It is empty if the mesh has no color. Cost: O(triangles + count).
#[must_use]
pub fn sample_colored_surface(mesh: &TriMesh, count: usize) -> Vec<(Surfel, [f32; 3])> {
    let count = if mesh.color().is_some() { count } else { 0 };
    sample(mesh, count, |surfel, triangle, weights| {
        let color = mesh.color_at(triangle, weights);
        (surfel, color.unwrap_or_default())
    })
}

/// Samples a surface. `take` receives the surfel, its triangle and its barycentric coordinates.
fn sample<T>(mesh: &TriMesh, count: usize, take: impl Fn(Surfel, usize, [f32; 3]) -> T) -> Vec<T> {
    // R₂, the analogue of the golden-ratio sequence in two dimensions: 1/g and 1/g² with g³ = g +
    // 1.
    const STEP_1: f64 = 0.754_877_666_246_692_7;
    const STEP_2: f64 = 0.569_840_290_998_053_3;

    let count = count.min(MAX_SAMPLES);
    let inward = mesh.facing() == Facing::Inward;
    let spacing = mesh.area() / count.max(1) as f64;
    let mut samples = Vec::with_capacity(count);
    let mut accumulated = 0.0;
    for triangle in 0..mesh.triangles().len() {
        accumulated += mesh.triangle_area(triangle);
        let Some(normal) = mesh.normal(triangle) else {
            continue;
        };
        let normal = if inward { -normal } else { normal };
        let [a, b, c] = mesh.corners(triangle).map(|p| p.cast::<f64>());
        while samples.len() < count && (samples.len() as f64 + 0.5) * spacing < accumulated {
            let i = samples.len() as f64;
            let (mut s, mut t) = ((0.5 + i * STEP_1).fract(), (0.5 + i * STEP_2).fract());
            if s + t > 1.0 {
                (s, t) = (1.0 - s, 1.0 - t);
            }
            let surfel = Surfel {
                point: (a + (b - a) * s + (c - a) * t).cast::<f32>(),
                normal,
            };
            #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
            let weights = [1.0 - s - t, s, t].map(|weight| weight as f32);
            samples.push(take(surfel, triangle, weights));
        }
    }
    samples
}
