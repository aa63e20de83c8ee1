//! Meshes, poses and an independent ray caster.

use hicp_core::{
    Isometry3, PinholeCamera, PixelRegion, Point3, RenderedView, Renderer, Translation3, TriMesh,
    UnitQuaternion, Vector3,
};
use hicp_raster::{Culling, DEFAULT_NEAR_METERS, RasterConfig, Rasterizer};
use proptest::prelude::*;

/// A camera with non-square pixels, an off-center principal point, and an image small enough for
/// brute force.
pub(crate) fn camera() -> PinholeCamera {
    PinholeCamera::new(52.0, 47.5, 21.3, 30.8, 56, 48).unwrap()
}

pub(crate) fn rasterizer(culling: Culling) -> Rasterizer {
    Rasterizer::new(RasterConfig {
        culling,
        ..RasterConfig::default()
    })
}

/// Renders into a new view.
pub(crate) fn render_region(
    rasterizer: &mut Rasterizer,
    mesh: &TriMesh,
    camera: &PinholeCamera,
    pose: &Isometry3<f64>,
    region: &PixelRegion,
) -> RenderedView {
    let mut view = RenderedView::default();
    rasterizer.render(mesh, camera, pose, region, &mut view);
    view
}

pub(crate) fn render(
    culling: Culling,
    mesh: &TriMesh,
    camera: &PinholeCamera,
    pose: &Isometry3<f64>,
) -> RenderedView {
    render_region(
        &mut rasterizer(culling),
        mesh,
        camera,
        pose,
        &camera.region(),
    )
}

/// Returns the depth bits of the whole image.
pub(crate) fn depth_bits(view: &RenderedView, camera: &PinholeCamera) -> Vec<u32> {
    pixels(camera)
        .map(|(u, v)| view.depth_at(u, v).to_bits())
        .collect()
}

pub(crate) fn pixels(camera: &PinholeCamera) -> impl Iterator<Item = (u32, u32)> {
    let width = camera.width();
    (0..camera.height()).flat_map(move |v| (0..width).map(move |u| (u, v)))
}

/// Returns the nearest intersection of a pixel's ray with any triangle at or beyond the near plane.
///
/// Both sides of triangles count. It is Möller and Trumbore's test in `f64`, in the object frame,
/// and shares nothing with the rasterizer.
pub(crate) fn cast(
    mesh: &TriMesh,
    camera: &PinholeCamera,
    pose: &Isometry3<f64>,
    u: u32,
    v: u32,
) -> Option<f64> {
    let through = camera.unproject(f64::from(u), f64::from(v), 1.0).coords;
    let origin = pose.inverse_transform_point(&Point3::origin());
    let direction = pose.inverse_transform_vector(&through);
    let mut nearest: Option<f64> = None;
    for triangle in 0..mesh.triangles().len() {
        let [a, b, c] = mesh.corners(triangle).map(|p| p.cast::<f64>());
        let (e1, e2) = (b - a, c - a);
        let p = direction.cross(&e2);
        let determinant = e1.dot(&p);
        if determinant == 0.0 {
            continue;
        }
        let s = origin - a;
        let alpha = s.dot(&p) / determinant;
        let q = s.cross(&e1);
        let beta = direction.dot(&q) / determinant;
        // The direction has z = 1 in the camera frame, so the parameter along the ray is the depth.
        let depth = e2.dot(&q) / determinant;
        if alpha >= 0.0 && beta >= 0.0 && alpha + beta <= 1.0 && depth >= DEFAULT_NEAR_METERS {
            nearest = Some(nearest.map_or(depth, |n| n.min(depth)));
        }
    }
    nearest
}

/// Returns whether a pixel center is within `margin` pixels of an edge of the clipped triangle.
///
/// The edges are those of the triangle after clipping at the near plane and projecting.
pub(crate) fn near_an_edge(
    mesh: &TriMesh,
    camera: &PinholeCamera,
    pose: &Isometry3<f64>,
    u: u32,
    v: u32,
    margin: f64,
) -> bool {
    let near = DEFAULT_NEAR_METERS;
    let center = (f64::from(u), f64::from(v));
    (0..mesh.triangles().len()).any(|triangle| {
        let corners = mesh.corners(triangle).map(|p| pose * p.cast::<f64>());
        let mut outline: Vec<Point3<f64>> = Vec::new();
        for k in 0..3 {
            let (p, q) = (corners[k], corners[(k + 1) % 3]);
            if p.z >= near {
                outline.push(p);
            }
            if (p.z >= near) != (q.z >= near) {
                outline.push(p + (q - p) * ((near - p.z) / (q.z - p.z)));
            }
        }
        let outline: Vec<(f64, f64)> = outline
            .iter()
            .map(|p| {
                (
                    camera.fx() * p.x / p.z + camera.cx(),
                    camera.fy() * p.y / p.z + camera.cy(),
                )
            })
            .collect();
        (0..outline.len()).any(|k| {
            segment_distance(center, outline[k], outline[(k + 1) % outline.len()]) <= margin
        })
    })
}

fn segment_distance(c: (f64, f64), p: (f64, f64), q: (f64, f64)) -> f64 {
    let (dx, dy) = (q.0 - p.0, q.1 - p.1);
    let length = dx * dx + dy * dy;
    let t = if length > 0.0 {
        (((c.0 - p.0) * dx + (c.1 - p.1) * dy) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (c.0 - p.0 - t * dx).hypot(c.1 - p.1 - t * dy)
}

/// Asserts that a view agrees with the ray caster at every pixel away from edges.
///
/// Returns the number of hit pixels.
pub(crate) fn assert_agrees(
    view: &RenderedView,
    mesh: &TriMesh,
    camera: &PinholeCamera,
    pose: &Isometry3<f64>,
    relative: f64,
) -> usize {
    let mut hits = 0;
    for (u, v) in pixels(camera) {
        let rendered = f64::from(view.depth_at(u, v));
        let cast = cast(mesh, camera, pose, u, v).unwrap_or(0.0);
        if (rendered - cast).abs() <= relative * cast {
            hits += usize::from(cast > 0.0);
        } else {
            assert!(
                near_an_edge(mesh, camera, pose, u, v, 1.0 / 64.0),
                "pixel ({u}, {v}): rendered {rendered}, cast {cast}"
            );
        }
    }
    hits
}

/// A subdivided icosahedron of radius 0.1 m.
pub(crate) fn icosphere(subdivisions: u32) -> TriMesh {
    let phi = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut vertices: Vec<Vector3<f64>> = Vec::new();
    for (a, b) in [(1.0, phi), (-1.0, phi), (1.0, -phi), (-1.0, -phi)] {
        vertices.push(Vector3::new(0.0, a, b));
        vertices.push(Vector3::new(a, b, 0.0));
        vertices.push(Vector3::new(b, 0.0, a));
    }
    // The faces are the triples of neighbors, at distance 2, wound to face outward.
    let mut triangles: Vec<[usize; 3]> = Vec::new();
    let adjacent = |p: &Vector3<f64>, q: &Vector3<f64>| ((p - q).norm() - 2.0).abs() < 1e-9;
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let (a, b, c) = (vertices[i], vertices[j], vertices[k]);
                if adjacent(&a, &b) && adjacent(&b, &c) && adjacent(&c, &a) {
                    let outward = (b - a).cross(&(c - a)).dot(&a) > 0.0;
                    triangles.push(if outward { [i, j, k] } else { [i, k, j] });
                }
            }
        }
    }
    assert_eq!(triangles.len(), 20);
    for _ in 0..subdivisions {
        let mut middle = std::collections::HashMap::new();
        let mut next = Vec::new();
        for [a, b, c] in triangles {
            let mut between = |p: usize, q: usize| {
                *middle.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    vertices.push(vertices[p] + vertices[q]);
                    vertices.len() - 1
                })
            };
            let (ab, bc, ca) = (between(a, b), between(b, c), between(c, a));
            next.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
            for v in &mut vertices {
                *v = v.normalize();
            }
        }
        triangles = next;
    }
    for v in &mut vertices {
        *v = v.normalize() * 0.1;
    }
    mesh_of(&vertices, &triangles)
}

/// A torus of radii 0.1 m and 0.04 m around the z axis.
pub(crate) fn torus(around: usize, across: usize) -> TriMesh {
    let angle = |k: usize, n: usize| k as f64 / n as f64 * std::f64::consts::TAU;
    let mut vertices = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..around {
        let (sin, cos) = angle(i, around).sin_cos();
        for j in 0..across {
            let (height, out) = angle(j, across).sin_cos();
            let radius = 0.1 + 0.04 * out;
            vertices.push(Vector3::new(radius * cos, radius * sin, 0.04 * height));
            let at = |i: usize, j: usize| i % around * across + j % across;
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    mesh_of(&vertices, &triangles)
}

/// A box of half sides 0.12 m, 0.07 m and 0.05 m.
pub(crate) fn cuboid() -> TriMesh {
    let corner = |k: usize, half: f64, bit: usize| if k >> bit & 1 == 1 { half } else { -half };
    let vertices: Vec<_> = (0..8)
        .map(|k| Vector3::new(corner(k, 0.12, 0), corner(k, 0.07, 1), corner(k, 0.05, 2)))
        .collect();
    let mut triangles = Vec::new();
    for [a, b, c, d] in [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ] {
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    mesh_of(&vertices, &triangles)
}

pub(crate) fn mesh_of(vertices: &[Vector3<f64>], triangles: &[[usize; 3]]) -> TriMesh {
    TriMesh::new(
        vertices
            .iter()
            .map(|v| Point3::from(*v).cast::<f32>())
            .collect(),
        triangles
            .iter()
            .map(|t| t.map(|i| u32::try_from(i).unwrap()))
            .collect(),
    )
    .unwrap()
}

/// The same surface with the opposite winding.
pub(crate) fn flipped(mesh: &TriMesh) -> TriMesh {
    let triangles = mesh.triangles().iter().map(|&[a, b, c]| [a, c, b]);
    TriMesh::new(mesh.vertices().to_vec(), triangles.collect()).unwrap()
}

pub(crate) fn closed_mesh() -> impl Strategy<Value = TriMesh> {
    prop_oneof![
        (0_u32..=2).prop_map(icosphere),
        (3_usize..14, 3_usize..9).prop_map(|(around, across)| torus(around, across)),
        Just(()).prop_map(|()| cuboid()),
    ]
}

/// Triangles anywhere in a cube of side 0.4 m, of any size and either winding.
pub(crate) fn soup() -> impl Strategy<Value = TriMesh> {
    let point = (-0.2..0.2_f32, -0.2..0.2_f32, -0.2..0.2_f32);
    prop::collection::vec([point.clone(), point.clone(), point], 1..30).prop_filter_map(
        "the soup has no area",
        |corners| {
            let vertices: Vec<_> = corners
                .iter()
                .flatten()
                .map(|(x, y, z)| Point3::new(*x, *y, *z))
                .collect();
            let triangles = (0..u32::try_from(corners.len()).unwrap())
                .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
                .collect();
            TriMesh::new(vertices, triangles).ok()
        },
    )
}

/// Poses of any orientation at a distance in a range, off the axis and partly outside of the image.
pub(crate) fn pose(z: std::ops::Range<f64>) -> impl Strategy<Value = Isometry3<f64>> {
    (
        [-1.0..1.0, -1.0..1.0, -1.0..1.0_f64],
        0.0..std::f64::consts::PI,
        -0.25..0.25,
        -0.25..0.25,
        z,
    )
        .prop_map(|(axis, angle, x, y, z)| {
            let axis = Vector3::from(axis)
                .try_normalize(1e-3)
                .unwrap_or(Vector3::x());
            Isometry3::from_parts(
                Translation3::new(x, y, z),
                UnitQuaternion::from_scaled_axis(axis * angle),
            )
        })
}
