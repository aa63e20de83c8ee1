//! Global search over hypotheses.

pub(crate) mod distinct;
pub(crate) mod found;
pub(crate) mod hypotheses;
pub(crate) mod hypothesis_search;
pub(crate) mod look_alikes;
pub(crate) mod near_symmetries;
pub(crate) mod options;
pub(crate) mod revolution;
pub(crate) mod run;
pub(crate) mod self_match;
pub(crate) mod shortlist;
pub(crate) mod turns;
