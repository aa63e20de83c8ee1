//! Cluttered scenes: several objects on a table, observed by a depth sensor.

use hicp_core::internal::bounds;
use hicp_core::{
    DepthImage, Isometry3, Mask, Model, PinholeCamera, Point3, TriMesh, UnitQuaternion, Vector3,
};
use hicp_raster::render_depth_image;
use rand::RngExt;

use crate::SimRng;
use crate::error::{SimError, check_range};
use crate::sensor::DepthSensor;

/// Half the side of the square table, meters.
const TABLE_HALF_METERS: f64 = 0.8;
/// Growth of the placement disc after each failed try, meters. More tries give more room.
const DISC_GROWTH_METERS: f64 = 0.005;
/// Elevation of the camera above the table, seen from its center, degrees. It is low enough that
/// objects hide each other.
const ELEVATION_DEGREES: std::ops::Range<f64> = 25.0..60.0;
/// Distance of the camera relative to the distance at which all objects just fit the image.
const DISTANCE_FACTOR: std::ops::Range<f64> = 0.85..1.05;
/// The same factor at the start and at the end of a path.
const PATH_FACTOR: [f64; 2] = [1.5, 0.9];
/// Change of the azimuth along a path, degrees.
const PATH_TURN_DEGREES: f64 = 40.0;

/// An object in a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedObject {
    /// Index into the models from which the scene was drawn.
    pub model: usize,
    /// Pose of the object in the world frame, meters. World z is up, and the table's surface is z =
    /// 0.
    pub world_from_object: Isometry3<f64>,
}

/// Objects on a table that do not touch each other.
///
/// Each object stands on one of the six sides of its axis-aligned box, with a random rotation
/// around the vertical. An object may appear several times.
#[derive(Clone, Debug, PartialEq)]
pub struct Clutter {
    /// The objects in the order of placement, from the center outward.
    pub objects: Vec<PlacedObject>,
    extent: f64,
}

/// The image of a [`Clutter`] from one camera pose.
#[derive(Clone, Debug)]
pub struct ClutterView {
    /// Pose of the world in the camera frame, meters.
    pub camera_from_world: Isometry3<f64>,
    /// The measured depth, meters.
    pub depth: DepthImage,
    /// The objects in the order of the scene.
    pub instances: Vec<SeenObject>,
}

/// An object in a [`ClutterView`].
#[derive(Clone, Debug)]
pub struct SeenObject {
    /// Index into the models.
    pub model: usize,
    /// Pose of the object in the camera frame, meters.
    pub camera_from_object: Isometry3<f64>,
    /// Pixels that the object would cover if it were alone.
    pub silhouette: Mask,
    /// Pixels at which it is the nearest surface.
    pub visible: Mask,
}

impl Clutter {
    /// Draws a scene of `count` objects from `models`, with replacement.
    ///
    /// Cost: O(vertices + count² tries).
    ///
    /// # Errors
    ///
    /// [`SimError::Parameter`] if there is no model, or if `count` is not in 1 to 100.
    pub fn draw(rng: &mut SimRng, models: &[Model], count: usize) -> Result<Self, SimError> {
        check_range("number of models", models.len() as f64, 1.0..=1e6)?;
        check_range("number of objects", count as f64, 1.0..=100.0)?;
        let mut objects = Vec::with_capacity(count);
        let mut discs: Vec<(f64, f64, f64)> = Vec::with_capacity(count);
        for _ in 0..count {
            let model = rng.random_range(0..models.len());
            let rotation = resting(rng);
            let (center, radius, lowest) = footprint(models[model].mesh(), &rotation);
            let mut reach = 0.0;
            let (x, y) = loop {
                let angle = std::f64::consts::TAU * rng.random::<f64>();
                let distance = reach * rng.random::<f64>().sqrt();
                let (x, y) = (distance * angle.cos(), distance * angle.sin());
                // Terminates, because the disc outgrows all placed objects.
                if discs
                    .iter()
                    .all(|(a, b, r)| (x - a).hypot(y - b) >= r + radius)
                {
                    break (x, y);
                }
                reach += DISC_GROWTH_METERS;
            };
            discs.push((x, y, radius));
            let shift = Vector3::new(x - center.0, y - center.1, -lowest);
            objects.push(PlacedObject {
                model,
                world_from_object: Isometry3::from_parts(shift.into(), rotation),
            });
        }
        let reaches = discs.iter().map(|(x, y, r)| x.hypot(*y) + r);
        let extent = reaches.fold(0.0, f64::max);
        Ok(Self { objects, extent })
    }

    /// Observes the center of the scene from a random direction, near enough that the objects fill
    /// the image.
    ///
    /// `models` must be those from which the scene was drawn. Cost: one render per object, and the
    /// cost of the sensor.
    ///
    /// # Errors
    ///
    /// As for [`DepthSensor::measure`].
    pub fn view(
        &self,
        rng: &mut SimRng,
        models: &[Model],
        camera: &PinholeCamera,
        sensor: &DepthSensor,
    ) -> Result<ClutterView, SimError> {
        let camera_from_world = self.look(rng, camera);
        self.view_from(rng, camera_from_world, models, camera, sensor)
    }

    /// Returns camera poses along a path, as poses of the world in the camera frame, meters.
    ///
    /// The path starts in a random direction, at 1.5 times the distance at which all objects just
    /// fit. In equal steps, the camera approaches to 0.9 times that distance and moves around the
    /// scene by 40°. It always looks at the center.
    pub fn path(
        &self,
        rng: &mut SimRng,
        camera: &PinholeCamera,
        images: usize,
    ) -> Vec<Isometry3<f64>> {
        let elevation = within(rng, &ELEVATION_DEGREES).to_radians();
        let azimuth = within(rng, &(0.0..std::f64::consts::TAU));
        let steps = images.saturating_sub(1).max(1) as f64;
        let along = |image: usize| {
            let done = image as f64 / steps;
            let [far, near] = PATH_FACTOR;
            let factor = far + done * (near - far);
            let turned = azimuth + done * PATH_TURN_DEGREES.to_radians();
            self.look_from(elevation, turned, factor, camera)
        };
        (0..images).map(along).collect()
    }

    /// Observes the scene from a given pose of the world in the camera frame.
    ///
    /// Otherwise the same as [`Clutter::view`].
    ///
    /// # Errors
    ///
    /// As for [`DepthSensor::measure`].
    pub fn view_from(
        &self,
        rng: &mut SimRng,
        camera_from_world: Isometry3<f64>,
        models: &[Model],
        camera: &PinholeCamera,
        sensor: &DepthSensor,
    ) -> Result<ClutterView, SimError> {
        let objects = self.objects.iter();
        let objects = objects.map(|o| (o.model, camera_from_world * o.world_from_object));
        compose(
            rng,
            camera_from_world,
            objects,
            None,
            models,
            camera,
            sensor,
        )
    }

    fn look(&self, rng: &mut SimRng, camera: &PinholeCamera) -> Isometry3<f64> {
        let elevation = within(rng, &ELEVATION_DEGREES).to_radians();
        let azimuth = within(rng, &(0.0..std::f64::consts::TAU));
        let factor = within(rng, &DISTANCE_FACTOR);
        self.look_from(elevation, azimuth, factor, camera)
    }

    /// Returns a camera pose that looks at the center of the scene.
    ///
    /// `factor` is the distance relative to the one at which all objects just fit.
    fn look_from(
        &self,
        elevation: f64,
        azimuth: f64,
        factor: f64,
        camera: &PinholeCamera,
    ) -> Isometry3<f64> {
        // Half the width of the image at a distance of 1 m.
        let half_width = 0.5 * f64::from(camera.width()) / camera.fx();
        let distance = self.extent * (1.0 + 1.0 / half_width) * factor;
        looking_at_center(elevation, azimuth, distance)
    }
}

/// Returns the pose of the world for a camera that looks at the center of the table.
///
/// Angles are in radians and the distance in meters.
pub(crate) fn looking_at_center(elevation: f64, azimuth: f64, distance: f64) -> Isometry3<f64> {
    let toward = Vector3::new(
        elevation.cos() * azimuth.cos(),
        elevation.cos() * azimuth.sin(),
        elevation.sin(),
    );
    let eye = Point3::from(toward * distance);
    // Converts a camera that looks along -z with y up to one that looks along z with y down.
    let half_turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    half_turn * Isometry3::look_at_rh(&eye, &Point3::origin(), &Vector3::z())
}

/// Observes objects on the table, given as indices of models with poses in the camera frame.
///
/// A mesh in the camera frame can hide them; it is not one of the instances.
pub(crate) fn compose(
    rng: &mut SimRng,
    camera_from_world: Isometry3<f64>,
    objects: impl Iterator<Item = (usize, Isometry3<f64>)>,
    hiding: Option<(&TriMesh, Isometry3<f64>)>,
    models: &[Model],
    camera: &PinholeCamera,
    sensor: &DepthSensor,
) -> Result<ClutterView, SimError> {
    let table = render_depth_image(&table()?, camera, &camera_from_world);
    let mut nearest = table.pixels().to_vec();
    let mut owner = vec![usize::MAX; nearest.len()];
    let mut put = |alone: &DepthImage, index| {
        for ((z, near), owner) in alone.pixels().iter().zip(&mut nearest).zip(&mut owner) {
            if *z > 0.0 && (*near <= 0.0 || z < near) {
                (*near, *owner) = (*z, index);
            }
        }
    };
    let mut seen = Vec::new();
    for (index, (model, camera_from_object)) in objects.enumerate() {
        let alone = render_depth_image(models[model].mesh(), camera, &camera_from_object);
        put(&alone, index);
        let silhouette = Mask::measured(&alone);
        seen.push((model, camera_from_object, silhouette));
    }
    if let Some((mesh, pose)) = hiding {
        put(&render_depth_image(mesh, camera, &pose), usize::MAX);
    }
    let (width, height) = (camera.width(), camera.height());
    let instances = seen
        .into_iter()
        .enumerate()
        .map(|(index, (model, camera_from_object, silhouette))| {
            let visible = owner.iter().map(|owner| *owner == index).collect();
            Ok(SeenObject {
                model,
                camera_from_object,
                silhouette,
                visible: Mask::new(width, height, visible)?,
            })
        })
        .collect::<Result<_, SimError>>()?;
    let perfect = DepthImage::from_meters(width, height, nearest)?;
    Ok(ClutterView {
        camera_from_world,
        depth: sensor.measure(rng, &perfect, camera)?,
        instances,
    })
}

pub(crate) fn within(rng: &mut SimRng, range: &std::ops::Range<f64>) -> f64 {
    range.start + (range.end - range.start) * rng.random::<f64>()
}

/// Draws a rotation that puts one of six sides down, followed by a rotation around the vertical.
fn resting(rng: &mut SimRng) -> UnitQuaternion<f64> {
    use std::f64::consts::{FRAC_PI_2, PI, TAU};
    let (axis, angle) = match rng.random_range(0..6) {
        0 => (Vector3::x_axis(), 0.0),
        1 => (Vector3::x_axis(), PI),
        2 => (Vector3::x_axis(), FRAC_PI_2),
        3 => (Vector3::x_axis(), -FRAC_PI_2),
        4 => (Vector3::y_axis(), FRAC_PI_2),
        _ => (Vector3::y_axis(), -FRAC_PI_2),
    };
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), TAU * rng.random::<f64>());
    turn * UnitQuaternion::from_axis_angle(&axis, angle)
}

/// Returns the center and the radius of the disc below a rotated mesh, and its lowest height.
fn footprint(mesh: &TriMesh, rotation: &UnitQuaternion<f64>) -> ((f64, f64), f64, f64) {
    let turned = || mesh.vertices().iter().map(|v| rotation * v.cast::<f64>());
    let [low, high] = bounds(turned()).unwrap_or_default();
    let center = (0.5 * (low.x + high.x), 0.5 * (low.y + high.y));
    let distances = turned().map(|p| (p.x - center.0).hypot(p.y - center.1));
    (center, distances.fold(0.0, f64::max), low.z)
}

fn table() -> Result<TriMesh, SimError> {
    let half = TABLE_HALF_METERS;
    let corners = [(-half, -half), (half, -half), (half, half), (-half, half)];
    let vertices = corners.map(|(x, y)| Point3::new(x, y, 0.0).cast::<f32>());
    Ok(TriMesh::new(vertices.to_vec(), vec![[0, 1, 2], [0, 2, 3]])?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Household, stream};

    fn models() -> Vec<Model> {
        [Household::Mug, Household::Hammer, Household::Carton]
            .map(|object| object.model().unwrap())
            .to_vec()
    }

    #[test]
    fn objects_stand_on_the_table_without_touching() {
        let models = models();
        for scene in 0..5 {
            let clutter = Clutter::draw(&mut stream(3, &["scene"], scene), &models, 7).unwrap();
            assert_eq!(clutter.objects.len(), 7);
            let points: Vec<Vec<Point3<f64>>> = clutter
                .objects
                .iter()
                .map(|object| {
                    let vertices = models[object.model].mesh().vertices().iter();
                    vertices
                        .map(|v| object.world_from_object * v.cast::<f64>())
                        .collect()
                })
                .collect();
            for (index, object) in points.iter().enumerate() {
                let lowest = object.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
                assert!(lowest.abs() < 1e-9, "{lowest}");
                for other in &points[..index] {
                    let disc = |points: &[Point3<f64>]| {
                        let mut sorted: [Vec<f64>; 2] = [
                            points.iter().map(|p| p.x).collect(),
                            points.iter().map(|p| p.y).collect(),
                        ];
                        sorted.iter_mut().for_each(|c| c.sort_by(f64::total_cmp));
                        let [x, y] = sorted.map(|c| 0.5 * (c[0] + c[c.len() - 1]));
                        let reach = points.iter().map(|p| (p.x - x).hypot(p.y - y));
                        (x, y, reach.fold(0.0, f64::max))
                    };
                    let ((a, b, r), (c, d, s)) = (disc(object), disc(other));
                    assert!((a - c).hypot(b - d) > r + s - 1e-9);
                }
            }
        }
    }

    #[test]
    fn views_hide_objects_behind_each_other_and_show_the_table() {
        let models = models();
        let camera = PinholeCamera::new(300.0, 300.0, 159.5, 119.5, 320, 240).unwrap();
        let mut hidden = 0;
        for scene in 0..4 {
            let clutter = Clutter::draw(&mut stream(5, &["scene"], scene), &models, 6).unwrap();
            let look = || {
                let mut rng = stream(5, &["view"], scene);
                clutter.view(&mut rng, &models, &camera, &DepthSensor::default())
            };
            let view = look().unwrap();
            assert_eq!(view.depth, look().unwrap().depth);
            let table = camera.width() * camera.height() / 10;
            let mut of_table = 0;
            for (u, v) in camera.region().pixels() {
                let z = f64::from(view.depth.pixels()[(v * camera.width() + u) as usize]);
                let owners = view.instances.iter();
                let owners = owners.filter(|i| i.visible.get(u, v) == Some(true)).count();
                assert!(owners <= 1);
                let point = camera.unproject(f64::from(u), f64::from(v), z);
                let world = view.camera_from_world.inverse() * point;
                if owners == 0 && z > 0.0 {
                    assert!(world.z.abs() < 1e-4, "{world}");
                    of_table += 1;
                } else if owners == 1 {
                    assert!(world.z > -1e-4, "{world}");
                }
            }
            assert!(of_table > table);
            for instance in &view.instances {
                let (all, seen) = (instance.silhouette.n_set(), instance.visible.n_set());
                assert!(all > 50 && seen <= all, "{seen} of {all}");
                hidden += usize::from(seen < all);
            }
        }
        assert!(hidden > 4, "{hidden}");
    }

    #[test]
    fn a_path_approaches_in_equal_steps() {
        let models = models();
        let camera = PinholeCamera::new(300.0, 300.0, 159.5, 119.5, 320, 240).unwrap();
        let clutter = Clutter::draw(&mut stream(5, &["scene"], 1), &models, 4).unwrap();
        let path = clutter.path(&mut stream(5, &["path"], 1), &camera, 9);
        assert_eq!(path.len(), 9);
        // The center is in front of every camera, at decreasing distances.
        let ranges: Vec<f64> = path.iter().map(|pose| pose.translation.z).collect();
        assert!(ranges.is_sorted_by(|a, b| a > b), "{ranges:?}");
        assert!((ranges[8] / ranges[0] - 0.6).abs() < 1e-9, "{ranges:?}");
        for pose in &path {
            let aside = pose.translation.x.hypot(pose.translation.y);
            assert!(aside < 1e-9, "{aside}");
        }
        let turns: Vec<f64> = path
            .windows(2)
            .map(|two| (two[1] * two[0].inverse()).rotation.angle())
            .collect();
        assert!(
            turns
                .iter()
                .all(|turn| (turn - turns[0]).abs() < 1e-9 && *turn > 0.02)
        );
        let measured = |pose: Isometry3<f64>| {
            let mut rng = stream(5, &["sensor"], 1);
            let view = clutter.view_from(&mut rng, pose, &models, &camera, &DepthSensor::default());
            let view = view.unwrap();
            view.instances
                .iter()
                .map(|object| object.camera_from_object)
                .collect::<Vec<_>>()
        };
        for (there, object) in measured(path[8]).iter().zip(&clutter.objects) {
            assert_eq!(*there, path[8] * object.world_from_object);
        }
        assert!(
            clutter
                .path(&mut stream(5, &["path"], 1), &camera, 0)
                .is_empty()
        );
        assert_eq!(
            clutter.path(&mut stream(5, &["path"], 1), &camera, 1).len(),
            1
        );
    }

    #[test]
    fn a_scene_without_models_or_objects_is_refused() {
        let mut rng = stream(1, &[], 0);
        assert!(Clutter::draw(&mut rng, &[], 3).is_err());
        assert!(Clutter::draw(&mut rng, &models(), 0).is_err());
    }
}
