//! Shows at which stage the search loses the true pose, and how often it is missed, as tables.
//!
//! Run `cargo run --release -p hicp-tests --example search_stages [SET] [SCENES] [MASK] [SEED]`.
//!
//! SET is `tuning` or `test` for household objects on a table, and `undeclared` for tuning objects
//! without their declared symmetries. With `handles`, a nearly round object with a handle stands
//! alone, and a third of it is hidden; `handles-test` has those that the search was not tuned on.
//! MASK is `exact`, `dilated`, `soft` or `box`. With the variable FAST, no rivals are computed, and
//! every case counts as won.
//!
//! The truth *wins* a case if `local` from the truth ends with a score at least 0.02 below that of
//! every other pose that `local` reaches from 72 even rotations at the centroid of the mask. A pose
//! is right if its MSSD, up to declared symmetries, is below a tenth of the diameter.

use std::time::Instant;

use hicp_sim::{
    CaseConfig, CaseMaker, Corruption, DepthSensor, Household, InitialPose, SimRng, stream,
};
use hicp_tests::mugs::public_mugs;
use hicp_tests::tabletop::{self, MaskKind, Tabletop};
use hicp_tests::{camera, household, mean, median};
use hybrid_icp::core::{Isometry3, Model, Observation, Point3, Problem, Vector3, rotation_grid};
use hybrid_icp::icp::{BoxedStage, Cascade, SearchOptions, Session, Stage, Workspace};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::{MeanVsd, Score, mssd};
use hybrid_icp::{Preset, Refiner, Warning, presets};

/// Rotations from which rivals of the truth are found.
const ROTATIONS: usize = 72;
/// The margin by which the truth must win, and below which two poses are ambiguous.
const MARGIN: f64 = 0.02;
const AMBIGUOUS: f64 = 0.01;
/// Won cases whose stages are analyzed.
const ANALYZED: usize = 40;

/// A case: a model in an image, with its true pose and a start.
struct Seen<'a> {
    name: &'a str,
    model: &'a Model,
    observation: Observation,
    truth: Isometry3<f64>,
    /// The true center, at a random rotation.
    turned: Isometry3<f64>,
    /// At the mean error of an estimator.
    near: Isometry3<f64>,
}

impl<'a> Seen<'a> {
    fn new(
        name: &'a str,
        model: &'a Model,
        seen: &tabletop::Seen,
        kind: MaskKind,
        random: &mut SimRng,
    ) -> Result<Self, Box<dyn std::error::Error>> {
        Ok(Self {
            name,
            model,
            observation: seen.observe(kind)?,
            truth: seen.truth,
            turned: seen.turned(random, model, model),
            near: seen.near(random, 1.0),
        })
    }

    fn error(&self, a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
        let points: Vec<Point3<f32>> = self.model.samples().iter().map(|s| s.point).collect();
        let symmetries = self.model.symmetries().motions();
        mssd(a, b, &points[..300.min(points.len())], &symmetries) / self.model.diameter()
    }

    fn right(&self, pose: &Isometry3<f64>) -> bool {
        self.error(pose, &self.truth) < 0.1
    }

    fn problem(&self) -> Problem<'_> {
        Problem::new(self.model, &self.observation)
    }
}

/// A stage with its memory, and the score by which a search compares poses.
struct Runner {
    workspace: Workspace,
    score: MeanVsd,
}

impl Runner {
    fn run(
        &mut self,
        stage: &mut dyn Stage,
        seen: &Seen<'_>,
        init: &Isometry3<f64>,
    ) -> (f64, Isometry3<f64>) {
        let problem = seen.problem();
        let outcome = stage.run(
            &problem,
            init,
            &mut Session::new(&mut self.workspace, &mut ()),
        );
        let pose = outcome.camera_from_object;
        (self.judge(seen, &pose), pose)
    }

    fn judge(&mut self, seen: &Seen<'_>, pose: &Isometry3<f64>) -> f64 {
        self.score
            .score(&mut self.workspace.context(&seen.problem()), pose)
    }
}

/// Returns even rotations with the model's center at the mean of the observed points.
fn even(seen: &Seen<'_>) -> Vec<Isometry3<f64>> {
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for (_, surfel) in seen.observation.surfels(3) {
        sum += surfel.point.coords.cast::<f64>();
        count += 1.0;
    }
    (0..ROTATIONS)
        .map(|index| {
            let turn = rotation_grid(index, ROTATIONS);
            let shift = sum / count - turn * seen.model.center().coords;
            Isometry3::from_parts(shift.into(), turn)
        })
        .collect()
}

/// Runs the parts of a search one by one and counts those that still have the truth.
fn stages(runner: &mut Runner, seen: &Seen<'_>, found: &mut [usize; STAGES.len()]) {
    let options = SearchOptions::default();
    let (all, most) = (options.hypotheses, options.aligned);
    let mut search = presets::estimate_with(Cascade(Vec::<BoxedStage>::new()));
    (search.options.aligned, search.options.refined) = (all, 1);
    runner.run(&mut search, seen, &seen.truth);
    let placed: Vec<_> = search.ranked().map(|(_, pose)| *pose).collect();
    let mut aligned: Vec<(f64, Isometry3<f64>)> = Vec::new();
    for pose in &placed[..most.min(placed.len())] {
        let pose = runner.run(&mut search.align, seen, pose).1;
        let mut context = runner.workspace.context(&seen.problem());
        aligned.push((search.ranking.score(&mut context, &pose), pose));
    }
    aligned.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut best: Vec<Isometry3<f64>> = Vec::new();
    for (_, pose) in aligned {
        let degrees = |other: &Isometry3<f64>| other.rotation.angle_to(&pose.rotation).to_degrees();
        let apart = |other| degrees(other) >= options.spacing_degrees;
        if best.len() < options.refined && best.iter().all(apart) {
            best.push(pose);
        }
    }
    let explored = best
        .iter()
        .map(|pose| runner.run(&mut search.explore, seen, pose).1);
    let explored: Vec<_> = explored.collect();
    let mut local = presets::local();
    let mut whole = presets::estimate_with(presets::local());
    let chosen = runner.run(&mut whole, seen, &seen.truth).1;
    let mut reaches = |poses: &[Isometry3<f64>]| {
        let mut poses = poses.iter();
        poses.any(|pose| seen.right(&runner.run(&mut local, seen, pose).1))
    };
    let have = [
        reaches(&placed),
        reaches(&placed[..most.min(placed.len())]),
        reaches(&best),
        reaches(&explored),
        seen.right(&chosen),
    ];
    for (count, has) in found.iter_mut().zip(have) {
        *count += usize::from(has);
    }
}

/// The stages of a search that can lose the truth.
const STAGES: [&str; 5] = [
    "placement",
    "ranking",
    "alignment",
    "exploration",
    "choice and `local`",
];

#[derive(Default)]
struct Counts {
    cases: usize,
    won: usize,
    /// Won cases that the final poses miss: of search, auto, and auto from a near start.
    missed: [usize; 3],
    /// Won cases in which no even rotation reaches the truth.
    hard: usize,
    hard_missed: usize,
    /// Results of `search` by whether an even rotation reaches another pose within 0.01, and by
    /// whether the result has the warning.
    ambiguous: [[usize; 2]; 2],
    milliseconds: [Vec<f64>; 4],
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let set = words.next().unwrap_or_else(|| "tuning".to_owned());
    let scenes: u64 = words.next().map_or(Ok(40), |text| text.parse())?;
    let mask = match words.next().as_deref() {
        None | Some("exact") => MaskKind::Exact,
        Some("dilated") => MaskKind::Dilated(8),
        Some("soft") => MaskKind::Soft,
        Some("box") => MaskKind::Box,
        Some(other) => return Err(format!("no kind of mask: {other}").into()),
    };
    let first: u64 = words.next().map_or(Ok(0), |text| text.parse())?;

    let mut counts = Counts::default();
    let mut found = [0; STAGES.len()];
    let mut analyzed = 0;
    let mut runner = Runner {
        workspace: Workspace::new(Rasterizer::default()),
        score: MeanVsd::imperfect_mask(),
    };
    let mut local = presets::local();
    let mut presets = [Preset::Search, Preset::Auto, Preset::Auto, Preset::Local]
        .map(|preset| (preset, Refiner::preset(preset)));
    let mut random = stream(first, &["search_stages"], 0);
    let analyze = if std::env::var_os("FAST").is_some() {
        0
    } else {
        ANALYZED
    };
    let verbose = std::env::var_os("VERBOSE").is_some();
    each_case(&set, first..first + scenes, mask, &mut random, |seen| {
        counts.cases += 1;
        let (best, pose) = runner.run(&mut local, seen, &seen.truth);
        let mut wins = seen.right(&pose);
        let mut reached = false;
        let mut rivals = vec![(best, pose)];
        let starts = if std::env::var_os("FAST").is_some() {
            Vec::new()
        } else {
            even(seen)
        };
        for start in starts {
            let (score, rival) = runner.run(&mut local, seen, &start);
            if seen.right(&rival) {
                reached = true;
            } else if score < best + MARGIN {
                wins = false;
            }
            rivals.push((score, rival));
        }
        counts.won += usize::from(wins);
        counts.hard += usize::from(wins && !reached);
        for (k, (_, refiner)) in presets.iter_mut().enumerate() {
            let init = if k < 2 { &seen.turned } else { &seen.near };
            let observation = Observation::new(
                seen.observation.shared_depth().clone(),
                seen.observation.mask().clone(),
                *seen.observation.camera(),
            )
            .expect("sizes agree");
            let start = Instant::now();
            let refined = refiner.refine(seen.model, &observation, init);
            counts.milliseconds[k].push(start.elapsed().as_secs_f64() * 1e3);
            let pose = refined.outcome.camera_from_object;
            if k == 0 {
                let score = runner.judge(seen, &pose);
                let alike = |(other, rival): &(f64, Isometry3<f64>)| {
                    other - score < AMBIGUOUS && seen.error(rival, &pose) > 0.1
                };
                let warned = refined
                    .warnings()
                    .iter()
                    .any(|warning| matches!(warning, Warning::Ambiguous { .. }));
                let ambiguous = rivals.iter().any(alike);
                counts.ambiguous[usize::from(ambiguous)][usize::from(warned)] += 1;
            }
            if k < 3 && wins && !seen.right(&pose) {
                counts.missed[k] += 1;
                counts.hard_missed += usize::from(k == 0 && !reached);
                if verbose {
                    let score = runner.judge(seen, &pose);
                    let error = seen.error(&pose, &seen.truth);
                    eprintln!(
                        "{} {k}: truth {best:.3}, ended at {score:.3} with confidence {:.2}, {error:.2} d off",
                        seen.name, refined.confidence
                    );
                }
            }
        }
        if wins && analyzed < analyze {
            analyzed += 1;
            stages(&mut runner, seen, &mut found);
        }
    })?;

    println!("{} cases, the truth wins {}\n", counts.cases, counts.won);
    println!("| stage | truth still there, of {analyzed} |\n|---|---|");
    for (name, found) in STAGES.iter().zip(found) {
        println!("| {name} | {found} |");
    }
    println!(
        "\n| preset | misses, of {} | median ms | mean ms |\n|---|---|---|---|",
        counts.won
    );
    let names = ["search", "auto", "auto from near", "local from near"];
    for (k, name) in names.iter().enumerate() {
        let times = &mut counts.milliseconds[k];
        let mean = mean(times);
        let missed = counts
            .missed
            .get(k)
            .map_or(String::new(), ToString::to_string);
        println!("| {name} | {missed} | {:.1} | {mean:.1} |", median(times));
    }
    println!(
        "\nhard (no even rotation reaches the truth): {}, missed by search: {}",
        counts.hard, counts.hard_missed
    );
    let [[quiet, wrongly], [missed, warned]] = counts.ambiguous;
    println!(
        "ambiguous: {warned} of {} warned; else {wrongly} of {}",
        warned + missed,
        wrongly + quiet
    );
    Ok(())
}

/// Calls `visit` with every case of a set.
fn each_case(
    set: &str,
    seeds: std::ops::Range<u64>,
    kind: MaskKind,
    random: &mut SimRng,
    mut visit: impl FnMut(&Seen<'_>),
) -> Result<(), Box<dyn std::error::Error>> {
    let table = match set {
        "undeclared" => Tabletop::of(
            [
                Household::Bottle,
                Household::Carton,
                Household::Pot,
                Household::Plate,
            ]
            .iter()
            .map(|object| {
                Ok((
                    object.name().to_owned(),
                    Model::new(object.solid().to_mesh()?),
                ))
            })
            .collect::<Result<_, hicp_sim::SimError>>()?,
        ),
        "tuning" | "test" => Tabletop::new(&household(set)?)?,
        _ => return handles(set, seeds, kind, random, visit),
    };
    for seed in seeds {
        for seen in table.scene(seed)? {
            let (name, model) = &table.objects[seen.model];
            visit(&Seen::new(name, model, &seen, kind, random)?);
        }
    }
    Ok(())
}

/// Visits objects with a handle, alone, with a third of what is visible hidden.
fn handles(
    set: &str,
    seeds: std::ops::Range<u64>,
    kind: MaskKind,
    random: &mut SimRng,
    mut visit: impl FnMut(&Seen<'_>),
) -> Result<(), Box<dyn std::error::Error>> {
    let mut models = vec![];
    if set == "handles" {
        models.push(("teapot", Household::Teapot.model()?));
    } else {
        models.push(("mug", Household::Mug.model()?));
        models.extend(public_mugs()?);
    }
    let mut maker = CaseMaker::new(CaseConfig::new(camera(), InitialPose::mean_error()))?;
    for seed in seeds {
        for (name, model) in &models {
            let case = maker.case(model, name, seed, 0)?;
            let corruption = Corruption {
                occluded_share: 1.0 / 3.0,
                ..Corruption::default()
            };
            let (depth, visible) = corruption.apply(&case)?;
            let seen = tabletop::Seen {
                model: 0,
                truth: case.camera_from_object,
                depth: depth.into(),
                visible,
                visible_share: 2.0 / 3.0,
                sensor: DepthSensor::default(),
                camera: camera(),
            };
            visit(&Seen::new(name, model, &seen, kind, random)?);
        }
    }
    Ok(())
}
