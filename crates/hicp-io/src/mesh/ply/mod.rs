//! PLY files: headers and binary payloads through `ply-rs-bw`, ASCII payloads by [`ascii`].

use hicp_core::Point3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding};

use super::{RawMesh, Reading};
use crate::error::{END_OF_FILE, IoError, Place};

mod ascii;
mod header;
mod rows;

use header::Header;
pub(crate) use rows::Vertex;
use rows::{Face, Row, Skipped};

/// Refuses a file by its header, when it may have the elements that it promises and they are too many.
///
/// A header that is longer than the head, or broken, is left to the parser.
pub(super) fn check_head(reading: &Reading<'_>, head: &[u8], bytes: u64) -> Result<(), IoError> {
    match Header::parse(reading.path, head, bytes) {
        Ok(header) => check_counts(reading, &header),
        Err(_) => Ok(()),
    }
}

fn check_counts(reading: &Reading<'_>, header: &Header) -> Result<(), IoError> {
    let (place, count) = header.count_of("vertex");
    reading.check_vertices(place, count)?;
    let (place, count) = header.count_of("face");
    reading.check_triangles(place, count)
}

/// Parses the vertices and faces of a PLY file.
pub(super) fn parse_mesh(reading: &Reading<'_>, content: Vec<u8>) -> Result<RawMesh, IoError> {
    let mut faces = Faces::default();
    let (vertices, header) = read(reading, &content, &mut faces)?;
    drop(content);
    if !header.ply.elements.contains_key("vertex") {
        return Err(header.without_vertices(reading.path));
    }
    let mut mesh = RawMesh::new(Place::Line(header.lines));
    mesh.vertices = vertices.iter().map(|v| Point3::from(v.value)).collect();
    drop(vertices);
    mesh.triangles.reserve(faces.places.len());
    let mut corners = Vec::new();
    let mut rest = faces.corners.as_slice();
    for (face, (place, count)) in faces.places.into_iter().enumerate() {
        let (indices, others) = rest.split_at(count.min(rest.len()));
        rest = others;
        corners.clear();
        for &index in indices {
            match u32::try_from(index) {
                Ok(corner) if (corner as usize) < mesh.vertices.len() => corners.push(corner),
                _ => {
                    return Err(IoError::FaceIndex {
                        path: reading.path.to_owned(),
                        place,
                        face,
                        index,
                        vertices: mesh.vertices.len(),
                    });
                }
            }
        }
        mesh.add_face(reading, place, &corners)?;
    }
    if mesh.triangles.is_empty() {
        return Err(header.without_triangles(reading.path));
    }
    Ok(mesh)
}

/// The corners of all faces one after the other, and of each where it stands and how many are its own.
#[derive(Debug, Default)]
struct Faces {
    corners: Vec<i64>,
    places: Vec<(Place, usize)>,
}

/// Reads all vertices of a PLY file, with normals.
pub(crate) fn read_vertices(
    reading: &Reading<'_>,
    content: &[u8],
) -> Result<Vec<Vertex<6>>, IoError> {
    Ok(read(reading, content, &mut Faces::default())?.0)
}

fn read<const N: usize>(
    reading: &Reading<'_>,
    content: &[u8],
    faces: &mut Faces,
) -> Result<(Vec<Vertex<N>>, Header), IoError> {
    let path = reading.path;
    let header = Header::parse(path, content, content.len() as u64)?;
    check_counts(reading, &header)?;
    let mut payload = Payload::new(reading, content, &header);
    let mut vertices = Vec::new();
    for element in header.ply.elements.values() {
        match element.name.as_str() {
            "vertex" => {
                for name in ["x", "y", "z"] {
                    header.require(path, element, name)?;
                }
                payload.read(element, |_, vertex| {
                    vertices.push(vertex);
                    Ok(())
                })?;
            }
            "face" => {
                header.require(path, element, header::FACE_LIST)?;
                // Counted here, for what is kept of them is eight times the size of small indices in the file.
                let mut triangles = 0_usize;
                payload.read(element, |place, face: Face| {
                    // A triangle fan has two corners more than triangles.
                    triangles += face.corners.len().saturating_sub(2);
                    reading.check_triangles(place, triangles)?;
                    faces.places.push((place, face.corners.len()));
                    faces.corners.extend(face.corners);
                    Ok(())
                })?;
            }
            "tristrips" if element.count > 0 => {
                return Err(IoError::Unsupported {
                    path: path.to_owned(),
                    place: header.place_of("tristrips"),
                    found: "triangle strips".to_owned(),
                    expected: "an element `face`",
                });
            }
            _ => payload.read(element, |_, _: Skipped| Ok(()))?,
        }
    }
    Ok((vertices, header))
}

/// What follows the header.
enum Payload<'a> {
    Ascii(&'a Reading<'a>, ascii::Lines<'a>),
    Binary {
        reading: &'a Reading<'a>,
        big_endian: bool,
        length: usize,
        reader: Reader<&'a [u8]>,
    },
}

impl<'a> Payload<'a> {
    fn new(reading: &'a Reading<'a>, content: &'a [u8], header: &'a Header) -> Self {
        if header.ply.encoding == Encoding::Ascii {
            return Self::Ascii(reading, ascii::Lines::new(reading.path, content, header));
        }
        Self::Binary {
            reading,
            big_endian: header.ply.encoding == Encoding::BinaryBigEndian,
            length: content.len(),
            reader: Reader::new(&content[header.bytes..]),
        }
    }

    /// Reads the elements of a kind, and hands over each with the place where it begins.
    fn read<E: Row>(
        &mut self,
        element: &ElementDef,
        mut take: impl FnMut(Place, E) -> Result<(), IoError>,
    ) -> Result<(), IoError> {
        let (reading, big_endian, length, reader) = match self {
            Self::Ascii(reading, lines) => return lines.read(reading, element, &mut take),
            Self::Binary {
                reading,
                big_endian,
                length,
                reader,
            } => (reading, *big_endian, *length, reader),
        };
        let parser = Parser::<E>::new();
        for number in 0..element.count {
            let place = Place::Byte((length - reader.get_ref().len()) as u64);
            let row = match big_endian {
                true => parser.read_big_endian_element(reader.get_mut(), element),
                false => parser.read_little_endian_element(reader.get_mut(), element),
            };
            let row = row.map_err(|error| {
                let found = match error.kind() {
                    std::io::ErrorKind::UnexpectedEof => END_OF_FILE.to_owned(),
                    _ => crate::error::quote(&error.to_string()),
                };
                let expected = format!(
                    "element {number} of {} elements `{}`",
                    element.count, element.name
                );
                IoError::at(reading.path, place, &found, expected)
            })?;
            row.check(reading, place)?;
            take(place, row)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::tests::reading;

    fn mesh(content: &[u8]) -> Result<RawMesh, IoError> {
        parse_mesh(&reading("a.ply"), content.to_vec())
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
                        Err(IoError::Bytes { .. } | IoError::Promise { .. })
                    ));
                }
            }
        }
    }

    #[test]
    fn a_negative_list_count_and_a_huge_one_are_refused() {
        for count in [-1_i32, i32::MAX] {
            let mut content = b"ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty float x\n\
                property float y\nproperty float z\nelement face 1\nproperty list int int vertex_indices\nend_header\n"
                .to_vec();
            content.extend(count.to_le_bytes());
            assert!(
                matches!(mesh(&content), Err(IoError::Bytes { .. })),
                "{count}"
            );
        }
    }

    #[test]
    fn a_face_that_names_a_missing_vertex_is_named() {
        for index in ["4", "-1"] {
            let content = format!(
                "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                 element face 2\nproperty list uchar int vertex_indices\nend_header\n\
                 0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n4 0 1 2 {index}\n"
            );
            match mesh(content.as_bytes()) {
                Err(IoError::FaceIndex {
                    face, index: found, ..
                }) => assert_eq!((face, found.to_string()), (1, index.to_owned())),
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn strips_are_refused_by_name() {
        let content = b"ply\nformat ascii 1.0\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n3 0 1 2\n";
        assert!(matches!(mesh(content), Err(IoError::Unsupported { .. })));
    }

    #[test]
    fn names_that_are_there_twice_shift_nothing() {
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
    fn bytes_are_counted_from_the_mark() {
        let text = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty uchar x\nproperty uchar y\n\
            property uchar z\nelement face 2\nproperty list uchar uchar vertex_index\nend_header\n";
        for mark in ["", "\u{feff}"] {
            let mut content = format!("{mark}{text}").into_bytes();
            let faces = content.len() as u64 + 3;
            content.extend([1, 2, 3, 3, 0, 0, 0, 3, 0, 0, 0]);
            assert_eq!(mesh(&content).unwrap().vertices, [Point3::new(1., 2., 3.)]);
            content.pop();
            match mesh(&content) {
                Err(IoError::Bytes { offset, .. }) => assert_eq!(offset, faces + 4),
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn what_has_no_triangles_is_told_so_by_its_header() {
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
            let error = mesh(content.as_bytes()).unwrap_err().to_string();
            assert!(
                error.contains(&format!("line {at}: found {found}, ")),
                "{error}"
            );
            assert_eq!(
                error.contains("a point cloud, no mesh"),
                rows.is_empty(),
                "{error}"
            );
        }
    }
}
