//! Correctness of estimates, and recalls by BOP's matching rules.

use crate::tolerances::{N_TOLERANCES, tolerances};

/// Number of thresholds of correctness per error function.
pub const N_THRESHOLDS: usize = 10;

/// The thresholds of MSSD in millimeters, for robots that need an absolute accuracy.
pub const MSSD_MM: [f64; N_THRESHOLDS] = [2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0, 20.0];

/// The image width, in pixels, for which BOP defines its thresholds of MSPD.
const MSPD_WIDTH: f64 = 640.0;

/// Share of the diameter below which an ADD or ADI is correct.
const AD_THRESHOLD: f64 = 0.1;

/// All errors of an estimate with respect to one instance.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PoseErrors {
    /// e_VSD(τ); see [`bop_vsd`](crate::bop_vsd).
    pub vsd: [f64; N_TOLERANCES],
    /// MSSD, meters.
    pub mssd_m: f64,
    /// MSPD, pixels of the test image.
    pub mspd_px: f64,
    /// ADD, meters.
    pub add_m: f64,
    /// ADI, meters.
    pub adi_m: f64,
    /// |t_est − t_gt|, meters.
    ///
    /// If it is a diameter or more, BOP sets MSSD, ADD and ADI to infinity; see
    /// [`PoseErrors::is_apart`].
    pub translation_m: f64,
}

impl PoseErrors {
    /// Returns whether the object's origins are a diameter or more apart.
    ///
    /// MSSD, ADD and ADI then count as infinite. The diameter is in meters.
    #[must_use]
    pub fn is_apart(&self, diameter: f64) -> bool {
        // A translation of NaN counts as apart.
        self.translation_m.is_nan() || self.translation_m >= diameter
    }
}

/// The estimates of one object in one image with respect to its instances.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TargetErrors {
    /// Diameter of the object, meters.
    pub diameter_m: f64,
    /// Width of the test image, pixels.
    pub image_width: u32,
    /// `true` if AD means ADI for this object, `false` for ADD.
    pub symmetric: bool,
    /// Number of instances to find.
    pub instances: usize,
    /// One list per estimate, by descending score ([`top_estimates`]), of its errors for every
    /// instance.
    pub estimates: Vec<Vec<PoseErrors>>,
}

impl TargetErrors {
    /// Returns for every instance the matched estimate, if its `error` is below `threshold`.
    ///
    /// See [`match_instances`].
    #[must_use]
    pub fn matches(
        &self,
        threshold: f64,
        error: impl Fn(&PoseErrors) -> f64,
    ) -> Vec<Option<usize>> {
        let counts = (self.estimates.len(), self.instances);
        assign(counts, threshold, |estimate, instance| {
            let errors = self.estimates[estimate].get(instance);
            errors.map_or(f64::INFINITY, &error)
        })
    }

    /// Returns the ADI, in meters, of the estimate that remains for each instance.
    ///
    /// Estimates select the nearest free instance by ADI, in the order of their scores. An instance
    /// without an estimate has `None`.
    #[must_use]
    pub fn adi_of_instances(&self) -> Vec<Option<f64>> {
        let matched = self.matches(f64::INFINITY, |e| e.adi_m);
        let matched = matched.into_iter().enumerate();
        matched
            .map(|(instance, estimate)| Some(self.estimates[estimate?][instance].adi_m))
            .collect()
    }

    fn found(&self, threshold: f64, error: impl Fn(&PoseErrors) -> f64) -> usize {
        self.matches(threshold, error)
            .iter()
            .filter(|m| m.is_some())
            .count()
    }
}

/// Returns the matched estimate of every instance.
///
/// The matching is greedy by descending score. Each estimate selects the free instance with the
/// lowest error strictly below the threshold, and the first of equals. `errors[e][i]` is the error
/// of estimate e, in descending order of score, for instance i. Cost: O(estimates × instances).
///
/// ```
/// // The better estimate selects the instance nearest to both. The other one gets the next.
/// let errors = [vec![0.1, 0.4], vec![0.0, 0.3]];
/// assert_eq!(hicp_score::match_instances(&errors, 2, 0.5), [Some(0), Some(1)]);
/// assert_eq!(hicp_score::match_instances(&errors, 2, 0.3), [Some(0), None]);
/// ```
#[must_use]
pub fn match_instances(
    errors: &[Vec<f64>],
    instances: usize,
    threshold: f64,
) -> Vec<Option<usize>> {
    assign(
        (errors.len(), instances),
        threshold,
        |estimate, instance| {
            let error = errors[estimate].get(instance);
            error.copied().unwrap_or(f64::INFINITY)
        },
    )
}

fn assign(
    (estimates, instances): (usize, usize),
    threshold: f64,
    error: impl Fn(usize, usize) -> f64,
) -> Vec<Option<usize>> {
    let mut taken = vec![None; instances];
    for estimate in 0..estimates {
        let mut best = (threshold, None);
        for (instance, by) in taken.iter().enumerate() {
            let error = error(estimate, instance);
            if by.is_none() && error < best.0 {
                best = (error, Some(instance));
            }
        }
        if let Some(instance) = best.1 {
            taken[instance] = Some(estimate);
        }
    }
    taken
}

/// Returns the indices of the `count` estimates with the highest scores, highest first.
///
/// Of equal scores, the first precedes.
#[must_use]
pub fn top_estimates(scores: &[f64], count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..scores.len()).collect();
    order.sort_by(|a, b| scores[*b].total_cmp(&scores[*a]));
    order.truncate(count);
    order
}

/// Returns the indices of the `count` instances with the largest visible fractions, largest first.
///
/// Of equal fractions, the first precedes. BOP requires at most `inst_count` instances of an object
/// in an image, the most visible ones.
#[must_use]
pub fn most_visible(fractions: &[f64], count: usize) -> Vec<usize> {
    top_estimates(fractions, count)
}

/// Recalls over any number of targets: of an object, of a scene, of a dataset.
///
/// A recall is the number of matched instances divided by the number of all instances, so one
/// without an estimate counts as not found. Recalls of several parts are not averaged:
/// [`Recalls::merge`] adds their instances.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Recalls {
    instances: usize,
    missing: usize,
    vsd: [[usize; N_THRESHOLDS]; N_TOLERANCES],
    mssd: [usize; N_THRESHOLDS],
    mspd: [usize; N_THRESHOLDS],
    ad: usize,
    /// Instances of objects that are not symmetric, and those found by ADD.
    asymmetric: usize,
    add: usize,
    mssd_mm: [usize; N_THRESHOLDS],
}

impl Recalls {
    /// Counts a target.
    ///
    /// An estimate is correct if its error is strictly below the threshold θ:
    ///
    /// - VSD: 0.05, 0.10, …, 0.50 at each of its tolerances.
    /// - MSSD: the same, times the diameter.
    /// - MSPD: 5, 10, …, 50 pixels in an image 640 pixels wide.
    /// - AD (ADI for symmetric objects, otherwise ADD) and ADD: a tenth of the diameter.
    /// - MSSD in millimeters: 2, 4, …, 20.
    pub fn count(&mut self, target: &TargetErrors) {
        self.instances += target.instances;
        self.missing += target.instances.saturating_sub(target.estimates.len());
        let diameter = target.diameter_m;
        let unless_apart = |errors: &PoseErrors, error: f64| {
            if errors.is_apart(diameter) {
                f64::INFINITY
            } else {
                error
            }
        };
        let mspd_scale = MSPD_WIDTH / f64::from(target.image_width);
        for (found, mm) in self.mssd_mm.iter_mut().zip(MSSD_MM) {
            *found += target.found(1e-3 * mm, |e| unless_apart(e, e.mssd_m));
        }
        if !target.symmetric {
            self.asymmetric += target.instances;
            self.add += target.found(AD_THRESHOLD, |e| unless_apart(e, e.add_m / diameter));
        }
        for (index, threshold) in tolerances().into_iter().enumerate() {
            for (tolerance, found) in self.vsd.iter_mut().enumerate() {
                found[index] += target.found(threshold, |e| e.vsd[tolerance]);
            }
            self.mssd[index] += target.found(threshold, |e| unless_apart(e, e.mssd_m / diameter));
            let pixels = 100.0 * threshold;
            self.mspd[index] += target.found(pixels, |e| e.mspd_px * mspd_scale);
        }
        self.ad += target.found(AD_THRESHOLD, |e| {
            let ad = if target.symmetric { e.adi_m } else { e.add_m };
            unless_apart(e, ad / diameter)
        });
    }

    /// Adds the instances of another part.
    pub fn merge(&mut self, other: &Self) {
        let sum = |a: &mut [usize], b: &[usize]| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        self.instances += other.instances;
        self.missing += other.missing;
        self.ad += other.ad;
        self.asymmetric += other.asymmetric;
        self.add += other.add;
        sum(&mut self.mssd_mm, &other.mssd_mm);
        sum(self.vsd.as_flattened_mut(), other.vsd.as_flattened());
        sum(&mut self.mssd, &other.mssd);
        sum(&mut self.mspd, &other.mspd);
    }

    /// Number of instances to find.
    #[must_use]
    pub fn instances(&self) -> usize {
        self.instances
    }

    /// Number of instances in excess of the estimates, which no threshold can match.
    #[must_use]
    pub fn missing(&self) -> usize {
        self.missing
    }

    /// AR_VSD: the mean recall over 10 tolerances and 10 thresholds.
    ///
    /// Like all recalls, it is 0 without instances.
    #[must_use]
    pub fn vsd(&self) -> f64 {
        self.mean(self.vsd.as_flattened())
    }

    /// AR_MSSD: the mean recall over its thresholds.
    #[must_use]
    pub fn mssd(&self) -> f64 {
        self.mean(&self.mssd)
    }

    /// AR_MSPD: the mean recall over its thresholds.
    #[must_use]
    pub fn mspd(&self) -> f64 {
        self.mean(&self.mspd)
    }

    /// AR = (AR_VSD + AR_MSSD + AR_MSPD) / 3, BOP's score of a dataset.
    #[must_use]
    pub fn average(&self) -> f64 {
        (self.vsd() + self.mssd() + self.mspd()) / 3.0
    }

    /// Recall of ADD(-S) below a tenth of the diameter.
    #[must_use]
    pub fn ad(&self) -> f64 {
        self.mean(&[self.ad])
    }

    /// Recall of MSSD below a tenth of the diameter.
    #[must_use]
    pub fn mssd_below_tenth(&self) -> f64 {
        // The second of the thresholds 0.05, 0.10, …
        self.mean(&self.mssd[1..2])
    }

    /// Recall of ADD below a tenth of the diameter, over the objects that are not symmetric.
    ///
    /// `None` without such objects.
    #[must_use]
    pub fn add(&self) -> Option<f64> {
        (self.asymmetric > 0).then(|| self.add as f64 / self.asymmetric as f64)
    }

    /// Recalls of MSSD below [`MSSD_MM`].
    #[must_use]
    pub fn mssd_mm(&self) -> [f64; N_THRESHOLDS] {
        self.mssd_mm.map(|found| self.mean(&[found]))
    }

    fn mean(&self, found: &[usize]) -> f64 {
        let all = self.instances * found.len();
        if all == 0 {
            0.0
        } else {
            found.iter().sum::<usize>() as f64 / all as f64
        }
    }
}
