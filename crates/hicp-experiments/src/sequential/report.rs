//! The report of a sequential study, with a figure like the paper's Figure 7.

use super::calibration;
use super::claims::claims;
use super::config::{PathDirection, TrajectoryClock, TrajectoryConfig, UnderlyingRecord};
use hicp_sim::WrongPose;
use hybrid_icp::WithoutPairs;

use super::rule::PlainCovariance;
use crate::analysis::{Analysis, FAILURE_VSD, Metric};
use crate::claims::{Claim, listed};
use crate::report::{
    Curve, Document, Entry, Figure, Panel, Reported, differences, figures, fixed, means,
    note_on_intervals, table, texts,
};

const AVERAGE: &str = "average";
/// The columns of `summary.csv`.
const SUMMARY: &str = "underlying|method|group|trajectories|vsd_initial|vsd_final|vsd_final_low|\
    vsd_final_high|failure_share|failure_low|failure_high|add_median_mm|n_estimates";
/// The columns of `differences.csv`.
const DIFFERENCES: &str = "underlying|group|method|against|vsd_difference|low|high";

impl Reported for TrajectoryConfig {
    fn claims(&self, analysis: &Analysis) -> Vec<Claim> {
        claims(self, analysis)
    }

    fn described(&self) -> Vec<(&'static str, String)> {
        let cost = |(index, u): (usize, &UnderlyingRecord)| {
            let (name, seconds, mve) = (&u.name, u.seconds_per_estimate, u.seconds_per_mve);
            let images = [false, true].map(|with_mve| self.n_images(index, with_mve));
            match self.clock {
                TrajectoryClock::Cost => format!(
                    "{name}: {seconds} s per estimate, {} images; with an MVE {mve:.4} s more, {} images",
                    images[0], images[1]
                ),
                TrajectoryClock::Real => format!("{name}: the measured time"),
            }
        };
        let costs = self.underlying.iter().enumerate().map(cost);
        let (from, over, speed) = (self.start_distance_m, self.path_m, self.speed_m_s);
        let direction = match self.path {
            PathDirection::OpticalAxis => "along the optical axis".to_owned(),
            PathDirection::Target { offset_m } => {
                format!("toward a point within {offset_m} m of the center")
            }
        };
        let path = format!("from {from} m over {over} m at {speed} m/s {direction}");
        let (images, voxel) = (self.reconstruction_images, self.reconstruction_voxel_m);
        let (meters, degrees) = (
            self.reconstruction_translation_m,
            self.reconstruction_rotation_deg,
        );
        let noise = &self.reconstruction_depth_noise;
        let wrong = match self.reconstruction_wrong_pose {
            WrongPose::Camera => "camera",
            WrongPose::Object => "object",
        };
        let truncation = match self.reconstruction_truncation_m {
            Some(meters) => format!("{meters} m"),
            None => "by the noise and the errors".to_owned(),
        };
        let reconstruction = format!(
            "{images} images with noise {noise}, {wrong} poses off by {meters} m and {degrees}°, \
             voxels of {voxel} m, truncation {truncation}"
        );
        let covariance = match self.covariance {
            PlainCovariance::Identity => "e_MVE·I₆, not moved",
            PlainCovariance::AboutObject => "e_MVE·U about the object, moved by the adjoint",
        };
        let without_pairs = match self.without_pairs {
            WithoutPairs::Initial => "the initial pose",
            WithoutPairs::Nothing => "nothing",
        };
        vec![
            ("version", self.version.clone()),
            (
                "trajectories per object and bin",
                self.trajectories.to_string(),
            ),
            ("pipelines", listed(costs)),
            ("path", path),
            ("reconstruction", reconstruction),
            ("depth noise", self.depth_noise.clone()),
            ("covariance of the paper's methods", covariance.to_owned()),
            ("fused if ICP finds no pairs", without_pairs.to_owned()),
        ]
    }

    fn document(entries: &[Entry<Self>]) -> Document {
        let calibration = table(entries, calibration::HEAD, |entry| {
            calibration::rows(&entry.study)
        });
        let tables = entries.iter().map(|entry| means(&entry.analysis).html());
        let means: String = tables.collect();
        let results = format!(
            "<h2>Mean VSD by initial VSD</h2>\n{means}\
             <h2>Do the errors match the covariances?</h2>\n<p>The table shows the share of the \
             final errors inside the ellipsoids of 50, 90 and 99 % probability. The distribution is χ²₆, and \
             Student's for the calibrated methods. Objects with a continuous symmetry are left out. A \
             trajectory failed if its final VSD is above {FAILURE_VSD}.</p>\n{}",
            calibration.html()
        );
        let rows = entries.iter().flat_map(Entry::panels).collect();
        let as_in_paper = "Mean VSD after the trajectory, as in Figure 7 of the paper";
        let is_real = |e: &Entry<Self>| e.study.config.clock == TrajectoryClock::Real;
        Document {
            title: "Sequential ICP, the study of §VI-C rerun",
            note: note(entries.iter().any(is_real)),
            figures: vec![("figure", as_in_paper, Figure::new(rows))],
            results,
            differences: table(entries, DIFFERENCES, Entry::differences),
            tables: vec![
                ("summary.csv", table(entries, SUMMARY, Entry::summary)),
                ("calibration.csv", calibration),
            ],
        }
    }
}

fn note(is_real: bool) -> String {
    let clock = match is_real {
        false => {
            "The clock is a stored cost, the mean of Table I of the paper, and for methods that need it the share of an MVE."
        }
        true => {
            "The clock was the measured processor time. Every method saw different images, and no run repeats this one."
        }
    };
    format!(
        "{clock} All pipelines get the same paths, starts and models. <i>gated</i> \
         methods leave out estimates with an MVE above 0.4, use the symmetries of the object, and fuse e_MVE·U, where U is the unit covariance about the object. <i>calibrated</i> methods also use the covariance of the \
         registration, fitted on other objects, and a stricter gate. {}",
        note_on_intervals()
    )
}

impl Entry<TrajectoryConfig> {
    /// Returns every pair of a pipeline and a method, with its index in the analysis.
    fn pairs(&self) -> impl Iterator<Item = (&str, &str, usize)> {
        let config = &self.study.config;
        let methods = || config.methods.iter().map(String::as_str);
        let pipelines = config.underlying.iter().map(|u| &*u.name);
        let pairs = pipelines.flat_map(move |u| methods().map(move |m| (u, m)));
        pairs.zip(0..).map(|((u, m), index)| (u, m, index))
    }

    /// Returns the rows of `summary.csv`: the figures of every pipeline and method in every group.
    fn summary(&self) -> Vec<Vec<String>> {
        let (analysis, metrics) = (&self.analysis, [Metric::Vsd, Metric::Failure]);
        let mut rows = Vec::new();
        for (underlying, method, index) in self.pairs() {
            for (group, described) in analysis.groups().iter().enumerate() {
                let Some((cell, figures)) = figures(analysis, &metrics, group, index) else {
                    continue;
                };
                let labels = texts(&[underlying, method, &described.label]);
                let others = [
                    fixed(Some(cell.add_median_mm), 3),
                    fixed(Some(cell.steps), 2),
                ];
                rows.push([&labels[..], &figures, &others].concat());
            }
        }
        rows
    }

    /// Returns the paired differences between every method and `average`, per pipeline and group.
    fn differences(&self) -> Vec<Vec<String>> {
        let (analysis, mut rows) = (&self.analysis, Vec::new());
        for (underlying, method, index) in self.pairs().filter(|pair| pair.1 != AVERAGE) {
            let average = TrajectoryConfig::variant(underlying, AVERAGE);
            let Some(average) = analysis.variant(&average) else {
                continue;
            };
            for (group, described) in analysis.groups().iter().enumerate() {
                let ends = differences(analysis, &[Metric::Vsd], group, [index, average]);
                let labels = texts(&[underlying, &described.label, method, AVERAGE]);
                rows.extend(ends.map(|ends| [labels, ends].concat()));
            }
        }
        rows
    }

    /// Lays out Figure 7: a panel per underlying pipeline with the paper's methods, and below it
    /// one with `average` and the methods beyond the paper.
    fn panels(&self) -> [Vec<Panel>; 2] {
        let config = &self.study.config;
        let paper = config.paper_methods();
        let mut beyond: Vec<&str> = config.methods.iter().map(String::as_str).collect();
        beyond.retain(|method| !paper.contains(method));
        if !beyond.is_empty() {
            beyond.insert(0, AVERAGE);
        }
        let panel = |underlying: &str, title: String, methods: &[&str]| {
            let curve = |method: &&str| {
                let name = TrajectoryConfig::variant(underlying, method);
                let curve = Curve::of(&self.analysis, self.analysis.variant(&name)?);
                // The title of the panel names the pipeline.
                let label = (*method).to_owned();
                Some(Curve { label, ..curve })
            };
            Panel {
                title,
                x_title: "pre-trajectory VSD".to_owned(),
                y_title: "mean post-trajectory VSD".to_owned(),
                curves: methods.iter().filter_map(curve).collect(),
            }
        };
        let names = || config.underlying.iter().map(|underlying| &*underlying.name);
        let of_paper = names().map(|name| panel(name, name.to_owned(), &paper));
        let others = names().map(|name| panel(name, format!("{name}: beyond the paper"), &beyond));
        [of_paper.collect(), others.collect()]
    }
}
