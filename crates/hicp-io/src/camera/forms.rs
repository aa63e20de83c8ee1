//! Cameras in the forms of ROS, OpenCV, RealSense, Open3D and NumPy.

use std::path::Path;

use hicp_core::{Matrix3, PinholeCamera};
use serde_json::Value;

use super::bop::{CameraFile, is_bop, number_of};
use super::distortion::{COEFFICIENTS, Distortion, is_distortion};
use crate::document::{self, numbers};
use crate::error::{IoError, IoErrorKind, Place, quote};
use crate::limits::ReadLimits;

const EXPECTED: &str = "a camera as JSON, YAML, XML, text, NPY or NPZ";

/// The keys of a calibration matrix, and of numbers under several names.
const MATRIX: [&str; 11] = [
    "cam_K",
    "K",
    "k",
    "camera_matrix",
    "cameraMatrix",
    "CameraMatrix",
    "Camera_Matrix",
    "mtx",
    "intrinsic_matrix",
    "intrinsics",
    "intrinsic",
];
const FX: [&str; 5] = ["fx", "f_u", "fl_x", "focal_length_x", "f"];
const FY: [&str; 5] = ["fy", "f_v", "fl_y", "focal_length_y", "f"];
const CX: [&str; 5] = ["cx", "ppx", "pp_x", "c_x", "principal_point_x"];
const CY: [&str; 5] = ["cy", "ppy", "pp_y", "c_y", "principal_point_y"];
const FLAT: [[&str; 5]; 4] = [FX, FY, CX, CY];
const WIDTH: [&str; 3] = ["width", "image_width", "w"];
const HEIGHT: [&str; 3] = ["height", "image_height", "h"];
const MODEL: [&str; 3] = ["distortion_model", "model", "camera_model"];
/// The distortions that RealSense numbers in this order, as `rs2_distortion`.
const REALSENSE: [&str; 6] = [
    "none",
    "modified Brown-Conrady",
    "inverse Brown-Conrady",
    "ftheta",
    "Brown-Conrady",
    "Kannala-Brandt",
];

/// Reads a camera for images of `image_size` (width, height) in pixels, in any common form.
///
/// - BOP's JSON, as [`read_camera_json`](crate::read_camera_json) reads it.
/// - A 3×3 matrix: JSON, text or NPY of nine numbers, by rows. If only the transpose is a
///   calibration matrix, the numbers are by columns, as in Open3D.
/// - Text with four numbers: fx, fy, cx, cy.
/// - ROS's `camera_info` as YAML or JSON, with `K`, `D` and the model.
/// - OpenCV's YAML and XML with `camera_matrix` and `distortion_coefficients`, and NPZ with `mtx`
///   and `dist`.
/// - RealSense's and similar files with fx, fy, ppx and ppy. Of several streams, `depth` is read.
/// - Open3D's `intrinsic_matrix`.
///
/// `depth_scale` is in millimeters per unit; next to `ppx` or `f_u`, it is in meters per unit, as
/// those programs write it. Distortions whose numbers are all 0 are dropped. A distortion may also
/// be next to BOP's `cam_K`, but not next to its `cam_model`.
///
/// # Errors
///
/// [`IoError`] names the key of the fault, or the distortion model that is not supported. It is of
/// the kind [`IoErrorKind::CameraSize`] if the camera is for images of another size.
pub fn read_camera(path: impl AsRef<Path>, image_size: (u32, u32)) -> Result<CameraFile, IoError> {
    ReadLimits::DEFAULT.read_camera(path, image_size)
}

impl ReadLimits {
    /// Reads a camera as [`read_camera`] does, from a file of at most `max_small_json_bytes`.
    ///
    /// # Errors
    ///
    /// As for [`read_camera`].
    pub fn read_camera(
        &self,
        path: impl AsRef<Path>,
        image_size: (u32, u32),
    ) -> Result<CameraFile, IoError> {
        let path = path.as_ref();
        let (root, is_json) = document::read(self, path, EXPECTED)?;
        if is_json && is_bop(&root) {
            return self.read_camera_json(path, image_size);
        }
        let mut found = Vec::new();
        match root.is_array() {
            true => found.push(("$".to_owned(), &root)),
            false => cameras(&root, "$", 0, &mut found),
        }
        let depth = found.iter().find(|(key, _)| key.ends_with(".depth"));
        match (&found[..], depth) {
            ([(key, camera)], _) | (_, Some((key, camera))) => {
                let (key, root) = (key.clone(), &root);
                let form = Form {
                    path,
                    key,
                    root,
                    camera,
                };
                form.read(image_size)
            }
            (found, _) => {
                let keys: Vec<_> = found.iter().take(8).map(|(key, _)| quote(key)).collect();
                let found = match found {
                    [] => "no camera".to_owned(),
                    _ => format!("{} cameras: {}", found.len(), keys.join(", ")),
                };
                let expected = "one with `cam_K`, `K`, `camera_matrix`, `intrinsic_matrix`, or fx, fy, cx and cy";
                let place = Place::Field("$".to_owned());
                Err(IoError::new(path, place, found, expected))
            }
        }
    }
}

/// Finds the objects that have the keys of a camera.
fn cameras<'a>(value: &'a Value, key: &str, depth: usize, found: &mut Vec<(String, &'a Value)>) {
    let Value::Object(members) = value else {
        return;
    };
    let has = |keys: &[&str]| keys.iter().any(|key| members.contains_key(*key));
    let is_matrix = |key: &&str| members.get(*key).is_some_and(|k| numbers(k).is_some());
    if MATRIX.iter().any(is_matrix) || (has(&FX) && has(&CX)) {
        found.push((key.to_owned(), value));
    } else if depth < 4 {
        for (name, member) in members {
            cameras(member, &format!("{key}.{name}"), depth + 1, found);
        }
    }
}

/// A camera in a file.
struct Form<'a> {
    path: &'a Path,
    /// The path of keys to the camera.
    key: String,
    root: &'a Value,
    camera: &'a Value,
}

impl Form<'_> {
    fn refuse(&self, name: &str, found: impl Into<String>, expected: &str) -> IoError {
        let place = Place::Field(format!("{}{name}", self.key));
        IoError::new(self.path, place, found, expected)
    }

    /// Returns the coefficients of the distortion and their key.
    fn coefficients(&self) -> Result<(String, Vec<f64>), IoError> {
        let both = [self.camera, self.root].into_iter();
        let mut members = both.filter_map(Value::as_object).flatten();
        let Some((key, value)) = members.find(|(key, value)| is_distortion(key, value)) else {
            let numbers = self.named(|name| self.member(&[name]).map(|(_, value)| value), "")?;
            return Ok(("k1".to_owned(), numbers));
        };
        match numbers(value) {
            Some(numbers) => Ok((key.clone(), numbers)),
            None if COEFFICIENTS.iter().any(|name| value.get(name).is_some()) => {
                let numbers = self.named(|name| value.get(name), &format!(".{key}"))?;
                Ok((key.clone(), numbers))
            }
            None => {
                let found = quote(&value.to_string());
                Err(self.refuse(&format!(".{key}"), found, "a list of finite numbers"))
            }
        }
    }

    /// Returns the coefficients that have keys of their own. The others are 0.
    fn named<'v>(
        &self,
        member: impl Fn(&'static str) -> Option<&'v Value>,
        key: &str,
    ) -> Result<Vec<f64>, IoError> {
        let number = |name: &&'static str| match member(name).filter(|value| !value.is_null()) {
            None => Ok(0.0),
            Some(value) => value.as_f64().ok_or_else(|| {
                let found = quote(&value.to_string());
                self.refuse(&format!("{key}.{name}"), found, "a finite number")
            }),
        };
        COEFFICIENTS.iter().map(number).collect()
    }

    /// Returns the member of the first key that the camera or the file has.
    fn member(&self, keys: &[&'static str]) -> Option<(&'static str, &Value)> {
        let both = [self.camera, self.root].into_iter();
        both.flat_map(|object| keys.iter().map(move |key| (*key, object.get(*key))))
            .find_map(|(key, value)| Some((key, value?)))
    }

    fn number(&self, keys: &[&'static str]) -> Option<f64> {
        numbers(self.member(keys)?.1)?.first().copied()
    }

    fn read(&self, (width, height): (u32, u32)) -> Result<CameraFile, IoError> {
        let size = self.number(&WIDTH).zip(self.number(&HEIGHT));
        if let Some((w, h)) = size.filter(|size| *size != (width.into(), height.into())) {
            let found = format!("a camera for {w}x{h} images");
            let error = self.refuse("", found, &format!("one for {width}x{height}"));
            return Err(error.with_kind(IoErrorKind::CameraSize));
        }
        let camera = PinholeCamera::from_matrix(&self.matrix()?, width, height);
        let camera = camera.map_err(|error| {
            let found = "numbers that are not a camera";
            let number = number_of(&error);
            let keys = FLAT.iter().find(|keys| Some(keys[0]) == number);
            let key = keys.and_then(|keys| self.member(keys));
            let name = key.map_or(String::new(), |(key, _)| format!(".{key}"));
            self.refuse(&name, found, "those of a pinhole camera")
                .with_source(error)
        })?;
        let depth_scale = match self.member(&["depth_scale"]) {
            None => None,
            Some((key, value)) => {
                let meters = self.camera.get("ppx").or(self.camera.get("f_u")).is_some();
                let scale = numbers(value).and_then(|numbers| numbers.first().copied());
                let scale = scale.filter(|scale| *scale > 0.0).ok_or_else(|| {
                    let found = quote(&value.to_string());
                    self.refuse(&format!(".{key}"), found, "a number above 0")
                })?;
                Some(if meters { scale * 1000.0 } else { scale })
            }
        };
        Ok(CameraFile {
            camera,
            depth_scale,
            distortion: self.distortion()?,
        })
    }

    fn matrix(&self) -> Result<Matrix3<f64>, IoError> {
        let flat = || {
            let [fx, fy, cx, cy] = FLAT.map(|keys| self.number(&keys));
            Some(vec![fx?, 0.0, cx?, 0.0, fy?, cy?, 0.0, 0.0, 1.0])
        };
        let array = numbers(self.camera).filter(|_| self.camera.is_array());
        let stated = || numbers(self.member(&MATRIX)?.1);
        let numbers = array.or_else(flat).or_else(stated).unwrap_or_default();
        let by_rows = match numbers[..] {
            [fx, fy, cx, cy] => Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0),
            // A matrix of 3x4 or 4x4 has its last column, which is 0, dropped.
            [a, b, c, x, d, e, f, y, g, h, i, z, ..]
                if [x, y, z] == [0.0; 3] && numbers.len() <= 16 =>
            {
                Matrix3::new(a, b, c, d, e, f, g, h, i)
            }
            [_, _, _, _, _, _, _, _, _] => Matrix3::from_row_slice(&numbers),
            [] if self.member(&FX).is_some() => return Err(self.wrong_number()),
            _ => {
                let found = match numbers.len() {
                    0 => "no numbers, or one that is not finite".to_owned(),
                    count => format!("{count} numbers"),
                };
                return Err(self.refuse("", found, "fx, fy, cx and cy, or a 3x3 matrix"));
            }
        };
        let is_transposed = by_rows.m13 == 0.0 && by_rows.m23 == 0.0 && by_rows.m31 != 0.0;
        Ok(match is_transposed {
            true => by_rows.transpose(),
            false => by_rows,
        })
    }

    /// Returns the error for fx, fy, cx or cy, one of which is missing or not a number.
    fn wrong_number(&self) -> IoError {
        let wrong = FLAT.iter().find(|keys| self.number(*keys).is_none());
        match wrong.and_then(|keys| self.member(keys)) {
            Some((key, value)) => {
                let found = quote(&value.to_string());
                self.refuse(&format!(".{key}"), found, "a finite number")
            }
            None => {
                let name = wrong.map_or("fx", |keys| keys[0]);
                self.refuse(
                    "",
                    format!("no `{name}`"),
                    "fx, fy, cx and cy, or a 3x3 matrix",
                )
            }
        }
    }

    fn distortion(&self) -> Result<Option<Distortion>, IoError> {
        let (key, mut k) = self.coefficients()?;
        let model = match self.member(&MODEL).map(|(_, model)| model) {
            None | Some(Value::Null) => String::new(),
            Some(Value::String(name)) => name.clone(),
            Some(other) => {
                let number = other
                    .as_u64()
                    .and_then(|number| usize::try_from(number).ok());
                let name = number.and_then(|number| REALSENSE.get(number));
                name.map_or_else(|| other.to_string(), ToString::to_string)
            }
        };
        if k.iter().all(|k| *k == 0.0) {
            return Ok(None);
        }
        while k.len() > 8 && k.last() == Some(&0.0) {
            k.pop();
        }
        let name = model.to_lowercase();
        let has = |part: &str| name.contains(part);
        let fisheye = has("fisheye") || has("equidistant") || has("kannala");
        let inverse = has("inverse") || has("modified") || has("ftheta");
        let brown = match &*name {
            "" | "plumb_bob" | "rational_polynomial" | "radtan" | "opencv" | "pinhole" => true,
            _ => has("brown"),
        };
        if fisheye && let [k1, k2, k3, k4] | [k1, k2, k3, k4, 0.0] = k[..] {
            return Ok(Some(Distortion::KannalaBrandt([k1, k2, k3, k4])));
        }
        if brown
            && !inverse
            && let 4 | 5 | 8 = k.len()
        {
            k.resize(8, 0.0);
            return Ok(k.try_into().ok().map(Distortion::BrownConrady));
        }
        let found = format!("the distortion {} of {} numbers", quote(&model), k.len());
        let expected = "Brown–Conrady with 4, 5 or 8 numbers (plumb_bob, rational_polynomial), or \
                        Kannala–Brandt with 4 (equidistant, fisheye): undistort the images first";
        Err(self.refuse(&format!(".{key}"), found, expected))
    }
}
