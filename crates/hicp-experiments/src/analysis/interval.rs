//! Estimates with intervals.

use std::fmt;

/// An estimate with its 95 % interval: the 2.5th and 97.5th percentiles of the bootstrap.
///
/// If all bootstrap samples of a share are equal, the interval is the one of [`never_seen`].
///
/// Displays as `estimate [low, high]`. The default precision is three digits; `{:+}` adds signs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The estimate from all rows.
    pub estimate: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Number of cases behind the estimate.
    pub cases: usize,
}

impl Interval {
    /// Returns estimate, lower and upper end.
    pub(crate) fn ends(self) -> [f64; 3] {
        [self.estimate, self.low, self.high]
    }

    /// Returns estimate and interval of a share in percent.
    pub(crate) fn percent(self) -> String {
        let [estimate, low, high] = self.ends().map(percent);
        format!("{estimate} [{low}, {high}]")
    }

    /// Returns the interval of the value minus a constant.
    pub(crate) fn minus(self, constant: f64) -> Self {
        self.map(|x| x - constant)
    }

    /// Returns the interval of a constant minus the value.
    pub(crate) fn from(self, constant: f64) -> Self {
        self.map(|x| constant - x)
    }

    fn map(self, change: impl Fn(f64) -> f64) -> Self {
        let [estimate, a, b] = self.ends().map(change);
        Self {
            estimate,
            low: a.min(b),
            high: a.max(b),
            ..self
        }
    }
}

impl fmt::Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = f.precision().unwrap_or(3);
        let [estimate, low, high] = self.ends();
        match f.sign_plus() {
            true => write!(
                f,
                "{estimate:+.digits$} [{low:+.digits$}, {high:+.digits$}]"
            ),
            false => write!(f, "{estimate:.digits$} [{low:.digits$}, {high:.digits$}]"),
        }
    }
}

/// Returns a share in percent with one digit. Zero has no sign.
pub(crate) fn percent(share: f64) -> String {
    let percent = format!("{:.1} %", 100.0 * share);
    match &*percent {
        "-0.0 %" => "0.0 %".to_owned(),
        _ => percent,
    }
}

/// Returns the upper 95 % bound of a share that none of `cases` independent cases shows.
///
/// This is 1 − 0.05^(1/n), the exact one-sided (Clopper–Pearson) bound, about 3/n. The bootstrap
/// gives no interval if all cases are equal.
#[must_use]
pub fn never_seen(cases: usize) -> f64 {
    1.0 - 0.05_f64.powf(1.0 / cases as f64)
}

/// Returns a quantile of sorted values, interpolated between neighbors.
///
/// If there are no values, returns `None`.
#[must_use]
pub fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let place = share * last as f64;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // Between 0 and the last index.
    let below = place.floor() as usize;
    let above = (below + 1).min(last);
    let part = place - below as f64;
    Some(sorted[below] * (1.0 - part) + sorted[above] * part)
}
