//! Writes the visible masks of a BOP dataset as detections, for `hybrid-icp bop estimate`.
//!
//! Run `cargo run --release -p hicp-tests --example detections DATASET SPLIT OUT.json`.

use hicp_io::bop::{Dataset, Rle};
use serde_json::json;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [root, split, out] = &arguments[..] else {
        return Err("expected DATASET SPLIT OUT.json".into());
    };
    let dataset = Dataset::open(root)?;
    let mut detections = Vec::new();
    for scene_id in dataset.scene_ids(split)? {
        let scene = dataset.scene(split, scene_id)?;
        for image_id in scene.image_ids() {
            let truths = scene.ground_truth(image_id).unwrap_or_default();
            for (index, truth) in truths.iter().enumerate() {
                let code = Rle::of_mask(&scene.read_visible_mask(image_id, index)?);
                detections.push(json!({
                    "scene_id": scene_id,
                    "image_id": image_id,
                    "category_id": truth.obj_id,
                    "score": 1.0,
                    "segmentation": {
                        "size": [code.height(), code.width()],
                        "counts": code.to_compressed(),
                    },
                }));
            }
        }
    }
    std::fs::write(out, serde_json::to_string(&detections)?)?;
    Ok(())
}
