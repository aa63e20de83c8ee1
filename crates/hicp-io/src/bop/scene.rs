//! One scene: a folder of images, each with a camera.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use hicp_core::{ColorImage, DepthImage, Isometry3, Mask};

use super::annotations::{GroundTruth, GroundTruthInfo, SceneCamera, by_image};
use crate::error::{IoError, Place};
use crate::limits::ReadLimits;
use crate::source::is_absent;

/// A scene of a dataset. Its JSON files are kept in memory; its images are read on demand.
#[derive(Clone, Debug)]
pub struct Scene {
    dir: PathBuf,
    /// The end of the names of the sensor's files and folders, such as `_cam1`; usually empty.
    suffix: String,
    limits: ReadLimits,
    cameras: BTreeMap<u32, SceneCamera>,
    ground_truth: Option<BTreeMap<u32, Vec<GroundTruth>>>,
    info: Option<BTreeMap<u32, Vec<GroundTruthInfo>>>,
}

impl Scene {
    /// Opens the scene in a folder.
    ///
    /// Reads `scene_camera.json`. If they exist, also reads `scene_gt.json` and
    /// `scene_gt_info.json`.
    ///
    /// # Errors
    ///
    /// [`IoErrorKind::Missing`](crate::IoErrorKind::Missing) if the folder or its camera file does
    /// not exist, otherwise an [`IoError`] that names the JSON key of the fault.
    pub fn open(dir: impl AsRef<Path>) -> Result<Self, IoError> {
        Self::open_within(ReadLimits::DEFAULT, dir, None)
    }

    /// Opens a scene as [`Scene::open`] does, and reads its JSON files and images within `limits`.
    ///
    /// With a `sensor`, the names of its files and folders end with it. For `cam1`, these are
    /// `scene_gt_cam1.json` and `depth_cam1`.
    ///
    /// # Errors
    ///
    /// As for [`Scene::open`].
    pub fn open_within(
        limits: ReadLimits,
        dir: impl AsRef<Path>,
        sensor: Option<&str>,
    ) -> Result<Self, IoError> {
        let dir = dir.as_ref().to_owned();
        if is_absent(&dir) {
            return Err(IoError::missing(dir, "scene"));
        }
        let suffix = sensor.map_or(String::new(), |name| format!("_{name}"));
        let path = |name: &str| dir.join(format!("{name}{suffix}.json"));
        let missing = || match &sensors(&dir)[..] {
            [] => IoError::missing(path("scene_camera"), "file of cameras"),
            names => {
                let what = format!("file of cameras (or --sensor {})", names.join(" or "));
                IoError::missing(path("scene_camera"), &what)
            }
        };
        Ok(Self {
            cameras: by_image(&limits, &path("scene_camera"))?.ok_or_else(missing)?,
            ground_truth: by_image(&limits, &path("scene_gt"))?,
            info: by_image(&limits, &path("scene_gt_info"))?,
            dir,
            suffix,
            limits,
        })
    }

    /// Returns the path of a JSON file of the scene, such as `scene_gt`. It may not exist.
    #[must_use]
    pub fn file(&self, name: &str) -> PathBuf {
        self.dir.join(format!("{name}{}.json", self.suffix))
    }

    /// Returns the path of an image in a folder of the scene, such as `depth`.
    fn image(&self, folder: &str, name: &str) -> PathBuf {
        self.dir.join(format!("{folder}{}/{name}", self.suffix))
    }

    /// Returns the folder.
    #[must_use]
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Returns the ids of the images, ascending.
    pub fn image_ids(&self) -> impl Iterator<Item = u32> + '_ {
        self.cameras.keys().copied()
    }

    /// Returns the camera of an image.
    ///
    /// # Errors
    ///
    /// [`IoError`] if `scene_camera.json` does not list the image.
    pub fn camera(&self, im_id: u32) -> Result<&SceneCamera, IoError> {
        self.cameras.get(&im_id).ok_or_else(|| {
            let found = format!("{} images", self.cameras.len());
            self.camera_error("$", &found, &format!("image {im_id} among them"))
        })
    }

    fn camera_error(&self, key: &str, found: &str, expected: &str) -> IoError {
        IoError::new(
            self.file("scene_camera"),
            Place::Field(key.to_owned()),
            found,
            expected,
        )
    }

    /// Returns the pose of the world in the camera frame of an image, meters.
    ///
    /// The poses of two images give the motion of the camera between them.
    ///
    /// # Errors
    ///
    /// As for [`Scene::camera`]. Also if the file does not state the pose.
    pub fn camera_from_world(&self, im_id: u32) -> Result<Isometry3<f64>, IoError> {
        let stated = self.camera(im_id)?.camera_from_world;
        stated.ok_or_else(|| {
            let found = "no `cam_R_w2c` and no `cam_t_w2c`";
            self.camera_error(
                &format!("$.{im_id}"),
                found,
                "both, to compute the camera motion",
            )
        })
    }

    /// Returns the true poses of an image in the order of the file, or `None` if unknown.
    #[must_use]
    pub fn ground_truth(&self, im_id: u32) -> Option<&[GroundTruth]> {
        Some(self.ground_truth.as_ref()?.get(&im_id)?)
    }

    /// Returns the visibility of an image's instances in the order of the file, or `None` if
    /// unknown.
    #[must_use]
    pub fn ground_truth_info(&self, im_id: u32) -> Option<&[GroundTruthInfo]> {
        Some(self.info.as_ref()?.get(&im_id)?)
    }

    /// Returns the path of the depth image of an image: PNG, or TIFF as in ITODD.
    ///
    /// # Errors
    ///
    /// [`IoErrorKind::Missing`](crate::IoErrorKind::Missing) if there is no depth image.
    pub fn depth_path(&self, im_id: u32) -> Result<PathBuf, IoError> {
        let png = self.image("depth", &format!("{im_id:06}.png"));
        let paths = ["png", "tif", "tiff"].map(|extension| png.with_extension(extension));
        let found = paths.into_iter().find(|path| !is_absent(path));
        found.ok_or_else(|| IoError::missing(png, "depth image"))
    }

    /// Reads the depth image of an image, meters.
    ///
    /// # Errors
    ///
    /// As for [`Scene::depth_path`], [`Scene::camera`] and
    /// [`read_depth`](crate::read_depth). Also if the camera does not state `depth_scale`.
    pub fn read_depth(&self, im_id: u32) -> Result<DepthImage, IoError> {
        let path = self.depth_path(im_id)?;
        let scale = self.camera(im_id)?.depth_scale.ok_or_else(|| {
            let expected = "one, to read depth images";
            self.camera_error(&format!("$.{im_id}"), "no `depth_scale`", expected)
        })?;
        match path.extension().is_some_and(|extension| extension == "png") {
            true => self.limits.read_depth_png(path, scale),
            false => self.limits.read_raw_depth(path)?.scaled(Some(scale)),
        }
    }

    /// Returns the path of an image's color or gray image, or `None` if neither exists.
    #[must_use]
    pub fn color_path(&self, im_id: u32) -> Option<PathBuf> {
        let mut folders = ["rgb", "gray"].into_iter();
        folders.find_map(|folder| self.picture_path(folder, im_id))
    }

    fn picture_path(&self, folder: &str, im_id: u32) -> Option<PathBuf> {
        let names = ["png", "jpg", "tif"].map(|ext| format!("{im_id:06}.{ext}"));
        let mut paths = names.iter().map(|name| self.image(folder, name));
        paths.find(|path| !is_absent(path))
    }

    /// Reads the color image of an image from `rgb/`, or returns `None` if there is none.
    ///
    /// # Errors
    ///
    /// As for [`read_color`](crate::read_color).
    pub fn read_color(&self, im_id: u32) -> Result<Option<ColorImage>, IoError> {
        let path = self.picture_path("rgb", im_id);
        path.map(|path| self.limits.read_color(path)).transpose()
    }

    /// Returns the path of the mask of an instance's visible part. The file may not exist.
    ///
    /// `instance` counts from 0 in the order of the ground truth.
    #[must_use]
    pub fn visible_mask_path(&self, im_id: u32, instance: usize) -> PathBuf {
        self.image("mask_visib", &format!("{im_id:06}_{instance:06}.png"))
    }

    /// Reads the mask of the visible part of an instance.
    ///
    /// # Errors
    ///
    /// [`IoErrorKind::Missing`](crate::IoErrorKind::Missing) if the mask does not exist, otherwise
    /// as for [`read_mask_png`](crate::read_mask_png).
    pub fn read_visible_mask(&self, im_id: u32, instance: usize) -> Result<Mask, IoError> {
        let path = self.visible_mask_path(im_id, instance);
        if is_absent(&path) {
            return Err(IoError::missing(path, "mask"));
        }
        self.limits.read_mask_png(path)
    }
}

/// Returns the sensors of a scene with several, as the ends of their files of cameras.
fn sensors(dir: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(dir).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let of_name = |name: String| {
        let name = name.strip_prefix("scene_camera_")?;
        name.strip_suffix(".json").map(str::to_owned)
    };
    let mut sensors: Vec<String> = names.filter_map(of_name).collect();
    sensors.sort();
    sensors
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::IoErrorKind;
    use std::fs;

    const CAMERA: &str = r#"{"10": {"cam_K": [600,0,1,0,600,1,0,0,1], "depth_scale": 0.5,
        "cam_R_w2c": [1,0,0,0,1,0,0,0,1], "cam_t_w2c": [0,0,1000]}, "2": {"cam_K": [600,0,1,0,600,1,0,0,1]}}"#;

    fn scene(files: &[(&str, &str)]) -> (tempfile::TempDir, Result<Scene, IoError>) {
        let dir = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = dir.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        let scene = Scene::open(dir.path());
        (dir, scene)
    }

    #[test]
    fn optional_files_may_be_missing() {
        let (_dir, scene) = scene(&[("scene_camera.json", CAMERA)]);
        let scene = scene.unwrap();
        assert_eq!(scene.image_ids().collect::<Vec<_>>(), [2, 10]);
        let camera = scene.camera(10).unwrap();
        assert_eq!(camera.depth_scale, Some(0.5));
        assert_eq!(camera.camera_from_world.unwrap().translation.z, 1.0);
        assert_eq!(scene.camera(2).unwrap().camera_from_world, None);
        assert_eq!(scene.camera_from_world(10).unwrap().translation.z, 1.0);
        assert!(
            matches!(scene.camera_from_world(2), Err(IoError { place: Some(Place::Field(key)), .. }) if key == "$.2")
        );
        assert!(matches!(
            scene.camera(3),
            Err(IoError {
                place: Some(Place::Field(_)),
                ..
            })
        ));
        assert!(scene.ground_truth(2).is_none() && scene.ground_truth_info(2).is_none());
        assert!(scene.color_path(2).is_none());
        assert!(matches!(
            scene.read_depth(2),
            Err(IoError {
                kind: IoErrorKind::Missing,
                ..
            })
        ));
        assert!(matches!(
            scene.read_visible_mask(2, 0),
            Err(IoError {
                kind: IoErrorKind::Missing,
                ..
            })
        ));
    }

    #[test]
    fn half_a_camera_pose_is_refused() {
        let half = CAMERA.replace(r#", "cam_t_w2c": [0,0,1000]"#, "");
        let (_dir, scene) = scene(&[("scene_camera.json", &half)]);
        let error = scene.unwrap_err().to_string();
        assert!(
            error.contains("$.10") && error.contains("cam_t_w2c"),
            "{error}"
        );
    }

    #[test]
    fn errors_of_a_camera_name_the_field() {
        let text = CAMERA.replacen("[600,0,1,0,600,1,0,0,1]", "400", 1);
        for (text, part) in [
            (
                text,
                "$.10.cam_K: found 400, expected an array of 9 numbers",
            ),
            (
                CAMERA.replace("0.5", "\"mm\""),
                "$.10.depth_scale: found the text \"mm\"",
            ),
        ] {
            let (_dir, scene) = scene(&[("scene_camera.json", &text)]);
            let error = scene.unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn errors_name_damaged_tiff_depth_images_and_a_missing_depth_scale() {
        let (_dir, scene) = scene(&[
            ("scene_camera.json", CAMERA),
            ("depth/000010.tif", ""),
            ("depth/000002.png", ""),
            ("gray/000002.jpg", ""),
            ("gray/000010.tif", ""),
        ]);
        let scene = scene.unwrap();
        assert!(matches!(
            scene.read_depth(10),
            Err(IoError { path, .. }) if path.ends_with("depth/000010.tif")
        ));
        assert!(
            matches!(scene.read_depth(2), Err(IoError { place: Some(Place::Field(key)), .. }) if key == "$.2")
        );
        for path in ["gray/000002.jpg", "gray/000010.tif"] {
            let id = path[5..11].parse().unwrap();
            assert!(scene.color_path(id).unwrap().ends_with(path));
        }
    }

    #[test]
    fn unreadable_files_are_not_reported_as_missing() {
        let (dir, opened) = scene(&[
            (
                "scene_camera.json",
                &CAMERA.replace(r#""2": {"#, r#""2": {"depth_scale": 1, "#),
            ),
            ("depth/000002.png/file", ""),
            ("depth/000010.tiff/file", ""),
            ("mask_visib/000002_000000.png/file", ""),
            ("gray/000002.png/file", ""),
        ]);
        let opened = opened.unwrap();
        let folder = |error: IoError| error.found == "a folder";
        assert!(folder(opened.read_depth(2).unwrap_err()));
        assert!(folder(opened.read_visible_mask(2, 0).unwrap_err()));
        assert!(opened.color_path(2).unwrap().ends_with("gray/000002.png"));
        assert!(folder(opened.read_depth(10).unwrap_err()));
        for name in ["scene_gt.json", "scene_gt_info.json"] {
            let path = dir.path().join(name);
            fs::create_dir(&path).unwrap();
            assert!(folder(Scene::open(dir.path()).unwrap_err()), "{name}");
            fs::remove_dir(&path).unwrap();
        }
        let file = dir.path().join("scene_camera.json");
        let inside_a_file = Scene::open(&file).unwrap_err();
        assert!(
            matches!(
                inside_a_file,
                IoError {
                    kind: IoErrorKind::Read,
                    ..
                }
            ),
            "{inside_a_file}"
        );
    }

    #[cfg(unix)]
    #[test]
    fn dangling_links_count_as_missing_and_circular_links_do_not() {
        use std::os::unix::fs::symlink;
        let (dir, _) = scene(&[("scene_camera.json", CAMERA)]);
        let path = dir.path().join("scene_gt.json");
        symlink(dir.path().join("nothing"), &path).unwrap();
        assert!(Scene::open(dir.path()).unwrap().ground_truth(2).is_none());
        fs::remove_file(&path).unwrap();
        symlink(&path, &path).unwrap();
        assert!(matches!(
            Scene::open(dir.path()),
            Err(IoError {
                kind: IoErrorKind::Read,
                ..
            })
        ));
    }

    #[test]
    fn ground_truth_is_in_meters_and_errors_name_the_field() {
        let pose = r#""cam_R_m2c": [1,0,0,0,1,0,0,0,1], "cam_t_m2c": [0, 0, 850.5]"#;
        let good = format!(r#"{{"2": [{{"obj_id": 7, {pose}}}]}}"#);
        let info = r#"{"2": [{"visib_fract": 0.5, "bbox_visib": [-1, -1, -1, -1], "extra": []}]}"#;
        let (_dir, opened) = scene(&[
            ("scene_camera.json", CAMERA),
            ("scene_gt.json", &good),
            ("scene_gt_info.json", info),
        ]);
        let opened = opened.unwrap();
        let truth = opened.ground_truth(2).unwrap()[0];
        assert_eq!(
            (truth.obj_id, truth.camera_from_object.translation.z),
            (7, 0.8505)
        );
        let info = opened.ground_truth_info(2).unwrap()[0];
        assert_eq!((info.visible_fraction, info.bbox_object), (Some(0.5), None));

        for (from, to, key) in [
            ("7", "-7", "$.2[0].obj_id"),
            ("850.5", "null", "$.2[0].cam_t_m2c[2]"),
            ("obj_id", "id", "$.2[0]"),
        ] {
            let bad = good.replace(from, to);
            let (_dir, opened) = scene(&[("scene_camera.json", CAMERA), ("scene_gt.json", &bad)]);
            match opened {
                Err(IoError {
                    place: Some(Place::Field(found)),
                    ..
                }) => assert_eq!(found, key),
                other => panic!("{other:?}"),
            }
        }
    }
}
