//! Malicious or damaged mesh files. Each error names the file, the place, the value found and the
//! value expected.

use std::error::Error;
use std::fs::File;
use std::path::{Path, PathBuf};

use hicp_io::{
    IoError, IoErrorKind, LengthUnit, Place, ReadLimits, read_depth_png, read_mesh, read_pose_json,
};

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, content).unwrap();
        path
    }
}

/// Returns the complete message of an error.
fn message(error: &IoError) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text.push_str(": ");
        text.push_str(&cause.to_string());
        source = cause.source();
    }
    text
}

#[track_caller]
fn refused(name: &str, content: impl AsRef<[u8]>, parts: &[&str]) {
    let folder = Folder::new();
    let path = folder.file(name, content);
    let text = match read_mesh(&path, LengthUnit::Meters) {
        Ok(mesh) => panic!("{name} was read: {} triangles", mesh.triangles().len()),
        Err(error) => message(&error),
    };
    for part in [&[name], parts].concat() {
        assert!(text.contains(part), "no {part:?} in: {text}");
    }
}

#[track_caller]
fn triangles(name: &str, content: impl AsRef<[u8]>) -> usize {
    let folder = Folder::new();
    let path = folder.file(name, content);
    match read_mesh(&path, LengthUnit::Meters) {
        Ok(mesh) => mesh.triangles().len(),
        Err(error) => panic!("{}", message(&error)),
    }
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

fn ply(format: &str, vertices: &str, faces: &str, list: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {faces}\nproperty list {list} vertex_indices\nend_header\n"
    )
}

fn stl(header: &str, count: u32, triangles: u32) -> Vec<u8> {
    let mut content = header.as_bytes().to_vec();
    content.resize(80, b' ');
    content.extend(count.to_le_bytes());
    for number in 0..triangles {
        let x = number as f32;
        for value in [0., 0., 1., x, 0., 0., x + 1., 0., 0., x, 1., 0.] {
            content.extend(value.to_le_bytes());
        }
        content.extend([0, 0]);
    }
    content
}

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
    // A list that announces more corners than there are bytes.
    for (count, bytes) in [
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
        refused("a.ply", format!("{text}3 0 1 {index}\n"), &["line 14"]);
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
        refused(
            "a.obj",
            format!("{SQUARE}v 0 0 {value}\nf 1 2 5\n"),
            &["line 5", "finite", "m"],
        );
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
    binary[84 + 12..84 + 16].copy_from_slice(&f32::INFINITY.to_le_bytes());
    refused("a.stl", binary, &["byte 96", "finite"]);
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
    let whole = ply("ascii", "3", "1", "uchar int") + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2";
    assert_eq!(triangles("a.ply", &whole), 1);
    for end in 1..whole.len() {
        if let Ok(mesh) = read_mesh(
            Folder::new().file("a.ply", &whole[..end]),
            LengthUnit::Meters,
        ) {
            panic!("{end}: {mesh:?}");
        }
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
fn unusual_but_valid_files_are_read() {
    let odd = format!(
        "\u{feff}# tabs\r\n{}\tf\t1\t2\t3\t4",
        SQUARE.replace(' ', "\t").replace('\n', "\t# c\r\n")
    );
    assert_eq!(triangles("a.obj", odd), 2);
    assert_eq!(
        triangles("a.obj", format!("{SQUARE}f -4 -3 \\\n-2 \\\n-1")),
        2
    );
    assert_eq!(
        triangles("a.obj", format!("{SQUARE}f 1 1 2\nf 1 2 3\nf 1 2 3\n")),
        3
    );
    let ngon: String = (0..5000)
        .map(|i| f64::from(i).to_radians() / 14.0)
        .map(|a| format!("v {} {} 0\n", a.cos(), a.sin()))
        .collect();
    let corners: String = (1..=5000).map(|i| format!(" {i}")).collect();
    assert_eq!(triangles("a.obj", format!("{ngon}f{corners}")), 4998);
    let comments = "ply\ncomment a\nformat ascii 1.0\ncomment\nobj_info b\nelement vertex 3\ncomment c\nproperty double x\nproperty int16 y\nproperty uint8 z\nproperty list uint8 float32 uv\nelement face 1\nproperty uchar flags\nproperty list int8 uint16 vertex_index\nend_header\n0 0 0 0\n1 0 0 2 0.5 .5\n\n0 1\t0 1 nan\n7 3 0 1 2";
    assert_eq!(triangles("a.ply", comments), 1);
    assert_eq!(triangles("a.ply", comments.replace('\n', "\r\n")), 1);
    assert_eq!(triangles("a.ply", comments.replace('\n', "\r")), 1);
}

#[test]
fn other_text_encodings_are_refused() {
    let text = format!("{SQUARE}f 1 2 3\n");
    let wide = |bytes: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(bytes).collect::<Vec<u8>>();
    for (content, name) in [
        (wide(u16::to_be_bytes), "UTF-16 BE"),
        (wide(u16::to_le_bytes), "UTF-16 LE"),
    ] {
        refused("a.obj", content, &["byte 0", name, "UTF-8"]);
    }
    let off = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let wide: Vec<u8> = off.encode_utf16().flat_map(u16::to_le_bytes).collect();
    refused("a.off", wide, &["UTF-16 LE"]);
    refused("a.ply", [0x1f, 0x8b, 8, 0, 0, 0], &["gzip", "gunzip"]);
    refused(
        "a.ply.gz",
        [0x1f, 0x8b, 8, 0, 0, 0],
        &["\"gz\"", "expected .glb"],
    );
}

/// The test would hang if a reader waited for a writer of the pipe.
#[cfg(unix)]
#[test]
fn only_regular_files_are_read() {
    let folder = Folder::new();
    let refused = |path: &Path, kind: &str| {
        let text = message(&read_mesh(path, LengthUnit::Meters).unwrap_err());
        assert!(
            text.contains(kind) && text.contains("regular file"),
            "{text}"
        );
    };
    let sub = folder.0.path().join("folder.ply");
    std::fs::create_dir(&sub).unwrap();
    refused(&sub, "a folder");
    let socket = folder.0.path().join("socket.stl");
    let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
    refused(&socket, "a socket");
    let link = folder.0.path().join("zero.obj");
    std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
    refused(&link, "a device");
    let pipe = folder.0.path().join("pipe.obj");
    match std::process::Command::new("mkfifo").arg(&pipe).status() {
        Ok(status) if status.success() => {
            refused(&pipe, "a pipe");
            assert!(read_pose_json(&pipe).is_err() && read_depth_png(&pipe, 1.0).is_err());
        }
        _ => println!("skipped the pipe: there is no mkfifo"),
    }
}

#[cfg(unix)]
#[test]
fn files_without_read_permission_are_refused() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new();
    let path = folder.file("a.obj", format!("{SQUARE}f 1 2 3\n"));
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o000)).unwrap();
    if File::open(&path).is_ok() {
        println!("skipped: this user has permission to read every file");
        return;
    }
    let text = message(&read_mesh(&path, LengthUnit::Meters).unwrap_err());
    assert!(
        text.contains("cannot read") && text.contains("ermission denied"),
        "{text}"
    );
}

#[test]
fn a_file_that_changes_constantly_is_read_unchanged_or_refused() {
    let folder = Folder::new();
    let texts = [10, 4000].map(|faces| format!("{SQUARE}{}", "f 1 2 3\n".repeat(faces)));
    let path = folder.file("a.obj", &texts[0]);
    let done = std::sync::atomic::AtomicBool::new(false);
    // Check the results after the writer has stopped; a panic before that would leave it running.
    let results: Vec<_> = std::thread::scope(|scope| {
        scope.spawn(|| {
            while !done.load(std::sync::atomic::Ordering::Relaxed) {
                for text in texts.iter().rev() {
                    if std::fs::write(&path, text).is_err() {
                        return;
                    }
                }
            }
        });
        let results = (0..300).map(|_| read_mesh(&path, LengthUnit::Meters));
        let results = results.collect();
        done.store(true, std::sync::atomic::Ordering::Relaxed);
        results
    });
    let mut refused = 0;
    for result in results {
        match result {
            Ok(mesh) => assert!(mesh.triangles().len() <= 4000),
            Err(IoError {
                place: Some(Place::Line(_)),
                ..
            }) => refused += 1,
            Err(error) => {
                let text = message(&error);
                assert!(text.contains("must not change while it is read"), "{text}");
                refused += 1;
            }
        }
    }
    println!("{refused} of 300 refused");
}

/// Creates a file with a given start, followed by zeros that occupy no disk space.
fn sparse(folder: &Folder, name: &str, start: &[u8], bytes: u64) -> PathBuf {
    let path = folder.file(name, start);
    let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
    file.set_len(bytes).unwrap();
    path
}

#[test]
fn fifty_million_triangles_are_refused_by_their_header() {
    let folder = Folder::new();
    let count = 50_000_000_u32;
    let mut header = vec![0; 80];
    header.extend(count.to_le_bytes());
    let path = sparse(&folder, "a.stl", &header, 84 + 50 * u64::from(count));
    match read_mesh(&path, LengthUnit::Meters) {
        Err(
            error @ IoError {
                kind: IoErrorKind::Limit,
                ..
            },
        ) => {
            let text = message(&error);
            for part in [
                "a.stl, byte 80",
                "50000000 triangles",
                "at most 10000000",
                "--max-triangles",
                "ReadLimits::max_triangles",
            ] {
                assert!(text.contains(part), "{text}");
            }
        }
        other => panic!("{other:?}"),
    }
    let header = ply("binary_little_endian", "25000000", "50000000", "uchar int");
    let path = sparse(
        &folder,
        "a.ply",
        header.as_bytes(),
        12 * 25_000_000 + 13 * 50_000_000,
    );
    assert!(matches!(
        read_mesh(&path, LengthUnit::Meters),
        Err(IoError { kind: IoErrorKind::Limit, place: Some(Place::Line(3)), found, .. })
            if found == "25000000 vertices"
    ));
    // The text formats do not announce their counts first, so the size of the file is limited.
    let path = sparse(&folder, "a.obj", SQUARE.as_bytes(), 2 << 30);
    let text = message(&read_mesh(&path, LengthUnit::Meters).unwrap_err());
    assert!(
        text.contains("2147483648 bytes") && text.contains("--max-file-bytes"),
        "{text}"
    );
}

#[test]
fn limits_can_be_set() {
    let folder = Folder::new();
    let faces = format!("{SQUARE}f 1 2 3 4\nf 1 2 3\n");
    let off = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n3 0 1 2\n";
    let text =
        ply("ascii", "4", "2", "uchar int") + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n3 0 1 2\n";
    for path in [
        folder.file("a.obj", faces),
        folder.file("a.off", off),
        folder.file("a.ply", text),
        folder.file("a.stl", stl("", 3, 3)),
    ] {
        let read = |limits: ReadLimits| limits.read_mesh(&path, LengthUnit::Meters);
        let bytes = std::fs::metadata(&path).unwrap().len();
        let vertices = read(ReadLimits::NONE).unwrap().vertices().len() as u64;
        let exact = ReadLimits {
            max_file_bytes: bytes,
            max_vertices: vertices,
            max_triangles: 3,
            ..ReadLimits::DEFAULT
        };
        assert_eq!(read(exact).unwrap().triangles().len(), 3);
        for (tight, named) in [
            (
                ReadLimits {
                    max_file_bytes: bytes - 1,
                    ..exact
                },
                "max_file_bytes",
            ),
            (
                ReadLimits {
                    max_vertices: vertices - 1,
                    ..exact
                },
                "max_vertices",
            ),
            (
                ReadLimits {
                    max_triangles: 2,
                    ..exact
                },
                "max_triangles",
            ),
        ] {
            match read(tight) {
                Err(
                    error @ IoError {
                        kind: IoErrorKind::Limit,
                        ..
                    },
                ) => {
                    assert!(error.expected.contains(named), "{error}");
                }
                other => panic!("{}: {other:?}", path.display()),
            }
        }
    }
    let rows = format!(
        "scene_id,im_id,obj_id,score,R,t,time\n{}",
        "1,1,1,1,1 0 0 0 1 0 0 0 1,0 0 500,-1\n".repeat(3)
    );
    let path = folder.file("a.csv", rows);
    let limits = ReadLimits {
        max_rows: 3,
        ..ReadLimits::DEFAULT
    };
    assert_eq!(limits.read_results(&path).unwrap().len(), 3);
    let text = message(
        &ReadLimits {
            max_rows: 2,
            ..limits
        }
        .read_results(&path)
        .unwrap_err(),
    );
    assert!(text.contains("line 4") && text.contains("3 rows"), "{text}");
    let path = folder.file("a.json", "[]      ");
    let limits = ReadLimits {
        max_json_bytes: 7,
        ..ReadLimits::DEFAULT
    };
    assert!(matches!(
        limits.read_detections(&path),
        Err(IoError { kind: IoErrorKind::Limit, expected, .. }) if expected.contains("max_json_bytes")
    ));
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
