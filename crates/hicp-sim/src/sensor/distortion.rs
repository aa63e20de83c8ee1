//! Systematic errors of depth sensors: smooth distortions and fattened edges.

use hicp_core::DepthImage;

use crate::SimRng;
use crate::error::{SimError, check_range};
use crate::field::Field;
use crate::mask::map_depth;
use crate::narrow;

/// Depth difference between neighboring pixels that counts as a depth edge, meters.
pub const DEPTH_EDGE_METERS: f64 = 0.02;

/// Errors of depth that averaging does not remove. The default changes nothing.
///
/// Structured light and stereo match windows of pixels. So their errors are the same over whole
/// areas, and near surfaces grow over the edge to what lies behind them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// Standard deviation of the smooth error, percent of the depth.
    pub percent: f64,
    /// Distance over which the smooth error changes, pixels.
    pub area_pixels: u32,
    /// Width by which near surfaces are fattened at depth edges, pixels; negative if they are
    /// thinned.
    pub fattening_pixels: i32,
}

impl Distortion {
    /// Returns the distorted image.
    ///
    /// Cost: O(pixels), times the square of the fattening.
    ///
    /// # Errors
    ///
    /// [`SimError`] if a parameter is out of its range.
    pub fn apply(&self, rng: &mut SimRng, perfect: &DepthImage) -> Result<DepthImage, SimError> {
        let fattening = f64::from(self.fattening_pixels);
        check_range("distortion in percent", self.percent, 0.0..=50.0)?;
        check_range("fattening in pixels", fattening, -64.0..=64.0)?;
        let (width, height) = (perfect.width(), perfect.height());
        let field = (self.percent > 0.0).then(|| Field::draw(rng, self.area_pixels, width, height));
        map_depth(perfect, |u, v, _| {
            let z = self.grown(perfect, u, v);
            let error = field.as_ref().map_or(0.0, |field| field.at(u, v));
            narrow((f64::from(z) * (1.0 + self.percent / 100.0 * error)).max(0.0))
        })
    }

    /// Returns the depth of a pixel, or of the surface that grows over it at an edge.
    fn grown(&self, depth: &DepthImage, u: u32, v: u32) -> f32 {
        let n = self.fattening_pixels.unsigned_abs();
        let own = depth.get(u, v).unwrap_or(0.0);
        if n == 0 || own <= 0.0 {
            return own;
        }
        let sign = self.fattening_pixels.signum() as f32;
        let (rows, columns) = (v.saturating_sub(n)..=v + n, u.saturating_sub(n)..=u + n);
        let around = rows.flat_map(|v| columns.clone().map(move |u| (u, v)));
        around
            .filter_map(|(u, v)| depth.get(u, v))
            .filter(|z| *z > 0.0 && f64::from(sign * (own - z)) > DEPTH_EDGE_METERS)
            .fold(own, |a, b| if sign * (a - b) > 0.0 { b } else { a })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::stream;

    fn flat(depth: impl Fn(u32) -> f32) -> DepthImage {
        let pixels = (0..120_u32).flat_map(|_| (0..160).map(&depth)).collect();
        DepthImage::from_meters(160, 120, pixels).expect("the sizes agree")
    }

    #[test]
    fn the_smooth_error_has_its_size_and_does_not_average_out() {
        let distortion = Distortion {
            percent: 1.0,
            area_pixels: 10,
            ..Distortion::default()
        };
        let image = distortion.apply(&mut stream(1, &[], 0), &flat(|_| 2.0));
        let image = image.expect("the parameters are valid");
        let errors: Vec<f64> = image.pixels().iter().map(|z| f64::from(*z) - 2.0).collect();
        let squares = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
        assert!((squares.sqrt() - 0.02).abs() < 0.003, "{}", squares.sqrt());
        let steps = errors.windows(2).map(|pair| (pair[1] - pair[0]).powi(2));
        let steps = steps.sum::<f64>() / errors.len() as f64;
        assert!(steps < 0.1 * squares, "{steps} {squares}");
    }

    #[test]
    fn near_surfaces_grow_or_shrink_and_slopes_stay() {
        let fattened = Distortion {
            fattening_pixels: 2,
            ..Distortion::default()
        };
        let step = flat(|u| if u < 50 { 1.0 } else { 1.5 });
        let image = fattened.apply(&mut stream(1, &[], 0), &step);
        let image = image.expect("the parameters are valid");
        assert_eq!(image.get(51, 60), Some(1.0));
        assert_eq!(image.get(52, 60), Some(1.5));
        let thinned = Distortion {
            fattening_pixels: -3,
            ..Distortion::default()
        };
        let image = thinned.apply(&mut stream(1, &[], 0), &step);
        let image = image.expect("the parameters are valid");
        assert_eq!(image.get(46, 60), Some(1.0));
        assert_eq!(image.get(47, 60), Some(1.5));
        let slope = flat(|u| 1.0 + 0.005 * u as f32);
        let same = fattened.apply(&mut stream(1, &[], 0), &slope);
        assert_eq!(same.expect("the parameters are valid"), slope);
    }

    #[test]
    fn the_default_changes_nothing_and_wrong_parameters_are_errors() {
        let image = flat(|u| if u < 50 { 0.0 } else { 1.0 });
        let same = Distortion::default().apply(&mut stream(1, &[], 0), &image);
        assert_eq!(same.expect("the parameters are valid"), image);
        let wrong = Distortion {
            percent: -1.0,
            ..Distortion::default()
        };
        let error = wrong.apply(&mut stream(1, &[], 0), &image).unwrap_err();
        assert!(
            error.to_string().contains("distortion in percent"),
            "{error}"
        );
    }
}
