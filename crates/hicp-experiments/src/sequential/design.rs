//! The sequential study as a kind of study.

use super::config::{SEQUENTIAL, TrajectoryConfig};
use super::rule::FusionRule;
use super::runner::TrajectoryRunner;
use crate::error::ExperimentError;
use crate::study::{
    ALL, Column, Columns, Design, Fields, Group, Layout, MAX_BINS, Models, ObjectRecord, Worker,
    quoted,
};
use crate::subject::Subject;

/// Most trajectories per object and bin.
const MAX_TRAJECTORIES: u64 = 100_000;
/// Most underlying pipelines: each has a panel of the figure.
const MAX_UNDERLYING: usize = 40;
/// Most methods.
const MAX_METHODS: usize = 100;

impl Design for TrajectoryConfig {
    const ROWS_FILE: &'static str = "trajectories.csv";
    const COLUMNS: &'static Columns = &[
        ("object", Column::Object),
        ("trajectory", Column::Case),
        ("bin", Column::Bin),
        ("underlying", Column::Setting),
        ("method", Column::Variant),
        ("vsd_initial", Column::VsdInitial),
        ("vsd_final", Column::VsdFinal),
        ("add_final_mm", Column::AddFinalMm),
        ("n_estimates", Column::Steps),
        ("mahalanobis_squared", Column::MahalanobisSquared),
        ("note", Column::Note),
    ];

    fn check(&self, fields: Fields<'_>) -> Result<(), ExperimentError> {
        let (is_valid, found) = (self.experiment == SEQUENTIAL, quoted(&self.experiment));
        fields.require(is_valid, "experiment", found, quoted(SEQUENTIAL))?;
        fields.count("trajectories", self.trajectories, MAX_TRAJECTORIES)?;
        fields.count("bins", self.bins as u64, MAX_BINS as u64)?;
        fields.not_negative(&[
            ("max_translation_m", self.max_translation_m),
            ("path_m", self.path_m),
            ("axis_offset_m", self.axis_offset_m),
            ("target_offset_m", self.target_offset_m),
            (
                "reconstruction_translation_m",
                self.reconstruction_translation_m,
            ),
            (
                "reconstruction_rotation_deg",
                self.reconstruction_rotation_deg,
            ),
        ])?;
        fields.positive(&[
            ("start_distance_m", self.start_distance_m),
            ("speed_m_s", self.speed_m_s),
            ("reconstruction_voxel_m", self.reconstruction_voxel_m),
            (
                "reconstruction_max_distance_m",
                self.reconstruction_max_distance_m,
            ),
        ])?;
        let layout = self.layout();
        fields.names("underlying", MAX_UNDERLYING, &layout.settings)?;
        for (index, underlying) in self.underlying.iter().enumerate() {
            let field = format!("underlying[{index}].seconds_per_estimate");
            fields.positive(&[(&field, underlying.seconds_per_estimate)])?;
        }
        fields.names("methods", MAX_METHODS, &layout.variants)?;
        for (index, method) in self.methods.iter().enumerate() {
            let is_known = FusionRule::from_name(method).is_some();
            let field = format_args!("methods[{index}]");
            fields.require(is_known, field, quoted(method), FusionRule::EXPECTED)?;
        }
        fields.common(
            &self.camera,
            &self.objects,
            &layout,
            ["underlying", "methods"],
        )
    }

    fn layout(&self) -> Layout<'_> {
        Layout {
            objects: self.objects.iter().map(|o| o.name.as_str()).collect(),
            settings: self.underlying.iter().map(|u| u.name.as_str()).collect(),
            variants: self.methods.iter().map(String::as_str).collect(),
            cases: self.trajectories.saturating_mul(self.bins as u64),
            bins: self.bins,
            is_binned: vec![true; self.underlying.len()],
            // An interrupted study is as even over the objects as it can be.
            is_interleaved: true,
        }
    }

    fn worker<'a>(
        &'a self,
        subjects: &'a [Subject],
        models: &'a Models,
    ) -> Result<Worker<'a>, ExperimentError> {
        let mut runner = TrajectoryRunner::new(self, subjects, models)?;
        Ok(Box::new(move |object, case| {
            runner.outcomes(object, case, &mut |_| ())
        }))
    }

    fn seed(&self) -> u64 {
        self.seed
    }

    fn objects(&self) -> &[ObjectRecord] {
        &self.objects
    }

    fn compared(&self) -> Vec<String> {
        let all = self.underlying.iter();
        let pairs = all.flat_map(|u| self.methods.iter().map(|m| Self::variant(&u.name, m)));
        pairs.collect()
    }

    fn groups(&self) -> Vec<Group> {
        let mut groups = Group::by_bin(&[0], self.bins.max(1));
        groups.push(Group::of_levels(ALL, vec![0]));
        groups
    }
}
