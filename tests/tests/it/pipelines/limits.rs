//! Pipeline files with too much work are refused with the field, the value found and the limit.

use hicp_sim::Household;
use hicp_tests::render;
use hybrid_icp::core::{Isometry3, Model, Observation, PinholeCamera, Vector3};
use hybrid_icp::pipeline::{Accepts, Catalog, Part, PartKind, PipelineErrorKind};
use hybrid_icp::pipeline::{PipelineFile, PipelineLimits};
use hybrid_icp::{Preset, Refiner};

const ICP: &str = r#"{ type = "icp", selection = "all-samples", association = "projective", metric = "point-to-plane" }"#;

fn parse(text: &str) -> PipelineFile {
    PipelineFile::parse(text, "my.toml").unwrap()
}

fn message(text: &str) -> String {
    parse(text).build().map(|_| ()).unwrap_err().to_string()
}

#[test]
fn a_count_of_a_billion_is_refused_with_its_field() {
    const RAISE: &str = "expected at most 1000000: raise the limit (--max-iterations N, PipelineLimits::max_iterations) if that is meant";
    let solver = |name: &str| {
        ICP.replace(
            "\"point-to-plane\"",
            &format!(
                "{{ type = \"{name}\", iterations = 1000000000, metric = \"point-to-plane\" }}"
            ),
        )
    };
    for (text, field, found) in [
        (
            format!("type = \"repeat\"\ntimes = 1000000000\nstage = {ICP}\n"),
            "my.toml:2: times",
            "1000000000, up to 50000000000 iterations in all",
        ),
        (
            format!("type = \"keep-best\"\nstage = {ICP}\ntimes = 1000000000\n"),
            "my.toml:3: times",
            "1000000000, up to 50000000000 iterations in all",
        ),
        (
            format!("type = \"anderson\"\nstage = {ICP}\nmax_steps = 1000000000\n"),
            "my.toml:3: max_steps",
            "1000000000, up to 50000000000 iterations in all",
        ),
        (
            format!(
                "type = \"alternate\"\naligned = {ICP}\nmisaligned = {ICP}\nmax_steps = 1000000000\n"
            ),
            "my.toml:4: max_steps",
            "1000000000, up to 50000000000 iterations in all",
        ),
        // The innermost field that exceeds the limit: 3 times 1000 times 50 iterations, and then
        // 100 times as many.
        (
            format!(
                "type = \"repeat\"\ntimes = 3\n[stage]\ntype = \"repeat\"\ntimes = 100\n[stage.stage]\ntype = \"repeat\"\ntimes = 1000\nstage = {ICP}\n"
            ),
            "my.toml:5: stage.times",
            "100, up to 5000000 iterations in all",
        ),
        (
            format!("type = \"guard\"\nstage = {}\n", solver("gauss-newton")),
            "my.toml:2: stage.metric.iterations",
            "1000000000, up to 1000000000 iterations in all",
        ),
        (
            format!(
                "type = \"at-resolution\"\nstage = {}\n",
                solver("levenberg-marquardt")
            ),
            "my.toml:2: stage.metric.iterations",
            "1000000000, up to 1000000000 iterations in all",
        ),
        (
            format!(
                "type = \"hypothesis-search\"\nrefined = 1000000000\nstage = {ICP}\nexplore = {ICP}\n"
            ),
            "my.toml:2: refined",
            "1000000000, up to 58833334656 iterations in all",
        ),
    ] {
        assert_eq!(message(&text), format!("{field}: found {found}, {RAISE}"));
    }
    let search = format!(
        "type = \"hypothesis-search\"\nhypotheses = 1000000000\nstage = {ICP}\nexplore = {ICP}\n"
    );
    assert_eq!(
        message(&search),
        "my.toml:2: hypotheses: found 1000000000, 1000000000 hypotheses, expected at most 100000: raise the limit (--max-hypotheses N, \
         PipelineLimits::max_hypotheses) if that is meant"
    );
}

#[test]
fn stages_without_an_iteration_limit_count_with_the_default_limit() {
    let endless = ICP.replace(" }", ", stop = [\"convergence\"] }");
    let text = |times: u32| format!("type = \"repeat\"\ntimes = {times}\nstage = {endless}\n");
    assert!(parse(&text(1000)).build().is_ok());
    assert!(message(&text(1001)).contains("times: found 1001, up to 1001000 iterations"));
    // A sequence of many stages, none of which exceeds the limit.
    let part = format!("{{ type = \"repeat\", times = 400, stage = {endless} }}");
    let text = |count: usize| {
        let parts = vec![part.as_str(); count].join(",\n");
        format!("type = \"cascade\"\nstages = [{parts}]\n")
    };
    assert!(parse(&text(2)).build().is_ok());
    let found = message(&text(3));
    let expected = "my.toml:2: stages: found up to 1200000 iterations in all, ";
    assert!(found.starts_with(expected), "{found}");
    // A switch runs only one of its stages.
    for kind in ["switch", "switch-among"] {
        let both = match kind {
            "switch" => format!("aligned = {part}\nmisaligned = {part}\n"),
            _ => format!("stages = [{part}, {part}, {part}]\n"),
        };
        let text = format!("type = \"repeat\"\ntimes = 2\n[stage]\ntype = \"{kind}\"\n{both}");
        assert!(parse(&text).build().is_ok());
        let three = text.replace("times = 2\n", "times = 3\n");
        assert!(message(&three).starts_with("my.toml:2: times: found 3, up to 1200000"));
    }
}

#[test]
fn limits_are_exact_when_raised_or_lowered() {
    let mut file = PipelineFile::parse(Preset::Search.toml(), "search").unwrap();
    file.set("hypotheses=100001").unwrap();
    let defaults = PipelineLimits::DEFAULT;
    let raised = PipelineLimits {
        max_hypotheses: 100_001,
        ..defaults
    };
    assert!(file.build_within(&defaults).is_err());
    assert!(file.build_within(&raised).is_ok());
    assert!(file.build_within(&PipelineLimits::NONE).is_ok());

    let text = format!("type = \"repeat\"\ntimes = 7\nstage = {ICP}\n");
    let file = parse(&text);
    let within = |max_iterations| PipelineLimits {
        max_iterations,
        ..defaults
    };
    assert!(file.build_within(&within(350)).is_ok());
    let refused = file.build_within(&within(349)).map(|_| ()).unwrap_err();
    assert!(
        refused.kind == PipelineErrorKind::Limit
            && refused.place.field == "times"
            && refused
                .problem
                .contains("at most 349: raise the limit (--max-iterations N"),
        "{refused}"
    );
}

/// A fiftieth or a tenth of the default limits is enough for every preset.
#[test]
fn presets_are_far_below_the_limits() {
    let fiftieth = PipelineLimits {
        max_iterations: PipelineLimits::DEFAULT.max_iterations / 50,
        max_hypotheses: PipelineLimits::DEFAULT.max_hypotheses / 50,
        max_samples: PipelineLimits::DEFAULT.max_samples / 10,
        max_neighbors: PipelineLimits::DEFAULT.max_neighbors / 10,
    };
    for preset in Preset::ALL {
        let file = PipelineFile::parse(preset.toml(), preset.name()).unwrap();
        if let Err(error) = file.build_within(&fiftieth) {
            panic!("{error}");
        }
    }
}

#[test]
fn numbers_that_overflow_are_refused_and_do_not_wrap() {
    let mut text = ICP.to_owned();
    for _ in 0..8 {
        text = format!("{{ type = \"repeat\", times = 4294967295, stage = {text} }}");
    }
    let text = format!("type = \"guard\"\nstage = {text}\n");
    let file = parse(&text);
    assert!(file.build().is_err());
    let all_but_one = PipelineLimits {
        max_iterations: u64::MAX - 1,
        ..PipelineLimits::NONE
    };
    assert!(file.build_within(&all_but_one).is_err());
    assert!(file.build_within(&PipelineLimits::NONE).is_ok());
}

/// Sampling a model at four billion points would need 100 GB of memory.
#[test]
fn excessive_sizes_are_refused_wherever_they_are() {
    let observing = ICP.replace(
        "\"projective\"",
        "{ type = \"reciprocal\", association = { type = \"observation-to-model\", samples = 4294967295 } }",
    );
    let near = ICP.replace("\"projective\"", "{ type = \"k-nearest\", k = 4294967295 }");
    let sampled = "{ type = \"sampled-mve\", samples = 1000001 }";
    for (text, wanted) in [
        (
            format!("type = \"guard\"\nstage = {observing}\n"),
            "my.toml:2: stage.association.association.samples: found 4294967295, 4294967295 samples, expected at most 1000000: raise",
        ),
        (
            format!("type = \"guard\"\nstage = {ICP}\nscore = {sampled}\n"),
            "my.toml:3: score.samples: found 1000001, 1000001 samples, expected at most 1000000: raise",
        ),
        (
            format!(
                "type = \"hypothesis-search\"\nstage = {ICP}\nexplore = {ICP}\nranking = {sampled}\n"
            ),
            "my.toml:4: ranking.samples: found",
        ),
        (
            format!(
                "type = \"switch\"\naligned = {ICP}\nmisaligned = {ICP}\nswitcher = {{ type = \"threshold\", score = {sampled} }}\n"
            ),
            "my.toml:4: switcher.score.samples: found",
        ),
        (
            format!("type = \"cascade\"\nstages = [{ICP}, {near}]\n"),
            "my.toml:2: stages.1.association.k: found 4294967295, 4294967295 neighbors, expected at most 100: raise",
        ),
    ] {
        let found = message(&text);
        assert!(found.starts_with(wanted), "{found}");
        assert!(parse(&text).build_within(&PipelineLimits::NONE).is_ok());
    }
}

/// Sets every count of every part to the largest number.
///
/// Each is refused, or the run ends with a truthful outcome.
#[test]
fn the_largest_counts_are_refused_or_end() {
    let model = Model::new(Household::Mug.solid().to_mesh().unwrap());
    let camera = PinholeCamera::new(60.0, 60.0, 23.5, 17.5, 48, 36).unwrap();
    let truth = Isometry3::translation(0.0, 0.0, 0.4);
    let (depth, mask) = render(&model, &camera, &truth);
    let observation = Observation::new(depth, mask, camera).unwrap();
    let init = truth
        * Isometry3::new(
            Vector3::new(0.003, 0.0, 0.002),
            Vector3::new(0.05, 0.0, 0.03),
        );
    let (mut refused, mut ended) = (Vec::new(), 0);
    for part in Catalog::built_in().parts() {
        for parameter in &part.parameters {
            if !matches!(parameter.accepts, Accepts::Count { .. }) {
                continue;
            }
            let text = use_of(part, parameter.name);
            match parse(&text).build() {
                Err(error) if error.kind == PipelineErrorKind::Limit => {
                    refused.push((part.name, parameter.name));
                }
                Err(error) => panic!("{error}: {text}"),
                Ok(stage) => {
                    let refined = Refiner::boxed(stage).refine(&model, &observation, &init);
                    assert!((0.0..=1.0).contains(&refined.mve), "{text}");
                    ended += 1;
                }
            }
        }
    }
    refused.sort_unstable();
    assert_eq!(
        refused,
        [
            ("alternate", "max_steps"),
            ("anderson", "max_steps"),
            ("gauss-newton", "iterations"),
            ("hypothesis-search", "aligned"),
            ("hypothesis-search", "hypotheses"),
            ("hypothesis-search", "refined"),
            ("k-nearest", "k"),
            ("keep-best", "times"),
            ("levenberg-marquardt", "iterations"),
            ("normal-compatible", "k"),
            ("normal-shooting", "k"),
            ("observation-to-model", "samples"),
            ("photometric", "samples"),
            ("repeat", "times"),
            ("sampled-mve", "samples"),
            ("visible-side", "samples"),
        ]
    );
    assert!(ended > 20, "{ended}");
}

/// Returns a pipeline around a part, with one count at the largest number and all required fields.
fn use_of(part: &Part, largest: &str) -> String {
    let fields = part.parameters.iter().filter_map(|parameter| {
        let value = match parameter.accepts {
            Accepts::Count { .. } if parameter.name == largest => u32::MAX.to_string(),
            Accepts::Count { min, default: None } => min.max(1).to_string(),
            Accepts::Number {
                min, default: None, ..
            } => format!("{:?}", min.max(1.0)),
            Accepts::NumberList => "[1.0]".to_owned(),
            Accepts::Part {
                kind,
                default: None,
            } => plain(kind).to_owned(),
            Accepts::Parts {
                kind,
                default: None,
            } => format!("[{}]", plain(kind)),
            _ => return None,
        };
        Some(format!("{} = {value}", parameter.name))
    });
    let fields: Vec<String> = std::iter::once(format!("type = \"{}\"", part.name))
        .chain(fields)
        .collect();
    let of_icp = |field: &str, otherwise: [&str; 3]| {
        let this = format!("{{ {} }}", fields.join(", "));
        let [mut selection, mut association, mut metric] = otherwise.map(str::to_owned);
        let mut more = String::new();
        match field {
            "selection" => selection = this,
            "association" => association = this,
            "metric" => metric = this,
            list => more = format!("{list} = [{this}]\n"),
        }
        format!(
            "type = \"icp\"\nselection = {selection}\nassociation = {association}\nmetric = {metric}\n{more}"
        )
    };
    let plain_icp = [
        plain(PartKind::Selection),
        plain(PartKind::Association),
        plain(PartKind::Metric),
    ];
    match part.kind {
        PartKind::Stage => fields.join("\n"),
        PartKind::Selection => of_icp("selection", plain_icp),
        PartKind::Association => of_icp("association", plain_icp),
        PartKind::Metric => of_icp("metric", plain_icp),
        PartKind::Filter => of_icp("filter", plain_icp),
        PartKind::Stop => of_icp("stop", plain_icp),
        PartKind::Score => format!(
            "type = \"guard\"\nstage = {ICP}\nscore = {{ {} }}\n",
            fields.join(", ")
        ),
        PartKind::Switcher => format!(
            "type = \"switch\"\naligned = {ICP}\nmisaligned = {ICP}\nswitcher = {{ {} }}\n",
            fields.join(", ")
        ),
    }
}

fn plain(kind: PartKind) -> &'static str {
    match kind {
        PartKind::Stage => ICP,
        PartKind::Selection => "\"visible-surface\"",
        PartKind::Association => "\"projective\"",
        PartKind::Metric => "\"point-to-plane\"",
        PartKind::Filter => "\"one-to-one\"",
        PartKind::Stop => "\"iteration-limit\"",
        PartKind::Score => "\"mve\"",
        PartKind::Switcher => "\"threshold\"",
    }
}
