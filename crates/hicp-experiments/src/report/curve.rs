//! The data of figures.

use crate::analysis::{Analysis, Interval, Metric};

/// Curves over the same axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Heading.
    pub title: String,
    /// Name of the x axis.
    pub x_title: String,
    /// Name of the y axis.
    pub y_title: String,
    /// The curves.
    pub curves: Vec<Curve>,
}

/// A variant's curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Name in the legend.
    pub label: String,
    /// Index of the variant in its study, which orders the legend.
    pub variant: usize,
    /// Points (x, mean with interval), from left to right.
    pub points: Vec<(f64, Interval)>,
}

impl Curve {
    /// Returns the means of a variant over the single groups.
    pub(crate) fn of(analysis: &Analysis, variant: usize) -> Self {
        let groups = analysis.groups().iter().enumerate();
        let singles = groups.filter(|(_, g)| g.single).enumerate();
        let points = singles.filter_map(|(step, (group, described))| {
            let x = match &described.bins {
                // The middle of the bin.
                Some(bins) => (bins.start as f64 + 0.5) / analysis.n_bins() as f64,
                None => described.label.parse().unwrap_or(step as f64),
            };
            Some((x, analysis.mean(Metric::Vsd, group, variant)?))
        });
        Self {
            label: analysis.variants()[variant].clone(),
            variant,
            points: points.collect(),
        }
    }
}
