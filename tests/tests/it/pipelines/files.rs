//! Pipelines from files: the same bits as in code, and helpful messages.

use std::collections::HashSet;
use std::time::{Duration, Instant};

use hicp_sim::{Household, rng};
use hicp_tests::perturbed_scene;
use hybrid_icp::icp::Stage;
use hybrid_icp::pipeline::PipelineFile;
use hybrid_icp::pipeline::{Accepts, Catalog, PartKind};
use hybrid_icp::{Preset, Refiner};

#[test]
fn every_shipped_file_gives_the_same_bits_as_its_code() {
    let mut rng = rng(21);
    let cases: Vec<_> = [Household::Mug, Household::Hammer]
        .into_iter()
        .flat_map(|object| [(object, 0.005, 0.1), (object, 0.07, 1.0)])
        .map(|(object, meters, angle)| perturbed_scene(object, 0.5, &mut rng, (meters, angle)))
        .collect();
    for preset in Preset::ALL {
        let file = PipelineFile::parse(preset.toml(), preset.name()).unwrap();
        let mut from_file = Refiner::boxed(file.build().unwrap());
        let mut from_code = Refiner::preset(preset);
        for (scene, init) in &cases {
            let expected = from_code.refine(&scene.model, &scene.observation, init);
            let found = from_file.refine(&scene.model, &scene.observation, init);
            assert_eq!(found, expected, "{preset}");
        }
    }
}

/// Returns TOML that uses a part and sets only the parameters without a default.
fn smallest_use(kind: PartKind, name: &str) -> String {
    let part = Catalog::built_in()
        .parts()
        .find(|p| p.kind == kind && p.name == name)
        .unwrap();
    let mut fields = format!("type = \"{name}\"");
    for parameter in &part.parameters {
        let value = match parameter.accepts {
            Accepts::Number {
                min, default: None, ..
            } => format!("{:?}", min.max(1.0)),
            Accepts::Count { min, default: None } => min.max(1).to_string(),
            Accepts::NumberList if name == "weighted-sum" => "[0.5]".to_owned(),
            Accepts::NumberList => "[0.2, 0.4]".to_owned(),
            Accepts::Part {
                kind,
                default: None,
            } => smallest_use(kind, first(kind)),
            Accepts::Parts {
                kind,
                default: None,
            } => format!("[{}]", smallest_use(kind, first(kind))),
            _ => continue,
        };
        fields += &format!(", {} = {value}", parameter.name);
    }
    format!("{{ {fields} }}")
}

fn first(kind: PartKind) -> &'static str {
    Catalog::built_in()
        .parts()
        .find(|p| p.kind == kind)
        .unwrap()
        .name
}

/// Returns a pipeline with a part in the place of its kind.
fn pipeline_with(kind: PartKind, part: &str) -> String {
    let field = |wanted, default: &str| {
        if kind == wanted {
            part.to_owned()
        } else {
            default.to_owned()
        }
    };
    let stage = if kind == PartKind::Stage {
        part.to_owned()
    } else {
        format!(
            "{{ type = \"icp\", selection = {}, association = {}, filter = [{}], metric = {}, stop = [{}] }}",
            field(PartKind::Selection, "\"all-samples\""),
            field(PartKind::Association, "\"projective\""),
            field(PartKind::Filter, "\"max-distance\""),
            field(PartKind::Metric, "\"point-to-point\""),
            field(PartKind::Stop, "\"iteration-limit\""),
        )
    };
    let switcher = field(PartKind::Switcher, "\"threshold\"");
    let score = field(PartKind::Score, "\"mve\"");
    format!(
        "type = \"guard\"\nscore = {score}\nstage = {{ type = \"switch\", switcher = {switcher}, aligned = {stage}, misaligned = {stage} }}"
    )
}

#[test]
fn every_part_of_the_catalog_builds_and_runs() {
    let (scene, init) = perturbed_scene(Household::Mug, 0.5, &mut rng(4), (0.003, 0.05));
    for part in Catalog::built_in().parts() {
        let text = pipeline_with(part.kind, &smallest_use(part.kind, part.name));
        let file = PipelineFile::parse(&text, part.name).unwrap();
        let stage = file.build().unwrap_or_else(|e| panic!("{e}\n{text}"));
        let refined = Refiner::boxed(stage).refine(&scene.model, &scene.observation, &init);
        // The guard around the part keeps the MVE from rising, whatever the part does.
        assert!(
            refined.mve <= refined.mve_initial,
            "{}: {refined:?}",
            part.name
        );
    }
}

#[test]
fn names_in_the_catalog_are_unique_within_a_kind() {
    let mut names = HashSet::new();
    for part in Catalog::built_in().parts() {
        assert!(names.insert((part.kind, part.name)), "{} twice", part.name);
    }
}

fn message(text: &str) -> String {
    let file = match PipelineFile::parse(text, "my.toml") {
        Ok(file) => file,
        Err(error) => return error.to_string(),
    };
    match file.build() {
        Ok(_) => "built".to_owned(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn messages_name_the_line_the_field_and_the_expected_value() {
    let icp = "type = \"icp\"\nselection = \"all-samples\"\nassociation = \"projective\"\nmetric = \"point-to-plane\"\n";
    assert_eq!(message(icp), "built");
    for (text, wanted) in [
        (
            icp.replace("point-to-plane", "point-to-plain"),
            "my.toml:4: metric: no metric is named \"point-to-plain\"; did you mean \"point-to-plane\"?",
        ),
        (
            format!("{icp}filtr = []\n"),
            "my.toml:5: filtr: icp has no such field; did you mean \"filter\"?",
        ),
        (
            format!("{icp}filter = [{{ type = \"max-distance\", limit = 1 }}]\nlimit = 2\n"),
            "my.toml:6: limit: icp has no such field; did you mean \"filter.0.limit\"?",
        ),
        (
            icp.replace("metric", "# metric"),
            "my.toml:1: metric: missing, expected a metric: point-to-point",
        ),
        (
            format!("{icp}filter = [\n  {{ type = \"max-distance\", limit = -1 }},\n]\n"),
            "my.toml:6: filter.0.limit: found -1, expected a number from 0 to inf",
        ),
        (
            format!("{icp}filter = [{{ type = \"max-distance\", unit = \"feet\" }}]\n"),
            "my.toml:5: filter.0.unit: found the text \"feet\", expected one of diameters, meters",
        ),
        (
            format!("{icp}filter = [{{ type = \"max-distance\", unit = \"meters\" }}]\n"),
            "my.toml:5: filter.0.limit: missing, expected a length in `unit`",
        ),
        (
            format!("{icp}filter = [{{ type = \"var-trimmed\", min_keep = 1 }}]\n"),
            "my.toml:5: filter.0.min_keep: found 1, expected at most max_keep, 0.99",
        ),
        (
            icp.replace(
                "\"all-samples\"",
                "{ type = \"visible-surface\", points = 9, pixels = 2 }",
            ),
            "my.toml:2: selection.points: found 9, expected either points or pixels",
        ),
        (
            icp.replace(
                "\"point-to-plane\"",
                "{ type = \"weighted-sum\", metrics = [\"point-to-plane\"], weights = [nan] }",
            ),
            "my.toml:4: metric.weights: found a list of 1, expected a list of numbers",
        ),
        (
            format!("{icp}stop = [{{ type = \"iteration-limit\", iterations = 2.5 }}]\n"),
            "my.toml:5: stop.0.iterations: found 2.5, expected a whole number of 0 or more",
        ),
        (
            format!("{icp}stop = \"divergence\"\n"),
            "my.toml:5: stop: found the text \"divergence\", expected a list of stop rules",
        ),
        (
            icp.replace("\"icp\"", "3"),
            "my.toml:1: type: found 3, expected the name of a stage",
        ),
        (
            "times = 2".to_owned(),
            "my.toml:1: type: missing, expected the name of a stage: icp",
        ),
        ("type = ".to_owned(), "my.toml:1: not TOML: "),
        (format!("{icp}type = \"icp\"\n"), "my.toml:5: not TOML: "),
    ] {
        let found = message(&text);
        assert!(found.starts_with(wanted), "wanted {wanted}\nfound  {found}");
    }
}

#[test]
fn overrides_change_nested_fields() {
    let parse = || PipelineFile::parse(Preset::Hybrid.toml(), "hybrid").unwrap();
    let mut file = parse();
    file.set("times=1").unwrap();
    file.set("stage.switcher.alpha = 0.5").unwrap();
    file.set("stage.aligned.stages.1.metric=point-to-point")
        .unwrap();
    // A bare name becomes a table if one of its fields is set.
    file.set("stage.misaligned.association.points=500").unwrap();
    assert!(file.build().is_ok());
    assert_ne!(file, parse());
    // A field of the inner stage needs no path.
    let mut color = PipelineFile::parse(Preset::Color.toml(), "color").unwrap();
    color.set("milliseconds=30").unwrap();
    let limit = color.build().unwrap().time_limit();
    assert_eq!(limit, Some(Duration::from_millis(30)));

    for (assignment, wanted) in [
        ("times", "expected path=value"),
        ("stage.nothing.here=1", "\"stage\" has no \"nothing\""),
        ("stage.aligned.stages.7.metric=x", "a list of 2"),
        (
            "stage.switcher.alpha=0.5\nnonsense=1",
            "is more than one TOML value",
        ),
        ("times.more.still=1", "\"times\" is 2, expected a table"),
    ] {
        let error = parse().set(assignment).unwrap_err().to_string();
        assert!(error.contains(wanted), "{assignment}: {error}");
    }
    let mut wrong = parse();
    wrong.set("stage.switcher.alpha=high").unwrap();
    let error = wrong.build().map(|_| ()).unwrap_err().to_string();
    assert_eq!(
        error,
        "hybrid: stage.switcher.alpha: found the text \"high\", expected a number from -inf to inf"
    );
}

#[test]
fn the_text_of_a_file_is_returned_and_an_absent_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.toml");
    std::fs::write(&path, Preset::Hybrid.toml()).unwrap();
    assert_eq!(
        PipelineFile::read_text(&path).unwrap(),
        Preset::Hybrid.toml()
    );
    let origin = path.to_string_lossy();
    let parsed = PipelineFile::parse(Preset::Hybrid.toml(), &origin).unwrap();
    assert_eq!(PipelineFile::read(&path).unwrap(), parsed);
    std::fs::write(&path, b"type = \"\xff\"").unwrap();
    let error = PipelineFile::read_text(&path).unwrap_err();
    let error = std::error::Error::source(&error).unwrap().to_string();
    assert!(error.contains("byte 8: found what is not UTF-8"), "{error}");
    let absent = PipelineFile::read_text(folder.path().join("absent.toml"));
    assert!(absent.unwrap_err().to_string().contains("absent.toml"));
}

/// Reading a large file once took more than a minute, because every value counted the lines again.
#[test]
fn reading_a_large_file_takes_time_in_proportion_to_its_size() {
    let stage = "\n[[stages]]\ntype = \"icp\"\nselection = { type = \"visible-surface\", points = 500 }\n\
                 association = \"projective\"\nmetric = \"point-to-plane\"\n";
    let text = format!("type = \"cascade\"\n{}", stage.repeat(6000));
    assert!(text.len() > 700_000);
    let start = Instant::now();
    let mut file = PipelineFile::parse(&text, "large.toml").unwrap();
    assert!(file.build().is_ok());
    file.set("stages.5999.metric=nothing").unwrap();
    assert!(file.build().is_err());
    let wrong = text.clone() + "points = 3\n";
    let error = PipelineFile::parse(&wrong, "large.toml").unwrap().build();
    let error = error.map(|_| ()).unwrap_err().to_string();
    assert!(
        error.starts_with("large.toml:36002: stages.5999.points: icp has no such field"),
        "{error}"
    );
    // Optimized code takes 0.1 s.
    let elapsed = start.elapsed();
    assert!(elapsed < Duration::from_secs(20), "{elapsed:?}");
}
