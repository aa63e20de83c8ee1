//! Tests of accepted and refused meshes, and of their facing.

use crate::support::{Numbers, cuboid, cuboid_triangles, wedge};
use hicp_core::{Facing, MAX_COORDINATE_METERS, MeshError, Point3, TriMesh};

fn inverted(mesh: &TriMesh) -> TriMesh {
    let triangles = mesh
        .triangles()
        .iter()
        .map(|[a, b, c]| [*a, *c, *b])
        .collect();
    TriMesh::new(mesh.vertices().to_vec(), triangles).unwrap()
}

fn moved(mesh: &TriMesh, by: f32) -> Vec<Point3<f32>> {
    mesh.vertices()
        .iter()
        .map(|p| Point3::new(p.x + by, p.y, p.z))
        .collect()
}

fn join(a: &TriMesh, b: &TriMesh) -> TriMesh {
    let offset = u32::try_from(a.vertices().len()).unwrap();
    let mut vertices = a.vertices().to_vec();
    vertices.extend_from_slice(b.vertices());
    let mut triangles = a.triangles().to_vec();
    triangles.extend(b.triangles().iter().map(|t| t.map(|i| i + offset)));
    TriMesh::new(vertices, triangles).unwrap()
}

#[test]
fn closed_meshes_determine_their_facing() {
    for mesh in [cuboid(0.1, 0.2, 0.3), wedge()] {
        assert_eq!(mesh.facing(), Facing::Outward);
        assert!(mesh.is_closed());
        assert_eq!(inverted(&mesh).facing(), Facing::Inward);
        assert!(inverted(&mesh).is_closed());
        // The volume does not depend on the origin, even if f32 has no digits to spare.
        let far = TriMesh::new(moved(&mesh, 1000.0), mesh.triangles().to_vec()).unwrap();
        assert_eq!(far.facing(), Facing::Outward);
    }
}

#[test]
fn open_and_inconsistent_meshes_have_unknown_facing() {
    let mesh = cuboid(0.1, 0.2, 0.3);
    for missing in 0..12 {
        let mut triangles = mesh.triangles().to_vec();
        triangles.remove(missing);
        let open = TriMesh::new(mesh.vertices().to_vec(), triangles).unwrap();
        assert_eq!(open.facing(), Facing::Unknown);
        assert!(!open.is_closed());

        let mut triangles = mesh.triangles().to_vec();
        triangles[missing].swap(1, 2);
        let inconsistent = TriMesh::new(mesh.vertices().to_vec(), triangles).unwrap();
        assert_eq!(inconsistent.facing(), Facing::Unknown);

        // A duplicated triangle adds a third use to its edges.
        let mut triangles = mesh.triangles().to_vec();
        triangles.push(triangles[missing]);
        let doubled = TriMesh::new(mesh.vertices().to_vec(), triangles).unwrap();
        assert_eq!(doubled.facing(), Facing::Unknown);
    }
}

#[test]
fn two_uses_of_an_edge_in_each_direction_differ_from_one() {
    // The same box twice: every edge has two uses in each direction.
    let mesh = cuboid(0.1, 0.1, 0.1);
    let mut triangles = mesh.triangles().to_vec();
    triangles.extend(cuboid_triangles());
    let twice = TriMesh::new(mesh.vertices().to_vec(), triangles).unwrap();
    assert_eq!(twice.facing(), Facing::Unknown);
    // A sheet with a front and a back is closed but has no inside.
    let corners = mesh.vertices()[..3].to_vec();
    let sheet = TriMesh::new(corners, vec![[0, 1, 2], [0, 2, 1]]).unwrap();
    assert_eq!(sheet.facing(), Facing::Unknown);
}

#[test]
fn parts_must_agree_on_the_facing() {
    let a = cuboid(0.1, 0.1, 0.1);
    let b = TriMesh::new(moved(&wedge(), 0.5), wedge().triangles().to_vec()).unwrap();
    assert_eq!(join(&a, &b).facing(), Facing::Outward);
    assert_eq!(join(&inverted(&a), &inverted(&b)).facing(), Facing::Inward);
    // A small inverted part next to a large one: the total volume would still be positive.
    assert_eq!(join(&a, &inverted(&b)).facing(), Facing::Unknown);
    assert_eq!(join(&inverted(&a), &b).facing(), Facing::Unknown);
}

#[test]
fn seams_with_separate_vertices_do_not_open_a_mesh() {
    let mesh = cuboid(0.1, 0.2, 0.3);
    // Give every triangle separate vertices, as exporters do for texture seams, and use −0 as well
    // as +0.
    let mut vertices: Vec<Point3<f32>> = Vec::new();
    for t in 0..12 {
        vertices.extend(mesh.corners(t).map(|p| {
            let sign = if t % 2 == 0 { -0.0 } else { 0.0 };
            Point3::new(p.x + 0.05, p.y, p.z).map(|x| if x == 0.0 { sign } else { x })
        }));
    }
    let triangles: Vec<[u32; 3]> = (0..12).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let seamed = TriMesh::new(vertices.clone(), triangles.clone()).unwrap();
    assert_eq!(seamed.facing(), Facing::Outward);
    assert_eq!(inverted(&seamed).facing(), Facing::Inward);
    assert!(
        vertices
            .iter()
            .any(|p| p.x.to_bits() == (-0.0_f32).to_bits())
    );
    // A seam with a gap is open.
    vertices[0].x += 1e-4;
    assert_eq!(
        TriMesh::new(vertices, triangles).unwrap().facing(),
        Facing::Unknown
    );
}

#[test]
fn triangles_with_a_repeated_corner_do_not_affect_the_facing() {
    // A triangle with a repeated corner has no area and does not affect the facing.
    let mesh = cuboid(0.1, 0.2, 0.3);
    let mut triangles = mesh.triangles().to_vec();
    triangles.push([0, 0, 1]);
    triangles.push([2, 2, 2]);
    let mesh = TriMesh::new(mesh.vertices().to_vec(), triangles).unwrap();
    assert_eq!(mesh.facing(), Facing::Outward);
    assert_eq!(mesh.normal(12), None);
    assert_eq!(mesh.triangle_area(13), 0.0);
}

#[test]
fn areas_and_normals_follow_the_winding() {
    let mesh = cuboid(0.1, 0.2, 0.3);
    let expected = 2.0 * (0.1 * 0.2 + 0.2 * 0.3 + 0.3 * 0.1);
    assert!((mesh.area() - expected).abs() < 1e-7 * expected);
    for t in 0..12 {
        let normal = mesh.normal(t).unwrap();
        let [a, b, c] = mesh.corners(t);
        // The normal points out of a convex body around the origin.
        assert!(normal.dot(&(a.coords + b.coords + c.coords)) > 0.0, "{t}");
        assert!((normal.norm() - 1.0).abs() < 2e-7);
    }
    let mut numbers = Numbers(51);
    let mut triangle = || {
        #[allow(clippy::cast_possible_truncation)]
        [0, 1, 2].map(|_| Point3::from(numbers.vector().map(|x| x as f32)))
    };
    for _ in 0..20 {
        let corners = triangle();
        let mesh = TriMesh::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap();
        let [a, b, c] = corners.map(|p| p.cast::<f64>());
        let (x, y, z) = ((b - a).norm(), (c - b).norm(), (a - c).norm());
        let s = 0.5 * (x + y + z);
        let heron = (s * (s - x) * (s - y) * (s - z)).sqrt();
        assert!((mesh.area() - heron).abs() < 1e-9);
    }
}

#[test]
fn unused_vertices_are_found() {
    let mut vertices = wedge().vertices().to_vec();
    vertices.insert(2, Point3::new(9.0, 9.0, 9.0));
    let triangles = wedge()
        .triangles()
        .iter()
        .map(|t| t.map(|i| i + u32::from(i >= 2)))
        .collect();
    let mesh = TriMesh::new(vertices, triangles).unwrap();
    assert_eq!(
        mesh.used_vertices(),
        [true, true, false, true, true, true, true]
    );
    assert!(mesh.used_points().eq(wedge().vertices().iter().copied()));
    assert_eq!(mesh.facing(), Facing::Outward);
}

#[test]
fn invalid_meshes_are_refused_with_the_reason() {
    let corners = || {
        vec![
            Point3::origin(),
            Point3::new(0.1, 0.0, 0.0),
            Point3::new(0.0, 0.1, 0.0),
        ]
    };
    let error = |vertices, triangles| TriMesh::new(vertices, triangles).unwrap_err();
    assert_eq!(
        error(corners(), vec![]),
        MeshError::NoTriangles { vertices: 3 }
    );
    assert_eq!(
        error(vec![], vec![]),
        MeshError::NoTriangles { vertices: 0 }
    );
    assert_eq!(
        error(corners(), vec![[0, 1, 2], [0, 3, 1]]),
        MeshError::IndexOutOfRange {
            triangle: 1,
            index: 3,
            vertices: 3
        }
    );
    assert_eq!(
        error(vec![], vec![[0, 0, 0]]),
        MeshError::IndexOutOfRange {
            triangle: 0,
            index: 0,
            vertices: 0
        }
    );
    for bad in [
        f32::NAN,
        f32::INFINITY,
        -f32::INFINITY,
        1.1 * MAX_COORDINATE_METERS,
    ] {
        for axis in 0..3 {
            let mut vertices = corners();
            vertices[1][axis] = bad;
            let MeshError::Coordinate { vertex, limit, .. } = error(vertices, vec![[0, 1, 2]])
            else {
                panic!("accepted {bad}");
            };
            assert_eq!((vertex, limit), (1, MAX_COORDINATE_METERS));
        }
    }
    assert_eq!(
        error(corners(), vec![[0, 1, 1], [2, 2, 2]]),
        MeshError::NoArea { triangles: 2 }
    );
    let line = vec![
        Point3::origin(),
        Point3::new(0.1, 0.1, 0.1),
        Point3::new(0.2, 0.2, 0.2),
    ];
    assert_eq!(
        error(line, vec![[0, 1, 2]]),
        MeshError::NoArea { triangles: 1 }
    );
}

#[test]
fn the_coordinate_step_grows_far_from_the_origin() {
    let at = |x: f32| {
        let corner = |x, y| Point3::new(x, y, 0.0);
        let mut vertices = vec![corner(x, 0.0), corner(x + 1.0, 0.0), corner(x, 1.0)];
        // A vertex that no triangle uses does not belong to the shape.
        vertices.push(corner(9e6, 0.0));
        let mesh = TriMesh::new(vertices, vec![[0, 1, 2]]).unwrap();
        mesh.coordinate_step()
    };
    assert!(at(0.0) < 1e-6);
    // Between 2²⁰ and 2²¹, the resolution of a 24-bit number is an eighth.
    assert_eq!(at(1.5e6), 0.125);
}
