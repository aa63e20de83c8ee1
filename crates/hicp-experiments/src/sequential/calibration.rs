//! Whether the covariances that methods state are what their errors say.

use super::row::TrajectoryRow;
use super::rule::FusionRule;
use super::study::TrajectoryStudy;
use crate::analysis::FAILURE_VSD;
use crate::html::Table;

/// Probabilities of the ellipsoids that errors are counted in.
const LEVELS: [f64; 3] = [0.5, 0.9, 0.99];

/// Share of final errors inside the ellipsoids that hold 50, 90 and 99 % if the stated covariance is right, per pipeline and method:
/// of all trajectories, and of those that did not fail.
pub(super) fn table(study: &TrajectoryStudy) -> Table {
    let config = &study.config;
    let pairs = config.underlying.iter().flat_map(|u| {
        let methods = config.methods.iter();
        methods.map(|method| (u.name.as_str(), method.as_str()))
    });
    let mut rows = Vec::new();
    for (underlying, method) in pairs {
        let Some(rule) = FusionRule::from_name(method) else {
            continue;
        };
        for (which, failures) in [("all", true), ("not failed", false)] {
            let of_pair = study.rows.iter().filter(|row| {
                let fine = row.vsd().is_some_and(|(_, last)| last <= FAILURE_VSD);
                row.underlying == underlying && row.method == method && (failures || fine)
            });
            let distances = of_pair.filter_map(TrajectoryRow::mahalanobis_squared);
            let within: Vec<f64> = distances
                .map(|distance| rule.probability_within(underlying, distance))
                .collect();
            if within.is_empty() {
                continue;
            }
            let mut row = vec![underlying.to_owned(), method.to_owned(), which.to_owned()];
            row.push(within.len().to_string());
            row.extend(LEVELS.map(|level| {
                let inside = within.iter().filter(|p| **p <= level).count();
                format!("{:.1}", 100.0 * inside as f64 / within.len() as f64)
            }));
            rows.push(row);
        }
    }
    let head = [
        "underlying",
        "method",
        "which",
        "trajectories",
        "inside_50",
        "inside_90",
        "inside_99",
    ];
    Table {
        head: head.map(str::to_owned).to_vec(),
        rows,
    }
}
