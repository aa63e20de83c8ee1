//! Sizes of studies, and names of their parts.

use std::collections::BTreeSet;

use hicp_experiments::{Config, Design, Experiment, FusionRule, TrajectoryConfig, Variant};
use hybrid_icp::Preset;
use hybrid_icp::pipeline::PipelineLimits;

use crate::common::{Folder, subjects};

#[test]
fn cases_are_per_object_and_rows_per_level_and_variant() {
    // Both pipelines switch, which a study of the threshold requires.
    let hybrid = Variant::preset(Preset::Hybrid);
    let other = Variant {
        name: "other".to_owned(),
        ..hybrid.clone()
    };
    let variants = [hybrid, other];
    for experiment in Experiment::ALL {
        let config = Config::new(experiment, &subjects(), &variants, 7, 1).unwrap();
        let layout = config.layout();
        assert_eq!(layout.n_cases(), 14);
        assert_eq!(layout.rows_per_case(), 2 * experiment.levels().len());
    }
}

#[test]
fn studies_have_different_titles() {
    let titles = Experiment::ALL.map(Experiment::title);
    assert_eq!(BTreeSet::from(titles).len(), titles.len());
}

#[test]
fn the_time_of_an_estimate_decides_the_distance_between_images() {
    let presets = [Preset::Hybrid, Preset::ProjectivePointToPlane];
    let mut config = TrajectoryConfig::new(&subjects(), &presets, 3, 1).unwrap();
    assert_eq!(config.layout().n_cases(), 3 * 10 * 2);
    assert_eq!(config.layout().rows_per_case(), 2 * FusionRule::ALL.len());
    config.underlying[1].seconds_per_estimate = 0.25;
    config.underlying[1].seconds_per_mve = 0.05;
    // 0.6 m in steps of 2.5 cm and of 3 cm, both ends included.
    assert_eq!(config.n_images(1, false), 25);
    assert_eq!(config.n_images(1, true), 21);
    assert_eq!(config.improved().n_images(1, true), 25);
}

#[test]
fn fusion_rules_are_found_by_their_names() {
    for rule in FusionRule::ALL {
        assert_eq!(FusionRule::from_name(&rule.name()), Some(rule));
    }
    assert_eq!(FusionRule::from_name("gated"), None);
}

#[test]
fn a_variant_from_a_file_has_its_name_and_is_a_pipeline() {
    let folder = Folder::new();
    let read = |name| Variant::read_within(&PipelineLimits::DEFAULT, &folder.path(name));
    let preset = Variant::preset(Preset::Hybrid);
    folder.write("mine.toml", &preset.toml);
    let mine = read("mine.toml").unwrap();
    assert_eq!((mine.name.as_str(), &mine.toml), ("mine", &preset.toml));
    folder.write("wrong.toml", "type = \"icq\"");
    assert!(read("wrong.toml").is_err() && read("absent.toml").is_err());
}

#[test]
fn rules_and_variants_beyond_the_paper_are_separate() {
    let of_paper = FusionRule::ALL.iter().filter(|rule| rule.is_of_paper());
    assert_eq!(of_paper.count(), 6);
    let beyond = Variant::beyond();
    let names: BTreeSet<&str> = beyond.iter().map(|variant| variant.name.as_str()).collect();
    assert_eq!(names.len(), beyond.len());
    let paper: Vec<String> = Variant::paper()
        .into_iter()
        .map(|variant| variant.name)
        .collect();
    let new: Vec<&str> = names
        .into_iter()
        .filter(|name| !paper.iter().any(|p| p == name))
        .collect();
    assert_eq!(new, ["auto", "hybrid-visible", "local", "search"]);
}
