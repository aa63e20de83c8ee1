//! A real dataset in BOP's layout, read completely.

use hicp_core::se3;
use hicp_io::bop::{Dataset, Rle, read_results, write_results};

#[test]
fn scenes_models_and_targets_agree() {
    let Some(root) = crate::common::data("bop/ycbv") else {
        return;
    };
    let dataset = Dataset::open(&root).unwrap();
    let infos = dataset.read_models_info().unwrap();
    assert_eq!(infos.len(), 12);
    for (obj_id, info) in &infos {
        let mesh = dataset.read_model(*obj_id).unwrap();
        let diameter = hicp_core::diameter(mesh.vertices());
        assert!(
            (diameter - info.diameter_m).abs() < 1e-6,
            "{obj_id}: {diameter}"
        );
    }

    let targets = dataset.read_targets().unwrap();
    assert_eq!(targets.len(), 19);
    let mut instances = 0;
    let scene_ids = dataset.scene_ids("test").unwrap();
    assert_eq!(scene_ids, [50, 51, 52, 53, 54]);
    for scene_id in scene_ids {
        let scene = dataset.scene("test", scene_id).unwrap();
        for image in scene.image_ids() {
            let depth = scene.read_depth(image).unwrap();
            let camera = scene.camera(image).unwrap();
            let camera = camera.pinhole(depth.width(), depth.height()).unwrap();
            assert_eq!((camera.width(), camera.height()), (640, 480));
            let color = scene.read_color(image).unwrap().unwrap();
            assert_eq!((color.width(), color.height()), (640, 480));
            let truths = scene.ground_truth(image).unwrap();
            let infos = scene.ground_truth_info(image).unwrap();
            assert_eq!(truths.len(), infos.len());
            for (instance, (truth, info)) in truths.iter().zip(infos).enumerate() {
                instances += 1;
                assert!(targets.iter().any(|target| {
                    (target.scene_id, target.im_id, target.obj_id)
                        == (scene_id, image, truth.obj_id)
                }));
                let mask = scene.read_visible_mask(image, instance).unwrap();
                let set = mask.n_set();
                assert_eq!(set, info.visible_pixels.unwrap() as usize);
                assert_eq!(Rle::of_mask(&mask).to_mask(), mask);
                // The median depth in the mask is near the object: all units are meters.
                let mut depths: Vec<f32> = depth
                    .pixels()
                    .iter()
                    .zip(mask.pixels())
                    .filter(|(z, set)| **set && **z > 0.0)
                    .map(|(z, _)| *z)
                    .collect();
                depths.sort_by(f32::total_cmp);
                let median = f64::from(depths[depths.len() / 2]);
                let z = truth.camera_from_object.translation.z;
                assert!((median - z).abs() < 0.15, "{median} {z}");
            }
        }
    }
    assert_eq!(instances, 19);
}

#[test]
fn results_are_near_the_truth_and_written_back_with_the_same_numbers() {
    let Some(folder) = crate::common::data("bop/ycbv/results") else {
        return;
    };
    let dataset = Dataset::open(folder.parent().unwrap()).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let mut files = 0;
    for file in std::fs::read_dir(&folder).unwrap() {
        let file = file.unwrap().path();
        assert!(file.to_string_lossy().ends_with("_ycbv-test.csv"));
        let rows = read_results(&file).unwrap();
        assert!(!rows.is_empty());
        let mut near = 0;
        for row in &rows {
            let scene = dataset.scene("test", row.scene_id).unwrap();
            let truths = scene.ground_truth(row.im_id).unwrap();
            let truth = truths
                .iter()
                .find(|truth| truth.obj_id == row.obj_id)
                .unwrap();
            let (_, distance) =
                se3::pose_distance(&truth.camera_from_object, &row.camera_from_object());
            near += usize::from(distance < 0.1);
        }
        assert!(
            2 * near > rows.len(),
            "{}: {near} of {}",
            file.display(),
            rows.len()
        );

        let copy = dir.path().join("copy.csv");
        write_results(&copy, &rows).unwrap();
        assert_eq!(read_results(&copy).unwrap(), rows);
        let numbers = |path: &std::path::Path| -> Vec<f64> {
            let text = std::fs::read_to_string(path).unwrap();
            let body = text.split_once('\n').unwrap().1.to_owned();
            body.split([',', ' ', '\n', '\r'])
                .filter(|word| !word.is_empty())
                .map(|word| word.parse().unwrap())
                .collect()
        };
        assert_eq!(numbers(&copy), numbers(&file));
        files += 1;
    }
    assert_eq!(files, 4);
}
