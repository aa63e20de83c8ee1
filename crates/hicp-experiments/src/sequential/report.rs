//! The report of a sequential study, with a figure like the paper's Figure 7.

use std::fmt::Write as _;
use std::path::Path;

use hicp_io::{write_atomically, write_rgb_png};

use super::calibration;
use super::claims::{claims, is_of_paper};
use super::config::TrajectoryClock;
use super::study::{TrajectoryStudy, variant};
use crate::analysis::{Analysis, FAILURE_VSD, Metric, REPLICATES};
use crate::claims::Claim;
use crate::error::ExperimentError;
use crate::figure::{Curve, Figure, Panel, curve};
use crate::html::{Table, page};
use crate::tables;

const TITLE: &str = "Sequential ICP, the study of §VI-C rerun";

/// What a report says, before it is written.
#[derive(Debug)]
pub struct TrajectoryReport {
    study: TrajectoryStudy,
    analysis: Analysis,
    claims: Vec<Claim>,
}

impl TrajectoryReport {
    /// Analyses a study.
    #[must_use]
    pub fn of(study: TrajectoryStudy) -> Self {
        let analysis = study.analysis();
        Self {
            claims: claims(&study.config, &analysis),
            study,
            analysis,
        }
    }

    /// The paper's findings and what became of them.
    #[must_use]
    pub fn claims(&self) -> &[Claim] {
        &self.claims
    }

    /// The means with their intervals; variants are named `underlying/method`.
    #[must_use]
    pub fn analysis(&self) -> &Analysis {
        &self.analysis
    }

    /// Figure 7: a panel per underlying pipeline with the paper's methods, and one with `average` and the gated methods.
    #[must_use]
    pub fn figure(&self) -> Figure {
        let config = &self.study.config;
        let panel = |title: String, curves: Vec<Curve>| Panel {
            title,
            x_title: "pre-trajectory VSD".to_owned(),
            y_title: "mean post-trajectory VSD".to_owned(),
            x: 0.0..1.0,
            x_numbers: 11,
            curves,
        };
        let draw = |underlying: &str, methods: &[String], first: usize, named: bool| {
            let curves = methods.iter().filter_map(|method| {
                let name = variant(underlying, method);
                Some((method, name.clone(), self.analysis.variant(&name)?))
            });
            let curves = curves.enumerate().map(|(style, (method, name, index))| {
                let label = if named { name } else { method.clone() };
                Curve {
                    label,
                    ..curve(&self.analysis, index, first + style)
                }
            });
            curves.collect::<Vec<Curve>>()
        };
        let (paper, beyond): (Vec<String>, Vec<String>) =
            config.methods.iter().cloned().partition(|m| is_of_paper(m));
        let mut row: Vec<Panel> = config
            .underlying
            .iter()
            .map(|u| panel(u.name.clone(), draw(&u.name, &paper, 0, false)))
            .collect();
        let shown: Vec<String> = std::iter::once("average".to_owned())
            .chain(beyond)
            .collect();
        let together = config
            .underlying
            .iter()
            .enumerate()
            .flat_map(|(index, u)| draw(&u.name, &shown, index * shown.len(), true));
        row.push(panel(
            "average, and beyond the paper".to_owned(),
            together.collect(),
        ));
        Figure { rows: vec![row] }
    }

    /// Writes `report.html`, which holds everything, and beside it `summary.csv`, `differences.csv`, `claims.csv`, `calibration.csv`,
    /// `figure.svg` and `figure.png`.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when the figure cannot be drawn or a file not written.
    pub fn write(&self, folder: &Path) -> Result<(), ExperimentError> {
        std::fs::create_dir_all(folder).map_err(ExperimentError::file(folder))?;
        let figure = self.figure();
        let svg = figure.svg()?;
        let (width, height, rgb) = figure.pixels()?;
        write_rgb_png(folder.join("figure.png"), width, height, &rgb)?;
        let write =
            |name: &str, bytes: &[u8]| write_atomically(folder.join(name), |w| w.write_all(bytes));
        write("figure.svg", svg.as_bytes())?;
        write("summary.csv", &self.summary().csv())?;
        write("differences.csv", &self.differences().csv())?;
        write("claims.csv", &self.claims_table().csv())?;
        write("calibration.csv", &calibration::table(&self.study).csv())?;
        write("report.html", self.html(&svg).as_bytes())?;
        Ok(())
    }

    fn claims_table(&self) -> Table {
        let named = self.claims.iter();
        let named: Vec<(String, Claim)> = named
            .map(|claim| ("sequential".to_owned(), claim.clone()))
            .collect();
        tables::claims(&named)
    }

    /// Pairs of pipeline and method with their index in the analysis.
    fn pairs(&self) -> Vec<(&str, &str, usize)> {
        let config = &self.study.config;
        let pairs = config.underlying.iter().flat_map(|u| {
            let methods = config.methods.iter();
            methods.filter_map(|m| {
                let index = self.analysis.variant(&variant(&u.name, m))?;
                Some((u.name.as_str(), m.as_str(), index))
            })
        });
        pairs.collect()
    }

    /// Everything per bin, pipeline and method.
    fn summary(&self) -> Table {
        let head = [
            "underlying",
            "method",
            "group",
            "trajectories",
            "vsd_initial",
            "vsd_final",
            "vsd_final_low",
            "vsd_final_high",
            "failure_share",
            "failure_low",
            "failure_high",
            "add_median_mm",
            "n_estimates",
        ];
        let mut rows = Vec::new();
        for (underlying, method, index) in self.pairs() {
            for (group, described) in self.analysis.groups().iter().enumerate() {
                let found = (
                    self.analysis.cell(group, index),
                    self.analysis.mean(Metric::Vsd, group, index),
                    self.analysis.mean(Metric::Failure, group, index),
                );
                let (Some(cell), Some(vsd), Some(failure)) = found else {
                    continue;
                };
                let mut row = vec![
                    underlying.to_owned(),
                    method.to_owned(),
                    described.label.clone(),
                    cell.count.to_string(),
                    format!("{:.4}", cell.vsd_initial),
                ];
                let figures = [vsd, failure];
                let figures = figures.iter().flat_map(|i| [i.estimate, i.low, i.high]);
                row.extend(figures.map(|x| format!("{x:.4}")));
                row.push(format!("{:.3}", cell.add_median_mm));
                row.push(format!("{:.2}", cell.iterations));
                rows.push(row);
            }
        }
        Table {
            head: head.map(str::to_owned).to_vec(),
            rows,
        }
    }

    /// Paired differences of every method from `average`, per pipeline and group.
    fn differences(&self) -> Table {
        let head = [
            "underlying",
            "group",
            "method",
            "against",
            "vsd_difference",
            "low",
            "high",
        ];
        let mut rows = Vec::new();
        for (underlying, method, index) in self.pairs() {
            let Some(average) = self.analysis.variant(&variant(underlying, "average")) else {
                continue;
            };
            if index == average {
                continue;
            }
            for (group, described) in self.analysis.groups().iter().enumerate() {
                let terms = [(group, index, 1.0), (group, average, -1.0)];
                let Some(i) = self.analysis.contrast(Metric::Vsd, &terms) else {
                    continue;
                };
                let mut row: Vec<String> = [underlying, &described.label, method, "average"]
                    .map(str::to_owned)
                    .to_vec();
                row.extend([i.estimate, i.low, i.high].map(|x| format!("{x:.4}")));
                rows.push(row);
            }
        }
        Table {
            head: head.map(str::to_owned).to_vec(),
            rows,
        }
    }

    fn what_was_run(&self) -> Table {
        let c = &self.study.config;
        let objects: Vec<&str> = c.objects.iter().map(|o| o.name.as_str()).collect();
        let expected = c.n_trajectories().saturating_mul(c.rows_per_trajectory());
        let rows = match self.study.rows.len() {
            rows if rows == expected => rows.to_string(),
            rows => format!("{rows} of {expected}: not finished"),
        };
        let costs = c
            .underlying
            .iter()
            .enumerate()
            .map(|(index, u)| match c.clock {
                TrajectoryClock::Cost => format!(
                    "{}: {} s per estimate, {:.4} m, {} images",
                    u.name,
                    u.seconds_per_estimate,
                    c.step_m(index),
                    c.n_images(index)
                ),
                TrajectoryClock::Real => format!("{}: as long as it took", u.name),
            });
        let fields = [
            ("version", c.version.clone()),
            ("seed", c.seed.to_string()),
            ("objects", objects.join(", ")),
            (
                "trajectories per object and bin",
                c.trajectories.to_string(),
            ),
            ("rows", rows),
            ("pipelines", costs.collect::<Vec<_>>().join("; ")),
            (
                "path",
                format!(
                    "from {} m over {} m at {} m/s",
                    c.start_distance_m, c.path_m, c.speed_m_s
                ),
            ),
            (
                "reconstruction",
                format!(
                    "{} images, {} m, {}°, voxels of {} m",
                    c.reconstruction_images,
                    c.reconstruction_translation_m,
                    c.reconstruction_rotation_deg,
                    c.reconstruction_voxel_m
                ),
            ),
            (
                "depth noise",
                format!(
                    "σ = {} + {} z + {} z² m",
                    c.depth_noise_m[0], c.depth_noise_m[1], c.depth_noise_m[2]
                ),
            ),
        ];
        Table {
            head: vec!["what".to_owned(), "value".to_owned()],
            rows: fields
                .into_iter()
                .map(|(name, value)| vec![name.to_owned(), value])
                .collect(),
        }
    }

    /// Why trajectories could not be made, once per trajectory.
    fn unmade(&self) -> Table {
        let mut rows: Vec<Vec<String>> = Vec::new();
        for row in self.study.rows.iter().filter(|row| row.measured.is_none()) {
            let told = vec![
                row.object.clone(),
                row.trajectory.to_string(),
                row.note.clone(),
            ];
            if rows.last() != Some(&told) {
                rows.push(told);
            }
        }
        Table {
            head: ["object", "trajectory", "why"].map(str::to_owned).to_vec(),
            rows,
        }
    }

    fn html(&self, svg: &str) -> String {
        let mut text = String::from("<h2>What was run</h2>\n");
        text.push_str(&self.what_was_run().html());
        let _ = writeln!(
            text,
            "<p>{} Both pipelines get the same paths, starts and models. Covariances are e_MVE·U with U the unit about the object, moved \
             by the adjoint; <i>gated</i> leaves out estimates with an MVE above 0.4 and brings symmetric poses together; \
             <i>calibrated</i> does so with the covariance of the registration, fitted on other objects, and a stricter gate. VSD is the mean over tolerances of 5 % to 50 % of the diameter, against the true pose of the original model, \
             at the path's start and end. Brackets hold 95 % intervals: percentiles of {REPLICATES} bootstrap samples over objects \
             and, within each, over trajectories of a bin; differences are paired.</p>",
            match self.study.config.clock {
                TrajectoryClock::Cost =>
                    "The clock is a stored cost, what Table I of the paper says on average: all methods of a \
                    pipeline see the same images.",
                TrajectoryClock::Real =>
                    "The clock was the processor's: an estimate took as long as it took, every method saw images \
                    of its own, and no run repeats this one.",
            }
        );
        text.push_str("<h2>The paper's findings</h2>\n");
        text.push_str(&self.claims_table().html());
        let _ = writeln!(
            text,
            "<h2>Mean VSD after the trajectory, as in Figure 7 of the paper</h2>\n<figure>{svg}</figure>"
        );
        text.push_str("<h2>Mean VSD by initial VSD</h2>\n");
        text.push_str(&tables::means(&self.analysis).html());
        let _ = writeln!(
            text,
            "<h2>Are the covariances what the errors say?</h2>\n<p>Share of the final errors inside the ellipsoids that should hold \
             50, 90 and 99 %, by χ²₆, for the calibrated methods by Student's distribution; objects that turn freely about an axis \
             are left out. A trajectory failed whose final VSD is above {FAILURE_VSD}.</p>"
        );
        text.push_str(&calibration::table(&self.study).html());
        let unmade = self.unmade();
        if !unmade.rows.is_empty() {
            text.push_str("<h2>Trajectories that could not be made</h2>\n");
            text.push_str(&unmade.html());
        }
        text.push_str("<h2>Differences from average, by group</h2>\n<details><summary>All paired differences</summary>\n");
        text.push_str(&self.differences().html());
        text.push_str("</details>\n");
        page(TITLE, &text)
    }
}
