//! Arbitrary bytes as a source of choices.

/// Takes choices from the front; once the bytes are used up, every choice is the first one.
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

    /// A number from 0 to `n` - 1, for `n` up to 256.
    pub(super) fn below(&mut self, n: usize) -> usize {
        usize::from(self.byte()) % n.max(1)
    }

    pub(super) fn pick<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())]
    }

    /// True once in `n` bytes that are spread evenly; false when the bytes are used up.
    pub(super) fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == n - 1
    }

    /// From -1 to 1.
    pub(super) fn signed(&mut self) -> f64 {
        f64::from(i16::from_le_bytes(self.array())) / 32768.0
    }

    /// Any bits, or one of the values at which arithmetic turns.
    pub(super) fn any_number(&mut self) -> f64 {
        const TURNS: [f64; 16] = [
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
            self.pick(&TURNS)
        }
    }
}
