//! A registered pose, and what the image says about it.

use hicp_core::Isometry3;
use hicp_icp::Quality;
use hicp_score::Evidence;

/// Distance within which two surfaces agree in [`Evidence`], in diameters.
const AGREES: f64 = 0.1;
/// Median distance from the mean of a normal distribution of deviation 1.
const MEDIAN: f64 = 0.6745;
/// Factor on the square of [`Evidence::noise`]. It makes up for the pixels that do not agree, which
/// are not part of the noise and are many if it is strong.
const CUT: f64 = 25.0;
/// Confidence of a pose that is as good as a right one usually is.
const SURE: f64 = 0.9;
/// The same for a pose that was expected, if the noise is at most [`LOW_NOISE`].
const LIKELY: f64 = 0.7;
/// Confidence of a pose that was expected and is not certain.
const EXPECTED: f64 = 0.3;
/// Noise at which a wrong pose rarely agrees with the image, in diameters.
const LOW_NOISE: f64 = 0.07;
/// Smallest share of the pixels of a held object that agree.
const HELD: f64 = 0.4;
/// Largest share of them that the camera may see through.
const SEEN_THROUGH: f64 = 0.1;
/// Factor by which the noise may exceed that of the images before.
const MAX_RISE: f64 = 1.1;

/// A registered pose with its evidence.
///
/// The limits were chosen on simulated sequences of the tuning objects.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub(super) pose: Isometry3<f64>,
    pub(super) quality: Option<Quality>,
    /// The MVE in the image.
    pub(super) mve: f64,
    pub(super) evidence: Evidence,
    /// The probability that the pose is right, by the evidence alone.
    pub(super) confidence: f64,
    /// Standard deviation of the depth noise that the evidence is judged by, in diameters.
    noise: f64,
}

impl Found {
    /// Judges the evidence at a pose, and the probability that it is right.
    ///
    /// `noise` is that of the images before, in diameters.
    ///
    /// Another surface can look noisier than the object, which would excuse its contradictions. The
    /// noise of the images before therefore limits the measured one.
    pub(super) fn new(
        pose: Isometry3<f64>,
        quality: Option<Quality>,
        (mve, evidence, confidence): (f64, Evidence, f64),
        noise: Option<f64>,
    ) -> Self {
        let limit = noise.map_or(f64::INFINITY, |noise| MAX_RISE * noise);
        Self {
            pose,
            quality,
            mve,
            evidence,
            confidence,
            noise: measured_noise(&evidence).min(limit),
        }
    }

    /// Returns the share of the visible pixels that contradict the pose, without those of noise.
    fn contradiction(&self) -> f64 {
        let e = &self.evidence;
        let outside = self.outside();
        let against = (e.contradicts() - outside * e.agrees / (1.0 - 2.0 * outside)).max(0.0);
        against / (e.agrees + e.contradicts()).max(1e-9)
    }

    /// Returns the share of a surface that noise moves in front of the tolerance of agreement.
    ///
    /// As many pixels are moved behind it. The noise is normally distributed.
    fn outside(&self) -> f64 {
        let tolerance = AGREES / self.noise.max(1e-3);
        // The upper tail of the normal distribution, to 2 % of its value below three deviations.
        0.5 * (-0.717 * tolerance - 0.416 * tolerance * tolerance).exp()
    }

    /// Returns the unexplained share of the pixels around the object, without those of noise.
    pub(super) fn unexplained(&self) -> f64 {
        self.evidence.unexplained - 2.0 * self.outside()
    }

    /// Returns whether the silhouette and the measured surface cover each other, up to two shares.
    ///
    /// It replaces the contour for sensors that measure nothing next to an edge.
    fn fills(&self, contradiction: f64, unexplained: f64) -> bool {
        self.contradiction() < contradiction && self.unexplained() < unexplained
    }

    /// Returns the supported share of the contour; 0 if nothing was measured next to it.
    fn contour(&self) -> f64 {
        self.evidence.contour.unwrap_or(0.0)
    }

    /// Returns how well a pose fits, to compare poses in one image.
    pub(super) fn merit(&self) -> f64 {
        let e = &self.evidence;
        e.agrees - e.contradicts() - 0.5 * e.unexplained + 0.2 * self.contour()
    }

    /// Returns the logarithm of the odds that the pose is right.
    pub(super) fn log_odds(&self) -> f64 {
        (self.confidence / (1.0 - self.confidence).max(1e-6)).ln()
    }

    /// Returns whether the image shows the object at the pose, given that it was expected there.
    ///
    /// The confidence excuses an unexplained surface around the object, such as a table, and
    /// contradictions such as edges that a sensor measures at a wrong place.
    pub(super) fn explains(&self) -> bool {
        let ends = self.contour() > 0.2 || self.fills(0.06, 0.1);
        let alone = ends && self.unexplained() < 0.5;
        let expected = self.confidence > EXPECTED;
        let limit = if expected { 0.45 } else { 0.2 };
        let agrees = self.evidence.agrees > 0.15 && self.contradiction() < limit;
        agrees && (alone || expected)
    }

    /// Returns whether the image may show the object at the pose, given that it was expected there.
    ///
    /// In contrast to [`Found::explains`], a surface that continues the object, such as a hand that
    /// holds it, does not contradict the pose.
    pub(super) fn may_be_held(&self) -> bool {
        let e = &self.evidence;
        e.agrees > HELD && e.seen_through < SEEN_THROUGH * e.agrees
    }

    /// Returns whether most of the object is hidden at the pose.
    pub(super) fn is_hidden(&self) -> bool {
        self.evidence.hidden > 0.7
    }

    /// Returns whether the pose is as good as a right one usually is.
    ///
    /// A seen contour excuses an unexplained surface around the object, such as a table. If the
    /// noise is low, the contour need not be seen, because many sensors measure nothing next to
    /// it. The object must only not be a small part of a larger surface.
    pub(super) fn is_sure(&self) -> bool {
        let (contour, unexplained) = (self.contour(), self.unexplained());
        let ends = contour > 0.6 || (contour > 0.45 && unexplained < 0.15);
        let usual = (ends || self.fills(0.04, 0.05)) && self.confidence >= SURE;
        let accurate = self.noise < LOW_NOISE && (contour > 0.2 || unexplained < 0.6);
        let likely = accurate && self.confidence >= LIKELY;
        self.explains() && self.contradiction() < 0.2 && (usual || likely)
    }

    /// Returns whether no other pose needs to be tried.
    pub(super) fn is_clear(&self) -> bool {
        self.is_sure() && self.contradiction() < 0.03
    }

    /// Returns whether the image shows the object at a pose where it was not expected.
    pub(super) fn stands_alone(&self) -> bool {
        let ends = self.contour() > 0.7 || self.fills(0.03, 0.05);
        let fits = self.evidence.agrees > 0.3 && self.fills(0.12, 0.15);
        fits && ends && self.confidence >= SURE
    }

    /// Returns whether the object was found, and no other pose needs to be tried.
    pub(super) fn is_unmistakable(&self) -> bool {
        self.stands_alone() && self.is_clear()
    }
}

/// Returns the standard deviation of the depth noise at a pose, in diameters.
pub(super) fn measured_noise(evidence: &Evidence) -> f64 {
    evidence.noise / MEDIAN * (1.0 + CUT * evidence.noise * evidence.noise)
}
