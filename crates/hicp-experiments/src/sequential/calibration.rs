//! The share of errors inside the ellipsoids of the stated covariances.

use super::config::TrajectoryConfig;
use super::rule::FusionRule;
use crate::analysis::FAILURE_VSD;
use crate::study::StudyOf;

/// Probabilities of the ellipsoids.
const LEVELS: [f64; 3] = [0.5, 0.9, 0.99];

/// The columns of the table.
pub(super) const HEAD: &str = "underlying|method|which|trajectories|inside_50|inside_90|inside_99";

/// Returns the share of final errors inside the ellipsoids of 50, 90 and 99 % probability.
///
/// The ellipsoids follow from the stated covariances. For each pipeline and method, there is a row
/// for all trajectories, and one for those that did not fail.
pub(super) fn rows(study: &StudyOf<TrajectoryConfig>) -> Vec<Vec<String>> {
    let mut table = Vec::new();
    let config = &study.config;
    for underlying in &config.underlying {
        for method in &config.methods {
            let Some(rule) = FusionRule::from_name(method) else {
                continue;
            };
            for (which, with_failures) in [("all", true), ("not failed", false)] {
                let rows = study.rows.iter();
                let rows = rows.filter(|r| r.setting == underlying.name && r.variant == *method);
                let measured = rows.filter_map(|row| row.measured.as_ref());
                let measured = measured.filter(|m| with_failures || m.vsd_final <= FAILURE_VSD);
                let within = measured.filter_map(|m| m.mahalanobis_squared);
                let within =
                    within.map(|squared| rule.probability_within(&underlying.name, squared));
                let within: Vec<f64> = within.collect();
                if within.is_empty() {
                    continue;
                }
                let mut row = vec![underlying.name.clone(), method.clone(), which.to_owned()];
                row.push(within.len().to_string());
                row.extend(LEVELS.map(|level| {
                    let inside = within.iter().filter(|p| **p <= level).count();
                    format!("{:.1}", 100.0 * inside as f64 / within.len() as f64)
                }));
                table.push(row);
            }
        }
    }
    table
}
