//! The conditions under which a study presents a case.

/// The conditions under which a case is presented.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition {
    /// Whether the initial pose is drawn into bins of the initial VSD (§VI-B.1), or is 6.2 mm and
    /// 9.5° off.
    pub binned: bool,
    /// Standard deviation of the depth noise, percent of the depth.
    pub depth_percent: f64,
    /// 0 for the original model, 1 to 4 for a reconstruction.
    pub model_level: u32,
    /// The threshold α, if it is what is studied.
    pub alpha: Option<f64>,
    /// The fault of the mask.
    pub mask: MaskFault,
}

/// The fault of a condition's mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaskFault {
    /// None.
    None,
    /// Eroded by 3 pixels.
    Eroded,
    /// Dilated by 3 pixels, over a wall 10 cm behind the object.
    Dilated,
    /// A straight cut removed 20 % of it.
    Missing,
    /// A board in front of the object hides 30 % of it.
    Occluded,
}

/// Perfect images of the original model, and binned initial poses.
pub(super) const PERFECT: Condition = Condition {
    binned: true,
    depth_percent: 0.0,
    model_level: 0,
    alpha: None,
    mask: MaskFault::None,
};

/// The same from initial poses that are 6.2 mm and 9.5° off.
pub(super) const OFF: Condition = Condition {
    binned: false,
    ..PERFECT
};

impl Condition {
    pub(super) fn depth(mut self, percent: u32) -> Self {
        self.depth_percent = f64::from(percent);
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

    pub(super) fn mask(mut self, fault: MaskFault) -> Self {
        self.mask = fault;
        self
    }
}
