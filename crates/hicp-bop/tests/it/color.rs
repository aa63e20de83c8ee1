//! Color images of a dataset.

use hicp_bop::{DatasetRefiner, FaultKind, MaskSource, ModelFolder, Models, Scenes};
use hicp_io::bop::{Dataset, ResultRow};
use hicp_io::{ReadLimits, write_rgb_png};
use hybrid_icp::{Preset, Refiner};

use crate::common::{BLOCK, KEY, World, estimate};

/// Copies the models into `models_color` with a color for each vertex.
fn color_models(dataset: &Dataset) {
    let mesh = dataset.read_model(BLOCK).unwrap();
    let mut text = "ply\nformat ascii 1.0\nelement vertex 8\n".to_owned();
    text += "property float x\nproperty float y\nproperty float z\n";
    text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    text += "element face 12\nproperty list uchar int vertex_indices\nend_header\n";
    for p in mesh.vertices() {
        text += &format!("{} {} {} 9 8 7\n", p.x * 1e3, p.y * 1e3, p.z * 1e3);
    }
    for [a, b, c] in mesh.triangles() {
        text += &format!("3 {a} {b} {c}\n");
    }
    let folder = dataset.root().join("models_color");
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(folder.join("obj_000005.ply"), text).unwrap();
    std::fs::write(
        dataset.root().join("models/models_info.json"),
        r#"{"5": {"diameter": 123.0}}"#,
    )
    .unwrap();
}

fn refiner(dataset: &Dataset, folder: &ModelFolder) -> DatasetRefiner {
    DatasetRefiner {
        models: Models::read(folder, &[BLOCK].into()),
        scenes: Scenes::new(dataset, "test", 1),
        masks: MaskSource::Visible,
    }
}

#[test]
fn the_color_image_is_read_only_if_a_model_has_colors() {
    let world = World::new();
    let plain = &world.dataset;
    color_models(plain);
    let rows = [ResultRow::new(KEY.0, KEY.1, BLOCK, estimate())];
    let colored = plain.clone().with_models("models_color").unwrap();
    let (models, info) = (
        colored.models_dir().unwrap(),
        colored.models_info_path().unwrap(),
    );
    let open = || ModelFolder::with_info(ReadLimits::DEFAULT, &models, &info).unwrap();
    let model = open().read(BLOCK).unwrap().unwrap();
    assert!(model.mesh().color().is_some());
    assert_eq!(model.diameter(), 0.123);
    let plain_folder = ModelFolder::open(plain.models_dir().unwrap()).unwrap();

    let mut pipeline = Refiner::preset(Preset::Hybrid);
    let mut faults = |dataset: &Dataset, folder: &ModelFolder| {
        let shared = refiner(dataset, folder);
        let result = shared.frame(&mut pipeline, KEY, &rows, &[0]);
        assert!(result.rows[0].pose.is_some());
        result.faults
    };
    // A missing color image is no fault.
    assert!(faults(&colored, &open()).is_empty());
    let rgb = world.path("test/000001/rgb");
    std::fs::create_dir(&rgb).unwrap();
    write_rgb_png(rgb.join("000004.png"), 160, 120, &[50; 3 * 160 * 120]).unwrap();
    assert!(faults(&colored, &open()).is_empty());
    let mut image = Scenes::new(&colored, "test", 1).read(KEY).unwrap();
    assert!(image.color.is_none());
    image.read_color().unwrap();
    let mut frame = MaskSource::Visible.frame(KEY, image);
    let observed = frame.observation(0).unwrap().color().unwrap();
    assert_eq!((observed.width(), observed.height()), (160, 120));

    write_rgb_png(rgb.join("000004.png"), 80, 60, &[50; 3 * 80 * 60]).unwrap();
    let [fault] = &faults(&colored, &open())[..] else {
        unreachable!("one fault")
    };
    assert_eq!(fault.kind, FaultKind::Damaged);
    assert!(fault.text.contains("80x60"), "{}", fault.text);
    // Without colors of models, nobody reads it.
    assert!(faults(&colored, &open().without_color()).is_empty());
    assert!(faults(plain, &plain_folder).is_empty());
    assert!(plain.clone().with_models("nothing").is_err());
}
