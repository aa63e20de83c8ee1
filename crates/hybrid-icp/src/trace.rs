//! A record of what ran.

use hicp_icp::{Observer, Outcome, RegimeEvent, StageEvent};

/// One ICP stage that ran.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageRecord {
    /// Decision of the switch, if this is the first stage after one.
    pub switched: Option<RegimeEvent>,
    /// Name of the point selection.
    pub selection: &'static str,
    /// Name of the data association.
    pub association: &'static str,
    /// Name of the error metric.
    pub metric: &'static str,
    /// Number of points selected.
    pub n_source: usize,
    /// Its outcome.
    pub outcome: Outcome,
}

/// An observer that stores one record per ICP stage.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// The stages in the order in which they ran.
    pub stages: Vec<StageRecord>,
    pending: Option<RegimeEvent>,
}

impl Trace {
    /// Creates an empty trace.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Removes all records and keeps the memory.
    pub fn clear(&mut self) {
        self.stages.clear();
        self.pending = None;
    }
}

impl Observer for Trace {
    fn on_regime(&mut self, event: &RegimeEvent) {
        self.pending = Some(*event);
    }

    fn on_stage_end(&mut self, event: &StageEvent<'_>) {
        self.stages.push(StageRecord {
            switched: self.pending.take(),
            selection: event.selection,
            association: event.association,
            metric: event.metric,
            n_source: event.n_source,
            outcome: *event.outcome,
        });
    }
}
