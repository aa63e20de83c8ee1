//! Objects on a table, seen by a depth camera, and pictures of what it sees.

use std::error::Error;

use hicp_sim::{Household, RelativeGaussian, rng};
use hybrid_icp::Refiner;
use hybrid_icp::core::{
    DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Point3, TriMesh,
    UnitQuaternion, Vector3,
};
use hybrid_icp::raster::render_depth_image;

use crate::svg::{Place, Svg};
use hicp_picture::contours;

/// An object and its pose.
pub(crate) struct Placed {
    pub(crate) model: Model,
    pub(crate) camera_from_object: Isometry3<f64>,
}

/// A depth image of objects.
pub(crate) struct Scene {
    pub(crate) camera: PinholeCamera,
    pub(crate) depth: DepthImage,
    pub(crate) objects: Vec<Placed>,
    /// The object at every pixel.
    owners: Vec<Option<usize>>,
}

/// A part of the image: left, top, width and height, pixels.
pub(crate) type Crop = (u32, u32, u32, u32);

impl Scene {
    /// Puts objects on a table, each at (x, y) in meters and rotated around the vertical by
    /// degrees. The camera of 640 × 480 pixels looks at the origin from `distance` meters, 35°
    /// above the table.
    pub(crate) fn on_a_table(
        distance: f64,
        objects: &[(Household, f64, f64, f64)],
    ) -> Result<Self, Box<dyn Error>> {
        let (sin, cos) = 35_f64.to_radians().sin_cos();
        let eye = Point3::new(0.0, -distance * cos, distance * sin);
        // From a frame that looks along -z with y up to one that looks along z with y down.
        let half_turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let target = Point3::new(0.0, 0.0, 0.04);
        let camera_from_world = half_turn * Isometry3::look_at_rh(&eye, &target, &Vector3::z());
        let placed = objects.iter().map(|(object, x, y, degrees)| {
            let model = object.model()?;
            let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), degrees.to_radians());
            let heights = model.mesh().vertices().iter().map(|p| f64::from(p.z));
            let lowest = heights.fold(f64::INFINITY, f64::min);
            let shift = Vector3::new(*x, *y, -lowest);
            Ok(Placed {
                model,
                camera_from_object: camera_from_world * Isometry3::from_parts(shift.into(), yaw),
            })
        });
        let objects = placed.collect::<Result<Vec<_>, Box<dyn Error>>>()?;
        let corner = |x, y| Point3::new(x, y, 0.0);
        let corners = [(-0.6, -0.6), (0.6, -0.6), (0.6, 0.6), (-0.6, 0.6)];
        let corners = corners.map(|(x, y)| corner(x, y)).to_vec();
        let table = TriMesh::new(corners, vec![[0, 1, 2], [0, 2, 3]])?;
        let camera = PinholeCamera::new(572.4, 573.6, 325.3, 242.0, 640, 480)?;
        let mut nearest = render_depth_image(&table, &camera, &camera_from_world)
            .pixels()
            .to_vec();
        let mut owners = vec![None; nearest.len()];
        for (index, object) in objects.iter().enumerate() {
            let alone =
                render_depth_image(object.model.mesh(), &camera, &object.camera_from_object);
            for ((z, near), owner) in alone.pixels().iter().zip(&mut nearest).zip(&mut owners) {
                if *z > 0.0 && (*near <= 0.0 || z < near) {
                    (*near, *owner) = (*z, Some(index));
                }
            }
        }
        let clean = DepthImage::from_meters(640, 480, nearest)?;
        Ok(Self {
            camera,
            depth: RelativeGaussian { percent: 0.15 }.apply(&mut rng(1), &clean),
            objects,
            owners,
        })
    }

    /// Shows one object without a table, and without noise.
    pub(crate) fn alone(camera: PinholeCamera, object: Placed) -> Self {
        let depth = render_depth_image(object.model.mesh(), &camera, &object.camera_from_object);
        let owner = |z: &f32| (*z > 0.0).then_some(0);
        Self {
            camera,
            owners: depth.pixels().iter().map(owner).collect(),
            depth,
            objects: vec![object],
        }
    }

    /// Observes an object through the mask of its visible pixels.
    pub(crate) fn observe(&self, index: usize) -> Result<Observation, Box<dyn Error>> {
        self.observe_where(|pixel| self.owners[pixel] == Some(index))
    }

    /// Observes through the mask of the pixels for which `on_object` holds.
    pub(crate) fn observe_where(
        &self,
        on_object: impl Fn(usize) -> bool,
    ) -> Result<Observation, Box<dyn Error>> {
        let masked = (0..self.owners.len()).map(on_object).collect();
        let mask = Mask::new(self.camera.width(), self.camera.height(), masked)?;
        Ok(Observation::new(self.depth.clone(), mask, self.camera)?)
    }

    /// Opens a panel that shows a part of the shaded depth image. Shapes that are added until
    /// [`close`] are in pixels of the image.
    pub(crate) fn panel(
        &self,
        svg: &mut Svg,
        (x, y): Place,
        width: f64,
        crop: Crop,
    ) -> Result<(), Box<dyn Error>> {
        let (left, top, columns, rows) = crop;
        let full = self.observe_where(|_| true)?;
        let mut gray = vec![250; columns as usize * rows as usize];
        for (index, surfel) in full.surfels(1) {
            let (u, v) = full.pixel(index);
            if (left..left + columns).contains(&u) && (top..top + rows).contains(&v) {
                let facing = surfel.normal.dot(&surfel.point.coords.normalize()).abs();
                let light = surfel.normal.dot(&Vector3::new(-0.5, -0.7, -0.5)).max(0.0);
                let tone = 70.0 + 75.0 * facing + 75.0 * light;
                // Few tones make small files.
                let pixel = (v - top) as usize * columns as usize + (u - left) as usize;
                gray[pixel] = (tone / 6.0).round() as u8 * 6;
            }
        }
        let height = width * f64::from(rows) / f64::from(columns);
        let (u, v) = (f64::from(left) - 0.5, f64::from(top) - 0.5);
        svg.add(&format!(
            r#"<svg x="{x}" y="{y}" width="{width}" height="{height:.1}" viewBox="{u} {v} {columns} {rows}">"#
        ));
        let size = (f64::from(columns), f64::from(rows));
        svg.image((u, v), size, (columns, rows), &gray)?;
        Ok(())
    }
}

/// Closes a panel.
pub(crate) fn close(svg: &mut Svg) {
    svg.add("</svg>");
}

/// Draws the outline of a model at a pose, smoothed, in pixels of the image.
pub(crate) fn outline(svg: &mut Svg, scene: &Scene, object: &Placed, color: &str) {
    let mut refiner = Refiner::preset(hybrid_icp::Preset::Local);
    let workspace = refiner.workspace_mut();
    let view = workspace.view(&object.model, &scene.camera, &object.camera_from_object);
    for path in contours(view).iter().filter(|path| path.len() > 12) {
        let middles: Vec<Place> = path
            .iter()
            .map(|side| {
                let (u, v) = side.inside;
                let (a, b) = side.outside;
                (
                    f64::midpoint(f64::from(u), a as f64),
                    f64::midpoint(f64::from(v), b as f64),
                )
            })
            .collect();
        let n = middles.len();
        let smooth = (0..=n).step_by(2).map(|place| {
            let around = (0..7).map(|k| middles[(place + n + k - 3) % n]);
            let (u, v) = around.fold((0.0, 0.0), |(u, v), p| (u + p.0 / 7.0, v + p.1 / 7.0));
            (u, v)
        });
        let mut smooth: Vec<Place> = smooth.collect();
        smooth.extend(smooth.first().copied());
        let ink = r#"fill="none" stroke-linejoin="round" stroke"#;
        svg.path(
            &smooth,
            &format!(r#"{ink}="white" stroke-width="3.4" stroke-opacity="0.75""#),
        );
        svg.path(&smooth, &format!(r#"{ink}="{color}" stroke-width="1.9""#));
    }
}
