//! Tests of mesh defects: on shapes with known defects, and against counts by definition.

use std::collections::BTreeSet;

use crate::support::{Numbers, cuboid, wedge};
use hicp_core::{MeshSurvey, Point3, TriMesh};

/// Returns the survey of a closed mesh of one part, changed where `change` says so.
fn clean_but(change: impl FnOnce(&mut MeshSurvey)) -> MeshSurvey {
    let mut survey = MeshSurvey::default();
    survey.components = 1;
    change(&mut survey);
    survey
}

/// A box with its triangles and vertices changed.
fn changed(change: impl FnOnce(&mut Vec<Point3<f32>>, &mut Vec<[u32; 3]>)) -> MeshSurvey {
    let mesh = cuboid(0.1, 0.2, 0.3);
    let (mut vertices, mut triangles) = (mesh.vertices().to_vec(), mesh.triangles().to_vec());
    change(&mut vertices, &mut triangles);
    TriMesh::new(vertices, triangles).unwrap().survey()
}

#[test]
fn closed_meshes_have_no_defects() {
    for mesh in [cuboid(0.1, 0.2, 0.3), wedge()] {
        assert_eq!(mesh.survey(), clean_but(|_| {}));
        assert!(mesh.survey().is_watertight());
    }
}

#[test]
fn each_defect_has_its_own_count() {
    for t in 0..12 {
        let missing = changed(|_, triangles| {
            triangles.remove(t);
        });
        let expected = clean_but(|survey| survey.boundary_edges = 3);
        assert_eq!(missing, expected);
        assert!(!missing.is_watertight());

        // Watertightness ignores the winding.
        let turned = changed(|_, triangles| triangles[t].swap(1, 2));
        let expected = clean_but(|survey| survey.misoriented_edges = 3);
        assert_eq!(turned, expected);
        assert!(turned.is_watertight());

        for order in [[0, 1, 2], [1, 2, 0], [2, 1, 0]] {
            let doubled = changed(|_, triangles| {
                let triangle = triangles[t];
                triangles.push(order.map(|corner: usize| triangle[corner]));
            });
            let expected = clean_but(|survey| {
                survey.duplicate_triangles = 1;
                survey.non_manifold_edges = 3;
            });
            assert_eq!(doubled, expected);
            assert!(!doubled.is_watertight());
        }
    }
}

#[test]
fn triangles_without_area_count_and_repeated_corners_give_no_edges() {
    let survey = changed(|_, triangles| triangles.extend([[0, 0, 1], [3, 2, 2], [5, 4, 5]]));
    let expected = clean_but(|survey| survey.degenerate_triangles = 3);
    assert_eq!(survey, expected);
    assert!(survey.is_watertight());
    // Three corners on a line have edges. Two of them are new here, and the third is one of the
    // box.
    let survey = changed(|vertices, triangles| {
        vertices.push(nalgebra::center(&vertices[0], &vertices[1]));
        triangles.push([0, 8, 1]);
    });
    let expected = clean_but(|survey| {
        survey.degenerate_triangles = 1;
        survey.boundary_edges = 2;
        survey.non_manifold_edges = 1;
    });
    assert_eq!(survey, expected);
}

#[test]
fn vertices_differ_by_position_and_parts_by_vertices() {
    // Separate vertices for each triangle, zeros of either sign, and two unused vertices.
    let seamed = changed(|vertices, triangles| {
        let corners = triangles.iter().flatten();
        let mut own: Vec<_> = corners.map(|i| vertices[*i as usize]).collect();
        for (index, vertex) in own.iter_mut().enumerate() {
            vertex.x = if vertex.x < 0.0 { 0.0 } else { vertex.x };
            if index % 2 == 0 && vertex.x == 0.0 {
                vertex.x = -0.0;
            }
        }
        own.extend([Point3::origin(), Point3::new(1.0, 1.0, 1.0)]);
        *vertices = own;
        *triangles = (0..12).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    });
    let expected = clean_but(|survey| survey.unused_vertices = 2);
    assert_eq!(seamed, expected);

    // Two boxes next to each other are two parts; corner to corner they are one.
    for (gap, components) in [(0.05, 2), (0.0, 1)] {
        let pair = changed(|vertices, triangles| {
            let mesh = cuboid(0.1, 0.2, 0.3);
            let by = mesh.vertices()[7] - mesh.vertices()[0];
            let beside = |p: &Point3<f32>| p + by * (1.0 + gap);
            vertices.extend(mesh.vertices().iter().map(beside));
            triangles.extend(mesh.triangles().iter().map(|t| t.map(|i| i + 8)));
        });
        let expected = clean_but(|survey| survey.components = components);
        assert_eq!(pair, expected);
    }
}

#[test]
fn a_mesh_without_edges_is_not_watertight() {
    let nothing = clean_but(|survey| survey.components = 0);
    assert!(!nothing.is_watertight());
    for components in [1, 2, 7] {
        let parts = clean_but(|survey| survey.components = components);
        assert!(parts.is_watertight());
    }
}

/// The counts by their definitions, each with a separate search over all triangles.
fn by_definition(mesh: &TriMesh) -> MeshSurvey {
    let positions: Vec<[i32; 3]> = mesh
        .vertices()
        .iter()
        .map(|p| {
            #[allow(clippy::cast_possible_truncation)]
            [p.x, p.y, p.z].map(|x| x as i32)
        })
        .collect();
    let all: Vec<[[i32; 3]; 3]> = mesh
        .triangles()
        .iter()
        .map(|corners| corners.map(|i| positions[i as usize]))
        .collect();
    let collinear = |[a, b, c]: &[[i32; 3]; 3]| {
        let along = |to: &[i32; 3]| [to[0] - a[0], to[1] - a[1], to[2] - a[2]];
        let (p, q) = (along(b), along(c));
        let cross = |i: usize, j: usize| p[i] * q[j] - p[j] * q[i];
        cross(0, 1) == 0 && cross(1, 2) == 0 && cross(2, 0) == 0
    };
    let set = |triangle: &[[i32; 3]; 3]| BTreeSet::from(*triangle);
    let sound: Vec<[[i32; 3]; 3]> = all.iter().filter(|t| set(t).len() == 3).copied().collect();
    let walks = |triangle: &[[i32; 3]; 3], from: &[i32; 3], to: &[i32; 3]| {
        (0..3).any(|side| triangle[side] == *from && triangle[(side + 1) % 3] == *to)
    };
    let places: Vec<[i32; 3]> = BTreeSet::from_iter(positions).into_iter().collect();
    let mut survey = MeshSurvey::default();
    survey.degenerate_triangles = all.iter().filter(|t| collinear(t)).count();
    survey.duplicate_triangles = (0..sound.len())
        .filter(|&i| sound[..i].iter().any(|t| set(t) == set(&sound[i])))
        .count();
    survey.unused_vertices = (0..mesh.vertices().len())
        .filter(|i| {
            let mut used = mesh.triangles().iter().flatten();
            used.all(|corner| *corner as usize != *i)
        })
        .count();
    for (i, a) in places.iter().enumerate() {
        for b in &places[..i] {
            let there = sound.iter().filter(|t| walks(t, a, b)).count();
            let back = sound.iter().filter(|t| walks(t, b, a)).count();
            survey.boundary_edges += usize::from(there + back == 1);
            survey.non_manifold_edges += usize::from(there + back > 2);
            survey.misoriented_edges += usize::from(there + back == 2 && there != back);
        }
    }
    let mut left = sound;
    while let Some(first) = left.pop() {
        survey.components += 1;
        let mut part = set(&first);
        while let Some(next) = left
            .iter()
            .position(|t| t.iter().any(|corner| part.contains(corner)))
        {
            part.extend(left.swap_remove(next));
        }
    }
    survey
}

#[test]
fn random_triangles_are_counted_as_by_definition() {
    let mut numbers = Numbers(71);
    let (mut surveyed, mut odd) = (0, [0; 7]);
    for _ in 0..400 {
        // Vertices on a grid, some of them more than once.
        let wide = 2 + numbers.below(3);
        let vertices: Vec<Point3<f32>> = (0..6 + numbers.below(20))
            .map(|_| {
                #[allow(clippy::cast_precision_loss)]
                Point3::from([0; 3].map(|_| numbers.below(wide) as f32))
            })
            .collect();
        let corner = |numbers: &mut Numbers| u32::try_from(numbers.below(vertices.len())).unwrap();
        let triangles = (0..1 + numbers.below(16))
            .map(|_| [0; 3].map(|_| corner(&mut numbers)))
            .collect();
        let Ok(mesh) = TriMesh::new(vertices.clone(), triangles) else {
            continue;
        };
        let survey = mesh.survey();
        assert_eq!(survey, by_definition(&mesh));
        surveyed += 1;
        let counts = [
            survey.degenerate_triangles,
            survey.duplicate_triangles,
            survey.unused_vertices,
            survey.boundary_edges,
            survey.non_manifold_edges,
            survey.misoriented_edges,
            survey.components - 1,
        ];
        for (odd, count) in odd.iter_mut().zip(counts) {
            *odd += usize::from(count > 0);
        }
    }
    assert!(surveyed > 300, "{surveyed}");
    assert!(odd.iter().all(|odd| *odd > 20), "{odd:?}");
}
