//! One page that holds everything: what was run, the claims, figures, tables.

use std::fmt::Write as _;
use std::path::Path;

use hicp_io::{write_atomically, write_rgb_png};

use crate::analysis::{Analysis, REPLICATES};
use crate::claims::{Claim, claims};
use crate::error::ExperimentError;
use crate::experiment::Experiment;
use crate::figure::Figure;
use crate::html::{Table, escaped, page};
use crate::study::Study;
use crate::tables;

/// What a report says, before it is written.
#[derive(Debug)]
pub struct Report {
    studies: Vec<(String, Study)>,
    analyses: Vec<(String, Analysis)>,
    claims: Vec<(String, Claim)>,
}

impl Report {
    /// Analyses studies under names, such as those of their folders.
    #[must_use]
    pub fn of(studies: Vec<(String, Study)>) -> Self {
        let analyses: Vec<(String, Analysis)> = studies
            .iter()
            .map(|(name, study)| (name.clone(), Analysis::of(study)))
            .collect();
        let claims = analyses
            .iter()
            .flat_map(|(name, analysis)| {
                claims(analysis)
                    .into_iter()
                    .map(|claim| (name.clone(), claim))
            })
            .collect();
        Self {
            studies,
            analyses,
            claims,
        }
    }

    /// The claims of all studies, with the names of the studies.
    #[must_use]
    pub fn claims(&self) -> &[(String, Claim)] {
        &self.claims
    }

    /// The analyses, with the names of the studies.
    #[must_use]
    pub fn analyses(&self) -> &[(String, Analysis)] {
        &self.analyses
    }

    /// Writes `report.html`, which holds everything, and beside it `summary.csv`, `differences.csv`, `claims.csv`, and the figures:
    /// `figure.svg` and `figure.png`, and `alpha.svg` and `alpha.png` where α was studied.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when a figure cannot be drawn or a file not written.
    pub fn write(&self, folder: &Path) -> Result<(), ExperimentError> {
        std::fs::create_dir_all(folder).map_err(ExperimentError::file(folder))?;
        let mut figures = Vec::new();
        for (name, alpha) in [("figure", false), ("alpha", true)] {
            let shown = self.analyses.iter().map(|(_, a)| a);
            let figure =
                Figure::of(shown.filter(|a| (a.experiment() == Experiment::Alpha) == alpha));
            if figure.is_empty() {
                continue;
            }
            let svg = figure.svg()?;
            write_atomically(folder.join(format!("{name}.svg")), |w| {
                w.write_all(svg.as_bytes())
            })?;
            let (width, height, rgb) = figure.pixels()?;
            write_rgb_png(folder.join(format!("{name}.png")), width, height, &rgb)?;
            figures.push((alpha, svg));
        }
        let write =
            |name: &str, bytes: &[u8]| write_atomically(folder.join(name), |w| w.write_all(bytes));
        write("summary.csv", &tables::summary(&self.analyses).csv())?;
        write(
            "differences.csv",
            &tables::differences(&self.analyses).csv(),
        )?;
        write("claims.csv", &tables::claims(&self.claims).csv())?;
        write("report.html", self.html(&figures).as_bytes())?;
        Ok(())
    }

    fn html(&self, figures: &[(bool, String)]) -> String {
        let mut text = String::from("<h2>What was run</h2>\n");
        text.push_str(&self.what_was_run().html());
        let _ = writeln!(
            text,
            "<p>Every variant refines the same images from the same initial poses. VSD is the mean over tolerances of 5 % to 50 % \
             of the diameter, against the true pose of the original model. Brackets hold 95 % intervals: percentiles of {REPLICATES} \
             bootstrap samples over objects and, within each, over cases; differences are paired. ADD(-S) is ADI where an object \
             declares symmetries. CPU time is the processor time of one thread from depth image and mask to pose, with normals and \
             search trees; compare its ratios.</p>"
        );
        text.push_str("<h2>The paper's claims</h2>\n");
        text.push_str(&tables::claims(&self.claims).html());
        for (alpha, svg) in figures {
            let caption = if *alpha {
                "The threshold α"
            } else {
                "Mean VSD after ICP, as in Figure 6 of the paper"
            };
            let _ = writeln!(text, "<h2>{caption}</h2>\n<figure>{svg}</figure>");
        }
        for (name, analysis) in &self.analyses {
            let heading = escaped(&format!("{name}: {}", analysis.experiment().title()));
            let _ = writeln!(text, "<h2>{heading}</h2>\n<h3>All rows</h3>");
            text.push_str(&tables::overall(analysis).html());
            let _ = writeln!(text, "<h3>Mean VSD by {}</h3>", by(analysis.experiment()));
            text.push_str(&tables::means(analysis).html());
        }
        let unmade = self.unmade();
        if !unmade.rows.is_empty() {
            text.push_str("<h2>Cases that could not be made</h2>\n");
            text.push_str(&unmade.html());
        }
        text.push_str("<h2>Differences of the mean VSD, by group</h2>\n<details><summary>All paired differences</summary>\n");
        text.push_str(&tables::differences(&self.analyses).html());
        text.push_str("</details>\n");
        page("The single-image studies of Hybrid ICP, rerun", &text)
    }

    fn what_was_run(&self) -> Table {
        let head = [
            "study",
            "experiment",
            "version",
            "seed",
            "objects",
            "cases per object",
            "rows",
            "camera",
        ];
        Table {
            head: head.map(str::to_owned).to_vec(),
            rows: self
                .studies
                .iter()
                .map(|(name, study)| {
                    let c = &study.config;
                    let objects: Vec<&str> = c.objects.iter().map(|o| o.name.as_str()).collect();
                    let camera = format!(
                        "{}×{}, f = {:.1}",
                        c.camera.width, c.camera.height, c.camera.fx
                    );
                    let expected = c.n_cases().saturating_mul(c.rows_per_case());
                    let rows = match study.rows.len() {
                        rows if rows == expected => rows.to_string(),
                        rows => format!("{rows} of {expected}: not finished"),
                    };
                    vec![
                        name.clone(),
                        c.experiment.name().to_owned(),
                        c.version.clone(),
                        c.seed.to_string(),
                        objects.join(", "),
                        c.poses.to_string(),
                        rows,
                        camera,
                    ]
                })
                .collect(),
        }
    }

    /// Why cases could not be made, once per case and reason.
    fn unmade(&self) -> Table {
        let mut rows: Vec<Vec<String>> = Vec::new();
        for (name, study) in &self.studies {
            for row in study.rows.iter().filter(|row| row.measured.is_none()) {
                let told = vec![
                    name.clone(),
                    row.object.clone(),
                    row.case.to_string(),
                    row.note.clone(),
                ];
                if rows.last() != Some(&told) {
                    rows.push(told);
                }
            }
        }
        Table {
            head: ["study", "object", "case", "why"]
                .map(str::to_owned)
                .to_vec(),
            rows,
        }
    }
}

fn by(experiment: Experiment) -> &'static str {
    match experiment {
        Experiment::InitNoise => "initial VSD",
        _ => experiment.level_title(),
    }
}
