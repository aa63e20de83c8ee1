//! Numbers in binary files.

/// A type of number: its kind, and its size in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NumberType {
    pub(crate) kind: Kind,
    /// 1, 2, 4 or 8. Floating point has 4 or 8, and in NumPy arrays also 2.
    pub(crate) bytes: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Float,
    Signed,
    Unsigned,
}

/// The usual number of positions.
pub(crate) const F32: NumberType = NumberType::new(Kind::Float, 4);

impl NumberType {
    pub(crate) const fn new(kind: Kind, bytes: usize) -> Self {
        Self { kind, bytes }
    }

    /// Reads the number at the start of some bytes, or returns `None` if they are too few.
    pub(crate) fn read(self, bytes: &[u8], big_endian: bool) -> Option<f64> {
        let mut little = [0; 8];
        little[..self.bytes].copy_from_slice(bytes.get(..self.bytes)?);
        if big_endian {
            little[..self.bytes].reverse();
        }
        let [a, b, c, d, ..] = little;
        let bits = u64::from_le_bytes(little);
        // Moves the sign to the highest bit.
        let unused = 64 - 8 * self.bytes;
        Some(match (self.kind, self.bytes) {
            #[cfg(feature = "npy")]
            (Kind::Float, 2) => half::f16::from_le_bytes([a, b]).to_f64(),
            (Kind::Float, 4) => f32::from_le_bytes([a, b, c, d]).into(),
            (Kind::Float, _) => f64::from_bits(bits),
            (Kind::Signed, _) => ((bits << unused).cast_signed() >> unused) as f64,
            (Kind::Unsigned, _) => bits as f64,
        })
    }
}

/// Rounds to `f32`, the precision of buffers.
#[allow(clippy::cast_possible_truncation, reason = "rounds")]
pub(crate) fn narrow(number: f64) -> f32 {
    number as f32
}

/// Drops the fraction of a number. The nearest integer in range replaces one out of range, and 0
/// replaces NaN.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates"
)]
pub(crate) fn whole(number: f64) -> u32 {
    number as u32
}

/// Rounds to a byte. The nearest byte replaces a number out of range, and 0 replaces NaN.
pub(crate) fn byte(number: f64) -> u8 {
    let [.., byte] = whole(number.round()).min(255).to_be_bytes();
    byte
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_saturate_and_nan_becomes_zero() {
        let numbers = [f64::NAN, -3.0, 0.4, 0.5, 254.6, 1e9, f64::INFINITY];
        assert_eq!(numbers.map(byte), [0, 0, 0, 1, 255, 255, 255]);
    }
}
