//! The surfaces around a place that may be a lost object.

use hicp_core::internal::median;
use hicp_core::{DepthImage, Mask, PinholeCamera, PixelRegion, Point3};

/// Number of cells across an object.
const CELLS: f64 = 24.0;
/// Step in depth between neighboring cells that separates two surfaces, in diameters.
const JUMP_DIAMETERS: f64 = 0.1;
/// Smallest such step, in standard deviations of the noise of the two cells.
const JUMP_DEVIATIONS: f64 = 2.0;
/// Distance of a pixel from the depth of its cell, in standard deviations of its noise.
const PIXEL_DEVIATIONS: f64 = 2.5;
/// Largest distance of a surface from its mean, in diameters.
const EXTENT_DIAMETERS: f64 = 0.75;
/// Smallest area of a surface, in squared diameters.
const LEAST_AREA: f64 = 0.01;
/// Distance between two surfaces that may be parts of one object, in diameters.
const PART_DIAMETERS: f64 = 0.6;

/// A place in the camera frame, and a distance from it, meters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sphere {
    pub(super) center: Point3<f64>,
    pub(super) radius: f64,
}

/// A connected surface of about the size of the object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    /// Its number in [`Segments`].
    pub(super) label: u32,
    /// Mean of its points, camera frame, meters.
    pub(super) mean: Point3<f64>,
    /// Area across the line of sight, square meters.
    pub(super) area: f64,
}

/// The surfaces inside a sphere that an object may have.
///
/// A surface ends at steps in depth. An object may have several surfaces, such as a mug and its
/// handle.
pub(super) struct Segments {
    cells: Cells,
    /// The number of the surface of each cell.
    labels: Vec<u32>,
    camera: PinholeCamera,
    /// Diameter of the object, meters.
    diameter: f64,
    /// The surfaces, the most probable first.
    pub(super) found: Vec<Segment>,
}

impl Segments {
    /// Separates the surfaces, and keeps those that are not larger than an object of a diameter
    /// (meters) and a surface area (square meters).
    ///
    /// Those near the center of the sphere, and of about the area that an object shows, come first.
    /// `within` restricts the pixels. Cost: O(pixels of the sphere).
    pub(super) fn new(
        depth: &DepthImage,
        camera: &PinholeCamera,
        sphere: &Sphere,
        (diameter, surface): (f64, f64),
        within: Option<&Mask>,
    ) -> Self {
        let cells = Cells::new(depth, camera, sphere, diameter, within);
        let mut labels = vec![0_u32; cells.depth.len()];
        let mut found = Vec::new();
        let mut queue = Vec::new();
        let mut label = 0;
        for start in 0..labels.len() {
            if labels[start] != 0 || cells.depth[start] <= 0.0 {
                continue;
            }
            label += 1;
            labels[start] = label;
            queue.clear();
            queue.push(start);
            let mut next = 0;
            while let Some(&cell) = queue.get(next) {
                next += 1;
                for other in cells.neighbors(cell) {
                    let step = (cells.depth[other] - cells.depth[cell]).abs();
                    let jump = cells.jump.max(cells.cell_noise * cells.depth[cell]);
                    if labels[other] == 0 && cells.depth[other] > 0.0 && step < jump {
                        labels[other] = label;
                        queue.push(other);
                    }
                }
            }
            if let Some((mean, area)) = cells.fits(&queue, camera, diameter)
                && area <= surface
            {
                found.push(Segment { label, mean, area });
            }
        }
        // The distance in deviations of the prediction, and the area as a factor. A convex object
        // shows a fourth of its surface on average.
        let cost = |segment: &Segment| {
            let away = 3.0 * (segment.mean - sphere.center).norm() / sphere.radius;
            let area = (4.0 * segment.area / surface).ln();
            away * away + area * area
        };
        found.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        Self {
            cells,
            labels,
            camera: *camera,
            diameter,
            found,
        }
    }

    /// Returns whether two surfaces may be parts of one object.
    pub(super) fn are_parts(&self, a: &Segment, b: &Segment) -> bool {
        (a.mean - b.mean).norm() <= PART_DIAMETERS * self.diameter
    }

    /// Returns the pixels of a surface, and of those that may be parts of the same object.
    pub(super) fn mask(&self, segment: &Segment, depth: &DepthImage) -> Mask {
        let parts = self.found.iter().filter(|s| self.are_parts(s, segment));
        let labels: Vec<u32> = parts.map(|part| part.label).collect();
        let sphere = Sphere {
            center: segment.mean,
            radius: (PART_DIAMETERS + EXTENT_DIAMETERS) * self.diameter,
        };
        let cells = &self.cells;
        let region = around(&self.camera, &sphere).intersection(&cells.region);
        Mask::in_region(depth.width(), depth.height(), &region, |u, v| {
            let cell = cells.place(u, v);
            let z = depth.get(u, v).unwrap_or(0.0);
            let same = labels.contains(&self.labels[cell]);
            let jump = cells.jump.max(cells.pixel_noise * z);
            same && z > 0.0 && (z - cells.depth[cell]).abs() < jump
        })
    }
}

/// The median depths of square cells.
struct Cells {
    region: PixelRegion,
    side: usize,
    columns: usize,
    /// Median depth, meters; 0 outside of the sphere and without depth.
    depth: Vec<f32>,
    /// Step in depth between two surfaces, meters.
    jump: f32,
    /// Largest step that is only noise between neighboring cells, per depth.
    cell_noise: f32,
    /// Largest distance by noise of a pixel from its cell, per depth.
    pixel_noise: f32,
}

impl Cells {
    fn new(
        depth: &DepthImage,
        camera: &PinholeCamera,
        sphere: &Sphere,
        diameter: f64,
        within: Option<&Mask>,
    ) -> Self {
        let region = around(camera, sphere);
        let across = camera.fx() * diameter / sphere.center.z.max(diameter);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // Clamped.
        let side = (across / CELLS).clamp(1.0, 16.0) as usize;
        let columns = region.width().div_ceil(side);
        let rows = region.height().div_ceil(side);
        let mut medians = Vec::with_capacity(columns * rows);
        let mut measured = Vec::with_capacity(side * side);
        let mut deviations = Vec::new();
        for row in 0..rows {
            for column in 0..columns {
                measured.clear();
                #[allow(clippy::cast_possible_truncation)] // Within the image.
                let (u, v) = (
                    region.u_min + (column * side) as u32,
                    region.v_min + (row * side) as u32,
                );
                #[allow(clippy::cast_possible_truncation)] // At most 16.
                let step = side as u32;
                for v in v..(v + step).min(region.v_max) {
                    for u in u..(u + step).min(region.u_max) {
                        let inside = within.is_none_or(|mask| mask.get(u, v) == Some(true));
                        measured.extend(depth.get(u, v).filter(|z| *z > 0.0 && inside));
                    }
                }
                let median = median(&mut measured, f32::total_cmp);
                let enough = measured.len() >= side * side / 2;
                let median = median.filter(|_| enough).unwrap_or(0.0);
                if median > 0.0 {
                    let sum: f32 = measured.iter().map(|z| (z - median).abs()).sum();
                    deviations.push(sum / (measured.len() as f32 * median));
                }
                medians.push(median);
            }
        }
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of depths.
        let jump = (JUMP_DIAMETERS * diameter) as f32;
        // The mean distance from the median is 0.8 standard deviations.
        let noise = f64::from(median(&mut deviations, f32::total_cmp).unwrap_or(0.0)) / 0.8;
        // A median of n values deviates by 1.25 / √n.
        let cell_noise = JUMP_DEVIATIONS * 1.25 * 2_f64.sqrt() / side as f64 * noise;
        let pixel_noise = PIXEL_DEVIATIONS * noise;
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of depths.
        let (cell_noise, pixel_noise) = (cell_noise as f32, pixel_noise as f32);
        let mut cells = Self {
            region,
            side,
            columns,
            depth: medians,
            jump,
            cell_noise,
            pixel_noise,
        };
        for cell in 0..cells.depth.len() {
            if (cells.point(cell, camera) - sphere.center).norm() > sphere.radius {
                cells.depth[cell] = 0.0;
            }
        }
        cells
    }

    fn place(&self, u: u32, v: u32) -> usize {
        (v - self.region.v_min) as usize / self.side * self.columns
            + (u - self.region.u_min) as usize / self.side
    }

    fn point(&self, cell: usize, camera: &PinholeCamera) -> Point3<f64> {
        let middle = |first: u32, index: usize| {
            f64::from(first) + (index as f64 + 0.5) * self.side as f64 - 0.5
        };
        let (column, row) = (cell % self.columns, cell / self.columns);
        let (u, v) = (
            middle(self.region.u_min, column),
            middle(self.region.v_min, row),
        );
        camera.unproject(u, v, f64::from(self.depth[cell]))
    }

    fn neighbors(&self, cell: usize) -> impl Iterator<Item = usize> + use<> {
        let (columns, cells) = (self.columns, self.depth.len());
        let column = cell % columns;
        [
            (column > 0).then(|| cell - 1),
            (column + 1 < columns).then_some(cell + 1),
            cell.checked_sub(columns),
            (cell + columns < cells).then_some(cell + columns),
        ]
        .into_iter()
        .flatten()
    }

    /// Returns the mean and the area of a surface if its size is that of the object or of a part.
    fn fits(
        &self,
        cells: &[usize],
        camera: &PinholeCamera,
        diameter: f64,
    ) -> Option<(Point3<f64>, f64)> {
        let points = || cells.iter().map(|cell| self.point(*cell, camera));
        let [width, height] = [camera.fx(), camera.fy()].map(|focal| self.side as f64 / focal);
        let area: f64 = points().map(|p| width * p.z * (height * p.z)).sum();
        let sum = points().fold(Point3::origin(), |sum, p| sum + p.coords);
        let mean = sum / cells.len().max(1) as f64;
        let extent = points().map(|p| (p - mean).norm()).fold(0.0, f64::max);
        let fits =
            area >= LEAST_AREA * diameter * diameter && extent <= EXTENT_DIAMETERS * diameter;
        fits.then_some((mean, area))
    }
}

/// Returns the part of the image that a sphere can cover.
fn around(camera: &PinholeCamera, sphere: &Sphere) -> PixelRegion {
    let nearest = sphere.center.z - sphere.radius;
    if nearest <= 0.05 * sphere.center.z {
        return camera.region();
    }
    // The extent of a box around the sphere, at its nearest and farthest depth.
    let bounds = |focal: f64, middle: f64, at: f64, size: u32| {
        let corners = [nearest, sphere.center.z + sphere.radius]
            .map(|z| [(at - sphere.radius) / z, (at + sphere.radius) / z])
            .concat();
        let low = corners.iter().copied().fold(f64::INFINITY, f64::min);
        let high = corners.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let size = f64::from(size);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // Clamped to the image.
        let pixel = |x: f64| (focal * x + middle).clamp(0.0, size) as u32;
        (pixel(low), pixel(high).saturating_add(1))
    };
    let (width, height) = (camera.width(), camera.height());
    let (u_min, u_max) = bounds(camera.fx(), camera.cx(), sphere.center.x, width);
    let (v_min, v_max) = bounds(camera.fy(), camera.cy(), sphere.center.y, height);
    let region = PixelRegion {
        u_min,
        v_min,
        u_max,
        v_max,
    };
    region.intersection(&camera.region())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_of_the_size_of_the_object_are_separated_from_larger_ones() {
        let camera = PinholeCamera::new(200.0, 200.0, 79.5, 59.5, 160, 120).unwrap();
        // Two squares of 8 cm at 0.5 m, one 5 cm nearer than the other, in front of a wall.
        let depth = (0..160 * 120).map(|i| match (i % 160, i / 160) {
            (40..72, 40..72) => 0.45,
            (72..104, 40..72) => 0.5,
            _ => 0.8,
        });
        let depth = DepthImage::from_meters(160, 120, depth.collect()).unwrap();
        let find = |x, radius, surface, within: Option<&Mask>| {
            let sphere = Sphere {
                center: Point3::new(x, 0.0, 0.5),
                radius,
            };
            Segments::new(&depth, &camera, &sphere, (0.12, surface), within)
        };
        let segments = find(0.04, 1.0, 0.03, None);
        let found = &segments.found;
        assert_eq!(found.len(), 2);
        // The nearer to the place comes first.
        assert!(found[0].mean.x > found[1].mean.x);
        for (segment, low) in found.iter().zip([72, 40]) {
            let mask = segments.mask(segment, &depth);
            let set = |u, v| mask.get(u, v) == Some(true);
            let pixels = (0..160 * 120).filter(|i| set(i % 160, i / 160)).count();
            assert!((32 * 32 - 130..=32 * 32).contains(&pixels), "{pixels}");
            assert!(set(low + 16, 56) && !set(low + 40, 56) && !set(low + 16, 90));
        }
        // They are too far apart for an object of 12 cm, but not for one of 20 cm.
        let larger = Segments {
            diameter: 0.2,
            ..find(0.04, 1.0, 0.03, None)
        };
        let mask = larger.mask(&larger.found[0], &depth);
        assert!([56, 88].iter().all(|u| mask.get(*u, 56) == Some(true)));
        // They have 52 and 64 cm², which is too much for an object of 50 cm².
        assert!(find(0.04, 1.0, 0.005, None).found.is_empty());
        assert_eq!(find(0.04, 0.06, 0.03, None).found.len(), 1);
        let left = Mask::in_region(160, 120, &camera.region(), |u, _| u < 72);
        assert_eq!(find(0.04, 1.0, 0.03, Some(&left)).found.len(), 1);
    }

    #[test]
    fn areas_do_not_depend_on_the_shape_of_a_pixel() {
        let camera = PinholeCamera::new(200.0, 100.0, 79.5, 29.5, 160, 60).unwrap();
        // A square of 8 cm at 0.5 m, in front of a wall.
        let depth = (0..160 * 60).map(|i| match (i % 160, i / 160) {
            (60..92, 20..36) => 0.5,
            _ => 0.9,
        });
        let depth = DepthImage::from_meters(160, 60, depth.collect()).unwrap();
        let sphere = Sphere {
            center: Point3::new(0.0, 0.0, 0.5),
            radius: 1.0,
        };
        let segments = Segments::new(&depth, &camera, &sphere, (0.12, 0.03), None);
        assert_eq!(segments.found.len(), 1);
        let area = segments.found[0].area;
        assert!((area / 0.0064 - 1.0).abs() < 0.05, "{area}");
    }

    #[test]
    fn noise_does_not_separate_a_surface_into_pieces() {
        let camera = PinholeCamera::new(200.0, 200.0, 79.5, 59.5, 160, 120).unwrap();
        // A square of 8 cm at 0.5 m, in front of a wall.
        let depth = (0..160 * 120).map(|i| match (i % 160, i / 160) {
            (60..92, 40..72) => 0.5,
            _ => 0.9,
        });
        let depth = DepthImage::from_meters(160, 120, depth.collect()).unwrap();
        let noise = hicp_sim::RelativeGaussian { percent: 2.5 };
        let depth = noise.apply(&mut hicp_sim::rng(1), &depth);
        let sphere = Sphere {
            center: Point3::new(0.0, 0.0, 0.5),
            radius: 1.0,
        };
        let segments = Segments::new(&depth, &camera, &sphere, (0.12, 0.03), None);
        let areas: Vec<f64> = segments.found.iter().map(|s| s.area).collect();
        assert!((areas[0] / 0.0064 - 1.0).abs() < 0.1, "{areas:?}");
        assert!(areas.len() < 4, "{areas:?}");
        let pixels = segments.mask(&segments.found[0], &depth).n_set();
        assert!((900..=1024).contains(&pixels), "{pixels}");
    }
}
