//! Fields of configurations, and configurations that cannot run.

use super::*;

#[test]
fn fields_of_a_configuration_are_checked() {
    let stored = Stored::single();
    let one = json!({"name": "mug", "source": "", "triangles": 1, "diameter_mm": 100.0, "symmetric": false, "fingerprint": ""});
    let variant = json!({"name": "hybrid", "pipeline": ""});
    for (pointer, value, field, part) in [
        ("/bins", json!(0), "bins", "1 to 1000"),
        ("/bins", json!(4_000_000_000_u64), "bins", "1 to 1000"),
        (
            "/bins",
            json!(1_000_000_000_000_000_000_u64),
            "bins",
            "1 to 1000",
        ),
        ("/bins", json!(MAX_BINS + 1), "bins", "1 to 1000"),
        ("/poses", json!(0), "poses", "1 to 1000000"),
        ("/poses", json!(u64::MAX), "poses", "1 to 1000000"),
        ("/objects", json!([]), "objects", "1 to"),
        ("/objects", json!([one, one]), "objects", "different names"),
        (
            "/objects",
            json!(vec![&one; MAX_OBJECTS + 1]),
            "objects",
            "1 to 10000",
        ),
        (
            "/objects/1/diameter_mm",
            json!(0.0),
            "objects[1].diameter_mm",
            "above 0",
        ),
        ("/variants", json!([]), "variants", "1 to"),
        (
            "/variants",
            json!([variant, variant]),
            "variants",
            "different names",
        ),
        ("/levels", json!([]), "levels", "1 to 1"),
        (
            "/levels",
            json!(["1"]),
            "levels[0]",
            "\"0\", as in every init-noise study",
        ),
        ("/levels", json!(vec!["0"; 100_000]), "levels", "1 to 1"),
        (
            "/max_translation_m",
            json!(-0.1),
            "max_translation_m",
            "at least 0",
        ),
        ("/max_distance_m", json!(0.0), "max_distance_m", "above 0"),
    ] {
        let outcome = stored.with(pointer, value);
        assert_eq!(outcome.0, field);
        assert!(outcome.2.contains(part), "{field}: {outcome:?}");
    }
    let outcome = stored.with("/objects", json!([one, one]));
    assert_eq!(outcome.1, "\"mug\" twice");
    // Each number is within its limit, but their product is not.
    let many: Vec<Value> = (0..=MAX_CELLS / 2)
        .map(|i| json!({"name": i.to_string(), "pipeline": ""}))
        .collect();
    let outcome = stored.with("/variants", json!(many));
    assert_eq!(outcome.0, "levels × variants × bins");
    assert_eq!(
        (&*outcome.1, &*outcome.2),
        ("1 × 5001 × 2", "at most 10000")
    );
}

#[test]
fn fields_of_a_sequential_configuration_are_checked() {
    let stored = Stored::sequential();
    let hybrid = json!({"name": "hybrid", "pipeline": "", "seconds_per_estimate": 0.5, "seconds_per_mve": 0.1});
    for (pointer, value, field, part) in [
        (
            "/experiment",
            json!("init-noise"),
            "experiment",
            "\"sequential\"",
        ),
        ("/bins", json!(0), "bins", "1 to 1000"),
        ("/bins", json!(4_000_000_000_u64), "bins", "1 to 1000"),
        (
            "/trajectories",
            json!(u64::MAX),
            "trajectories",
            "1 to 100000",
        ),
        ("/objects", json!([]), "objects", "1 to"),
        ("/underlying", json!([]), "underlying", "1 to"),
        (
            "/underlying",
            json!([hybrid, hybrid]),
            "underlying",
            "different names",
        ),
        (
            "/underlying/0/seconds_per_estimate",
            json!(0.0),
            "underlying[0].seconds_per_estimate",
            "above 0",
        ),
        (
            "/underlying/0/seconds_per_mve",
            json!(-0.1),
            "underlying[0].seconds_per_mve",
            "at least 0",
        ),
        ("/depth_noise", json!("d435"), "depth_noise", "a noise"),
        (
            "/path",
            json!({"target": {"offset_m": -1.0}}),
            "path.target.offset_m",
            "at least 0",
        ),
        (
            "/reconstruction_truncation_m",
            json!(0.0),
            "reconstruction_truncation_m",
            "above 0",
        ),
        ("/methods", json!([]), "methods", "1 to"),
        (
            "/methods",
            json!(["average", "average"]),
            "methods",
            "different names",
        ),
        (
            "/methods",
            json!(["average", "mean"]),
            "methods[1]",
            "a method of the paper",
        ),
        ("/speed_m_s", json!(0.0), "speed_m_s", "above 0"),
        ("/path_m", json!(-1.0), "path_m", "at least 0"),
    ] {
        let outcome = stored.with(pointer, value);
        assert_eq!(outcome.0, field);
        assert!(outcome.2.contains(part), "{field}: {outcome:?}");
    }
    // Each number is within its limit, but their product is not.
    let mut config: Value = serde_json::from_str(&stored.text(CONFIG_FILE)).unwrap();
    config["methods"] = json!(FusionRule::ALL.map(FusionRule::name));
    stored.write(CONFIG_FILE, config.to_string());
    let outcome = stored.with("/bins", json!(MAX_BINS));
    assert_eq!(outcome.0, "underlying × methods × bins");
    assert_eq!(
        (&*outcome.1, &*outcome.2),
        ("2 × 10 × 1000", "at most 10000")
    );
}

#[test]
fn invalid_configurations_are_not_run() {
    let folder = Folder::new();
    let out = folder.path("out");
    let presets = [Variant::preset(Preset::Hybrid)];
    let mut config = Config::new(Experiment::InitNoise, &subjects(), &presets, 2, 3).unwrap();
    config.bins = 0;
    let go = &mut |_| ControlFlow::Continue(());
    let outcome = run(&config, &subjects(), &out, RunOptions::default(), go);
    refused(outcome, &["bins: found 0, expected 1 to 1000"]);
    let mut config = TrajectoryConfig::new(&subjects(), &[Preset::Hybrid], 1, 3).unwrap();
    config.bins = 0;
    let outcome = run(&config, &subjects(), &out, RunOptions::default(), go);
    refused(outcome, &["bins: found 0, expected 1 to 1000"]);
    assert!(!out.exists());
}

/// The configurations of the committed results are still valid; only their rows are not committed.
#[test]
fn the_committed_configurations_are_read() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/study");
    if !docs.is_dir() {
        eprintln!("SKIPPED: the package has no {}", docs.display());
        return;
    }
    for name in ["beyond", "sequential", "sequential/improved"] {
        let folder = Folder::new();
        let config = std::fs::read(docs.join(name).join(CONFIG_FILE)).unwrap();
        folder.write(CONFIG_FILE, config);
        if name == "beyond" {
            let row = "\nbowl,0,hybrid,perfect,0,0.05,0.04,1.5,9,converged,2.5,,\n";
            folder.write(Config::ROWS_FILE, format!("{}{row}", Config::COLUMNS));
            let study = folder.study::<Config>();
            assert_eq!(study.config.levels.len(), 14, "{name}");
        } else {
            let row = "\nbowl,0,0,hybrid,last-estimate,0.05,0.04,1.5,9,2.5,\n";
            folder.write(
                TrajectoryConfig::ROWS_FILE,
                format!("{}{row}", TrajectoryConfig::COLUMNS),
            );
            let study = folder.study::<TrajectoryConfig>();
            assert_eq!(study.config.bins, 10, "{name}");
        }
    }
}

#[test]
fn ranges_of_bins_have_fixed_limits_of_the_initial_vsd() {
    for (bins, low, high, first) in [
        (10, 0..3, 7..10, "0.0-0.1"),
        (20, 0..6, 14..20, "0.00-0.05"),
        (7, 0..2, 5..7, "0.000-0.143"),
        (1, 0..0, 1..1, "0.0-1.0"),
    ] {
        let stored = Stored::single();
        let mut study = Study::read(stored.root()).unwrap();
        study.config.bins = bins;
        let analysis = Analysis::of(&study);
        let range = |label| {
            let group = analysis.group(label).unwrap();
            analysis.groups()[group].bins.clone().unwrap()
        };
        assert_eq!((range(LOW), range(HIGH)), (low, high), "{bins}");
        assert_eq!(analysis.groups()[0].label, first);
        let all = analysis.mean(Metric::Vsd, analysis.overall(), 0).unwrap();
        assert!((all.estimate - 0.04).abs() < 1e-12);
        // There is no such group or variant.
        assert!(
            analysis
                .mean(Metric::Vsd, analysis.groups().len(), 0)
                .is_none()
        );
        assert!(analysis.mean(Metric::Vsd, 0, 2).is_none());
        assert!(
            analysis.cell(analysis.groups().len(), 0).is_none() && analysis.cell(0, 2).is_none()
        );
        let figures = Report::of(vec![("it".to_owned(), study)]).figures();
        let points = &figures[0].1.rows[0][0].curves[0].points;
        assert!((points[0].0 - 0.5 / bins as f64).abs() < 1e-12);
    }
}

#[test]
fn numbers_that_are_not_a_camera_are_refused_by_name() {
    for stored in [Stored::single(), Stored::sequential()] {
        for (pointer, value, name) in [
            ("/camera/fx", json!(0.0), "fx is 0"),
            ("/camera/fy", json!(-1.0), "fy is -1"),
            ("/camera/width", json!(u32::MAX), "width is 4294967295"),
        ] {
            let error = stored.error_with(pointer, value);
            assert!(error.found.contains(name), "{error}");
            assert_eq!(error.expected, "the configuration of a study");
        }
    }
}
