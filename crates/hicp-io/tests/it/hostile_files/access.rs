//! Files that cannot be read, change, or are too large.

use super::*;

type Tighten = fn(&mut ReadLimits);

/// The test would hang if a reader waited for a writer of the pipe.
#[cfg(unix)]
#[test]
fn only_regular_files_are_read() {
    let folder = Folder::new();
    let refused = |path: &Path, kind: &str| {
        refused_mesh(path, &[kind, "regular file"]);
    };
    let sub = folder.path("folder.ply");
    std::fs::create_dir(&sub).unwrap();
    refused(&sub, "a folder");
    let socket = folder.path("socket.stl");
    let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
    refused(&socket, "a socket");
    let link = folder.path("zero.obj");
    std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
    refused(&link, "a device");
    let pipe = folder.path("pipe.obj");
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
    let path = folder.write("a.obj", format!("{SQUARE}f 1 2 3\n"));
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o000)).unwrap();
    if File::open(&path).is_ok() {
        println!("skipped: this user has permission to read every file");
        return;
    }
    refused_mesh(&path, &["cannot read", "ermission denied"]);
}

#[test]
fn a_file_that_changes_constantly_is_read_unchanged_or_refused() {
    let folder = Folder::new();
    let texts = [10, 4000].map(|faces| format!("{SQUARE}{}", "f 1 2 3\n".repeat(faces)));
    let path = folder.write("a.obj", &texts[0]);
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

#[test]
fn fifty_million_triangles_are_refused_by_their_header() {
    let folder = Folder::new();
    let count = 50_000_000_u32;
    let mut header = vec![0; 80];
    header.extend(count.to_le_bytes());
    let path = folder.sparse("a.stl", &header, 84 + 50 * u64::from(count));
    let error = refused_mesh(
        &path,
        &[
            "a.stl, byte 80",
            "50000000 triangles",
            "at most 10000000",
            "--max-triangles",
            "ReadLimits::max_triangles",
        ],
    );
    assert_eq!(error.kind, IoErrorKind::Limit);
    let header = ply("binary_little_endian", "25000000", "50000000", "uchar int");
    let path = folder.sparse("a.ply", header, 12 * 25_000_000 + 13 * 50_000_000);
    let error = refused_mesh(&path, &["line 3", "25000000 vertices"]);
    assert_eq!(
        (error.kind, error.place),
        (IoErrorKind::Limit, Some(Place::Line(3)))
    );
    // The text formats do not announce their counts first, so the size of the file is limited.
    let path = folder.sparse("a.obj", SQUARE, 2 << 30);
    refused_mesh(&path, &["2147483648 bytes", "--max-file-bytes"]);
}

#[test]
fn limits_can_be_set() {
    let folder = Folder::new();
    let faces = format!("{SQUARE}f 1 2 3 4\nf 1 2 3\n");
    let off = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n3 0 1 2\n";
    let text =
        ply("ascii", "4", "2", "uchar int") + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n3 0 1 2\n";
    for path in [
        folder.write("a.obj", faces),
        folder.write("a.off", off),
        folder.write("a.ply", text),
        folder.write("a.stl", stl("", 3, 3)),
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
        let tight: [(&str, Tighten); 3] = [
            ("max_file_bytes", |limits| limits.max_file_bytes -= 1),
            ("max_vertices", |limits| limits.max_vertices -= 1),
            ("max_triangles", |limits| limits.max_triangles -= 1),
        ];
        for (named, tighten) in tight {
            let mut limits = exact;
            tighten(&mut limits);
            let error = common::refused(read(limits), &[named]);
            assert_eq!(error.kind, IoErrorKind::Limit);
        }
    }
    let rows = format!(
        "scene_id,im_id,obj_id,score,R,t,time\n{}",
        "1,1,1,1,1 0 0 0 1 0 0 0 1,0 0 500,-1\n".repeat(3)
    );
    let path = folder.write("a.csv", rows);
    let of_rows = |most| common::limits(|limits| limits.max_rows = most).read_results(&path);
    assert_eq!(of_rows(3).unwrap().len(), 3);
    common::refused(of_rows(2), &["line 4", "3 rows"]);
    let path = folder.write("a.json", "[]      ");
    let limits = common::limits(|limits| limits.max_json_bytes = 7);
    let error = common::refused(limits.read_detections(&path), &["max_json_bytes"]);
    assert_eq!(error.kind, IoErrorKind::Limit);
}
