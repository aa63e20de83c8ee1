//! Studies of single images as a kind of study.

use super::config::Config;
use super::runner::Runner;
use crate::error::ExperimentError;
use crate::study::{
    Column, Columns, Design, Fields, Group, Layout, MAX_BINS, MAX_CELLS, Models, ObjectRecord,
    Worker, quoted,
};
use crate::subject::Subject;

/// Most cases per object.
const MAX_POSES: u64 = 1_000_000;

impl Design for Config {
    const ROWS_FILE: &'static str = "cases.csv";
    const COLUMNS: &'static Columns = &[
        ("object", Column::Object),
        ("case", Column::Case),
        ("variant", Column::Variant),
        ("level", Column::Setting),
        ("bin", Column::Bin),
        ("vsd_initial", Column::VsdInitial),
        ("vsd_final", Column::VsdFinal),
        ("add_final_mm", Column::AddFinalMm),
        ("iterations", Column::Steps),
        ("termination", Column::Termination),
        ("cpu_ms", Column::CpuMs),
        ("note", Column::Note),
    ];

    fn check(&self, fields: Fields<'_>) -> Result<(), ExperimentError> {
        fields.count("poses", self.poses, MAX_POSES)?;
        fields.count("bins", self.bins as u64, MAX_BINS as u64)?;
        fields.not_negative(&[
            ("max_translation_m", self.max_translation_m),
            ("translation_m", self.translation_m),
            ("rotation_deg", self.rotation_deg),
            ("axis_offset_m", self.axis_offset_m),
        ])?;
        fields.positive(&[("max_distance_m", self.max_distance_m)])?;
        let (layout, known) = (self.layout(), self.experiment.levels());
        fields.names("levels", known.len(), &layout.settings)?;
        // The meaning of a level follows from its index. A study may have only the first levels.
        for (index, (level, known)) in self.levels.iter().zip(&known).enumerate() {
            let name = self.experiment.name();
            let expected = format_args!("{}, as in every {name} study", quoted(known));
            let field = format_args!("levels[{index}]");
            fields.require(level == known, field, quoted(level), expected)?;
        }
        fields.names("variants", MAX_CELLS, &layout.variants)?;
        fields.common(&self.camera, &self.objects, &layout, ["levels", "variants"])
    }

    fn layout(&self) -> Layout<'_> {
        let levels = 0..self.levels.len();
        let is_binned = levels.map(|level| self.experiment.condition(level, 0).binned);
        Layout {
            objects: self.objects.iter().map(|o| o.name.as_str()).collect(),
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

    fn seed(&self) -> u64 {
        self.seed
    }

    fn objects(&self) -> &[ObjectRecord] {
        &self.objects
    }

    fn groups(&self) -> Vec<Group> {
        self.experiment.groups(&self.levels, self.layout().n_bins())
    }
}
