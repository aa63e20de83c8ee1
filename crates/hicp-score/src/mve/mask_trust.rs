//! The trust in the pixels of a mask.

/// The trust in the mask of an observation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum MaskTrust {
    /// Every masked pixel shows the object, and no other pixel does, as in §IV-A.
    #[default]
    Exact,
    /// The mask of a detector: too large, too small, soft, or a box.
    ///
    /// A pixel counts the more, the more certain it is to show the object:
    ///
    /// - Its weight rises from 0 at the border of the mask to 1 well inside it. It rises at once if
    ///   the depth has a step at the border, so that the mask is right.
    /// - Pixels on the plane around the mask, such as a table, have no weight. If there is such a
    ///   plane, the weight rises from 4 pixels outside the mask on, because the mask may be too
    ///   small.
    /// - Surfaces that continue outside the mask are other objects and have no weight. If the mask
    ///   is a box, surfaces that end inside it have the full weight. This rule applies only if
    ///   there is a plane around the mask and the border of the mask is uncertain.
    /// - Pixels whose depth differs from that of the mask by more than the diameter have no weight.
    ///
    /// A rendered pixel with a low weight counts fully if the camera sees through it, or if it lies
    /// inside a surface that the object touches. If a nearer surface hides it, it does not count.
    /// Otherwise it counts half.
    ///
    /// Sensors measure nothing along edges, but the mask shows the object there. A masked pixel
    /// without a measured depth counts half against a pose that does not cover it, if the border of
    /// the mask is certain and the mask is not a box.
    ///
    /// Some masks are cut to the pixels with a depth, so that the object is larger than its mask.
    /// If most pixels along the outside of the border have no depth, and most along its inside have
    /// one, pixels without a depth up to 10 pixels outside the mask do not count. If most pixels
    /// farther around have no depth, either, this rule does not apply: the background may be too
    /// far away to be measured.
    ///
    /// Cost: about that of one more score, once per observation and diameter.
    Imperfect,
}
