//! Tests of shared edges, which must have neither gaps nor double hits for any vertices.

use crate::common::*;
use hicp_core::{Isometry3, PinholeCamera, Point3, TriMesh};
use hicp_raster::Culling;
use proptest::prelude::*;

const SIDE: u32 = 24;

/// A camera for which object coordinates at 1 m are pixels: x = u, y = v.
fn pixel_camera() -> PinholeCamera {
    PinholeCamera::new(1.0, 1.0, 0.0, 0.0, SIDE, SIDE).unwrap()
}

fn flat_mesh(points: &[(f32, f32)], triangles: &[[u32; 3]]) -> TriMesh {
    let vertices = points.iter().map(|(u, v)| Point3::new(*u, *v, 0.0));
    TriMesh::new(vertices.collect(), triangles.to_vec()).unwrap()
}

/// Returns the number of triangles that cover every pixel, each rendered alone.
fn hits(mesh: &TriMesh, camera: &PinholeCamera, pose: &Isometry3<f64>) -> Vec<u32> {
    let mut hits = vec![0; camera.region().area()];
    for &triangle in mesh.triangles() {
        let Ok(alone) = TriMesh::new(mesh.vertices().to_vec(), vec![triangle]) else {
            continue;
        };
        let view = render(Culling::Never, &alone, camera, pose);
        for (hit, (u, v)) in hits.iter_mut().zip(pixels(camera)) {
            *hit += u32::from(view.depth_at(u, v) > 0.0);
        }
    }
    hits
}

fn one_meter() -> Isometry3<f64> {
    Isometry3::translation(0.0, 0.0, 1.0)
}

#[test]
fn the_top_and_left_edges_own_their_pixels() {
    let camera = pixel_camera();
    let square = [(2.0, 3.0), (7.0, 3.0), (7.0, 6.0), (2.0, 6.0)];
    for triangles in [[[0, 1, 2], [0, 2, 3]], [[0, 3, 1], [1, 3, 2]]] {
        let mesh = flat_mesh(&square, &triangles);
        for (hit, (u, v)) in hits(&mesh, &camera, &one_meter())
            .iter()
            .zip(pixels(&camera))
        {
            let inside = (2..7).contains(&u) && (3..6).contains(&v);
            assert_eq!(*hit, u32::from(inside), "({u}, {v})");
        }
    }
}

#[test]
fn a_vertex_at_a_pixel_center_belongs_to_one_triangle_of_its_fan() {
    let camera = pixel_camera();
    let center = (10.0, 10.0);
    let ring = [
        (20.0, 10.0),
        (18.0, 16.0),
        (10.0, 21.0),
        (3.0, 17.0),
        (1.0, 10.0),
        (4.0, 4.0),
        (10.0, 2.0),
        (15.0, 5.0),
    ];
    let points: Vec<_> = std::iter::once(center).chain(ring).collect();
    let fan: Vec<_> = (0..8).map(|k| [0, 1 + k, 1 + (k + 1) % 8]).collect();
    let hits = hits(&flat_mesh(&points, &fan), &camera, &one_meter());
    assert!(hits.iter().all(|hit| *hit <= 1));
    assert_eq!(hits[10 * SIDE as usize + 10], 1);
    // On the spokes, too.
    for step in 1..5 {
        assert_eq!(hits[10 * SIDE as usize + 10 + step], 1);
        assert_eq!(hits[(10 + step) * SIDE as usize + 10], 1);
    }
}

/// A grid over the whole image whose inner points are moved by quarters of a pixel.
///
/// Many points are therefore at pixel centers.
fn grid() -> impl Strategy<Value = TriMesh> {
    const CELLS: usize = 6;
    let moves = prop::collection::vec(
        (-7_i8..=7, -7_i8..=7, any::<bool>()),
        (CELLS + 1) * (CELLS + 1),
    );
    moves.prop_map(|moves| {
        let step = (SIDE as f32 + 4.0) / CELLS as f32;
        let mut points = Vec::new();
        let mut triangles = Vec::new();
        for row in 0..=CELLS {
            for column in 0..=CELLS {
                let (du, dv, diagonal) = moves[row * (CELLS + 1) + column];
                let inner = (1..CELLS).contains(&row) && (1..CELLS).contains(&column);
                let shift = |d: i8| if inner { f32::from(d) / 4.0 } else { 0.0 };
                points.push((
                    (column as f32 * step - 2.0).round() + shift(du),
                    (row as f32 * step - 2.0).round() + shift(dv),
                ));
                if row < CELLS && column < CELLS {
                    let at = |r: usize, c: usize| {
                        u32::try_from((row + r) * (CELLS + 1) + column + c).unwrap()
                    };
                    let [a, b, c, d] = [at(0, 0), at(0, 1), at(1, 1), at(1, 0)];
                    triangles.extend(if diagonal {
                        [[a, b, c], [a, c, d]]
                    } else {
                        [[a, b, d], [b, c, d]]
                    });
                }
            }
        }
        flat_mesh(&points, &triangles)
    })
}

/// Returns the signed area in the image, as wound.
fn area(mesh: &TriMesh, triangle: usize) -> f32 {
    let [a, b, c] = mesh.corners(triangle);
    (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_tessellation_covers_every_pixel_once(mesh in grid()) {
        // A cell may be folded over. Its neighbors then rightly cover twice.
        let folded = (0..mesh.triangles().len()).any(|t| area(&mesh, t) < 0.0);
        let hits = hits(&mesh, &pixel_camera(), &one_meter());
        prop_assert!(hits.iter().all(|hit| *hit >= 1));
        prop_assert!(folded || hits.iter().all(|hit| *hit == 1));
    }

    /// Tests general positions in perspective, where rounding decides.
    ///
    /// Every pixel of a plane that fills the image is hit once.
    #[test]
    fn a_tilted_tessellation_covers_every_pixel_once(
        mesh in grid(),
        tilt in -0.9..0.9_f64,
        turn in -3.0..3.0_f64,
    ) {
        prop_assume!((0..mesh.triangles().len()).all(|t| area(&mesh, t) > 0.0));
        let camera = PinholeCamera::new(300.0, 280.0, 11.7, 12.9, SIDE, SIDE).unwrap();
        let pose = Isometry3::translation(0.0, 0.0, 60.0)
            * Isometry3::rotation(hicp_core::Vector3::new(tilt, 0.0, 0.0))
            * Isometry3::rotation(hicp_core::Vector3::new(0.0, 0.0, turn))
            * Isometry3::translation(-12.0, -12.0, 0.0);
        let hits = hits(&mesh, &camera, &pose);
        prop_assert!(hits.iter().all(|hit| *hit == 1), "{:?}", hits);
    }

    /// Pieces clipped by the near plane and the guard band still fit.
    ///
    /// The scene is a floor below the camera, from behind it to the horizon.
    #[test]
    fn a_clipped_tessellation_has_neither_gaps_nor_double_hits(
        mesh in grid(),
        height in 0.002..0.5_f64,
        turn in -3.0..3.0_f64,
    ) {
        prop_assume!((0..mesh.triangles().len()).all(|t| area(&mesh, t) > 0.0));
        let camera = PinholeCamera::new(12.0, 12.0, 11.7, 2.3, SIDE, SIDE).unwrap();
        let pose = Isometry3::translation(0.0, height, 0.0)
            * Isometry3::rotation(hicp_core::Vector3::new(std::f64::consts::FRAC_PI_2, 0.0, 0.0))
            * Isometry3::rotation(hicp_core::Vector3::new(0.0, 0.0, turn))
            * Isometry3::translation(-12.0, -12.0, 0.0);
        let hits = hits(&mesh, &camera, &pose);
        for (hit, (u, v)) in hits.iter().zip(pixels(&camera)) {
            // The floor's depth along the pixel's ray, and the intersection.
            let depth = height / ((f64::from(v) - 2.3) / 12.0);
            let point = camera.unproject(f64::from(u), f64::from(v), depth);
            if depth > 0.011 && depth < 11.0 && point.x.abs() < 7.0 {
                prop_assert_eq!(*hit, 1, "({}, {}), depth {}", u, v, depth);
            } else if depth < 0.009 {
                prop_assert_eq!(*hit, 0, "({}, {}), depth {}", u, v, depth);
            }
        }
    }
}

/// A closed mesh with its vertices and edges exactly at pixel centers.
#[test]
fn a_closed_mesh_at_pixel_centers_has_no_hole() {
    let camera = PinholeCamera::new(8.0, 8.0, 12.0, 12.0, SIDE, SIDE).unwrap();
    // An octahedron whose ring lies at depth 1 with corners at integer pixels. Its poles project to
    // the center pixel.
    let r = 1.0;
    let mesh = TriMesh::new(
        vec![
            Point3::new(r, 0.0, 0.0),
            Point3::new(0.0, r, 0.0),
            Point3::new(-r, 0.0, 0.0),
            Point3::new(0.0, -r, 0.0),
            Point3::new(0.0, 0.0, -0.5),
            Point3::new(0.0, 0.0, 0.5),
        ],
        vec![
            [0, 1, 5],
            [1, 2, 5],
            [2, 3, 5],
            [3, 0, 5],
            [1, 0, 4],
            [2, 1, 4],
            [3, 2, 4],
            [0, 3, 4],
        ],
    )
    .unwrap();
    for culling in [Culling::Auto, Culling::Never] {
        let view = render(culling, &mesh, &camera, &one_meter());
        let mut count = 0;
        for (u, v) in pixels(&camera) {
            let reach = u.abs_diff(12) + v.abs_diff(12);
            if reach < 8 {
                assert!(view.depth_at(u, v) > 0.0, "hole at ({u}, {v})");
                count += 1;
            } else if reach > 8 {
                assert!(view.depth_at(u, v) == 0.0, "spill at ({u}, {v})");
            }
        }
        assert_eq!(count, 113);
        assert_eq!(view.depth_at(12, 12), 0.5);
    }
}

/// Triangles larger than 512 px use another code path with the same result.
#[test]
fn large_triangles_cover_every_pixel_once() {
    let camera = PinholeCamera::new(1.0, 1.0, 0.0, 0.0, 4000, 3).unwrap();
    let points = [
        (-3.0, -2.0),
        (4003.25, -2.0),
        (4003.25, 5.5),
        (-3.0, 5.5),
        (1777.0, 1.0),
    ];
    let mesh = flat_mesh(&points, &[[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]);
    assert!(
        hits(&mesh, &camera, &one_meter())
            .iter()
            .all(|hit| *hit == 1)
    );
}
