//! Parses PLY files into meshes and point clouds.

use hicp_core::Vector3;

use super::header::{
    COLOR_SLOTS, Element, Encoding, FACE_IMAGE, FACE_TEXTURE, Header, Property, TEXTURE_SLOTS,
};
use super::rows::Rows;
use crate::error::{IoError, Place, quote};
use crate::limits::Limit;
use crate::mesh::raw::{FACE, RawMesh, Reading};
use crate::mesh::texture;
use crate::number::{narrow, whole};

/// Returns an error if the header alone shows that the file has too many elements.
///
/// A header that is longer than `head` or invalid is left to the parser.
pub(crate) fn check_head(reading: &Reading<'_>, head: &[u8], bytes: u64) -> Result<(), IoError> {
    match Header::parse(reading.path, head, bytes) {
        Ok(header) => check_counts(reading, &header),
        Err(_) => Ok(()),
    }
}

fn check_counts(reading: &Reading<'_>, header: &Header) -> Result<(), IoError> {
    for (name, limit) in [("vertex", Limit::VERTICES), ("face", Limit::TRIANGLES)] {
        if let Some(element) = header.element(name) {
            reading.check(limit, Place::Line(element.line), element.count)?;
        }
    }
    Ok(())
}

/// Parses the vertices and faces of a PLY file.
pub(crate) fn parse_mesh(reading: Reading<'_>, content: Vec<u8>) -> Result<RawMesh<'_>, IoError> {
    parse(reading, &content, true)
}

/// Parses the vertices of a PLY file with their normals, which are NaN if the file has none.
///
/// Vertices without a position are skipped.
pub(crate) fn parse_points<'a>(
    reading: Reading<'a>,
    content: &[u8],
) -> Result<RawMesh<'a>, IoError> {
    parse(reading, content, false)
}

fn parse<'a>(
    reading: Reading<'a>,
    content: &[u8],
    with_faces: bool,
) -> Result<RawMesh<'a>, IoError> {
    let header = Header::parse(reading.path, content, content.len() as u64)?;
    check_counts(&reading, &header)?;
    if let Some(Element {
        line, count: 1.., ..
    }) = header.element("tristrips")
        && with_faces
    {
        return Err(reading.refuse(Place::Line(*line), "triangle strips", "an element `face`"));
    }
    // Element names are case-sensitive, so the message lists them as they are.
    let names: Vec<&str> = header.elements.iter().map(|e| &*e.name).collect();
    let names = format!("the elements {names:?}");
    let end = Place::Line(header.lines);
    let Some(vertex) = header.element("vertex") else {
        return Err(reading.refuse(end, names, "an element `vertex`"));
    };
    vertex.require(reading.path, 3, "properties `x`, `y` and `z`")?;

    const POINTS: &str = "an element `face` with a face of three corners or more: vertices alone are a point cloud, not a mesh";
    let mut mesh = RawMesh::new(
        reading,
        match header.element("face") {
            None => reading.refuse(end, names, POINTS),
            Some(Element { line, count, .. }) => {
                let found = quote(&format!("element face {count}"));
                let expected = if *count == 0 { POINTS } else { FACE };
                reading.refuse(Place::Line(*line), found, expected)
            }
        },
    );
    let text = match header.encoding {
        Encoding::Ascii => String::from_utf8_lossy(&content[header.bytes..]),
        _ => "".into(),
    };
    let mut rows = Rows::new(content, &text, &header);
    let textured = with_faces && reading.with_color && !header.textures.is_empty();
    let mut coordinates = Vec::new();
    // Faces may precede the vertices that they refer to.
    let mut early = None;
    for element in &header.elements {
        match &*element.name {
            "vertex" => {
                let coordinates = textured.then_some(&mut coordinates);
                read_vertices(&mut rows, element, with_faces, coordinates, &mut mesh)?;
            }
            "face" if with_faces && element.line > vertex.line => {
                let coordinates = textured.then_some(&*coordinates);
                read_faces(&mut rows, element, coordinates, &mut mesh)?;
            }
            name => {
                if name == "face" && with_faces {
                    early = Some((rows.clone(), element));
                }
                rows.read(&reading, element, &[], |_, _, _| Ok(()))?;
            }
        }
    }
    if let Some((mut rows, element)) = early {
        let coordinates = textured.then_some(&*coordinates);
        read_faces(&mut rows, element, coordinates, &mut mesh)?;
    }
    for name in header.textures.iter().filter(|_| textured) {
        mesh.colors.add_image(reading.limits, reading.path, || {
            texture::read(&reading, name)
        });
    }
    Ok(mesh)
}

fn read_vertices(
    rows: &mut Rows<'_>,
    element: &Element,
    with_faces: bool,
    mut coordinates: Option<&mut Vec<[f32; 2]>>,
    mesh: &mut RawMesh<'_>,
) -> Result<(), IoError> {
    let reading = mesh.reading;
    let has = |slot| element.properties.iter().any(|p| p.slot == Some(slot));
    let mut slots = vec![if with_faces { 0..3 } else { 0..6 }];
    let colored = with_faces && reading.with_color && { COLOR_SLOTS }.all(has);
    coordinates.take_if(|_| !{ TEXTURE_SLOTS }.all(has));
    slots.extend(colored.then_some(COLOR_SLOTS));
    slots.extend(coordinates.is_some().then_some(TEXTURE_SLOTS));
    let properties = element.properties.iter().filter(|p| p.is_in(&slots));
    let order: Vec<usize> = properties.filter_map(|p| p.slot).collect();
    let is_byte = |p: &Property| p.is_in(&[COLOR_SLOTS]) && p.scalar.bytes == 1;
    let bytes = element.properties.iter().any(is_byte);
    rows.read(&reading, element, &slots, |place, numbers, _| {
        let mut vertex = [f64::NAN; 11];
        for (slot, number) in order.iter().zip(numbers) {
            vertex[*slot] = *number;
        }
        let [x, y, z, nx, ny, nz, red, green, blue, s, t] = vertex;
        if !with_faces {
            if ![x, y, z].iter().all(|number| number.is_finite()) {
                mesh.n_skipped += 1;
                return Ok(());
            }
            mesh.normals.push(Vector3::new(nx, ny, nz));
        }
        if colored {
            mesh.colors.add([red, green, blue], bytes);
        }
        if let Some(coordinates) = &mut coordinates {
            coordinates.push(downward(s, t));
        }
        mesh.add_vertex(place, [x, y, z])
    })
}

/// Converts texture coordinates whose origin is the lower left corner.
fn downward(s: f64, t: f64) -> [f32; 2] {
    [narrow(s), narrow(1.0 - t)]
}

fn read_faces(
    rows: &mut Rows<'_>,
    element: &Element,
    coordinates: Option<&[[f32; 2]]>,
    mesh: &mut RawMesh<'_>,
) -> Result<(), IoError> {
    let reading = mesh.reading;
    let needed = "a list property `vertex_indices` or `vertex_index`";
    element.require(reading.path, 1, needed)?;
    let last = if coordinates.is_some() { FACE_IMAGE } else { 0 };
    let slots = 0..last + 1;
    let slots = std::slice::from_ref(&slots);
    let properties = element.properties.iter().filter(|p| p.is_in(slots));
    let order: Vec<Option<usize>> = properties.map(|p| p.slot).collect();
    let place_of = |slot| order.iter().position(|kept| *kept == Some(slot));
    let (mut faces, mut of_face) = (0, Vec::new());
    rows.read(&reading, element, slots, |place, numbers, ends| {
        let part = |slot| {
            let index = place_of(slot)?;
            let start = index.checked_sub(1).map_or(0, |before| ends[before]);
            Some(&numbers[start..ends[index]])
        };
        let corners = part(0).unwrap_or_default();
        faces += 1;
        mesh.add_corners(place, faces - 1, corners)?;
        let Some(of_vertices) = coordinates else {
            return Ok(());
        };
        of_face.clear();
        match part(FACE_TEXTURE) {
            Some(pairs) if pairs.len() == 2 * corners.len() => {
                of_face.extend(pairs.chunks_exact(2).map(|pair| downward(pair[0], pair[1])));
            }
            // The corners are valid indices, because the face was added.
            _ if !of_vertices.is_empty() => {
                of_face.extend(
                    corners
                        .iter()
                        .map(|corner| of_vertices[whole(*corner) as usize]),
                );
            }
            _ => return Ok(()),
        }
        let image = part(FACE_IMAGE).and_then(|image| image.first());
        mesh.texture_face(image.map_or(0, |image| whole(*image)), &of_face);
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::tests::reading;
    use hicp_core::Point3;

    fn mesh(content: &[u8]) -> Result<RawMesh<'static>, IoError> {
        parse_mesh(reading("a.ply"), content.to_vec())
    }

    const CORNERS: [[f32; 3]; 4] = [
        [0.0, 0.0, 0.5],
        [1.0, 0.0, 0.5],
        [1.0, 1.0, 0.5],
        [0.0, 1.0, 0.5],
    ];

    #[test]
    fn every_encoding_and_type_gives_the_same_mesh() {
        for encoding in ["binary_little_endian", "binary_big_endian"] {
            for coordinate in ["float", "float64"] {
                for count in ["uchar", "ushort", "int"] {
                    let mut content = format!(
                        "ply\r\nformat {encoding} 1.0\r\ncomment M\u{fc}ller\r\nelement vertex 4\r\n\
                         property uchar red\r\nproperty {coordinate} x\r\nproperty {coordinate} y\r\n\
                         property {coordinate} z\r\nelement odd 2\r\nproperty list uchar short things\r\n\
                         element face 1\r\nproperty list {count} uint vertex_index\r\nproperty float scalar_C2C[<0.1]\r\n\
                         end_header\r\n"
                    )
                    .into_bytes();
                    let little = encoding == "binary_little_endian";
                    let mut put = |bytes: &[u8]| {
                        let mut bytes = bytes.to_vec();
                        if !little {
                            bytes.reverse();
                        }
                        content.extend(bytes);
                    };
                    for corner in CORNERS {
                        put(&[10]);
                        for value in corner {
                            match coordinate {
                                "float" => put(&value.to_le_bytes()),
                                _ => put(&f64::from(value).to_le_bytes()),
                            }
                        }
                    }
                    put(&[2]);
                    put(&7_i16.to_le_bytes());
                    put(&8_i16.to_le_bytes());
                    put(&[0]);
                    match count {
                        "uchar" => put(&[4]),
                        "ushort" => put(&4_u16.to_le_bytes()),
                        _ => put(&4_i32.to_le_bytes()),
                    }
                    for index in 0..4_u32 {
                        put(&index.to_le_bytes());
                    }
                    put(&1.0_f32.to_le_bytes());
                    let mesh = mesh(&content).unwrap();
                    assert_eq!(mesh.vertices, CORNERS.map(|c| Point3::from(c).cast()));
                    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);

                    content.pop();
                    assert!(matches!(
                        self::mesh(&content),
                        Err(IoError {
                            place: Some(Place::Byte(_) | Place::Line(_)),
                            ..
                        })
                    ));
                }
            }
        }
    }

    #[test]
    fn the_error_for_triangle_strips_names_them() {
        let content = b"ply\nformat ascii 1.0\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n3 0 1 2\n";
        assert_eq!(mesh(content).unwrap_err().found, "triangle strips");
    }

    #[test]
    fn duplicate_property_names_do_not_shift_values() {
        for names in [
            ["quality", "quality"],
            ["s(1)", "s[1]"],
            ["h\u{f6}he", "h\u{e4}he"],
        ] {
            let mut content = format!(
                "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
                 property float z\nproperty float {}\nproperty float {}\nelement face 1\n\
                 property list uchar uchar vertex_index\nend_header\n",
                names[0], names[1]
            )
            .into_bytes();
            for [x, y, z] in CORNERS {
                for value in [x, y, z, 0.25, 0.75] {
                    content.extend(value.to_le_bytes());
                }
            }
            content.extend([4, 0, 1, 2, 3]);
            let mesh = mesh(&content).unwrap();
            assert_eq!(mesh.vertices, CORNERS.map(|c| Point3::from(c).cast()));
            assert_eq!(mesh.triangles.len(), 2);
        }
    }

    #[test]
    fn byte_offsets_include_the_byte_order_mark() {
        let text = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty uchar x\nproperty uchar y\n\
            property uchar z\nelement face 2\nproperty list uchar uchar vertex_index\nend_header\n";
        for mark in ["", "\u{feff}"] {
            let mut content = format!("{mark}{text}").into_bytes();
            let faces = content.len() as u64 + 3;
            content.extend([1, 2, 3, 3, 0, 0, 0, 3, 0, 0, 0]);
            assert_eq!(mesh(&content).unwrap().vertices, [Point3::new(1., 2., 3.)]);
            content.pop();
            match mesh(&content) {
                Err(IoError {
                    place: Some(Place::Byte(offset)),
                    ..
                }) => assert_eq!(offset, faces + 4),
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn the_error_for_a_file_without_triangles_quotes_its_header() {
        for (elements, rows, at, found) in [
            ("", "", 7, "the elements [\"vertex\"]"),
            (
                "element Face 0\n",
                "",
                8,
                "the elements [\"vertex\", \"Face\"]",
            ),
            ("element face 0\n", "", 7, "\"element face 0\""),
            (
                "element face 1\nproperty list uchar int vertex_index\n",
                "2 0 0\n",
                7,
                "\"element face 1\"",
            ),
        ] {
            let content = format!(
                "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                 {elements}end_header\n0 0 0\n{rows}"
            );
            let mesh = mesh(content.as_bytes());
            let mesh = mesh.and_then(|mesh| mesh.finish());
            let error = mesh.unwrap_err().to_string();
            assert!(
                error.contains(&format!("line {at}: found {found}, ")),
                "{error}"
            );
            assert_eq!(
                error.contains("a point cloud, not a mesh"),
                rows.is_empty(),
                "{error}"
            );
        }
    }
}
