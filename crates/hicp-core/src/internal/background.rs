//! The plane behind an object, such as the table it stands on.

use std::sync::Arc;

use nalgebra::Vector3;

use crate::internal::noise::depth_noise;
use crate::internal::plane::DepthPlane;
use crate::sensor::observation::Observation;

/// Width of the ring around the mask, as a share of the square root of the mask's area.
const RING: f64 = 0.25;
/// Fewest pixels of the ring for a plane, and about the most that are used.
const FEWEST: usize = 50;
const MOST: usize = 600;
/// Share of the ring that must lie on the plane.
const LEAST_SHARE: f64 = 0.4;
/// Number of planes through three pixels that are tried.
const TRIES: usize = 48;
/// Smallest height above the plane of a point that is not on it, meters.
const LEAST_HEIGHT_METERS: f64 = 0.004;
/// Largest half width of the window over which heights are averaged, pixels.
const MAX_HALF_WINDOW: usize = 4;

/// The noise of an observation, and the plane around its mask.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings {
    /// Standard deviation of the depth noise inside the mask, meters.
    pub noise: f64,
    /// The plane that most pixels around the mask lie on.
    pub plane: Option<Background>,
}

impl Surroundings {
    /// Returns the surroundings of an observation's mask, which are computed once and shared.
    #[must_use]
    pub fn of(observation: &Observation) -> Arc<Self> {
        observation.derived().get_or_build(0, || {
            let noise = depth_noise(observation);
            let plane = Background::around(observation, noise);
            Self { noise, plane }
        })
    }
}

/// The plane around a mask.
#[derive(Clone, Copy, Debug)]
pub struct Background {
    plane: DepthPlane,
    noise: f64,
}

impl Background {
    /// Finds the plane that most pixels around the mask lie on, or returns `None`.
    ///
    /// `noise` is the standard deviation of the depth, meters.
    fn around(observation: &Observation, noise: f64) -> Option<Self> {
        let area = observation.n_measured();
        let (region, camera) = (observation.region(), observation.camera());
        let (depth, mask) = (observation.depth(), observation.mask());
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Far below 2³².
        let band = (RING * (area as f64).sqrt()).ceil().max(4.0) as u32;
        let around = region.grown(band).intersection(&camera.region());
        let step = (around.area() / (2 * MOST)).isqrt().max(1);
        let ring: Vec<Vector3<f64>> = around
            .grid(step)
            .filter(|(u, v)| mask.get(*u, *v) == Some(false))
            .filter_map(|(u, v)| {
                let z = f64::from(depth.get(u, v)?);
                (z > 0.0).then(|| Vector3::new(f64::from(u), f64::from(v), z))
            })
            .collect();
        if ring.len() < FEWEST {
            return None;
        }
        let near = LEAST_HEIGHT_METERS.max(2.5 * noise);
        let near_plane = |plane: DepthPlane| {
            let pixels = ring.iter().copied();
            pixels.filter(move |p| (plane.depth(p.x, p.y) - p.z).abs() < near)
        };
        let support = |plane: &DepthPlane| near_plane(*plane).count();
        let mut plane = DepthPlane::through_three(&ring, TRIES).max_by_key(support)?;
        for _ in 0..2 {
            plane = DepthPlane::fit(near_plane(plane))?;
        }
        let found = support(&plane) as f64 > LEAST_SHARE * ring.len() as f64;
        found.then_some(Self { plane, noise })
    }

    /// Returns the distance of a pixel (u, v) of depth z in front of the plane, along the optical
    /// axis, meters.
    ///
    /// If the plane is behind the camera at that pixel, it is infinite.
    #[must_use]
    #[inline]
    pub fn height(&self, u: f64, v: f64, z: f64) -> f64 {
        self.plane.depth(u, v) - z
    }

    /// Returns the certainty that each of some pixels is not on the plane, 0 to 1.
    ///
    /// The pixels ((u, v), z) are the rows of a grid with `width` columns, `step` pixels apart.
    #[must_use]
    pub fn off_plane(
        &self,
        pixels: impl Iterator<Item = ((u32, u32), f32)>,
        width: usize,
        step: usize,
    ) -> Vec<f32> {
        // Sums of heights and counts over the rectangle from the corner of the grid.
        let mut sums = vec![(0.0, 0_u32); width + 1];
        let mut line = (0.0, 0);
        for ((u, v), z) in pixels {
            if sums.len().is_multiple_of(width + 1) {
                line = (0.0, 0);
                sums.push(line);
            }
            if z > 0.0 {
                let height = self.height(u.into(), v.into(), z.into());
                line = (line.0 + height.clamp(-1.0, 1.0), line.1 + 1);
            }
            let above: (f64, u32) = sums[sums.len() - width - 1];
            sums.push((above.0 + line.0, above.1 + line.1));
        }
        // Averaging over a window reduces the noise by its width.
        let error = |half: usize| 3.0 * self.noise / (2 * half + 1) as f64;
        let largest = (MAX_HALF_WINDOW / step).max(1);
        let half = (0..largest).find(|half| error(*half) <= LEAST_HEIGHT_METERS);
        let half = half.unwrap_or(largest);
        let least = LEAST_HEIGHT_METERS.max(error(half));
        let at = |row: usize, column: usize| sums[row * (width + 1) + column];
        let rows = sums.len() / (width + 1) - 1;
        let mut off = Vec::with_capacity(rows * width);
        for row in 0..rows {
            let (top, bottom) = (row.saturating_sub(half), (row + half + 1).min(rows));
            for column in 0..width {
                let (left, right) = (column.saturating_sub(half), (column + half + 1).min(width));
                let (a, b) = (at(top, left), at(top, right));
                let (c, d) = (at(bottom, left), at(bottom, right));
                let count = (d.1 + a.1) - (b.1 + c.1);
                let mean = (d.0 + a.0 - b.0 - c.0) / f64::from(count.max(1));
                #[allow(clippy::cast_possible_truncation)] // Between 0 and 1.
                off.push((mean.abs() / least - 1.0).clamp(0.0, 1.0) as f32);
            }
        }
        off
    }
}
