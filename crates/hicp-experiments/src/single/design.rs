//! The [`Design`] of studies of single images.

use hicp_io::IoError;

use super::config::Config;
use super::runner::Runner;
use crate::error::ExperimentError;
use crate::study::{Design, Fields, Group, Layout, MAX_CELLS, Models, Worker, quoted};
use crate::subject::Subject;

/// Largest number of cases per object.
const MAX_POSES: u64 = 1_000_000;

impl Design for Config {
    const ROWS_FILE: &'static str = "cases.csv";
    const COLUMNS: &'static str = "object,case,variant,level,bin,vsd_initial,vsd_final,\
        add_final_mm,iterations,termination,cpu_ms,regimes,note";

    fn check(&self, fields: &Fields<'_>) -> Result<(), IoError> {
        fields.count("poses", MAX_POSES)?;
        fields.at_least_0(&[
            "max_translation_m",
            "translation_m",
            "rotation_deg",
            "axis_offset_m",
        ])?;
        fields.above_0(&["max_distance_m"])?;
        if let Some(half_side) = self.normal_window {
            let is_valid = (1..=10).contains(&half_side);
            fields.require(is_valid, "normal_window", half_side, "null, or 1 to 10")?;
        }
        let known = self.experiment.levels();
        fields.names("levels", known.len())?;
        // The index of a level decides its meaning. A study may have only the first levels.
        for (index, (level, known)) in self.levels.iter().zip(&known).enumerate() {
            let name = self.experiment.name();
            let expected = format_args!("{}, as in every {name} study", quoted(known));
            let field = format_args!("levels[{index}]");
            fields.require(level == known, field, quoted(level), expected)?;
        }
        fields.names("variants", MAX_CELLS)?;
        fields.common(&self.layout(), self.max_distance_m, ["levels", "variants"])
    }

    fn layout(&self) -> Layout<'_> {
        let levels = 0..self.levels.len();
        let is_binned = levels.map(|level| self.experiment.condition(level, 0).binned);
        Layout {
            seed: self.seed,
            camera: self.camera,
            objects: &self.objects,
            settings: self.levels.iter().map(String::as_str).collect(),
            variants: self.variants.iter().map(|v| v.name.as_str()).collect(),
            cases: self.poses,
            bins: self.bins,
            is_binned: is_binned.collect(),
            is_interleaved: false,
        }
    }

    fn worker<'a>(
        &'a self,
        subjects: &'a [Subject],
        models: &'a Models,
    ) -> Result<Worker<'a>, ExperimentError> {
        let mut runner = Runner::new(self, subjects, models)?;
        Ok(Box::new(move |object, case| runner.outcomes(object, case)))
    }

    fn groups(&self) -> Vec<Group> {
        self.experiment.groups(&self.levels, self.layout().n_bins())
    }
}
