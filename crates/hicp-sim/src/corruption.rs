//! Corruptions of a case: all imperfections of its image in one value.

use hicp_core::{DepthImage, Mask, Observation, PixelRegion};

use crate::case::Case;
use crate::error::{SimError, check_range};
use crate::mask::{Cut, MaskDefects, map_depth, map_mask};
use crate::narrow;
use crate::sensor::DepthSensor;
use crate::stream::stream;

/// Distance of the board of [`Corruption::occluded_share`] in front of the object's nearest point,
/// meters.
pub const OCCLUDER_GAP_METERS: f64 = 0.05;

/// The imperfections between a perfect image of an object and the input of a pipeline.
///
/// The default changes nothing. The order is: the scene (a wall behind, a board in front), the
/// sensor, the segmentation.
///
/// Each step has its own stream of random numbers, which depends on the case and not on the
/// parameters of the step. Different levels of one step are therefore paired, and no step changes
/// the stream of another. A wall or a board still changes the noise of single pixels, because the
/// sensor draws one number per measured pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Corruption {
    /// Distance of a wall across the optical axis behind the farthest visible point of the object,
    /// meters.
    ///
    /// If `None`, there is no wall, and pixels that a dilated mask adds have no depth.
    pub wall_behind_meters: Option<f64>,
    /// Share of the object's visible pixels that a board in front of it hides, 0 to 1.
    ///
    /// The board has a straight edge in a random direction. Hidden pixels leave the mask, and their
    /// depth is that of the board.
    pub occluded_share: f64,
    /// The depth sensor.
    pub sensor: DepthSensor,
    /// The segmentation.
    pub mask: MaskDefects,
}

impl Corruption {
    /// Returns the imperfect depth image and mask of a case. They depend only on the case and on
    /// `self`.
    ///
    /// # Errors
    ///
    /// [`SimError::Parameter`] if a parameter is out of its range.
    pub fn apply(&self, case: &Case) -> Result<(DepthImage, Mask), SimError> {
        check_range("occluded share", self.occluded_share, 0.0..=1.0)?;
        let wall = self.wall_behind_meters.unwrap_or(0.0);
        check_range("distance of the wall in meters", wall, 0.0..=100.0)?;
        let of = |step: &str| stream(case.seed, &[&case.object, step], case.index);

        let (mut depth, mut mask) = (case.depth.clone(), case.mask.clone());
        let cut = Cut::new(&mut of("occluder"), &mask, self.occluded_share);
        if self.wall_behind_meters.is_some() || cut.is_some() {
            depth = self.scene(&depth, &mask, cut.as_ref())?;
        }
        if let Some(cut) = cut {
            mask = map_mask(&mask, |u, v, set| set && !cut.removes(u, v))?;
        }
        let depth = self
            .sensor
            .measure(&mut of("sensor"), &depth, &case.camera)?;
        let mask = self.mask.apply(&mut of("mask"), &mask)?;
        Ok((depth, mask))
    }

    /// Returns the observation of a case after [`Corruption::apply`].
    ///
    /// # Errors
    ///
    /// As for [`Corruption::apply`].
    pub fn observe(&self, case: &Case) -> Result<Observation, SimError> {
        let (depth, mask) = self.apply(case)?;
        Ok(Observation::new(depth, mask, case.camera)?)
    }

    /// Adds the wall and the board to a perfect depth image.
    fn scene(
        &self,
        depth: &DepthImage,
        mask: &Mask,
        cut: Option<&Cut>,
    ) -> Result<DepthImage, SimError> {
        let measured = || depth.pixels().iter().copied().filter(|z| *z > 0.0);
        let (nearest, farthest) = measured().fold((f32::INFINITY, 0.0_f32), |(low, high), z| {
            (low.min(z), high.max(z))
        });
        let (nearest, farthest) = (f64::from(nearest), f64::from(farthest));
        let wall = self
            .wall_behind_meters
            .map(|behind| narrow(farthest + behind));
        let board = narrow((nearest - OCCLUDER_GAP_METERS).max(nearest * 0.5));
        let hidden = around(&mask.bounding_region(), mask);
        map_depth(depth, |u, v, z| match cut {
            Some(cut) if hidden.contains(u, v) && cut.removes(u, v) => board,
            _ if z > 0.0 => z,
            _ => wall.unwrap_or(0.0),
        })
    }
}

/// Widens a region by a quarter of its size on every side, within the image.
fn around(region: &PixelRegion, image: &Mask) -> PixelRegion {
    let (du, dv) = (
        (region.u_max - region.u_min) / 4,
        (region.v_max - region.v_min) / 4,
    );
    PixelRegion {
        u_min: region.u_min.saturating_sub(du),
        v_min: region.v_min.saturating_sub(dv),
        u_max: (region.u_max + du).min(image.width()),
        v_max: (region.v_max + dv).min(image.height()),
    }
}
