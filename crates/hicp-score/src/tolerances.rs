//! The misalignment tolerances of VSD, and counts for them.

/// Number of tolerances: 5 %, 10 %, …, 50 % of the diameter.
pub const N_TOLERANCES: usize = 10;

/// Returns the tolerances as fractions of the diameter, each as k · 0.05.
#[must_use]
pub fn tolerances() -> [f64; N_TOLERANCES] {
    std::array::from_fn(|k| (k + 1) as f64 * 0.05)
}

/// Counts the pixels that agree within each tolerance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AgreementCounts {
    tolerances: [f64; N_TOLERANCES],
    /// `histogram[k]` counts pixels whose smallest tolerance above the difference is the k-th.
    ///
    /// The last entry counts pixels beyond all tolerances.
    histogram: [u64; N_TOLERANCES + 1],
    inverse_diameter: f64,
}

impl AgreementCounts {
    pub(crate) fn new(diameter: f64) -> Self {
        Self {
            tolerances: tolerances(),
            histogram: [0; N_TOLERANCES + 1],
            inverse_diameter: 1.0 / diameter,
        }
    }

    /// Adds a pixel of the intersection whose distances differ by `difference` ≥ 0.
    #[inline]
    pub(crate) fn add(&mut self, difference: f64) {
        let relative = difference * self.inverse_diameter;
        // A first guess, which rounding may put off by one. Then the strict comparison that defines
        // "correct".
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // Clamped. NaN becomes 0 and then climbs to the end: it agrees with nothing.
        let mut k = (relative * 20.0).clamp(0.0, N_TOLERANCES as f64) as usize;
        let correct = |k: usize| relative < self.tolerances[k];
        while k > 0 && correct(k - 1) {
            k -= 1;
        }
        while k < N_TOLERANCES && !correct(k) {
            k += 1;
        }
        self.histogram[k] += 1;
    }

    /// Returns e(τ) for every tolerance.
    ///
    /// It is the share of the union that is not in the intersection or differs by τ or more. An
    /// empty union is an error of 1: nothing is visible where something should be.
    pub(crate) fn errors(&self, union: u64) -> [f64; N_TOLERANCES] {
        let mut sum = 0;
        let correct = std::array::from_fn(|k| {
            sum += self.histogram[k];
            sum
        });
        errors(correct, union)
    }
}

/// Returns the share of `union` pixels that are not `correct`, for every tolerance.
///
/// For an empty union, all are 1.
pub(crate) fn errors(correct: [u64; N_TOLERANCES], union: u64) -> [f64; N_TOLERANCES] {
    correct.map(|correct| {
        if union == 0 {
            // Open: VSD and MVE of an empty union: §III-B. The worst value, since nothing is
            // visible where something should be.
            1.0
        } else {
            (union - correct) as f64 / union as f64
        }
    })
}

/// Returns the mean of the errors over the tolerances.
pub(crate) fn mean(errors: &[f64; N_TOLERANCES]) -> f64 {
    errors.iter().sum::<f64>() / N_TOLERANCES as f64
}
