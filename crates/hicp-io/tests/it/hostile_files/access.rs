//! Files that cannot be read, change, or are too large.

use super::*;

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
