//! Defects of segmentations: masks that are too small, too large, or incomplete.

use hicp_core::{DepthImage, Mask, PixelRegion};
use rand::RngExt;

use crate::SimRng;
use crate::error::{SimError, check_range};
use crate::field::Field;

/// Defects of a segmentation mask, applied in the order of the fields. The default changes nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MaskDefects {
    /// Share of the mask's pixels that a straight cut in a random direction removes, 0 to 1.
    pub missing_share: f64,
    /// Radius of the disc by which the mask is eroded, pixels. Pixels outside the image count as
    /// inside the mask.
    pub erosion_pixels: u32,
    /// Radius of the disc by which the mask is dilated, pixels.
    pub dilation_pixels: u32,
    /// Number of cells across the longer side of the mask's box, as a network predicts them.
    ///
    /// Each cell holds its covered share, which is interpolated between cells. 0 keeps the mask.
    pub soft_cells: u32,
    /// The interpolated share above which a pixel of a soft mask is set.
    pub soft_threshold: f64,
    /// Standard deviation of a smooth displacement of the mask's border, pixels.
    pub ragged_pixels: u32,
    /// If `true`, the bounding box replaces the mask.
    pub boxed: bool,
}

/// Largest radius of an erosion or dilation, pixels.
const MAX_RADIUS: u32 = 256;
/// Distance over which the displacement of a ragged border changes, per pixel of displacement.
const AREA_PER_DISPLACEMENT: u32 = 6;

impl MaskDefects {
    /// Returns the mask with these defects. Cost: O(pixels of the mask's box · radius).
    ///
    /// # Errors
    ///
    /// [`SimError::Parameter`] if the share or the threshold is not in [0, 1], or a radius is above
    /// 256 pixels.
    pub fn apply(&self, rng: &mut SimRng, mask: &Mask) -> Result<Mask, SimError> {
        check_range("missing share of the mask", self.missing_share, 0.0..=1.0)?;
        check_range("threshold of the soft mask", self.soft_threshold, 0.0..=1.0)?;
        for (what, radius) in [
            ("erosion in pixels", self.erosion_pixels),
            ("dilation in pixels", self.dilation_pixels),
            ("raggedness in pixels", self.ragged_pixels),
        ] {
            check_range(what, f64::from(radius), 0.0..=f64::from(MAX_RADIUS))?;
        }
        let mut mask = mask.clone();
        // Always draw the cut, so that different shares of one stream cut in the same direction.
        let cut = Cut::new(rng, &mask, self.missing_share);
        if let Some(cut) = cut {
            mask = map_mask(&mask, |u, v, set| set && !cut.removes(u, v))?;
        }
        if self.erosion_pixels > 0 {
            mask = grow(&mask, self.erosion_pixels, false)?;
        }
        if self.dilation_pixels > 0 {
            mask = grow(&mask, self.dilation_pixels, true)?;
        }
        if self.soft_cells > 0 {
            mask = soften(&mask, self.soft_cells, self.soft_threshold)?;
        }
        if self.ragged_pixels > 0 {
            mask = displace(rng, &mask, self.ragged_pixels)?;
        }
        if self.boxed {
            let region = mask.bounding_region();
            mask = map_mask(&mask, |u, v, _| region.contains(u, v))?;
        }
        Ok(mask)
    }
}

/// A straight line with a given share of a mask's pixels on its far side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cut {
    direction: (f64, f64),
    offset: f64,
}

impl Cut {
    /// Draws a direction and places the line. Returns `None` if the share cuts nothing.
    ///
    /// Always draws exactly one number.
    pub(crate) fn new(rng: &mut SimRng, mask: &Mask, share: f64) -> Option<Self> {
        let (sine, cosine) = (std::f64::consts::TAU * rng.random::<f64>()).sin_cos();
        let mut cut = Self {
            direction: (cosine, sine),
            offset: f64::INFINITY,
        };
        let region = mask.bounding_region();
        let mut positions: Vec<f64> = region
            .pixels()
            .filter(|(u, v)| mask.get(*u, *v) == Some(true))
            .map(|(u, v)| cut.position(u, v))
            .collect();
        positions.sort_by(f64::total_cmp);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // Between 0 and the number of pixels.
        let kept = ((1.0 - share) * positions.len() as f64).round() as usize;
        cut.offset = *positions.get(kept)?;
        Some(cut)
    }

    fn position(&self, u: u32, v: u32) -> f64 {
        self.direction.0 * f64::from(u) + self.direction.1 * f64::from(v)
    }

    /// Returns whether a pixel, inside or outside the mask, lies on the far side.
    pub(crate) fn removes(&self, u: u32, v: u32) -> bool {
        self.position(u, v) >= self.offset
    }
}

/// Returns a mask with `new(u, v, set)` at every pixel.
pub(crate) fn map_mask(
    mask: &Mask,
    mut new: impl FnMut(u32, u32, bool) -> bool,
) -> Result<Mask, SimError> {
    let image = PixelRegion::of_image(mask.width(), mask.height());
    let set = image.pixels().zip(mask.pixels());
    let set = set.map(|((u, v), set)| new(u, v, *set));
    Ok(Mask::new(mask.width(), mask.height(), set.collect())?)
}

/// Returns a depth image with `new(u, v, depth)` at every pixel.
pub(crate) fn map_depth(
    depth: &DepthImage,
    mut new: impl FnMut(u32, u32, f32) -> f32,
) -> Result<DepthImage, SimError> {
    let (width, height) = (depth.width(), depth.height());
    let image = PixelRegion::of_image(width, height);
    let depths = image.pixels().zip(depth.pixels());
    let depths = depths.map(|((u, v), z)| new(u, v, *z));
    Ok(DepthImage::collect(width, height, depths)?)
}

/// Averages a mask over square cells, interpolates between their centers, and thresholds.
fn soften(mask: &Mask, cells: u32, threshold: f64) -> Result<Mask, SimError> {
    let region = mask.bounding_region();
    let longest = hicp_core::internal::index(region.width().max(region.height()));
    if longest == 0 {
        return Ok(mask.clone());
    }
    let side = f64::from(longest) / f64::from(cells);
    // A border of empty cells lets the interpolation fall to zero outside of the box.
    let count = cells as usize + 2;
    let mut sums = vec![(0.0, 0.0); count * count];
    let cell = |pixel: u32, first: u32| (f64::from(pixel) - f64::from(first) + 0.5) / side + 1.0;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // At least 0, and clamped to the cells.
    let index = |x: f64| (x as usize).min(count - 1);
    // The cells at the end of the shorter side reach beyond the box.
    let square = PixelRegion {
        u_max: region.u_min + longest,
        v_max: region.v_min + longest,
        ..region
    };
    for (u, v) in square.pixels() {
        let at = index(cell(v, region.v_min)) * count + index(cell(u, region.u_min));
        sums[at].0 += f64::from(u8::from(mask.get(u, v) == Some(true)));
        sums[at].1 += 1.0;
    }
    let share = |x: usize, y: usize| {
        let (sum, n) = sums[y.min(count - 1) * count + x.min(count - 1)];
        if n > 0.0 { sum / n } else { 0.0 }
    };
    let reach = 0.0..count as f64 - 0.5;
    map_mask(mask, |u, v, _| {
        let (x, y) = (cell(u, region.u_min) - 0.5, cell(v, region.v_min) - 0.5);
        if !(reach.contains(&x) && reach.contains(&y)) {
            return false;
        }
        let (i, j) = (index(x), index(y));
        let (a, b) = (x - i as f64, y - j as f64);
        let row = |j| share(i, j) * (1.0 - a) + share(i + 1, j) * a;
        row(j) * (1.0 - b) + row(j + 1) * b > threshold
    })
}

/// Displaces every pixel at random, by similar distances in areas of six times `pixels`.
fn displace(rng: &mut SimRng, mask: &Mask, pixels: u32) -> Result<Mask, SimError> {
    let (width, height) = (mask.width(), mask.height());
    let [x, y] = [(); 2].map(|()| Field::draw(rng, AREA_PER_DISPLACEMENT * pixels, width, height));
    map_mask(mask, |u, v, _| {
        let moved = |place: u32, field: &Field| {
            f64::from(place) + (f64::from(pixels) * field.at(u, v)).round()
        };
        let (u, v) = (moved(u, &x), moved(v, &y));
        let inside = (0.0..f64::from(width)).contains(&u) && (0.0..f64::from(height)).contains(&v);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Inside the image.
        let set = inside && mask.get(u as u32, v as u32) == Some(true);
        set
    })
}

/// Spreads the pixels of one value over a disc: set pixels to dilate, unset pixels to erode.
fn grow(mask: &Mask, radius: u32, value: bool) -> Result<Mask, SimError> {
    let (width, height) = (i64::from(mask.width()), i64::from(mask.height()));
    let mut grown = mask.pixels().to_vec();
    let r = i64::from(radius);
    // Half the width of the disc in the row at a distance of `dy` from its center.
    let half_width = |dy: i64| {
        #[allow(clippy::cast_possible_truncation)]
        // At most the radius.
        let x = ((r * r - dy * dy) as f64).sqrt() as i64;
        x
    };
    let is = |u: i64, v: i64| {
        // A negative coordinate is outside the image.
        let (Ok(u), Ok(v)) = (u32::try_from(u), u32::try_from(v)) else {
            return false;
        };
        mask.get(u, v) == Some(value)
    };
    for v in 0..height {
        for u in 0..width {
            // Only the border needs to spread; the inside adds nothing.
            let border = [(1, 0), (-1, 0), (0, 1), (0, -1)];
            if !is(u, v) || border.iter().all(|(dx, dy)| is(u + dx, v + dy)) {
                continue;
            }
            for y in (v - r).max(0)..=(v + r).min(height - 1) {
                let reach = half_width(y - v);
                let (from, to) = ((u - reach).max(0), (u + reach).min(width - 1));
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                // Clamped to the image.
                let (from, to) = ((y * width + from) as usize, (y * width + to) as usize);
                grown[from..=to].fill(value);
            }
        }
    }
    Ok(Mask::new(mask.width(), mask.height(), grown)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng;

    fn disc(radius: f64) -> Mask {
        let set = (0..100 * 80)
            .map(|i| f64::hypot(f64::from(i % 100) - 50.0, f64::from(i / 100) - 40.0) <= radius);
        Mask::new(100, 80, set.collect()).unwrap()
    }

    fn count(mask: &Mask) -> usize {
        mask.n_set()
    }

    fn apply(missing_share: f64, erosion_pixels: u32, dilation_pixels: u32, mask: &Mask) -> Mask {
        let defects = MaskDefects {
            missing_share,
            erosion_pixels,
            dilation_pixels,
            ..MaskDefects::default()
        };
        defects.apply(&mut rng(4), mask).unwrap()
    }

    #[test]
    fn a_mask_without_defects_is_unchanged() {
        assert_eq!(apply(0.0, 0, 0, &disc(20.0)), disc(20.0));
    }

    #[test]
    fn erosion_and_dilation_match_their_definitions() {
        // By definition, erosion keeps a pixel if the whole disc around it is set, and dilation
        // sets a pixel if any pixel of the disc is set.
        let mask = apply(0.3, 0, 0, &disc(23.0));
        for radius in [1_u32, 2, 5] {
            let (eroded, dilated) = (apply(0.0, radius, 0, &mask), apply(0.0, 0, radius, &mask));
            let r = i64::from(radius);
            for (u, v) in PixelRegion::of_image(100, 80).pixels() {
                let around = |wanted: bool| {
                    (-r..=r)
                        .flat_map(|dy| (-r..=r).map(move |dx| (dx, dy)))
                        .any(|(dx, dy)| {
                            let at = (
                                u32::try_from(i64::from(u) + dx),
                                u32::try_from(i64::from(v) + dy),
                            );
                            let (Ok(x), Ok(y)) = at else { return false };
                            dx * dx + dy * dy <= r * r && mask.get(x, y) == Some(wanted)
                        })
                };
                assert_eq!(eroded.get(u, v), Some(!around(false)), "{u} {v}");
                assert_eq!(dilated.get(u, v), Some(around(true)), "{u} {v}");
            }
        }
    }

    #[test]
    fn the_missing_part_has_its_share_and_grows_with_it() {
        let full = disc(30.0);
        for share in [0.1, 0.25, 0.5] {
            let cut = apply(share, 0, 0, &full);
            let missing = 1.0 - count(&cut) as f64 / count(&full) as f64;
            assert!((missing - share).abs() < 0.01, "{share}: {missing}");
        }
        assert_eq!(count(&apply(1.0, 0, 0, &full)), 0);
        // A larger share of the same stream cuts a larger part in the same direction.
        let (small, large) = (apply(0.1, 0, 0, &full), apply(0.4, 0, 0, &full));
        assert!(
            large
                .pixels()
                .iter()
                .zip(small.pixels())
                .all(|(l, s)| !l || *s)
        );
    }

    #[test]
    fn soft_masks_follow_the_threshold_and_boxes_fill_the_corners() {
        let full = disc(30.0);
        let soft = |soft_cells, soft_threshold| {
            let defects = MaskDefects {
                soft_cells,
                soft_threshold,
                ..MaskDefects::default()
            };
            defects.apply(&mut rng(4), &full).unwrap()
        };
        let (small, half, large) = (soft(14, 0.9), soft(14, 0.5), soft(14, 0.0));
        assert!(count(&small) < count(&half) && count(&half) < count(&large));
        let changed = half.pixels().iter().zip(full.pixels());
        let changed = changed.filter(|(a, b)| a != b).count();
        assert!(changed > 0 && changed < count(&full) / 10, "{changed}");
        let reach = large.bounding_region();
        assert!(reach.width() <= 61 + 2 * 5 && reach.width() > 61);

        // All sides of a bar move alike, whether or not its width is a multiple of the cells.
        for width in [30, 37, 44] {
            let region = PixelRegion {
                u_min: 20,
                v_min: 9,
                u_max: 20 + width,
                v_max: 69,
            };
            let bar = Mask::in_region(100, 80, &region, |_, _| true);
            for (soft_threshold, most) in [(0.5, 2), (0.0, 5)] {
                let defects = MaskDefects {
                    soft_cells: 14,
                    soft_threshold,
                    ..MaskDefects::default()
                };
                let soft = defects.apply(&mut rng(4), &bar).unwrap().bounding_region();
                let moved = [
                    region.u_min.abs_diff(soft.u_min),
                    region.v_min.abs_diff(soft.v_min),
                    region.u_max.abs_diff(soft.u_max),
                    region.v_max.abs_diff(soft.v_max),
                ];
                assert!(moved.iter().all(|by| *by <= most), "{width}: {moved:?}");
            }
        }

        let boxed = MaskDefects {
            boxed: true,
            ..MaskDefects::default()
        };
        let boxed = boxed.apply(&mut rng(4), &full).unwrap();
        assert_eq!(boxed.bounding_region(), full.bounding_region());
        assert_eq!(count(&boxed), full.bounding_region().area());
    }

    #[test]
    fn a_ragged_border_moves_both_ways_by_the_stated_distance() {
        let full = disc(30.0);
        let ragged_pixels = 2;
        let defects = MaskDefects {
            ragged_pixels,
            ..MaskDefects::default()
        };
        let (mut added, mut removed) = (0.0, 0.0);
        for seed in 0..20 {
            let ragged = defects.apply(&mut rng(seed), &full).unwrap();
            for (u, v) in PixelRegion::of_image(100, 80).pixels() {
                let (was, is) = (full.get(u, v) == Some(true), ragged.get(u, v) == Some(true));
                added += f64::from(u8::from(is && !was));
                removed += f64::from(u8::from(was && !is));
                let from_border = f64::hypot(f64::from(u) - 50.0, f64::from(v) - 40.0) - 30.0;
                let far = from_border.abs() > 6.0 * f64::from(ragged_pixels);
                assert!(was == is || !far, "{u} {v}");
            }
        }
        // The mean of a positive part of a normal variable is σ/√(2π).
        let area = std::f64::consts::TAU * 30.0 * 20.0;
        let expected = f64::from(ragged_pixels) / std::f64::consts::TAU.sqrt();
        for pixels in [added, removed] {
            let ratio = pixels / area / expected;
            assert!((ratio - 1.0).abs() < 0.2, "{ratio}");
        }
    }

    #[test]
    fn an_empty_mask_stays_empty_and_invalid_shares_are_refused() {
        let empty = Mask::new(10, 10, vec![false; 100]).unwrap();
        assert_eq!(count(&apply(0.5, 3, 3, &empty)), 0);
        let wrong = MaskDefects {
            missing_share: f64::NAN,
            ..MaskDefects::default()
        };
        let error = wrong.apply(&mut rng(1), &empty).unwrap_err().to_string();
        assert_eq!(
            error,
            "missing share of the mask is NaN, expected a number from 0 to 1"
        );
    }
}
