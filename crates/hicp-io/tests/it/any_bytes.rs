//! Robustness: no reader panics, for any content of a file.

use std::path::Path;

use hicp_io::bop::{read_detections, read_models_info, read_results, read_targets};
use hicp_io::{
    IoError, LengthUnit, read_camera_json, read_cloud, read_color, read_depth_png, read_mask_png,
    read_mesh, read_pose_json,
};
use proptest::prelude::*;

type Reader = fn(&Path) -> Result<(), IoError>;

/// The name of a file, possible beginnings of its content, and the reader to call.
const READERS: [(&str, &[&str], Reader); 13] = [
    ("a.obj", &["", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf "], |p| mesh(p)),
    (
        "a.stl",
        &["", "solid x\nfacet normal 0 0 1\nouter loop\nvertex "],
        |p| mesh(p),
    ),
    ("a.ply", PLY, |p| mesh(p)),
    ("b.ply", PLY, |p| {
        read_cloud(p, LengthUnit::Meters).map(drop)
    }),
    ("a.png", PNG, |p| read_depth_png(p, 1.0).map(drop)),
    ("b.png", PNG, |p| read_mask_png(p).map(drop)),
    ("c.png", PNG, |p| read_color(p).map(drop)),
    ("a.json", JSON, |p| read_pose_json(p).map(drop)),
    ("b.json", JSON, |p| read_camera_json(p, (4, 3)).map(drop)),
    ("c.json", JSON, |p| read_targets(p).map(drop)),
    ("d.json", JSON, |p| read_detections(p).map(drop)),
    ("e.json", JSON, |p| read_models_info(p).map(drop)),
    (
        "a.csv",
        &["", "scene_id,im_id,obj_id,score,R,t,time\n50,1,2,"],
        |p| read_results(p).map(drop),
    ),
];
const PLY: &[&str] = &[
    "",
    "ply\nformat ascii 1.0\nelement vertex ",
    "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty int y\nproperty list char int z\nend_header\n",
    "ply\nformat binary_big_endian 1.0\nelement face 9\nproperty list int short vertex_index\nend_header\n",
    "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty double z\n\
     element face 2\nproperty list uchar uchar vertex_indices\nend_header\n",
];
const PNG: &[&str] = &["", "\u{89}PNG\r\n\u{1a}\n"];
const JSON: &[&str] = &["", "{\"", "[{\"scene_id\":", "{\"1\":{\"cam_K\":["];

fn mesh(path: &Path) -> Result<(), IoError> {
    read_mesh(path, LengthUnit::Meters).map(drop)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn no_bytes_make_a_reader_panic(
        reader in prop::sample::select(READERS.to_vec()),
        start in any::<prop::sample::Index>(),
        binary in prop::collection::vec(any::<u8>(), 0..200),
        text in "[-0-9 .,:/ev\\n\\\\\\[\\]{}\"f]{0,80}",
        as_text in any::<bool>(),
    ) {
        let (name, starts, read) = reader;
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(name);
        // The first character of a PNG signature is a single byte, which is not UTF-8.
        let mut content: Vec<u8> = start.get(starts).chars().map(|c| u8::try_from(c).unwrap()).collect();
        content.extend(if as_text { text.into_bytes() } else { binary });
        std::fs::write(&path, &content).unwrap();
        if let Err(error) = read(&path) {
            prop_assert!(error.to_string().contains(name), "{}", error);
        }
    }
}
