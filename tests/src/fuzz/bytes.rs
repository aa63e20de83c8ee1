//! Choices made from arbitrary bytes.

/// A source of choices, made from the bytes in order.
///
/// After the last byte, every choice is the first one.
pub(super) struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    pub(super) fn new(data: &'a [u8]) -> Self {
        Self(data)
    }

    pub(super) fn byte(&mut self) -> u8 {
        let [byte] = self.array();
        byte
    }

    pub(super) fn array<const N: usize>(&mut self) -> [u8; N] {
        std::array::from_fn(|_| match self.0 {
            [first, rest @ ..] => {
                self.0 = rest;
                *first
            }
            [] => 0,
        })
    }

    /// Returns a number from 0 to `n` - 1, for `n` up to 256.
    pub(super) fn below(&mut self, n: usize) -> usize {
        usize::from(self.byte()) % n.max(1)
    }

    pub(super) fn pick<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())]
    }

    /// Returns `true` for one in `n` evenly distributed bytes, and `false` after the last byte.
    pub(super) fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == n - 1
    }

    /// Returns a number from -1 to 1.
    pub(super) fn signed(&mut self) -> f64 {
        f64::from(i16::from_le_bytes(self.array())) / 32768.0
    }

    /// Returns a number with arbitrary bits, or one of the special values of arithmetic.
    pub(super) fn any_number(&mut self) -> f64 {
        const SPECIAL: [f64; 16] = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            0.5,
            1e-3,
            1e3,
            1e6,
            1e-30,
            1e30,
            f64::MIN_POSITIVE,
            f64::MAX,
            5e-324,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
        ];
        if self.one_in(2) {
            f64::from_le_bytes(self.array())
        } else {
            self.pick(&SPECIAL)
        }
    }
}
