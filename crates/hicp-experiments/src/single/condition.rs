//! The conditions under which a study presents a case.

use hicp_sim::{Corruption, DepthNoise, RelativeGaussian};

/// The conditions under which a case is presented.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition {
    /// `true` if initial poses are drawn into bins of the initial VSD (§VI-B.1).
    ///
    /// Otherwise their errors have the size in the configuration, by default 6.2 mm and 9.5°.
    pub binned: bool,
    /// The imperfections of the image and the mask.
    pub corruption: Corruption,
    /// The model: 0 for the original, 1 to 4 for a reconstruction.
    pub model_level: u32,
    /// The threshold α, if the study varies it.
    pub alpha: Option<f64>,
}

impl Condition {
    /// Creates the condition of perfect images of the original model.
    pub(super) fn perfect(binned: bool) -> Self {
        let perfect = Self {
            binned,
            corruption: Corruption::default(),
            model_level: 0,
            alpha: None,
        };
        perfect.depth(0)
    }

    /// Sets the depth noise, percent of the depth.
    pub(super) fn depth(mut self, percent: u32) -> Self {
        let percent = f64::from(percent);
        self.corruption.sensor.noise = DepthNoise::Relative(RelativeGaussian { percent });
        self
    }

    pub(super) fn model(mut self, level: u32) -> Self {
        self.model_level = level;
        self
    }

    pub(super) fn alpha(mut self, alpha: f64) -> Self {
        self.alpha = Some(alpha);
        self
    }

    pub(super) fn corrupt(mut self, how: fn(&mut Corruption)) -> Self {
        how(&mut self.corruption);
        self
    }
}
