//! Medians from a histogram.

/// Number of bins, and the share of the diameter that they cover.
const BINS: usize = LAST as usize + 1;
const LAST: u8 = 99;
const COVERED: f32 = 0.5;

/// A median of shares of the diameter.
pub(crate) struct Median {
    bins: [u32; BINS],
}

impl Median {
    /// Creates a median without values.
    pub(crate) const fn new() -> Self {
        Self { bins: [0; BINS] }
    }

    /// Adds the values of a bin.
    pub(crate) fn add(&mut self, bin: Bin) {
        self.bins[usize::from(bin.0)] += 1;
    }

    /// Returns the median, interpolated within its bin; 0 without values.
    pub(crate) fn get(&self) -> f64 {
        let half = f64::from(self.bins.iter().sum::<u32>()) / 2.0;
        let mut below = 0.0;
        for (bin, count) in self.bins.iter().enumerate() {
            let count = f64::from(*count);
            if count > 0.0 && below + count >= half {
                let place = bin as f64 + (half - below) / count;
                return place * f64::from(COVERED) / BINS as f64;
            }
            below += count;
        }
        0.0
    }
}

/// Lengths in meters as shares of the diameter.
#[derive(Clone, Copy)]
pub(crate) struct Scale {
    bins_per_meter: f32,
}

/// The bin of a share.
#[derive(Clone, Copy)]
pub(crate) struct Bin(u8);

impl Scale {
    /// Creates the scale of a diameter in meters.
    pub(crate) fn new(diameter: f32) -> Self {
        Self {
            bins_per_meter: BINS as f32 / (COVERED * diameter),
        }
    }

    /// Returns the bin of the absolute value of a length in meters.
    pub(crate) fn bin(self, meters: f32) -> Bin {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Saturates; NaN is 0.
        let bin = (meters.abs() * self.bins_per_meter) as u8;
        Bin(bin.min(LAST))
    }
}
