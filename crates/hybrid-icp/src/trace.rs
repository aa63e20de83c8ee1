//! A record of what ran.

use hicp_icp::{Observer, Outcome, RegimeEvent, StageEvent};

/// One ICP stage that ran.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct StageRecord {
    /// Decision of the switch, if this is the first stage after one.
    pub switched: Option<RegimeEvent>,
    /// Name of the point selection.
    pub selection: &'static str,
    /// Name of the data association.
    pub association: &'static str,
    /// Names of the outlier filters and weights, in order.
    pub filters: Vec<&'static str>,
    /// Name of the error metric.
    pub metric: &'static str,
    /// Names of the stop rules, in order.
    pub stop_rules: Vec<&'static str>,
    /// Number of points selected.
    pub n_source: usize,
    /// Its outcome.
    pub outcome: Outcome,
}

impl From<&StageEvent<'_>> for StageRecord {
    fn from(event: &StageEvent<'_>) -> Self {
        Self {
            switched: None,
            selection: event.selection,
            association: event.association,
            filters: event.filters.to_vec(),
            metric: event.metric,
            stop_rules: event.stop_rules.to_vec(),
            n_source: event.n_source,
            outcome: *event.outcome,
        }
    }
}

/// An observer that stores one record per ICP stage.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Trace {
    /// The stages in the order in which they ran.
    pub stages: Vec<StageRecord>,
    #[cfg_attr(feature = "serde", serde(skip))]
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
        let mut record = StageRecord::from(event);
        record.switched = self.pending.take();
        self.stages.push(record);
    }
}
