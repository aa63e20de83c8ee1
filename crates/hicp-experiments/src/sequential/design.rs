//! The [`Design`] of sequential studies.

use hicp_io::IoError;
use hicp_sim::DepthNoise;

use super::config::{PathDirection, SEQUENTIAL, TrajectoryConfig};
use super::rule::FusionRule;
use super::runner::TrajectoryRunner;
use crate::error::ExperimentError;
use crate::study::{ALL, Design, Fields, Group, Layout, Models, Worker, quoted};
use crate::subject::Subject;

/// Largest number of trajectories per object and bin.
const MAX_TRAJECTORIES: u64 = 100_000;
/// Largest number of underlying pipelines. Each has a column of the figure.
const MAX_UNDERLYING: usize = 40;
/// Largest number of methods.
const MAX_METHODS: usize = 100;

impl Design for TrajectoryConfig {
    const ROWS_FILE: &'static str = "trajectories.csv";
    const COLUMNS: &'static str = "object,trajectory,bin,underlying,method,vsd_initial,vsd_final,\
        add_final_mm,n_estimates,mahalanobis_squared,note";

    fn check(&self, fields: &Fields<'_>) -> Result<(), IoError> {
        let (is_valid, found) = (self.experiment == SEQUENTIAL, quoted(&self.experiment));
        fields.require(is_valid, "experiment", found, quoted(SEQUENTIAL))?;
        fields.count("trajectories", MAX_TRAJECTORIES)?;
        fields.at_least_0(&[
            "max_translation_m",
            "path_m",
            "axis_offset_m",
            "reconstruction_translation_m",
            "reconstruction_rotation_deg",
        ])?;
        fields.above_0(&[
            "start_distance_m",
            "speed_m_s",
            "reconstruction_voxel_m",
            "reconstruction_max_distance_m",
        ])?;
        if let PathDirection::Target { offset_m } = self.path {
            let (is_valid, expected) = (offset_m >= 0.0, "a number of at least 0");
            fields.require(is_valid, "path.target.offset_m", offset_m, expected)?;
        }
        if let Some(truncation) = self.reconstruction_truncation_m {
            fields.between("reconstruction_truncation_m", truncation, f64::INFINITY)?;
        }
        for (field, text) in [
            ("depth_noise", &self.depth_noise),
            (
                "reconstruction_depth_noise",
                &self.reconstruction_depth_noise,
            ),
        ] {
            let is_valid = text.parse::<DepthNoise>().is_ok();
            let expected = "a noise, such as none, relative:2 or d435-ahn2019-axial";
            fields.require(is_valid, field, quoted(text), expected)?;
        }
        fields.names("underlying", MAX_UNDERLYING)?;
        for (index, underlying) in self.underlying.iter().enumerate() {
            let field = format_args!("underlying[{index}].seconds_per_estimate");
            fields.between(field, underlying.seconds_per_estimate, f64::INFINITY)?;
            let seconds = underlying.seconds_per_mve;
            let field = format_args!("underlying[{index}].seconds_per_mve");
            fields.require(seconds >= 0.0, field, seconds, "a number of at least 0")?;
        }
        fields.names("methods", MAX_METHODS)?;
        for (index, method) in self.methods.iter().enumerate() {
            let is_known = FusionRule::from_name(method).is_some();
            let field = format_args!("methods[{index}]");
            fields.require(is_known, field, quoted(method), FusionRule::EXPECTED)?;
        }
        let nearest = self.start_distance_m - self.path_m;
        fields.common(&self.layout(), nearest, ["underlying", "methods"])
    }

    fn layout(&self) -> Layout<'_> {
        Layout {
            seed: self.seed,
            camera: self.camera,
            objects: &self.objects,
            settings: self.underlying.iter().map(|u| u.name.as_str()).collect(),
            variants: self.methods.iter().map(String::as_str).collect(),
            cases: self.trajectories.saturating_mul(self.bins as u64),
            bins: self.bins,
            is_binned: vec![true; self.underlying.len()],
            // An interrupted study then has nearly the same number of trajectories of every object.
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
