//! Simulated cases with the troubles of a robot cell: objects on a table that hide each other,
//! boards in front of them, depth noise and imperfect masks.

use std::f64::consts::TAU;
use std::sync::Arc;

use hicp_sim::{
    Case, Clutter, Corruption, DepthNoise, DepthSensor, Distortion, Dropout, Household,
    MaskDefects, Proportions, RelativeGaussian, SimError, SimRng, perturb, rotation, stream,
};
use hybrid_icp::core::{DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera};
use hybrid_icp::nalgebra::Vector3;
use rand::RngExt;

use crate::camera;

/// Fewest visible pixels of an object that is a case, of an image of 640×480 pixels.
const LEAST_PIXELS: f64 = 1000.0;
/// The same of an image of any size.
const FEWEST_PIXELS: f64 = 100.0;
/// The sizes of [`Tabletop::resized`], as powers of two of 640×480 pixels.
const SIZES: std::ops::Range<f64> = -3.0..1.5;
/// Smallest visible share of an object that is a case.
const LEAST_VISIBLE: f64 = 0.3;
/// Objects in a scene.
const OBJECTS: usize = 5;

/// A defect of a mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaskKind {
    /// The visible pixels.
    Exact,
    /// Dilated by a disc of this radius, pixels.
    Dilated(u32),
    /// Eroded by a disc of this radius, pixels.
    Eroded(u32),
    /// 28 cells across the box, interpolated and cut at a half, as networks predict masks.
    Soft,
    /// As [`MaskKind::Soft`], but every pixel above zero is set, as readers of soft masks do.
    SoftAboveZero,
    /// Displaced at random by this many pixels, differently in areas of six times the size.
    Ragged(u32),
    /// The bounding box.
    Box,
}

impl MaskKind {
    /// The kinds that the tables show.
    pub const ALL: [Self; 9] = [
        Self::Exact,
        Self::Dilated(4),
        Self::Dilated(8),
        Self::Dilated(16),
        Self::Eroded(4),
        Self::Soft,
        Self::SoftAboveZero,
        Self::Box,
        Self::Ragged(4),
    ];

    /// Returns the kinds of the cases to which the confidence is fitted: all but the last.
    pub fn fitted() -> &'static [Self] {
        &Self::ALL[..8]
    }

    /// Returns the name in tables.
    pub fn name(self) -> String {
        match self {
            Self::Exact => "exact".into(),
            Self::Dilated(pixels) => format!("dilated {pixels} px"),
            Self::Eroded(pixels) => format!("eroded {pixels} px"),
            Self::Soft => "soft, above a half".into(),
            Self::SoftAboveZero => "soft, above zero".into(),
            Self::Ragged(pixels) => format!("ragged {pixels} px"),
            Self::Box => "box".into(),
        }
    }

    /// Returns the same defect for images of another size, of one pixel at least.
    fn scaled(self, factor: f64) -> Self {
        let scale = |pixels: u32| ((f64::from(pixels) * factor).round() as u32).max(1);
        match self {
            Self::Dilated(pixels) => Self::Dilated(scale(pixels)),
            Self::Eroded(pixels) => Self::Eroded(scale(pixels)),
            Self::Ragged(pixels) => Self::Ragged(scale(pixels)),
            other => other,
        }
    }

    /// Returns a mask with this defect.
    ///
    /// # Errors
    ///
    /// Never for the kinds in [`MaskKind::ALL`].
    pub fn apply(self, mask: &Mask) -> Result<Mask, SimError> {
        self.defects().apply(&mut stream(0, &["mask"], 0), mask)
    }

    fn defects(self) -> MaskDefects {
        let mut defects = MaskDefects::default();
        match self {
            Self::Exact => {}
            Self::Dilated(pixels) => defects.dilation_pixels = pixels,
            Self::Eroded(pixels) => defects.erosion_pixels = pixels,
            Self::Soft => (defects.soft_cells, defects.soft_threshold) = (28, 0.5),
            Self::SoftAboveZero => defects.soft_cells = 28,
            Self::Ragged(pixels) => defects.ragged_pixels = pixels,
            Self::Box => defects.boxed = true,
        }
        defects
    }
}

/// The models from which scenes are drawn.
#[derive(Debug)]
pub struct Tabletop {
    /// The models, with their names.
    pub objects: Vec<(String, Model)>,
    models: Vec<Model>,
    resized: bool,
}

/// An object in a noisy image, before segmentation.
#[derive(Debug)]
pub struct Seen {
    /// Index into [`Tabletop::objects`].
    pub model: usize,
    /// The true pose, camera from object, meters.
    pub truth: Isometry3<f64>,
    /// The noisy depth image, meters.
    pub depth: Arc<DepthImage>,
    /// The visible pixels of the object.
    pub visible: Mask,
    /// Their share of the pixels that the object would cover alone.
    pub visible_share: f64,
    /// The sensor that measured the depth.
    pub sensor: DepthSensor,
    /// The camera.
    pub camera: PinholeCamera,
}

impl Tabletop {
    /// Creates the scenes of some household objects.
    ///
    /// # Errors
    ///
    /// If a model cannot be built.
    pub fn new(objects: &[Household]) -> Result<Self, SimError> {
        Self::stretched(objects, Proportions::default())
    }

    /// Creates the scenes of any models.
    pub fn of(objects: Vec<(String, Model)>) -> Self {
        Self {
            models: objects.iter().map(|(_, model)| model.clone()).collect(),
            objects,
            resized: false,
        }
    }

    /// Returns the scenes in images of 80×60 to about 1,800×1,360 pixels, each of another size.
    ///
    /// The objects have at least 100 pixels, and the defects of masks grow with the image.
    #[must_use]
    pub fn resized(self) -> Self {
        Self {
            resized: true,
            ..self
        }
    }

    /// Returns the camera of a scene.
    fn camera(&self, seed: u64) -> PinholeCamera {
        let full = camera();
        if !self.resized {
            return full;
        }
        let mut random = stream(seed, &["size"], 0);
        let scale = random.random_range(SIZES).exp2();
        let [fx, fy, width, height] = [
            full.fx(),
            full.fy(),
            f64::from(full.width()),
            f64::from(full.height()),
        ]
        .map(|length| length * scale);
        let [cx, cy] = [full.cx(), full.cy()].map(|center| (center + 0.5) * scale - 0.5);
        PinholeCamera::new(fx, fy, cx, cy, width as u32, height as u32).expect("a valid camera")
    }

    /// Returns the visible objects of a scene: five on a table, with noise of 0 to 3 %.
    ///
    /// In front of every second object stands a board that hides up to half of what is visible.
    ///
    /// # Errors
    ///
    /// If there is no model.
    pub fn scene(&self, seed: u64) -> Result<Vec<Seen>, SimError> {
        self.scene_of(seed, |random| white(3.0 * random.random::<f64>()))
    }

    /// Returns the same, but the sensor has systematic errors, as structured light and stereo have.
    ///
    /// # Errors
    ///
    /// If there is no model.
    pub fn distorted_scene(&self, seed: u64) -> Result<Vec<Seen>, SimError> {
        self.scene_of(seed, |random| DepthSensor {
            distortion: Distortion {
                percent: 0.8 * random.random::<f64>(),
                area_pixels: random.random_range(8..80),
                fattening_pixels: random.random_range(-3..4),
            },
            quantization_meters: Some(0.001),
            dropout: Dropout {
                max_incidence_degrees: Some(random.random_range(65.0..88.0)),
                edge_pixels: random.random_range(0..3),
            },
            ..white(0.8 * random.random::<f64>().powi(2))
        })
    }

    fn scene_of(
        &self,
        seed: u64,
        sensor: impl FnOnce(&mut SimRng) -> DepthSensor,
    ) -> Result<Vec<Seen>, SimError> {
        let mut random = stream(seed, &["tabletop"], 0);
        let clutter = Clutter::draw(&mut random, &self.models, OBJECTS)?;
        let camera = self.camera(seed);
        let scale = scale_of(&camera);
        let least = (LEAST_PIXELS * scale * scale).max(FEWEST_PIXELS) as usize;
        let perfect = DepthSensor::default();
        let view = clutter.view(&mut random, &self.models, &camera, &perfect)?;
        let sensor = sensor(&mut random);
        let mut seen = Vec::new();
        for (index, object) in (0..).zip(&view.instances) {
            let occluded_share = match index % 2 {
                0 => 0.0,
                _ => 0.5 * random.random::<f64>(),
            };
            let case = Case {
                object: self.objects[object.model].0.clone(),
                seed,
                index,
                camera,
                camera_from_object: object.camera_from_object,
                init: object.camera_from_object,
                bin: None,
                vsd_initial: 0.0,
                tries: 1,
                depth: view.depth.clone(),
                mask: object.visible.clone(),
            };
            if case.mask.n_set() < least {
                continue;
            }
            let corruption = Corruption {
                occluded_share,
                sensor,
                ..Corruption::default()
            };
            let (depth, visible) = corruption.apply(&case)?;
            let visible_share = visible.n_set() as f64 / object.silhouette.n_set() as f64;
            if visible.n_set() < least || visible_share < LEAST_VISIBLE {
                continue;
            }
            seen.push(Seen {
                model: object.model,
                truth: object.camera_from_object,
                depth: Arc::new(depth),
                visible,
                visible_share,
                sensor,
                camera,
            });
        }
        Ok(seen)
    }

    /// Creates the scenes of some household objects in other proportions.
    ///
    /// # Errors
    ///
    /// If a model cannot be built.
    pub fn stretched(objects: &[Household], proportions: Proportions) -> Result<Self, SimError> {
        let named = objects
            .iter()
            .map(|object| Ok((object.name().to_owned(), object.model_with(proportions)?)));
        Ok(Self::of(named.collect::<Result<_, SimError>>()?))
    }
}

impl Seen {
    /// Returns the standard deviation of the depth noise, percent of the depth.
    pub fn noise_percent(&self) -> f64 {
        match self.sensor.noise {
            DepthNoise::Relative(RelativeGaussian { percent }) => percent,
            _ => 0.0,
        }
    }

    /// Returns the observation with a kind of mask.
    ///
    /// # Errors
    ///
    /// Never with the sizes of a scene.
    pub fn observe(&self, kind: MaskKind) -> Result<Observation, SimError> {
        let mask = kind.scaled(scale_of(&self.camera)).apply(&self.visible)?;
        Ok(Observation::new(
            Arc::clone(&self.depth),
            mask,
            self.camera,
        )?)
    }

    /// Replaces the image by a wall through the object, up to 40° from facing the camera.
    ///
    /// # Errors
    ///
    /// Never with the sizes of a scene.
    pub fn walled(&self, random: &mut SimRng) -> Result<Self, SimError> {
        let slope = (40.0 * random.random::<f64>()).to_radians().tan();
        let (sin, cos) = (TAU * random.random::<f64>()).sin_cos();
        let normal = Vector3::new(slope * cos, slope * sin, 1.0);
        let distance = normal.dot(&self.truth.translation.vector);
        let (width, height) = (self.depth.width(), self.depth.height());
        let wall = self.camera.region().pixels().map(|(u, v)| {
            let ray = self.camera.unproject(f64::from(u), f64::from(v), 1.0);
            (distance / normal.dot(&ray.coords)) as f32
        });
        let wall = DepthImage::collect(width, height, wall)?;
        let depth = self.sensor.measure(random, &wall, &self.camera)?;
        Ok(Self {
            depth: Arc::new(depth),
            visible: self.visible.clone(),
            ..*self
        })
    }

    /// Returns a start at the mean error of an estimator (6.2 mm, 9.5°), times a factor.
    pub fn near(&self, random: &mut SimRng, factor: f64) -> Isometry3<f64> {
        let (meters, degrees) = (0.0062 * factor, 9.5 * factor);
        perturb(random, &self.truth, meters, degrees.to_radians())
    }

    /// Returns a start with a random rotation, and the center of `model` at that of the object.
    ///
    /// `own` is the model of the object. `model` may be that of a wrong class.
    pub fn turned(&self, random: &mut SimRng, own: &Model, model: &Model) -> Isometry3<f64> {
        let turn = rotation(random);
        let center = self.truth * own.center();
        Isometry3::from_parts((center - turn * model.center()).into(), turn)
    }
}

/// Returns the size of the image relative to 640×480 pixels.
fn scale_of(camera: &PinholeCamera) -> f64 {
    camera.fx() / crate::camera().fx()
}

/// A sensor with independent noise, percent of the depth.
fn white(percent: f64) -> DepthSensor {
    DepthSensor {
        noise: DepthNoise::Relative(RelativeGaussian { percent }),
        ..DepthSensor::default()
    }
}
