//! Content that contradicts itself or the format.

use super::*;

#[test]
fn headers_that_announce_terabytes_are_refused() {
    let few = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".repeat(4);
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for (vertices, faces) in [("3", "1000000000000"), ("1000000000000", "1")] {
            let text = ply(format, vertices, faces, "uchar int") + &few;
            refused(
                "a.ply",
                text,
                &["line ", "promises 1000000000000", "are left"],
            );
        }
    }
    for element in [
        "vertex 18446744073709551615\nproperty float x",
        "empty 1000000000000",
    ] {
        let text = format!("ply\nformat ascii 1.0\nelement {element}\nend_header\n1 2 3\n");
        refused("a.ply", text, &["line 3", "promises"]);
    }
    let counts = ply("ascii", "18446744073709551616", "1", "uchar int");
    refused("a.ply", counts, &["line 3"]);
    refused("a.ply", ply("ascii", "-3", "1", "uchar int"), &["line 3"]);
    refused(
        "a.off",
        "OFF\n3 99999999999 0\n0 0 0\n1 0 0\n0 1 0\n",
        &["line 2", "99999999999 faces"],
    );
    refused(
        "a.stl",
        stl("made", u32::MAX, 1),
        &["byte 80", "4294967295 triangles"],
    );
    // A list that announces more corners than there are bytes, or fewer than none.
    for (count, bytes) in [
        ("int", (-1_i32).to_le_bytes()),
        ("int", 2_000_000_000_i32.to_le_bytes()),
        ("uint", [0xff; 4]),
    ] {
        let mut content =
            ply("binary_little_endian", "1", "1", &format!("{count} uint")).into_bytes();
        content.extend([0; 12]);
        content.extend(bytes);
        content.extend([0; 40]);
        refused("a.ply", content, &["byte ", "element 0 of 1"]);
    }
    refused(
        "a.ply",
        ply("ascii", "3", "1", "uchar int") + "0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n",
        &["line 13"],
    );
}

#[test]
fn indices_out_of_range_are_refused() {
    for face in [
        "f 1 2 5",
        "f 1 2 0",
        "f 1 2 -5",
        "f 1 2 4294967297",
        "f 1 2 1e3",
        "f 1 2 3.0",
    ] {
        refused(
            "a.obj",
            format!("{SQUARE}{face}\n"),
            &["line 5", face, "expected"],
        );
    }
    for index in ["4", "-1", "4294967296"] {
        let text = ply("ascii", "3", "2", "uchar int") + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
        let named = format!("vertex {index} in face 1");
        refused(
            "a.ply",
            format!("{text}3 0 1 {index}\n"),
            &["line 14", &named],
        );
        refused(
            "a.off",
            format!("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 {index}\n"),
            &["line 6", index, "0 to 2"],
        );
    }
}

#[test]
fn invalid_coordinates_are_refused() {
    for value in [
        "nan",
        "-NaN",
        "inf",
        "-Infinity",
        "1e400",
        "1e30",
        "-20000000",
    ] {
        for position in [
            format!("{value} 0 0"),
            format!("0 {value} 0"),
            format!("0 0 {value}"),
        ] {
            let text = format!("{SQUARE}v {position}\nf 1 2 5\n");
            refused("a.obj", text, &["line 5", "finite", "m"]);
        }
        refused(
            "a.off",
            format!("OFF\n3 1 0\n0 0 0\n1 {value} 0\n0 1 0\n3 0 1 2\n"),
            &["line 4", "finite"],
        );
        let vertices = format!("0 0 0\n1 0 0\n{value} 1 0\n3 0 1 2\n");
        refused(
            "a.ply",
            ply("ascii", "3", "1", "uchar int") + &vertices,
            &["line 12", "finite"],
        );
        let facet = format!("solid\nfacet normal 0 0 1 outer loop\n\nvertex {value} 0 0\n");
        refused("a.stl", facet, &["line 4", "finite"]);
    }
    let mut binary = stl("", 2, 2);
    let second = 84 + 50 + 12;
    binary[second..second + 4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    refused("a.stl", binary, &["byte 146", "finite"]);
    // The coordinates of a map are accepted, and so are denormal numbers.
    let far = "v 500000 4582345.26 0\nv 500010 4582345 0\nv 500000 4582355 0\nf 1 2 3\n";
    assert_eq!(triangles("a.obj", far), 1);
    assert_eq!(
        triangles("a.obj", format!("{SQUARE}v 1e-310 -4e-45 0\nf 5 2 3\n")),
        1
    );
}

#[test]
fn truncated_files_are_refused() {
    let text = format!("solid a\n{}endsolid a\n", "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n".repeat(2));
    assert_eq!(triangles("a.stl", &text), 2);
    assert_eq!(triangles("a.stl", text.trim_end()), 2);
    for end in text
        .match_indices('\n')
        .map(|(at, _)| at)
        .filter(|at| *at + 12 < text.len())
    {
        refused(
            "a.stl",
            &text[..end],
            &["line ", "the end of the file", "expected"],
        );
    }
    for padding in [0, 1, 49] {
        let mut content = stl("solid", 3, 3);
        content.extend(vec![0; padding]);
        assert_eq!(triangles("a.stl", &content), 3);
    }
    for missing in [1, 49, 50, 149, 150] {
        let mut content = stl("solid", 3, 3);
        content.truncate(content.len() - missing);
        refused("a.stl", &content, &["byte 80", "promises 3 triangles"]);
    }
    refused(
        "a.stl",
        stl("", 2, 3),
        &["byte 80", "2 triangles", "3, which"],
    );
    refused("a.stl", stl("", 0, 1), &["byte 80"]);
    let whole = ply("ascii", "3", "1", "uchar int") + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2";
    assert_eq!(triangles("a.ply", &whole), 1);
    for end in 1..whole.len() {
        refused("a.ply", &whole[..end], &[]);
    }
    let mut binary = ply("binary_big_endian", "3", "1", "double short").into_bytes();
    binary.extend([0; 36 + 8 + 6]);
    refused("a.ply", binary, &["a.ply"]);
}

#[test]
fn files_without_faces_are_refused() {
    refused("a.obj", "", &["line 1", "a face of three corners"]);
    refused("a.obj", "# nothing\n", &["a face of three corners"]);
    refused(
        "a.obj",
        SQUARE,
        &["line 4", "end of the file", "a face of three corners"],
    );
    refused(
        "a.obj",
        format!("{SQUARE}l 1 2 3\np 1\nf 1 2\n"),
        &["line ", "a face of three corners"],
    );
    refused(
        "a.off",
        "OFF\n0 0 0\n",
        &["line 2", "a face of three corners"],
    );
    refused(
        "a.ply",
        ply("ascii", "1", "0", "uchar int") + "0 0 0\n",
        &["line 7", "a face of three corners"],
    );
    refused(
        "a.ply",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n",
        &["line 7", "a face of three corners"],
    );
    refused(
        "a.stl",
        stl("", 0, 0),
        &["byte 80", "a count of 0", "a face of three corners"],
    );
    refused(
        "a.stl",
        "solid empty\nendsolid empty\n",
        &["line ", "a face of three corners"],
    );
    for name in ["a.off", "a.ply", "a.stl"] {
        refused(
            name,
            "",
            &["line 1"].map(|part| if name == "a.stl" { "byte 0" } else { part }),
        );
    }
    refused("a.obj", format!("{SQUARE}f 1 1 2\n"), &["zero area"]);
}

#[test]
fn the_error_for_a_ply_file_without_vertices_lists_its_elements() {
    let text = ply("ascii", "3", "1", "uchar int").replace("element vertex", "element Vertex");
    refused(
        "a.ply",
        format!("{text}0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
        &["[\"Vertex\", \"face\"]", "expected an element `vertex`"],
    );
}
