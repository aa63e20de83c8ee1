//! Constants of the stages that the comparison with other libraries runs.

use hybrid_icp::icp::{IterationLimit, SmallMotion};

/// Maximum distance of a pair in all stages, meters.
///
/// It is larger than the error of any start. The other libraries use the same value.
pub const GATE_METERS: f32 = 0.03;

/// Stop rule: the next increment is below 0.1 mm and 0.01°, or there were 100 evaluations.
pub const STOP: (SmallMotion, IterationLimit) = (
    SmallMotion {
        translation_meters: 1e-4,
        rotation_degrees: 0.01,
    },
    IterationLimit(100),
);
