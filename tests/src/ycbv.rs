//! Real YCB-Video frames, if the machine has them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use hicp_io::bop::Dataset;
use hybrid_icp::core::{
    ColorImage, DepthImage, Isometry3, Mask, Model, ModelConfig, Observation, PinholeCamera,
};

/// Returns the dataset's folder, if it exists and contains result files.
///
/// It is `ycbv` in `BOP_PATH`, in `HICP_DATA/bop`, or in the shared data next to the project. The
/// tests need the excerpt with its folder `results`.
pub fn root() -> Option<PathBuf> {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/bop");
    let folders = [
        std::env::var_os("BOP_PATH").map(PathBuf::from),
        std::env::var_os("HICP_DATA").map(|data| PathBuf::from(data).join("bop")),
        Some(shared),
    ];
    folders
        .into_iter()
        .flatten()
        .map(|folder| folder.join("ycbv"))
        .find(|folder| folder.join("results").is_dir())
}

/// An object instance in a frame, with its true pose.
#[derive(Debug)]
pub struct Instance {
    /// Scene, image and object id.
    pub key: (u32, u32, u32),
    /// The object.
    pub model: Arc<Model>,
    /// The true pose, camera from object.
    pub truth: Isometry3<f64>,
    depth: Arc<DepthImage>,
    color: Option<Arc<ColorImage>>,
    mask: Mask,
    camera: PinholeCamera,
}

impl Instance {
    /// Creates a new observation.
    pub fn observe(&self) -> Observation {
        let depth = Arc::clone(&self.depth);
        Observation::new(depth, self.mask.clone(), self.camera).expect("sizes agree")
    }

    /// Creates a new observation with the color image, if there is one.
    pub fn observe_color(&self) -> Observation {
        match &self.color {
            Some(color) => self
                .observe()
                .with_color(color.clone())
                .expect("sizes agree"),
            None => self.observe(),
        }
    }
}

/// Reads every instance of the test split.
pub fn instances(dataset: &Dataset) -> Vec<Instance> {
    let infos = dataset.read_models_info().expect("models_info.json reads");
    let mut models = std::collections::BTreeMap::new();
    let mut instances = Vec::new();
    for scene_id in dataset.scene_ids("test").expect("the split exists") {
        let scene = dataset.scene("test", scene_id).expect("the scene opens");
        for im_id in scene.image_ids() {
            let depth = Arc::new(scene.read_depth(im_id).expect("the depth image reads"));
            let color = scene.read_color(im_id).expect("the color image reads");
            let color = color.map(Arc::new);
            let camera = scene
                .camera(im_id)
                .expect("the image has a camera")
                .pinhole(depth.width(), depth.height())
                .expect("the camera is valid");
            let truths = scene
                .ground_truth(im_id)
                .expect("the image has ground truth");
            for (index, truth) in truths.iter().enumerate() {
                let model = models.entry(truth.obj_id).or_insert_with(|| {
                    let mesh = dataset.read_model(truth.obj_id).expect("the model reads");
                    let info = &infos[&truth.obj_id];
                    let config = ModelConfig {
                        diameter: Some(info.diameter_m),
                        symmetries: info.symmetries.clone(),
                        ..ModelConfig::default()
                    };
                    Arc::new(Model::with_config(mesh, config))
                });
                instances.push(Instance {
                    key: (scene_id, im_id, truth.obj_id),
                    model: Arc::clone(model),
                    truth: truth.camera_from_object,
                    depth: Arc::clone(&depth),
                    color: color.clone(),
                    mask: scene
                        .read_visible_mask(im_id, index)
                        .expect("the mask reads"),
                    camera,
                });
            }
        }
    }
    instances
}
