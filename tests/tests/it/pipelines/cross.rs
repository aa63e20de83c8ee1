//! Every combination of the catalog's selections, associations, filters and metrics.
//!
//! Every run starts from a small perturbation.
//!
//! Each combination is built from the text of a pipeline file and runs on three scenes. Whatever
//! the parts, a run must not panic, and must return a finite pose, a truthful outcome, and the same
//! bits when repeated. The golden file `golden/cross.txt` records which combinations *converge*. It
//! has a line per selection, association and filter, a column per metric, and in it a character per
//! scene:
//!
//! - `+`: the mean distance of the model's samples from their true places, up to the declared
//!   symmetries, fell to half or less.
//! - `-`: it did not.
//! - `~`: it ended within 10 % of the half.
//!
//! Rounding differs between machines. A result within 10 % of the half therefore agrees with any of
//! the three, and a `~` in the file agrees with anything within 20 %. Everything else must agree
//! exactly, including better results, so that every change of the parts is reviewed. To accept a
//! change, run `HICP_BLESS=1 cargo test -p hicp-tests --test it cross` and check the difference.
//!
//! Combinations without meaning are left out:
//!
//! - The selection `none` with associations that start from the selected points.
//! - Selections with associations that start from the observation or a render, which ignore the
//!   selection.
//! - Filters on the observed surface: if the association searches the observation, every point is
//!   paired with itself, so that one line is enough.
//!
//! Filters that are seldom used run on the visible surface only.

use std::fmt::Write as _;
use std::path::Path;

use hicp_sim::{Household, RelativeGaussian, object_pose, perturb, rng};
use hicp_tests::{Scene, camera, render};
use hybrid_icp::BoxedStage;
use hybrid_icp::core::internal::pose_bits as bits;
use hybrid_icp::core::{Isometry3, Model, ModelConfig, Observation, se3};
use hybrid_icp::icp::{Outcome, Session, Verdict, Workspace};
use hybrid_icp::pipeline::PipelineFile;
use hybrid_icp::pipeline::{Catalog, PartKind};
use hybrid_icp::raster::Rasterizer;

/// Maximum number of evaluations per run.
const ITERATIONS: usize = 12;
/// Number of model samples, and approximate number of points of selections and search trees.
const POINTS: usize = 400;
/// Interval of the runs that are repeated with a new pipeline and a new workspace.
const REPEATED: usize = 5;
/// Filters that are combined with every selection.
const MAIN_FILTERS: [&str; 5] = [
    "max-distance",
    "max-normal-angle",
    "trimmed",
    "one-to-one",
    "normal-weight",
];
/// Associations that start from the observation or a render and ignore the selection.
///
/// `joined` joins two of them here.
const WITHOUT_SELECTION: [&str; 5] = [
    "observation-to-model",
    "closest-point-on-mesh",
    "rendered-surface",
    "contour",
    "joined",
];

struct Case {
    scene: Scene,
    init: Isometry3<f64>,
    before: f64,
}

/// Returns a mug without noise, and a hammer and a carton with 0.3 % noise.
///
/// The initial poses are 3 mm and 3° off.
fn cases() -> Vec<Case> {
    let mut rng = rng(12);
    let camera = camera();
    [
        (Household::Mug, 0.0),
        (Household::Hammer, 0.3),
        (Household::Carton, 0.3),
    ]
    .into_iter()
    .map(|(object, percent)| {
        let config = ModelConfig {
            samples: POINTS,
            symmetries: object.symmetries(),
            ..ModelConfig::default()
        };
        let model = Model::with_config(object.solid().to_mesh().unwrap(), config);
        let truth = object_pose(&mut rng, &model.center(), 0.5..0.7, 0.02);
        let (depth, mask) = render(&model, &camera, &truth);
        let depth = RelativeGaussian { percent }.apply(&mut rng, &depth);
        let init = perturb(&mut rng, &truth, 0.003, 3.0_f64.to_radians());
        let scene = Scene {
            observation: Observation::new(depth, mask, camera).unwrap(),
            model,
            truth,
        };
        let before = point_error(&scene, &init);
        Case {
            scene,
            init,
            before,
        }
    })
    .collect()
}

/// Returns the mean distance of the model's samples from their true places, for the best symmetry.
fn point_error(scene: &Scene, pose: &Isometry3<f64>) -> f64 {
    let samples = scene.model.samples();
    let motions = scene.model.symmetries().motions();
    let errors = motions.iter().map(|motion| {
        let truth = scene.truth * motion;
        let distances = samples.iter().map(|sample| {
            let point = sample.point.cast::<f64>();
            (pose * point - truth * point).norm()
        });
        distances.sum::<f64>() / samples.len() as f64
    });
    errors.min_by(f64::total_cmp).unwrap()
}

/// Returns the parts of a kind as TOML, sized for small scenes.
fn parts(kind: PartKind) -> Vec<(&'static str, String)> {
    Catalog::built_in()
        .parts()
        .filter(|part| part.kind == kind)
        .map(|part| {
            let mut text = format!("{{ type = \"{}\"", part.name);
            for parameter in &part.parameters {
                let value = match (part.name, parameter.name) {
                    ("weighted-sum", "metrics") => {
                        "[\"point-to-point\", \"point-to-plane\"]".to_owned()
                    }
                    ("metric-schedule", "metrics") => {
                        "[\"point-to-point\", \"point-to-plane\"]".to_owned()
                    }
                    ("weighted-sum", "weights") => "[0.5, 0.5]".to_owned(),
                    ("schedule", "filters") => {
                        "[{ type = \"max-distance\", limit = 0.5 }, \"max-distance\"]".to_owned()
                    }
                    ("joined", "associations") => format!(
                        "[{{ type = \"rendered-surface\", points = {POINTS} }}, \"contour\"]"
                    ),
                    ("without-boundary", "selection") => {
                        format!("{{ type = \"visible-surface\", points = {POINTS} }}")
                    }
                    // The default would keep all samples and not test the selection.
                    (_, "count") if kind == PartKind::Selection => (POINTS / 2).to_string(),
                    (_, "points") => POINTS.to_string(),
                    ("observation-to-model", "samples") => "4000".to_owned(),
                    ("voxel-grid", "cell") => "0.1".to_owned(),
                    ("frozen", "translation" | "rotation") => "[false, false, false]".to_owned(),
                    _ => continue,
                };
                write!(text, ", {} = {value}", parameter.name).unwrap();
            }
            (part.name, text + " }")
        })
        .collect()
}

/// Returns the lines of the table: selection, association and filters, by name and as TOML.
fn lines() -> Vec<([&'static str; 3], [String; 3])> {
    let mut filters = vec![("none", String::new())];
    filters.extend(parts(PartKind::Filter));
    let mut lines = Vec::new();
    let mut selections = parts(PartKind::Selection);
    selections.retain(|(selection, _)| *selection != "none");
    for (selection, selection_text) in selections {
        for (association, association_text) in parts(PartKind::Association) {
            let usual = selection == "visible-surface";
            if !usual && WITHOUT_SELECTION.contains(&association) {
                continue;
            }
            for (filter, filter_text) in &filters {
                let main = *filter == "none"
                    || selection != "observed-surface" && MAIN_FILTERS.contains(filter);
                if main || usual {
                    lines.push((
                        [selection, association, *filter],
                        [
                            selection_text.clone(),
                            association_text.clone(),
                            filter_text.clone(),
                        ],
                    ));
                }
            }
        }
    }
    lines
}

fn build(text: &str) -> BoxedStage {
    let file = PipelineFile::parse(text, "combination").unwrap_or_else(|e| panic!("{e}\n{text}"));
    file.build().unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn run(stage: &mut BoxedStage, workspace: &mut Workspace, case: &Case) -> Outcome {
    let problem = case.scene.problem();
    stage.run(&problem, &case.init, &mut Session::new(workspace, &mut ()))
}

/// Checks the properties of every outcome, whatever the parts.
fn assert_truthful(outcome: &Outcome, init: &Isometry3<f64>, text: &str) {
    let pose = &outcome.camera_from_object;
    assert!(se3::is_finite(pose), "{outcome:?}\n{text}");
    assert!(
        (pose.rotation.norm() - 1.0).abs() < 1e-9,
        "{outcome:?}\n{text}"
    );
    let kept = matches!(outcome.verdict, Verdict::KeptInitial(why) if why == outcome.termination);
    assert_eq!(kept, bits(pose) == bits(init), "{outcome:?}\n{text}");
    assert!(
        (1..=ITERATIONS).contains(&outcome.iterations),
        "{outcome:?}\n{text}"
    );
    // A new pose was evaluated, and the outcome reports its evaluation.
    assert!(kept || outcome.evaluation.is_some(), "{outcome:?}\n{text}");
    assert_eq!(
        outcome.evaluation.is_some(),
        outcome.quality.is_some(),
        "{outcome:?}\n{text}"
    );
    if let (Some(evaluation), Some(quality)) = (outcome.evaluation, outcome.quality) {
        assert!(evaluation.n_pairs > 0, "{outcome:?}\n{text}");
        let loss = evaluation.mean_loss;
        assert!(loss.is_finite() && loss >= 0.0, "{outcome:?}\n{text}");
        assert!(
            quality.fitness > 0.0 && quality.fitness <= 1.0,
            "{outcome:?}\n{text}"
        );
        assert!(
            quality.point_rmse.is_finite() && quality.plane_rmse <= quality.point_rmse * 1.000_01,
            "{outcome:?}\n{text}"
        );
    }
}

/// Returns whether a result agrees with a character of the golden file.
///
/// `share` is the remaining error as a share of the initial one.
fn agrees(written: char, share: f64) -> bool {
    match written {
        '+' => share <= 0.55,
        '-' => share >= 0.45,
        '~' => (0.4..=0.6).contains(&share),
        _ => false,
    }
}

fn verdict(share: f64) -> char {
    match share {
        _ if (0.45..=0.55).contains(&share) => '~',
        _ if share < 0.5 => '+',
        _ => '-',
    }
}

/// Returns the remaining error of each run of a line, as a share of the initial one.
///
/// The order is by metric, then by scene.
fn shares(
    line: usize,
    [selection, association, filter]: &[String; 3],
    metrics: &[(&str, String)],
    cases: &[Case],
    workspace: &mut Workspace,
) -> Vec<f64> {
    let mut shares = Vec::with_capacity(metrics.len() * cases.len());
    for (_, metric) in metrics {
        let text = format!(
            "type = \"icp\"\nselection = {selection}\nassociation = {association}\nfilter = [{filter}]\nmetric = {metric}\n\
             stop = [{{ type = \"motion\" }}, {{ type = \"iteration-limit\", iterations = {ITERATIONS} }}]\n"
        );
        let mut stage = build(&text);
        for case in cases {
            let outcome = run(&mut stage, workspace, case);
            assert_truthful(&outcome, &case.init, &text);
            let runs_before = line * metrics.len() * cases.len() + shares.len();
            if runs_before.is_multiple_of(REPEATED) {
                // The warm stage and a new one in a new workspace must return the same bits. They
                // share the search trees.
                let again = run(&mut stage, workspace, case);
                let fresh = run(
                    &mut build(&text),
                    &mut Workspace::new(Rasterizer::default()),
                    case,
                );
                assert_eq!(outcome, again, "{text}");
                assert_eq!(outcome, fresh, "{text}");
            }
            let after = point_error(&case.scene, &outcome.camera_from_object);
            shares.push(after / case.before);
        }
    }
    shares
}

#[test]
fn every_combination_matches_the_golden_file() {
    let cases = cases();
    let metrics = parts(PartKind::Metric);
    let lines = lines();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    // Thread t of n runs every n-th line from line t on, because slow associations are adjacent.
    let mut found: Vec<(usize, Vec<f64>)> = std::thread::scope(|scope| {
        let shares_of_thread = |thread: usize| {
            let mut workspace = Workspace::new(Rasterizer::default());
            let every_nth = lines.iter().enumerate().skip(thread).step_by(threads);
            every_nth
                .map(|(line, (_, texts))| {
                    (line, shares(line, texts, &metrics, &cases, &mut workspace))
                })
                .collect::<Vec<_>>()
        };
        let threads: Vec<_> = (0..threads)
            .map(|thread| scope.spawn(move || shares_of_thread(thread)))
            .collect();
        threads
            .into_iter()
            .flat_map(|thread| {
                thread
                    .join()
                    .unwrap_or_else(|e| std::panic::resume_unwind(e))
            })
            .collect()
    });
    found.sort_by_key(|(line, _)| *line);
    let found: Vec<_> = found
        .into_iter()
        .map(|(line, shares)| (lines[line].0, shares))
        .collect();

    let mut header = format!("{:<62}", "# selection association filter");
    for (metric, _) in &metrics {
        write!(header, " {metric}").unwrap();
    }
    let line = |names: &[&str; 3], cells: &str| {
        let [selection, association, filter] = names;
        format!("{selection:<17} {association:<24} {filter:<19}{cells}")
    };
    let cells = |shares: &[f64]| {
        let mut text = String::new();
        for scenes in shares.chunks(cases.len()) {
            text.push(' ');
            text.extend(scenes.iter().map(|share| verdict(*share)));
        }
        text
    };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("golden/cross.txt");
    if std::env::var_os("HICP_BLESS").is_some() {
        let mut text = header + "\n";
        for (names, shares) in &found {
            text += &(line(names, &cells(shares)) + "\n");
        }
        std::fs::write(&path, text).unwrap();
        return;
    }
    let golden = std::fs::read_to_string(&path).unwrap();
    let mut golden = golden.lines();
    assert_eq!(golden.next(), Some(header.as_str()), "the metrics");
    let mut differences = String::new();
    for (names, shares) in &found {
        let written = golden.next().unwrap_or("nothing");
        let expected: String = written
            .strip_prefix(&line(names, ""))
            .unwrap_or_else(|| panic!("expected a line for {names:?}, found {written}"))
            .split(' ')
            .collect();
        let same = expected.chars().count() == shares.len()
            && expected.chars().zip(shares).all(|(c, s)| agrees(c, *s));
        if !same {
            let now = line(names, &cells(shares));
            writeln!(differences, "was {written}\nis  {now}\n    {shares:.3?}").unwrap();
        }
    }
    assert_eq!(golden.next(), None, "the golden file has more lines");
    assert!(differences.is_empty(), "\n{differences}");
}
