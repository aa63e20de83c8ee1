//! Rotations spread evenly over SO(3).

use nalgebra::{Quaternion, UnitQuaternion};

/// The positive root of ψ⁴ = ψ + 4, which spreads the second angle of the spiral.
const PSI: f64 = 1.533_751_168_755_204_3;

/// Returns the `index`-th of `count` rotations that cover SO(3) evenly.
///
/// The rotations form a super-Fibonacci spiral (Alexa, CVPR 2022). All `count` rotations together
/// cover the group about as evenly as that number of rotations can; a prefix of them does not. An
/// index beyond `count` continues the spiral. Cost: O(1), without memory.
///
/// ```
/// use hicp_core::{rotation_grid, so3};
/// let grid: Vec<_> = (0..500).map(|i| rotation_grid(i, 500)).collect();
/// // Every rotation has one of the 500 within about 36°.
/// let turn = so3::exp(&nalgebra::Vector3::new(0.3, -2.0, 1.1));
/// let nearest = grid.iter().map(|r| r.angle_to(&turn)).fold(f64::INFINITY, f64::min);
/// assert!(nearest.to_degrees() < 36.0);
/// ```
#[must_use]
#[allow(clippy::cast_precision_loss)] // Counts far below 2⁵³.
pub fn rotation_grid(index: usize, count: usize) -> UnitQuaternion<f64> {
    let step = index as f64 + 0.5;
    let share = (step / count.max(1) as f64).clamp(0.0, 1.0);
    let turn = std::f64::consts::TAU * step;
    let (sin_a, cos_a) = (turn / std::f64::consts::SQRT_2).sin_cos();
    let (sin_b, cos_b) = (turn / PSI).sin_cos();
    let (inner, outer) = (share.sqrt(), (1.0 - share).sqrt());
    UnitQuaternion::new_normalize(Quaternion::new(
        outer * cos_b,
        inner * sin_a,
        inner * cos_a,
        outer * sin_b,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::so3;
    use nalgebra::Vector3;

    /// Compares rotations with the formulas of the paper's page, evaluated with thirty digits.
    ///
    /// With s = i + ½, r² = s/n, R² = 1 − s/n, α = 2πs/√2 and β = 2πs/ψ: (x, y, z, w) = (r sin α, r
    /// cos α, R sin β, R cos β).
    #[test]
    fn the_grid_is_the_published_spiral() {
        assert!((PSI.powi(4) - PSI - 4.0).abs() < 1e-14);
        let golden = [
            (
                0,
                1,
                [
                    0.562_640_058_572_400_2,
                    -0.428_294_483_375_219_45,
                    0.628_011_140_981_484,
                    -0.324_964_623_925_643_2,
                ],
            ),
            (
                0,
                5,
                [
                    0.251_620_283_566_47,
                    -0.191_539_115_843_028_84,
                    0.842_565_361_117_081_3,
                    -0.435_985_793_628_235_6,
                ],
            ),
            (
                3,
                5,
                [
                    0.131_538_016_023_735_2,
                    -0.826_255_257_375_430_9,
                    0.536_697_750_538_592,
                    -0.109_341_321_406_022_4,
                ],
            ),
            (
                41,
                100,
                [
                    0.532_965_368_805_561_3,
                    -0.361_867_262_478_870_9,
                    0.271_902_492_610_603_1,
                    0.714_890_924_905_429_8,
                ],
            ),
        ];
        for (index, count, expected) in golden {
            let found = rotation_grid(index, count).coords;
            // The angles reach 184 radians, where f64 has a precision of 3e-14.
            let error = (found - nalgebra::Vector4::from(expected)).amax();
            assert!(error < 1e-13, "{index} of {count}: {error}");
        }
    }

    /// Evenly spread rotations leave gaps not much larger than those of densely packed balls.
    #[test]
    fn the_grid_leaves_no_large_gap_and_no_cluster() {
        for (count, largest) in [(64, 75.0), (256, 48.0), (1024, 31.0)] {
            let grid: Vec<_> = (0..count).map(|i| rotation_grid(i, count)).collect();
            let mut worst: f64 = 0.0;
            for probe in 0..2000 {
                let x = f64::from(probe);
                let axis = Vector3::new((x * 1.7).sin(), (x * 2.3).cos(), (x * 0.9).sin());
                let rotation =
                    so3::exp(&(axis.normalize() * (x * 0.618).rem_euclid(std::f64::consts::PI)));
                let gap = grid.iter().map(|r| r.angle_to(&rotation));
                worst = worst.max(gap.fold(f64::INFINITY, f64::min));
            }
            assert!(
                worst.to_degrees() < largest,
                "{count}: {}",
                worst.to_degrees()
            );
            for (i, a) in grid.iter().enumerate() {
                let others = grid.iter().enumerate().filter(|(j, _)| *j != i);
                let nearest = others.map(|(_, b)| a.angle_to(b));
                let nearest = nearest.fold(f64::INFINITY, f64::min).to_degrees();
                assert!(nearest > 0.35 * largest, "{count}: {nearest}");
            }
        }
    }
}
