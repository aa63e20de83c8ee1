//! Fast conversion of coordinates to pixels.

/// 2²³: floats from here on are integers. Adding it moves the integer into the last bits of the
/// mantissa.
const WHOLE: f32 = 8_388_608.0;

/// Returns the whole part of a number from 0 to 2²², and anything for other numbers.
///
/// A cast would test for those, one lane at a time.
#[must_use]
#[inline(always)]
pub fn whole(number: f32) -> u32 {
    let rounded = (number + WHOLE) - WHOLE;
    let floor = if rounded > number {
        rounded - 1.0
    } else {
        rounded
    };
    (floor + WHOLE).to_bits() & 0x007f_ffff
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    fn the_whole_part_equals_a_cast() {
        for integer in [0_u16, 1, 2, 3, 255, 639, 640, 32_767, 65_535] {
            let integer = f32::from(integer);
            for fraction in [0.0, 1e-3, 0.25, 0.4999, 0.5, 0.500_01, 0.75, 0.999] {
                let number = integer + fraction;
                assert_eq!(whole(number), number as u32, "{number}");
            }
            let below = integer.next_down().max(0.0);
            assert_eq!(whole(below), below as u32, "{below}");
        }
    }
}
