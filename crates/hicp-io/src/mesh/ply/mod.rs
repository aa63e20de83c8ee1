//! PLY files: headers and binary payloads through `ply-rs-bw`, ASCII payloads by [`ascii`].

use std::path::Path;

use hicp_core::Point3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, PropertyAccess};

use super::RawMesh;
use crate::error::{END_OF_FILE, IoError};

mod ascii;
mod header;
mod rows;

use header::Header;
use rows::Skipped;
pub(crate) use rows::{Face, Vertex};

/// Parses the vertices and faces of a PLY file.
pub(super) fn parse_mesh(path: &Path, content: Vec<u8>) -> Result<RawMesh, IoError> {
    let (vertices, faces) = read(path, &content)?;
    drop(content);
    let mut mesh = RawMesh {
        vertices: vertices
            .iter()
            .map(|v| Point3::new(v.value[0], v.value[1], v.value[2]))
            .collect(),
        triangles: Vec::with_capacity(faces.len()),
    };
    let mut corners = Vec::new();
    for (number, face) in faces.into_iter().enumerate() {
        corners.clear();
        for index in face.corners {
            match u32::try_from(index) {
                Ok(corner) if (corner as usize) < mesh.vertices.len() => corners.push(corner),
                _ => {
                    return Err(IoError::FaceIndex {
                        path: path.to_owned(),
                        face: number,
                        index,
                        vertices: mesh.vertices.len(),
                    });
                }
            }
        }
        mesh.add_face(&corners);
    }
    Ok(mesh)
}

/// Reads all vertices and faces of a PLY file.
pub(crate) fn read(path: &Path, content: &[u8]) -> Result<(Vec<Vertex>, Vec<Face>), IoError> {
    let header = Header::parse(path, content)?;
    let mut payload = Payload::new(path, content, &header);
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for element in header.ply.elements.values() {
        match element.name.as_str() {
            "vertex" => {
                for name in ["x", "y", "z"] {
                    header.require(path, element, name)?;
                }
                vertices = payload.read(element)?;
            }
            "face" => {
                header.require(path, element, header::FACE_LIST)?;
                faces = payload.read(element)?;
            }
            "tristrips" if element.count > 0 => {
                return Err(IoError::Unsupported {
                    path: path.to_owned(),
                    found: "triangle strips".to_owned(),
                    expected: "an element `face`",
                });
            }
            _ => {
                payload.read::<Skipped>(element)?;
            }
        }
    }
    Ok((vertices, faces))
}

/// What follows the header.
enum Payload<'a> {
    Ascii(ascii::Lines<'a>),
    Binary {
        path: &'a Path,
        header: &'a Header,
        length: usize,
        reader: Reader<&'a [u8]>,
    },
}

impl<'a> Payload<'a> {
    fn new(path: &'a Path, content: &'a [u8], header: &'a Header) -> Self {
        let rest = &content[header.bytes..];
        match header.ply.encoding {
            Encoding::Ascii => Self::Ascii(ascii::Lines::new(path, rest, header.lines)),
            Encoding::BinaryBigEndian | Encoding::BinaryLittleEndian => Self::Binary {
                path,
                header,
                length: content.len(),
                reader: Reader::new(rest),
            },
        }
    }

    fn read<E: PropertyAccess>(&mut self, element: &ElementDef) -> Result<Vec<E>, IoError> {
        match self {
            Self::Ascii(lines) => lines.read(element),
            Self::Binary {
                path,
                header,
                length,
                reader,
            } => Parser::<E>::new()
                .read_payload_for_element(reader, element, &header.ply)
                .map_err(|error| IoError::Bytes {
                    path: path.to_path_buf(),
                    offset: (*length - reader.get_ref().len()) as u64,
                    found: match error.kind() {
                        std::io::ErrorKind::UnexpectedEof => END_OF_FILE.to_owned(),
                        _ => crate::error::quote(&error.to_string()),
                    },
                    expected: format!("{} elements `{}`", element.count, element.name),
                }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(content: &[u8]) -> Result<RawMesh, IoError> {
        parse_mesh(Path::new("a.ply"), content.to_vec())
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
}
