//! The surfaces around a place that may be a lost object.

use hicp_core::{DepthImage, Mask, PinholeCamera, PixelRegion, Point3};

/// Number of cells across an object.
const CELLS: f64 = 24.0;
/// Step in depth between neighboring cells that separates two surfaces, in diameters.
const JUMP_DIAMETERS: f64 = 0.1;
/// Largest distance of a surface from its mean, in diameters.
const EXTENT_DIAMETERS: f64 = 0.75;
/// Smallest area of a surface, in squared diameters.
const LEAST_AREA: f64 = 0.01;
/// Number of frames in which a surface that was searched in vain is not searched again.
const REST: usize = 5;
/// Movement in diameters and relative change of the area above which a surface is another one.
const OTHER_MEAN: f64 = 0.1;
const OTHER_AREA: f64 = 0.15;

/// A place in the camera frame, and a distance from it, meters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sphere {
    pub(super) center: Point3<f64>,
    pub(super) radius: f64,
}

/// A connected surface of about the size of the object.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    pub(super) mask: Mask,
    /// Mean of its points, camera frame, meters.
    pub(super) mean: Point3<f64>,
    /// Area across the line of sight, square meters.
    pub(super) area: f64,
}

/// A surface that was searched in vain.
pub(super) struct Rejected {
    mean: Point3<f64>,
    area: f64,
    /// Number of frames until it is searched again.
    rest: usize,
}

impl Rejected {
    pub(super) fn new(segment: &Segment) -> Self {
        Self {
            mean: segment.mean,
            area: segment.area,
            rest: REST,
        }
    }

    /// Counts a frame, and returns whether the surface still is not searched.
    pub(super) fn rests(&mut self) -> bool {
        self.rest -= 1;
        self.rest > 0
    }

    /// Returns whether a surface has about the same place and area.
    pub(super) fn is(&self, segment: &Segment, diameter: f64) -> bool {
        let moved = (segment.mean - self.mean).norm() / diameter;
        let grown = (segment.area / self.area - 1.0).abs();
        moved < OTHER_MEAN && grown < OTHER_AREA
    }
}

/// Returns the surfaces inside a sphere that are not larger than an object of a diameter.
///
/// A surface ends at steps in depth. Surfaces nearer to the center of the sphere come first.
/// `within` restricts the pixels. Cost: O(pixels of the sphere).
pub(super) fn segments(
    depth: &DepthImage,
    camera: &PinholeCamera,
    sphere: &Sphere,
    diameter: f64,
    within: Option<&Mask>,
) -> Vec<Segment> {
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
                if labels[other] == 0 && cells.depth[other] > 0.0 && step < cells.jump {
                    labels[other] = label;
                    queue.push(other);
                }
            }
        }
        if let Some((mean, area)) = cells.fits(&queue, camera, diameter) {
            found.push((label, mean, area));
        }
    }
    let away = |mean: &Point3<f64>| (mean - sphere.center).norm();
    found.sort_by(|(_, a, _), (_, b, _)| away(a).total_cmp(&away(b)));
    let found = found.into_iter().map(|(label, mean, area)| {
        let mask = Mask::in_region(depth.width(), depth.height(), &cells.region, |u, v| {
            let cell = cells.place(u, v);
            let z = depth.get(u, v).unwrap_or(0.0);
            labels[cell] == label && z > 0.0 && (z - cells.depth[cell]).abs() < cells.jump
        });
        Segment { mask, mean, area }
    });
    found.collect()
}

/// The median depths of square cells.
struct Cells {
    region: PixelRegion,
    side: usize,
    columns: usize,
    /// Median depth, meters; 0 outside of the sphere and without depth.
    depth: Vec<f32>,
    jump: f32,
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
        // Four to nine pixels of a cell are enough for its median.
        let skip = side.div_ceil(3);
        let columns = region.width().div_ceil(side);
        let rows = region.height().div_ceil(side);
        let mut medians = Vec::with_capacity(columns * rows);
        let mut measured = Vec::with_capacity(side * side);
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
                for v in (v..(v + step).min(region.v_max)).step_by(skip) {
                    for u in (u..(u + step).min(region.u_max)).step_by(skip) {
                        let inside = within.is_none_or(|mask| mask.get(u, v) == Some(true));
                        measured.extend(depth.get(u, v).filter(|z| *z > 0.0 && inside));
                    }
                }
                medians.push(median(&mut measured, side.div_ceil(skip).pow(2) / 2).unwrap_or(0.0));
            }
        }
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of depths.
        let jump = (JUMP_DIAMETERS * diameter) as f32;
        let mut cells = Self {
            region,
            side,
            columns,
            depth: medians,
            jump,
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
        let side = self.side as f64 / camera.fx();
        let area: f64 = points().map(|p| (side * p.z).powi(2)).sum();
        let sum = points().fold(Point3::origin(), |sum, p| sum + p.coords);
        let mean = sum / cells.len().max(1) as f64;
        let extent = points().map(|p| (p - mean).norm()).fold(0.0, f64::max);
        let fits =
            area >= LEAST_AREA * diameter * diameter && extent <= EXTENT_DIAMETERS * diameter;
        fits.then_some((mean, area))
    }
}

/// Returns the median if there are at least as many values.
fn median(values: &mut [f32], at_least: usize) -> Option<f32> {
    if values.len() < at_least.max(1) {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f32::total_cmp).1)
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
        let find = |x, radius, within: Option<&Mask>| {
            let sphere = Sphere {
                center: Point3::new(x, 0.0, 0.5),
                radius,
            };
            segments(&depth, &camera, &sphere, 0.12, within)
        };
        let found = find(0.04, 1.0, None);
        assert_eq!(found.len(), 2);
        // The nearer to the place comes first.
        assert!(found[0].mean.x > found[1].mean.x);
        for (segment, low) in found.iter().zip([72, 40]) {
            let set = |u, v| segment.mask.get(u, v) == Some(true);
            let pixels = (0..160 * 120).filter(|i| set(i % 160, i / 160)).count();
            assert!((32 * 32 - 130..=32 * 32).contains(&pixels), "{pixels}");
            assert!(set(low + 16, 56) && !set(low + 40, 56) && !set(low + 16, 90));
        }
        assert_eq!(find(0.04, 0.06, None).len(), 1);
        let left = Mask::in_region(160, 120, &camera.region(), |u, _| u < 72);
        assert_eq!(find(0.04, 1.0, Some(&left)).len(), 1);
    }
}
