//! Checks of inputs and results, each of which is well-formed by itself.

use std::f64::consts::{FRAC_PI_4, PI};
use std::sync::Arc;

use hicp_core::internal::{bounds, median};
use hicp_core::{Isometry3, Model, Observation, PinholeCamera, diameter, se3};
use hicp_icp::Alternative;
use hicp_score::Flatness;
use hicp_switch::PAPER_ALPHA;

use crate::warning::{CenterFault, Warning};

/// Diameters that a depth camera can see. A coin in meters or a car in millimeters is outside.
const PLAUSIBLE_DIAMETERS_METERS: std::ops::RangeInclusive<f64> = 0.002..=10.0;

/// Share of the diameter that rounding the coordinates may cost.
const COARSE: f64 = 1e-3;
/// Largest distance by which a symmetry may move the center, diameters.
const MOVED: f64 = 0.5;

/// Largest factor between the measured depth and that of the initial pose.
const DEPTH_RATIO: f64 = 3.0;

/// Largest number of pixels of the mask, as a multiple of what the model can cover.
const MASK_RATIO: f64 = 10.0;

/// Largest number of pixels of the smallest side of the model's box, as a multiple of the mask's.
///
/// Up to 95 % of the object may be occluded. A unit that is wrong by a factor of 10 gives 100 times
/// as many pixels.
const SLIVER_RATIO: f64 = 20.0;

/// Least rise of the MVE from which a refinement made the pose worse ([`Warning::Worse`]).
///
/// The MVE of three of 71 real poses rose by less, and none of them was worse by 0.1 mm (ADI).
const WORSE: f64 = 0.01;

/// MVE at and above which an initial pose explains nothing of the mask
/// ([`Warning::FoundElsewhere`]).
///
/// Of 71 poses that four estimators gave for the right object, one is above it. All poses that were
/// found in the mask of another object are above it (`docs/robustness.md`).
pub const EXPLAINS_NOTHING: f64 = 0.9;

/// The recommended least confidence of an accepted pose. `docs/book/trust.md` states how many of
/// such poses are wrong.
pub const ACCEPTED: f64 = 0.95;

/// Share of the mesh's diameter by which a stated one may differ. BOP states the diameters of other
/// versions of the mesh, with more vertices.
const DIAMETER_TOLERANCE: f64 = 0.05;

/// Sizes of images, relative to this one, to which its intrinsics may belong.
const SIZES: [f64; 8] = [0.25, 1.0 / 3.0, 0.5, 2.0 / 3.0, 1.5, 2.0, 3.0, 4.0];
/// Largest distance of a principal point from the middle of that image, in halves of the width.
const CENTERED: f64 = 0.06;
/// Length of a mask, in diameters, that no object has, also if the mask has errors.
const TOO_LONG: f64 = 1.15;
/// Length from which on a mask shows more than the object, so that its length says nothing.
const NOT_OF_OBJECT: f64 = 1.3;
/// Largest logarithm of the ratio of the sides of a pixel.
const SQUARE: f64 = 0.1;
/// Largest angle between the optical axis and a pixel. The corners of the widest depth cameras are
/// at 68°.
const FARTHEST_DEGREES: f64 = 70.0;

/// Returns warnings about the inputs of a refinement; `init` is camera from object, meters.
///
/// A warning refuses nothing. Cost: O(pixels of the mask's box + vertices).
///
/// ```
/// use hybrid_icp::core::{
///     DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Point3, TriMesh,
/// };
/// use hybrid_icp::{Warning, warnings};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let corners = [[0., 0., 0.], [0.1, 0., 0.], [0., 0.1, 0.]].map(Point3::from);
/// let model = Model::new(TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?);
/// // The wall is 0.8 m away, but the depth was read at a tenth of its scale.
/// let depth = DepthImage::from_meters(64, 48, vec![0.08; 64 * 48])?;
/// let camera = PinholeCamera::new(60.0, 60.0, 31.5, 23.5, 64, 48)?;
/// let observation = Observation::new(depth, Mask::full(64, 48), camera)?;
/// let warnings = warnings(&model, &observation, &Isometry3::translation(0.0, 0.0, 0.8));
/// assert!(matches!(warnings[0], Warning::Depth { .. }));
/// # Ok(()) }
/// ```
#[must_use]
pub fn warnings(model: &Model, observation: &Observation, init: &Isometry3<f64>) -> Vec<Warning> {
    let rigid = se3::is_finite(init) && (init.rotation.norm() - 1.0).abs() < 1e-6;
    let distance = if rigid {
        (init * model.center()).z
    } else {
        f64::NAN
    };
    let mut warnings = warnings_of_model(model);
    let mut of_image = warnings_of_image(model, observation, distance);
    if !warnings.is_empty() {
        // One warning about the same numbers is enough.
        let size = |w: &Warning| matches!(w, Warning::Mask { .. } | Warning::Sliver { .. });
        of_image.retain(|warning| !size(warning));
    }
    warnings.append(&mut of_image);
    warnings
}

/// Returns the [`warnings`] that depend on an image.
///
/// `distance` is z of the object's center in the camera frame, meters. Cost: O(pixels of the mask's
/// box) for the first time, then O(1), and O(vertices) if the mask is small for the object.
#[must_use]
pub fn warnings_of_image(model: &Model, observation: &Observation, distance: f64) -> Vec<Warning> {
    let camera = observation.camera();
    let Inside {
        pixels,
        median_depth,
    } = *Inside::of(observation);
    let is_crop = |warning: &Warning| match (warning, median_depth) {
        (Warning::Center { fault, .. }, Some(depth)) => {
            was_cropped(model, observation, depth, *fault)
        }
        _ => false,
    };
    let center = warning_of_center(camera).filter(|warning| !is_crop(warning));
    let mut warnings = Vec::from_iter(center);
    let no_depth = median_depth.is_none() && pixels > 0;
    warnings.extend(no_depth.then_some(Warning::NoDepth));
    warnings.extend(warning_of_distance(distance, median_depth));
    if !warnings.is_empty() || pixels == 0 {
        return warnings;
    }
    let diameter = model.diameter();
    // The pixels of a square meter at the distance.
    let density = camera.fx() * camera.fy() / distance.powi(2);
    // No silhouette of that diameter is larger than a disc.
    let at_most = FRAC_PI_4 * density * diameter.powi(2);
    if pixels as f64 > MASK_RATIO * at_most.max(1.0) {
        warnings.push(Warning::Mask {
            pixels,
            at_most,
            diameter,
            distance,
        });
    }
    let too_many = SLIVER_RATIO * pixels as f64;
    let widest = 2.0 * model.radius();
    if density * widest.powi(2) > too_many && !touches_border(observation) {
        let at_least = density * smallest_side(model);
        if at_least > too_many {
            warnings.push(Warning::Sliver {
                pixels,
                at_least,
                diameter,
                distance,
            });
        }
    }
    warnings
}

/// Checks the distance of the object at the initial pose against the depth inside the mask.
///
/// `distance` is z of the object's center in the camera frame, `median_depth` the median depth
/// inside the mask, both in meters. Returns [`Warning::BehindCamera`] or [`Warning::Depth`].
///
/// ```
/// use hybrid_icp::{Warning, checks::warning_of_distance};
/// assert_eq!(warning_of_distance(0.5, Some(0.6)), None);
/// assert!(matches!(warning_of_distance(-0.5, None), Some(Warning::BehindCamera { .. })));
/// assert!(matches!(warning_of_distance(5.0, Some(0.6)), Some(Warning::Depth { .. })));
/// ```
#[must_use]
pub fn warning_of_distance(distance: f64, median_depth: Option<f64>) -> Option<Warning> {
    if distance.is_nan() || distance <= 0.0 {
        return Some(Warning::BehindCamera { z: distance });
    }
    let plausible = distance / DEPTH_RATIO..=distance * DEPTH_RATIO;
    let measured = median_depth.filter(|measured| !plausible.contains(measured))?;
    Some(Warning::Depth {
        measured,
        expected: distance,
    })
}

/// Returns the [`warnings`] about a model that need no image.
///
/// ```
/// use hybrid_icp::core::{Model, Point3, TriMesh};
/// use hybrid_icp::{Warning, checks::warnings_of_model};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // A mesh of 80 mm that was read as meters.
/// let corners = [[0., 0., 0.], [80., 0., 0.], [0., 80., 0.]].map(Point3::from);
/// let model = Model::new(TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?);
/// assert!(matches!(warnings_of_model(&model)[..], [Warning::Diameter { .. }]));
/// # Ok(()) }
/// ```
#[must_use]
pub fn warnings_of_model(model: &Model) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let diameter = model.diameter();
    if !PLAUSIBLE_DIAMETERS_METERS.contains(&diameter) {
        warnings.push(Warning::Diameter { diameter });
    }
    if !model.has_possible_diameter() {
        warnings.extend(warning_of_diameter(model));
    }
    warnings.extend(warning_of_symmetries(model));
    let step = model.mesh().coordinate_step();
    if step > COARSE * diameter {
        warnings.push(Warning::CoarseCoordinates { step, diameter });
    }
    warnings
}

/// Returns [`Warning::Symmetry`] if a declared symmetry moves the center by more than half of the
/// diameter.
///
/// ```
/// use hybrid_icp::core::{Model, ModelConfig, Point3, Symmetries, SymmetryAxis, TriMesh, Vector3};
/// use hybrid_icp::{Warning, checks::warning_of_symmetries};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let corners = [[0., 0., 0.], [0.1, 0., 0.], [0., 0.1, 0.]].map(Point3::from);
/// let mesh = TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?;
/// // An offset of 50 mm that was read as meters.
/// let axis = SymmetryAxis::new(Vector3::z(), Point3::new(50.0, 50.0, 0.0))?;
/// let symmetries = Symmetries { continuous: vec![axis], ..Symmetries::default() };
/// let model = Model::with_config(mesh, ModelConfig { symmetries, ..ModelConfig::default() });
/// assert!(matches!(warning_of_symmetries(&model), Some(Warning::Symmetry { .. })));
/// # Ok(()) }
/// ```
#[must_use]
pub fn warning_of_symmetries(model: &Model) -> Option<Warning> {
    let (center, diameter) = (model.center(), model.diameter());
    let symmetries = model.symmetries();
    let half_turns = symmetries.continuous.iter().map(|axis| axis.rotation(PI));
    let motions = symmetries.discrete.iter().copied().chain(half_turns);
    let distances = motions.map(|motion| (motion * center - center).norm());
    let distance = distances.fold(0.0, f64::max);
    (distance > MOVED * diameter).then_some(Warning::Symmetry { distance, diameter })
}

/// Returns [`Warning::StatedDiameter`] if a model's stated diameter differs by more than 5 % from
/// that of its mesh.
///
/// The stated diameter is [`ModelConfig::diameter`](hicp_core::ModelConfig::diameter). A dataset's
/// file can be wrong or belong to other models; all lengths in diameters are then wrong. It costs
/// about O(n log n) of the vertices, so call it once per model. [`warnings_of_model`] includes only
/// the diameters that no mesh of that radius has.
///
/// ```
/// use hybrid_icp::core::{Model, ModelConfig, Point3, TriMesh};
/// use hybrid_icp::{Warning, checks::warning_of_diameter};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let corners = [[0., 0., 0.], [0.1, 0., 0.], [0., 0.1, 0.]].map(Point3::from);
/// let mesh = TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?;
/// assert_eq!(warning_of_diameter(&Model::new(mesh.clone())), None);
/// let config = ModelConfig { diameter: Some(1.4), ..ModelConfig::default() };
/// let warning = warning_of_diameter(&Model::with_config(mesh, config));
/// assert!(matches!(warning, Some(Warning::StatedDiameter { .. })));
/// # Ok(()) }
/// ```
#[must_use]
pub fn warning_of_diameter(model: &Model) -> Option<Warning> {
    let vertices: Vec<_> = model.mesh().used_points().collect();
    let (stated, measured) = (model.diameter(), diameter(&vertices));
    let differ = (stated - measured).abs() > DIAMETER_TOLERANCE * measured;
    differ.then_some(Warning::StatedDiameter { stated, measured })
}

/// Returns warnings about the result of a refinement.
///
/// The arguments are [`Refinement::mve_initial`](crate::Refinement::mve_initial),
/// [`Refinement::mve`](crate::Refinement::mve),
/// [`Refinement::confidence`](crate::Refinement::confidence) and
/// [`Refinement::flatness`](crate::Refinement::flatness).
///
/// A high MVE alone is no reason for a warning, because imperfect masks raise it. Without a warning
/// the pose can still be wrong: an object that looks nearly the same from two sides explains the
/// image in both orientations.
///
/// ```
/// use hybrid_icp::{Warning, checks::warnings_of_result, score::Flatness};
/// // A rough pose that became a good one.
/// let at = |residual| Some(Flatness::new(residual, 0.0025, 0.009, 0.2));
/// assert_eq!(warnings_of_result(0.6, 0.1, 0.97, at(0.002)), []);
/// // Something was found in the mask, but nothing that the detector had seen there.
/// let found = warnings_of_result(0.95, 0.2, 0.7, None);
/// assert!(matches!(found[..], [Warning::FoundElsewhere { .. }]));
/// // Nothing was found.
/// assert!(matches!(warnings_of_result(0.95, 0.7, 0.01, None)[..], [Warning::Unexplained { .. }]));
/// // It got worse, but not bad. Less is no news.
/// assert_eq!(warnings_of_result(0.1, 0.105, 0.8, None), []);
/// assert!(matches!(warnings_of_result(0.1, 0.2, 0.8, None)[..], [Warning::Worse { .. }]));
/// // The object was found on a wall.
/// assert!(matches!(warnings_of_result(0.6, 0.1, 0.8, at(0.008))[..], [Warning::Flat { .. }]));
/// ```
#[must_use]
pub fn warnings_of_result(
    mve_initial: f64,
    mve: f64,
    confidence: f64,
    flatness: Option<Flatness>,
) -> Vec<Warning> {
    let mut warnings = Vec::new();
    if mve > mve_initial + WORSE {
        warnings.push(Warning::Worse { mve_initial, mve });
    }
    if mve >= PAPER_ALPHA && confidence < ACCEPTED {
        warnings.push(Warning::Unexplained { mve });
        return warnings;
    }
    if confidence < 0.5 {
        warnings.push(Warning::Doubtful { confidence });
    }
    if mve_initial >= EXPLAINS_NOTHING && confidence < ACCEPTED {
        warnings.push(Warning::FoundElsewhere { mve_initial, mve });
    }
    if let Some(flatness) = flatness.filter(Flatness::is_flat) {
        warnings.push(Warning::Flat { flatness });
    }
    warnings
}

/// Returns the warning about another pose that explains the image as well as the returned one.
///
/// There is none if the other pose is worse by [`Alternative::AMBIGUOUS_GAP`] or more.
#[must_use]
pub fn warning_of_runner_up(runner_up: &Alternative) -> Option<Warning> {
    runner_up.is_ambiguous().then_some(Warning::Ambiguous {
        gap: runner_up.gap,
        rotation_degrees: runner_up.rotation_degrees,
    })
}

/// Returns the area of the smallest side of the model's box along its axes, m²: 0 for a sheet.
fn smallest_side(model: &Model) -> f64 {
    let [low, high] = bounds(model.mesh().used_points()).unwrap_or_default();
    let mut sides: [f64; 3] = (high.cast::<f64>() - low.cast::<f64>()).into();
    sides.sort_by(f64::total_cmp);
    sides[0] * sides[1]
}

/// Returns [`Warning::Center`] if the intrinsics are hardly those of the image.
///
/// The principal point of a cropped image may be anywhere, also outside. If a crop looks like a
/// resized image, the mask decides ([`was_cropped`]).
fn warning_of_center(camera: &PinholeCamera) -> Option<Warning> {
    let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
    let (u, v) = (0.5 * width, 0.5 * height);
    let [fx, fy, cx, cy] = [camera.fx(), camera.fy(), camera.cx(), camera.cy()];
    let off = |x: f64, y: f64| (x - u).abs() + (y - v).abs();
    let resized = |factor: &f64| off(cx / factor, cy / factor) < CENTERED * u;
    // Pixels are about square, but the halves of an image's sides are not.
    let square = |x: f64, y: f64| (x / y).ln().abs() < SQUARE;
    let exchanged = off(fx, fy) < 0.2 * u && square(cx, cy);
    let corner = (cx.max(width - cx) / fx).hypot(cy.max(height - cy) / fy);
    let degrees = corner.atan().to_degrees();
    let fault = if off(cx, cy) <= 0.2 * u {
        (degrees > FARTHEST_DEGREES).then_some(CenterFault::Far { degrees })
    } else if off(cy, cx) < 0.25 * off(cx, cy) {
        Some(CenterFault::Swapped)
    } else if exchanged && (!square(fx, fy) || cx > width || cy > height) {
        Some(CenterFault::Exchanged)
    } else if let Some(factor) = SIZES.into_iter().find(resized) {
        Some(CenterFault::Resized { factor })
    } else {
        (degrees > FARTHEST_DEGREES).then_some(CenterFault::Far { degrees })
    };
    fault.map(|fault| Warning::Center { cx, cy, fault })
}

/// Returns whether a box has pixels of an image, as [`Mask::in_box`](hicp_core::Mask::in_box)
/// rounds it.
///
/// The box is x and y of its corner, width and height; the size of the image is width and height,
/// in pixels. A box of less than a pixel has none.
///
/// ```
/// use hybrid_icp::checks::box_overlaps;
/// assert!(box_overlaps([-20.0, 470.0, 30.0, 30.0], (640, 480)));
/// assert!(!box_overlaps([640.0, 10.0, 30.0, 30.0], (640, 480)));
/// ```
#[must_use]
pub fn box_overlaps([x, y, w, h]: [f64; 4], (width, height): (u32, u32)) -> bool {
    let overlaps = |start: f64, length: f64, side: u32| {
        length >= 1.0 && start.round() < f64::from(side) && (start + length).round() > 0.0
    };
    overlaps(x, w, width) && overlaps(y, h, height)
}

/// Returns [`Warning::Box`] if a box ends outside of an image, as one of two corners often does, or
/// within its first pixel, as one in shares of the image does.
///
/// The box is x and y of its corner, width and height, as for
/// [`Mask::in_box`](hicp_core::Mask::in_box); the size of the image is width and height, in
/// pixels. A tenth of the box may be outside.
///
/// ```
/// use hybrid_icp::{Warning, checks::warning_of_box};
/// assert_eq!(warning_of_box([300.0, 200.0, 90.0, 80.0], (640, 480)), None);
/// let corners = warning_of_box([300.0, 200.0, 390.0, 280.0], (640, 480));
/// assert!(matches!(corners, Some(Warning::Box { .. })));
/// assert!(warning_of_box([0.4, 0.3, 0.1, 0.2], (640, 480)).is_some());
/// ```
#[must_use]
pub fn warning_of_box([x, y, w, h]: [f64; 4], (width, height): (u32, u32)) -> Option<Warning> {
    let (right, bottom) = (x + w, y + h);
    let is_outside = right > f64::from(width) + 0.1 * w || bottom > f64::from(height) + 0.1 * h;
    let is_tiny = right <= 1.0 && bottom <= 1.0;
    (is_outside || is_tiny).then_some(Warning::Box {
        right,
        bottom,
        width,
        height,
    })
}

/// Returns whether an image that seems to be resized was cropped, by the length of its mask.
///
/// With the focal length of a resized image, the mask would be longer than the model at that depth.
fn was_cropped(model: &Model, observation: &Observation, depth: f64, fault: CenterFault) -> bool {
    let CenterFault::Resized { factor } = fault else {
        return false;
    };
    let (camera, region) = (observation.camera(), observation.region());
    let across = region.width() as f64 / camera.fx();
    let down = region.height() as f64 / camera.fy();
    let length = across.max(down) * depth / model.diameter();
    factor * length > TOO_LONG && length < NOT_OF_OBJECT && !touches_border(observation)
}

/// Returns whether the mask may continue beyond the image.
fn touches_border(observation: &Observation) -> bool {
    let (camera, region) = (observation.camera(), observation.region());
    region.u_min == 0
        || region.v_min == 0
        || region.u_max == camera.width()
        || region.v_max == camera.height()
}

/// Returns the median of the depths measured inside the mask, meters.
///
/// Returns `None` if nothing was measured there. Cost: O(pixels of the mask's box), once per
/// observation.
#[must_use]
pub fn median_depth(observation: &Observation) -> Option<f64> {
    Inside::of(observation).median_depth
}

/// The pixels inside the mask of an observation.
struct Inside {
    /// Number of pixels.
    pixels: usize,
    /// Median of the measured depths, meters.
    median_depth: Option<f64>,
}

impl Inside {
    fn of(observation: &Observation) -> Arc<Self> {
        let (depth, mask) = (observation.depth(), observation.mask());
        observation.derived().get_or_build(0, || {
            let masked = observation.region().pixels();
            let masked = masked.filter(|(u, v)| mask.get(*u, *v) == Some(true));
            let depths: Vec<f32> = masked.filter_map(|(u, v)| depth.get(u, v)).collect();
            let mut measured = Vec::from_iter(depths.iter().copied().filter(|z| *z > 0.0));
            Self {
                pixels: depths.len(),
                median_depth: median(&mut measured, f32::total_cmp).map(f64::from),
            }
        })
    }
}
