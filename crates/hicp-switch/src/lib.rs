//! Dynamic Switching: the trait [`Switcher`], thresholds on a score, and stages that switch.
//!
//! **Should you use this crate?** Yes, to select ICP stages by the image. To refine poses with one
//! call, use `hybrid-icp`.
//!
//! ```
//! use hicp_icp::Stage;
//! use hicp_score::MeanVsd;
//! use hicp_switch::{PAPER_ALPHA, Switch, Threshold};
//!
//! /// Dynamic Switching between any two stages.
//! fn switching(aligned: impl Stage, misaligned: impl Stage) -> impl Stage {
//!     Switch {
//!         switcher: Threshold { score: MeanVsd::paper(), alpha: PAPER_ALPHA },
//!         aligned,
//!         misaligned,
//!     }
//! }
//! ```

mod switch;
mod switch_until_stall;
mod switcher;
mod threshold;

pub use hicp_icp::{Regime, RegimeEvent};
pub use switch::{Switch, SwitchAmong};
pub use switch_until_stall::SwitchUntilStall;
pub use switcher::Switcher;
pub use threshold::{PAPER_ALPHA, Threshold, Thresholds};
