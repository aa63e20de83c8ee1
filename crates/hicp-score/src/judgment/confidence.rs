//! The probability that a pose is right, and its expected error.

use hicp_core::{Context, Isometry3};

use crate::judgment::evidence::Evidence;
use crate::judgment::grid::Grid;
use crate::judgment::insides::find_insides;
use crate::judgment::misfit::Misfit;
use crate::judgment::network::{BASE, N_FEATURES, UNITS};

/// Smallest distance, in diameters, that the logarithm of a distance tells from 0.
const FINEST: f64 = 0.002;
/// Number of pixels from which on more make a pose no more certain. Of larger objects, the evidence
/// compares a part of the pixels.
const MOST_PIXELS: f64 = 22_000.0;
/// Least distance of the object, in diameters. Surfaces that are nearer agree with every pose.
const NEAREST: f64 = 0.1;
/// Largest magnitude of a feature.
const LIMIT: f64 = 20.0;
/// The log-odds of a pose near its initial one: an offset and the factor of the network's, then the
/// same per logarithm of the number of poses. Printed by the example `confidence -- near` when no
/// pose counted more than 1. Hardly any initial pose of that fit is at a look-alike, so the fit
/// would trust a pose that another one beats.
const NEAR_ODDS: [f64; 4] = [0.434, 1.091, -0.811, -0.215];
/// The logarithms of its errors relative to the network's: an offset, and the factor of the
/// logarithm of the number of poses. First in diameters, then in degrees.
const NEAR_ERRORS: [[f64; 2]; 2] = [[-0.10, 0.28], [-0.12, 0.37]];

/// The calibrated probability that a pose is right, and the error to expect.
///
/// A pose is right if no point of the surface is farther from its true place than a tenth of the
/// diameter ([`mssd`](crate::mssd) up to declared symmetries).
///
/// The model is a network with a few hidden units. Its features are the [`Evidence`], the
/// [`Misfit`], the score, and the number of poses that look alike. It is fitted on simulated cases
/// of some 1,000 invented objects of 100 pixels or more, with imperfect masks, noise, systematic
/// errors of the sensor, images cut along the mask, occlusion, look-alikes, walls and wrong classes
/// (`cargo run --release -p hicp-tests --example confidence -- fit 16000`). A probability is right
/// on average over such cases.
///
/// ```
/// use hicp_score::Confidence;
/// assert_eq!(Confidence::none(0.2).probability, 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Confidence {
    /// Probability that the pose is right, 0 to 1.
    pub probability: f64,
    /// Typical largest distance of a surface point from its true place, meters.
    pub error_meters: f64,
    /// Typical rotation error, degrees.
    pub error_degrees: f64,
}

impl Confidence {
    /// The names of [`Confidence::features`].
    pub const FEATURES: [&'static str; N_FEATURES] = [
        "ahead",
        "rim_open",
        "rim_ahead",
        "log_systematic",
        "bias",
        "weak",
        "unexplained",
        "log_sigma",
        "hidden",
        "inside",
        "unmeasured",
        "mask_missing",
        "log_pixels",
        "mve",
        "log_look_alikes",
    ];

    /// Measures the evidence at a pose whose mean VSD estimate is `mve`, and the confidence.
    ///
    /// `look_alikes` is the number of other poses that may be the right one, because they explain
    /// the image as well and nothing is known of the initial pose. With 0, no other pose is
    /// considered. For a pose near an initial one, pass 0, and then call
    /// [`near_initial`](Self::near_initial).
    ///
    /// Without a model, an image or a rendered pixel, the probability is 0. It also is 0 if the
    /// model's diameter is impossible, or more than ten times the distance of the surface, because
    /// the evidence is measured in diameters. If the render covers the whole image, it is 0, too:
    /// no part of the silhouette is compared. This occurs with a mesh of another unit.
    ///
    /// Cost: one render (shared with other components that use this pose) and about 40 µs.
    /// Allocates nothing.
    #[must_use]
    pub fn at(
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
        mve: f64,
        look_alikes: f64,
    ) -> (Evidence, Self) {
        let diameter = context.problem.model().map_or(0.0, |m| m.diameter());
        let (Some((model, observation)), Some(view)) =
            (context.problem.sides(), context.view(camera_from_object))
        else {
            return (Evidence::default(), Self::none(diameter));
        };
        let mut grid = Grid::new(diameter);
        grid.compare(observation, view);
        let view_area = view.region().area();
        find_insides(&mut grid);
        let evidence = Evidence::of(&grid);
        let of_image = view_area == observation.camera().region().area();
        let cells = grid.width * grid.height * grid.step.pow(2);
        let judged = model.has_possible_diameter()
            && grid.distance() >= NEAREST * diameter
            && !(of_image && evidence.pixels == cells);
        let confidence = if judged && evidence.agrees > 0.0 {
            let features = Self::features(&evidence, &Misfit::of(&grid), mve, look_alikes);
            Self::of(&features, diameter)
        } else {
            Self::none(diameter)
        };
        (evidence, confidence)
    }

    /// The confidence in a pose that nothing in the image supports.
    ///
    /// The expected errors are the diameter, in meters, and a half turn.
    #[must_use]
    pub fn none(diameter: f64) -> Self {
        Self {
            probability: 0.0,
            error_meters: diameter,
            error_degrees: 180.0,
        }
    }

    /// Corrects the confidence in a pose that is near its initial pose (`hicp_icp::is_near`).
    ///
    /// `self` must be the confidence of [`Confidence::at`] with 0 look-alikes. `look_alikes` is the
    /// number of other poses that explain the image as well. An initial pose makes them less likely
    /// but does not exclude them, so they lower the probability by less than in [`Confidence::at`].
    /// A probability of 0 does not change.
    #[must_use]
    pub fn near_initial(self, look_alikes: f64) -> Self {
        if self.probability == 0.0 {
            return self;
        }
        let log_poses = look_alikes.ln_1p();
        let log_odds = (self.probability / (1.0 - self.probability)).ln();
        let [offset, factor, lower, flatter] = NEAR_ODDS;
        let log_odds = offset + lower * log_poses + (factor + flatter * log_poses) * log_odds;
        let [meters, degrees] =
            NEAR_ERRORS.map(|[offset, factor]| (offset + factor * log_poses).exp());
        Self {
            probability: 1.0 / (1.0 + (-log_odds).exp()),
            error_meters: self.error_meters * meters,
            error_degrees: (self.error_degrees * degrees).min(180.0),
        }
    }

    /// Returns the features of the model, in the order of [`Confidence::FEATURES`].
    #[must_use]
    pub fn features(
        evidence: &Evidence,
        misfit: &Misfit,
        mve: f64,
        look_alikes: f64,
    ) -> [f64; N_FEATURES] {
        let seen = 1.0 - evidence.hidden - evidence.unmeasured;
        [
            misfit.ahead,
            misfit.rim_open,
            misfit.rim_ahead,
            (misfit.systematic + FINEST).ln(),
            misfit.bias.abs(),
            misfit.weak,
            misfit.unexplained,
            (misfit.sigma + FINEST).ln(),
            evidence.hidden,
            evidence.inside,
            evidence.unmeasured,
            evidence.mask_missing,
            (evidence.pixels as f64 * seen).clamp(1.0, MOST_PIXELS).ln(),
            mve,
            look_alikes.ln_1p(),
        ]
    }

    /// Evaluates the model for a `diameter` in meters.
    #[must_use]
    pub fn of(features: &[f64; N_FEATURES], diameter: f64) -> Self {
        let mut sums = BASE;
        for (bias, weights, outputs) in &UNITS {
            let products = weights.iter().zip(features);
            let products = products.map(|(w, x)| w * x.clamp(-LIMIT, LIMIT));
            // The maximum of NaN and 0 is 0.
            let value = (bias + products.sum::<f64>()).max(0.0);
            for (sum, output) in sums.iter_mut().zip(outputs) {
                *sum += output * value;
            }
        }
        let [log_odds, log_error, log_degrees] = sums;
        Self {
            probability: 1.0 / (1.0 + (-log_odds).exp()),
            error_meters: log_error.exp().min(1.0) * diameter,
            error_degrees: log_degrees.exp().min(180.0),
        }
    }
}
