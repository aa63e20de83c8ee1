//! The sequential study end to end: streaming, resuming, pairing, and any number of threads.

use hicp_core::PinholeCamera;
use hicp_experiments::{
    Design, FusionRule, Metric, Panel, PathDirection, Row, Subject, TrajectoryClock,
    TrajectoryConfig, TrajectoryReport,
};
use hicp_sim::Household;
use hybrid_icp::{Preset, WithoutPairs};

use crate::common::{Folder, assert_contains, refused};

const BOTH: [Preset; 2] = [Preset::Hybrid, Preset::ProjectiveCascadePointPlane];

const ROWS: &str = TrajectoryConfig::ROWS_FILE;

fn mug() -> Vec<Subject> {
    Subject::household(&[Household::Mug]).unwrap()
}

/// Creates a study of one short trajectory per bin, with a small camera and a coarse
/// reconstruction.
fn config() -> TrajectoryConfig {
    let mut config = TrajectoryConfig::new(&mug(), &BOTH, 1, 3)
        .unwrap()
        .improved();
    config.camera = PinholeCamera::new(143.0, 143.0, 79.5, 59.5, 160, 120).unwrap();
    config.start_distance_m = 0.6;
    config.path_m = 0.12;
    config.underlying[1].seconds_per_estimate = 0.4;
    config.reconstruction_images = 20;
    config.reconstruction_voxel_m = 0.004;
    config.reconstruction_truncation_m = Some(0.012);
    config
}

#[test]
fn a_small_study_runs_to_its_report() {
    let config = config();
    let folder = Folder::with(&config, 2);
    let study = folder.study::<TrajectoryConfig>();
    assert_eq!(study.rows.len(), 10 * 2 * FusionRule::ALL.len());
    for row in &study.rows {
        let measured = row.measured.as_ref().unwrap();
        let (vsd_initial, vsd_final) = (measured.vsd_initial, measured.vsd_final);
        // All rows of a trajectory have the same start, which determines the bin.
        let bin = usize::try_from(row.case).unwrap();
        assert_eq!(row.bin, Some(bin));
        assert!((vsd_initial * 10.0 - bin as f64 - 0.5).abs() <= 0.5 + 1e-4);
        assert!((0.0..=1.0).contains(&vsd_final), "{row:?}");
        // 12 cm at 0.1 m/s and 0.542 s per image: after 0, 5.42 and 10.84 cm. At 0.4 s: every 4 cm.
        let images = if row.setting == "hybrid" { 3 } else { 4 };
        assert_eq!(config.n_images(usize::from(images == 4), true), images);
        assert!(measured.steps <= images, "{row:?}");
        // A method with an estimate states a covariance.
        let distance = measured.mahalanobis_squared;
        assert_eq!(distance.is_some(), measured.steps > 0, "{row:?}");
        assert!(distance.is_none_or(|squared| squared >= 0.0));
    }
    // Methods differ, and from good starts all find the object.
    let differ = study.rows.chunks(FusionRule::ALL.len());
    let vsd = |row: &Row| row.measured.as_ref().map(|m| (m.vsd_initial, m.vsd_final));
    let differ = differ.filter(|rows| rows.iter().any(|r| vsd(r) != vsd(&rows[0])));
    assert!(differ.count() > 0);
    let report = TrajectoryReport::of(vec![("sequential".to_owned(), study)]);
    let analysis = &report.entries()[0].analysis;
    let average = analysis.variant("hybrid/average").unwrap();
    let first = analysis.mean(Metric::Vsd, 0, average).unwrap();
    assert!(first.estimate < 0.3, "{first:?}");
    assert_eq!(report.claims().count(), 2 * 6 + 2);
    // Each underlying pipeline has a panel with the paper's six methods, and one with average and
    // the four methods beyond the paper.
    let (_, figure) = report.figures().remove(0);
    let curves = |row: &Vec<Panel>| row.iter().map(|p| p.curves.len()).collect::<Vec<_>>();
    let curves: Vec<Vec<usize>> = figure.rows.iter().map(curves).collect();
    assert_eq!(curves, [[6, 6], [5, 5]]);
    report.write(folder.root()).unwrap();
    let html = folder.text("report.html");
    assert_contains(
        &html,
        &[
            "<svg",
            "post-trajectory VSD",
            "gated-weighted-average",
            "calibrated-weighted-average",
            "average is at least as good",
        ],
    );
    for file in [
        "figure.svg",
        "figure.png",
        "summary.csv",
        "differences.csv",
        "claims.csv",
        "calibration.csv",
    ] {
        assert!(folder.path(file).metadata().unwrap().len() > 100);
    }
}

#[test]
fn threads_and_interruptions_do_not_change_the_rows() {
    let config = config();
    let whole = Folder::with(&config, 1).bytes(ROWS);
    let two = Folder::with(&config, 2);
    assert_eq!(two.bytes(ROWS), whole);
    // Cut in the header, between trajectories, and within one.
    for cut in [5, whole.len() / 2, whole.len() - 7] {
        two.write(ROWS, &whole[..cut]);
        two.run(&config, 2, true).unwrap();
        assert_eq!(two.bytes(ROWS), whole, "cut at {cut}");
    }
    // Existing rows are not overwritten, and another study does not continue them.
    refused(two.run(&config, 1, false), &["or --resume"]);
    let mut other = config.clone();
    other.underlying[0].seconds_per_estimate = 0.3;
    let resumed = two.run(&other, 1, true);
    refused(resumed, &["\"seconds_per_estimate\": 0.3"]);
}

#[test]
fn pipelines_of_one_study_share_paths_and_starts() {
    let both = config();
    let mut alone = both.clone();
    alone.underlying.remove(0);
    let rows = |config| Folder::with(config, 2).study::<TrajectoryConfig>().rows;
    let [both, alone] = [&both, &alone].map(rows);
    let expected: Vec<_> = both
        .into_iter()
        .filter(|row| row.setting == BOTH[1].name())
        .collect();
    assert_eq!(alone, expected);
}

#[test]
fn with_the_real_clock_every_method_runs_to_the_end() {
    let mut config = config();
    config.clock = TrajectoryClock::Real;
    config.methods = vec!["last-estimate".to_owned(), "average".to_owned()];
    // The camera is so fast that the path ends after a few images on any machine.
    config.speed_m_s = 20.0;
    let folder = Folder::with(&config, 2);
    let study = folder.study::<TrajectoryConfig>();
    assert_eq!(study.config.clock, TrajectoryClock::Real);
    assert_eq!(study.rows.len(), 10 * 2 * 2);
    for row in &study.rows {
        // Every method registers at least the first image.
        assert!(
            row.measured
                .as_ref()
                .is_some_and(|m| (0.0..=1.0).contains(&m.vsd_final)),
            "{row:?}"
        );
    }
    assert!(
        study
            .rows
            .iter()
            .any(|row| row.measured.as_ref().is_some_and(|m| m.steps > 0))
    );
    let report = TrajectoryReport::of(vec![("sequential".to_owned(), study)]);
    report.write(folder.root()).unwrap();
    let html = folder.text("report.html");
    assert!(html.contains("no run repeats this one"));
}

#[test]
fn methods_that_need_an_mve_see_fewer_images() {
    let mut config = config();
    config.methods = vec!["average".to_owned(), "weighted-average".to_owned()];
    config.underlying.truncate(1);
    (
        config.underlying[0].seconds_per_estimate,
        config.underlying[0].seconds_per_mve,
    ) = (0.3, 0.3);
    let folder = Folder::with(&config, 2);
    let study = folder.study::<TrajectoryConfig>();
    // 12 cm at 0.1 m/s: an image every 3 cm, and with an MVE every 6 cm.
    let steps = |row: &Row| row.measured.as_ref().map(|m| m.steps);
    let steps: Vec<_> = study.rows.iter().map(steps).collect();
    assert_eq!(steps, [Some(5), Some(3)].repeat(10));
}

#[test]
fn a_field_is_changed_by_name() {
    let config = config();
    let changed = config.with("reconstruction_truncation_m=0.012").unwrap();
    assert_eq!(changed.reconstruction_truncation_m, Some(0.012));
    let changed = changed
        .with("path={\"target\":{\"offset_m\":0.05}}")
        .unwrap();
    assert_eq!(changed.path, PathDirection::Target { offset_m: 0.05 });
    let changed = changed.with("without_pairs=nothing").unwrap();
    assert_eq!(changed.without_pairs, WithoutPairs::Nothing);
    for (change, part) in [
        ("speed=1", "speed: found no such field"),
        ("objects=[]", "objects: found a field that the command sets"),
        ("speed_m_s=fast", "speed_m_s"),
        ("speed_m_s=-1", "speed_m_s"),
        ("depth_noise=d435", "a noise"),
    ] {
        refused(config.with(change), &[part]);
    }
}

#[test]
fn configurations_that_cannot_be_run_are_refused() {
    let refused = |subjects: &[Subject], n, presets: &[Preset]| {
        TrajectoryConfig::new(subjects, presets, n, 1)
    };
    assert!(refused(&mug(), 0, &BOTH).is_err());
    assert!(refused(&mug(), 1, &[]).is_err());
    assert!(refused(&mug(), 1, &[BOTH[0], BOTH[0]]).is_err());
    assert!(refused(&[], 1, &BOTH).is_err());
}
