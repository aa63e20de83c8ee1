//! Means, intervals and claims on handmade rows.

use hicp_experiments::{
    Analysis, Claim, ClaimVerdict, Config, Experiment, HIGH, LOW, Measured, Metric, NOISY, Report,
    Row, Study, Subject, Variant, claims, never_seen,
};
use hicp_sim::Household;
use hybrid_icp::Preset;

/// Creates a study whose figures are functions of (variant, level, case), with an offset per
/// object.
fn study(
    experiment: Experiment,
    poses: u64,
    vsd: impl Fn(&str, &str, u64) -> f64,
    cpu_ms: impl Fn(&str) -> f64,
) -> Study {
    let subjects = Subject::household(&Household::TEST[..4]).unwrap();
    let variants = if experiment == Experiment::Alpha {
        &Variant::paper()[..1]
    } else {
        &Variant::paper()[..]
    };
    let config = Config::new(experiment, &subjects, variants, poses, 1).unwrap();
    let mut rows = Vec::new();
    for (number, object) in config.objects.iter().enumerate() {
        for case in 0..poses {
            for level in &config.levels {
                for variant in &config.variants {
                    let bin = experiment.is_binned().then_some((case % 10) as usize);
                    rows.push(Row {
                        object: object.name.clone(),
                        case,
                        variant: variant.name.clone(),
                        setting: level.clone(),
                        bin,
                        measured: Some(Measured {
                            vsd_initial: bin.map_or(0.2, |b| 0.05 + b as f64 / 10.0),
                            // The offsets of objects and cases are the same for all variants.
                            vsd_final: vsd(&variant.name, level, case)
                                + 0.01 * number as f64
                                + 0.002 * (case % 3) as f64,
                            add_final_mm: 1.0 + case as f64,
                            steps: 10,
                            termination: "converged".to_owned(),
                            regimes: if case % 2 == 0 { "aa" } else { "ma" }.to_owned(),
                            cpu_ms: Some(cpu_ms(&variant.name)),
                            ..Measured::default()
                        }),
                        note: String::new(),
                    });
                }
            }
        }
    }
    Study { config, rows }
}

fn tested(study: &Study) -> Vec<Claim> {
    claims(study.config.experiment, &Analysis::of(study))
}

fn verdict(claims: &[Claim], part: &str) -> ClaimVerdict {
    let found: Vec<_> = claims.iter().filter(|c| c.text.contains(part)).collect();
    assert_eq!(found.len(), 1, "{part}: {found:?}");
    found[0].verdict
}

/// Projective variants are good in low bins, nearest neighbors are the same everywhere, and hybrid
/// is the better of both.
fn as_in_the_paper(variant: &str, _: &str, case: u64) -> f64 {
    let bin = (case % 10) as f64 / 10.0;
    let metric = f64::from(u8::from(variant.ends_with("point-to-plane"))) * 0.05;
    match variant {
        "hybrid" => bin.min(0.35) * 0.9,
        "nn-point-to-point" => 0.38,
        v if v.starts_with("nn-") => 0.4 + metric,
        _ => 0.01 + bin + metric,
    }
}

#[test]
fn means_and_differences_match_the_input() {
    let analysis = Analysis::of(&study(Experiment::InitNoise, 20, as_in_the_paper, |_| 2.0));
    let (hybrid, nn) = (
        analysis.variant("hybrid").unwrap(),
        analysis.variant("nn-point-to-point").unwrap(),
    );
    let first = analysis.group("0.0-0.1").unwrap();
    assert_eq!(analysis.groups()[first].label, "0.0-0.1");
    // Cases 0 and 10: 0.002 · (0 + 1)/2; objects: 0.01 · 1.5.
    let mean = analysis.mean(Metric::Vsd, first, nn).unwrap();
    assert!(
        (mean.estimate - (0.38 + 0.001 + 0.015)).abs() < 1e-12,
        "{mean:?}"
    );
    assert!(mean.low < mean.estimate && mean.estimate < mean.high);
    // The offsets of objects spread by 0.03, so the interval is at most that wide.
    assert!(mean.low >= 0.38 && mean.high <= 0.38 + 0.034, "{mean:?}");
    // The offsets of objects and cases cancel in a paired difference.
    let difference = analysis
        .contrast(Metric::Vsd, &[(first, hybrid, 1.0), (first, nn, -1.0)])
        .unwrap();
    for value in [difference.estimate, difference.low, difference.high] {
        assert!((value + 0.38).abs() < 1e-12, "{difference:?}");
    }
    // Either all cases are above 0.3, or none.
    let failed = |group, variant| {
        analysis
            .mean(Metric::Failure, group, variant)
            .unwrap()
            .estimate
    };
    assert_eq!((failed(first, hybrid), failed(first, nn)), (0.0, 1.0));
    let cell = analysis.cell(analysis.overall(), hybrid).unwrap();
    assert_eq!(
        (cell.count, cell.steps, cell.cpu_deviation_ms),
        (80, 10.0, Some(0.0))
    );
    assert!((cell.add_median_mm - 10.5).abs() < 1e-12);
    assert!((cell.vsd_initial - 0.5).abs() < 1e-12);
    assert_eq!(
        analysis
            .cell(analysis.group(LOW).unwrap(), hybrid)
            .unwrap()
            .count,
        24
    );
    assert_eq!(
        analysis
            .cell(analysis.group(HIGH).unwrap(), hybrid)
            .unwrap()
            .count,
        24
    );
}

#[test]
fn the_interval_covers_the_choice_of_objects() {
    // One object differs from the others, so the drawn objects decide the mean.
    let mut study = study(Experiment::InitNoise, 10, |_, _, _| 0.1, |_| 1.0);
    for row in study
        .rows
        .iter_mut()
        .filter(|r| r.object == "bowl" && r.variant == "hybrid")
    {
        row.measured.as_mut().unwrap().vsd_final += 0.4;
    }
    let analysis = Analysis::of(&study);
    let all = analysis.overall();
    let difference = analysis
        .contrast(Metric::Vsd, &[(all, 0, 1.0), (all, 1, -1.0)])
        .unwrap();
    assert!((difference.estimate - 0.1).abs() < 1e-12);
    // Among four drawn objects, none is the bowl with probability 0.32, and at least three are with
    // probability 0.05.
    assert!(
        difference.low.abs() < 1e-12 && difference.high >= 0.2,
        "{difference:?}"
    );
}

#[test]
fn claims_about_the_initial_pose_differ_from_their_opposites() {
    let holding = tested(&study(Experiment::InitNoise, 20, as_in_the_paper, |_| 1.0));
    let opposite =
        |variant: &str, level: &str, case: u64| 0.9 - as_in_the_paper(variant, level, case);
    let failing = tested(&study(Experiment::InitNoise, 20, opposite, |_| 1.0));
    let same = tested(&study(Experiment::InitNoise, 20, |_, _, _| 0.3, |_| 1.0));
    for part in [
        "lower mean VSD than each",
        "at low initial VSD (below 0.3) a projective",
        "nn-point-to-point (",
        "even at low",
    ] {
        assert_eq!(verdict(&holding, part), ClaimVerdict::Holds, "{part}");
        assert_eq!(verdict(&failing, part), ClaimVerdict::DoesNotHold, "{part}");
        assert_eq!(verdict(&same, part), ClaimVerdict::Equivalent, "{part}");
    }
    assert_eq!(verdict(&holding, "every step"), ClaimVerdict::Holds);
    assert_eq!(verdict(&failing, "every step"), ClaimVerdict::DoesNotHold);
    assert_eq!(
        verdict(&holding, "every projective variant fails"),
        ClaimVerdict::Holds
    );
    assert_eq!(
        verdict(&failing, "every projective variant fails"),
        ClaimVerdict::DoesNotHold
    );
    assert_eq!(verdict(&holding, "cascading is worse"), ClaimVerdict::Holds);
    assert_eq!(
        verdict(&failing, "cascading is worse"),
        ClaimVerdict::DoesNotHold
    );
}

#[test]
fn claims_about_depth_noise_differ_from_their_opposites() {
    let with = |sign: f64| {
        move |variant: &str, level: &str, case: u64| {
            let percent: f64 = level.parse().unwrap();
            let plane = variant.ends_with("point-to-plane") || variant.contains("cascade");
            let little = if plane && percent == 1.0 {
                -0.03 * sign
            } else {
                0.0
            };
            let rise = if variant.starts_with("nn-") {
                0.02 * sign
            } else {
                0.0
            };
            // A random effect per case, with the same mean for all variants.
            let effect = if plane {
                0.001 * (case % 2) as f64
            } else {
                0.0
            };
            let hybrid = if variant == "hybrid" {
                -0.05 * sign
            } else {
                0.0
            };
            0.3 + little + rise * percent + effect + hybrid
        }
    };
    let holding = tested(&study(Experiment::DepthNoise, 12, with(1.0), |_| 1.0));
    let failing = tested(&study(Experiment::DepthNoise, 12, with(-1.0), |_| 1.0));
    let analysis = Analysis::of(&study(Experiment::DepthNoise, 12, with(1.0), |_| 1.0));
    assert!(analysis.group(NOISY).is_some());
    for part in [
        "every step of depth noise",
        "lower mean VSD than each",
        "less susceptible",
        "projective-point-to-plane improves",
        "nn-cascade-plane-point improves",
    ] {
        assert_eq!(verdict(&holding, part), ClaimVerdict::Holds, "{part}");
        assert_eq!(verdict(&failing, part), ClaimVerdict::DoesNotHold, "{part}");
    }
}

#[test]
fn the_order_of_table_one_is_checked_pair_by_pair() {
    let paper = |variant: &str| {
        hicp_experiments::TABLE_I
            .iter()
            .find(|(n, ..)| *n == variant)
            .unwrap()
            .1
    };
    let holding = tested(&study(
        Experiment::Timing,
        4,
        |_, _, _| 0.1,
        |v| 1e3 * paper(v),
    ));
    assert_eq!(verdict(&holding, "order of Table I"), ClaimVerdict::Holds);
    assert_eq!(
        verdict(&holding, "every projective variant is faster"),
        ClaimVerdict::Holds
    );
    let swapped = tested(&study(
        Experiment::Timing,
        4,
        |_, _, _| 0.1,
        |v| match v {
            "hybrid" => 300.0,
            v => 1e3 * paper(v),
        },
    ));
    assert_eq!(
        verdict(&swapped, "order of Table I"),
        ClaimVerdict::DoesNotHold
    );
    let figures = &swapped[1].figures;
    assert!(figures.starts_with("35 of 36 pairs"), "{figures}");
}

#[test]
fn claims_are_about_the_variants_of_the_paper() {
    let mut study = study(Experiment::InitNoise, 20, as_in_the_paper, |_| 2.0);
    let judged = |study: &Study| {
        let claims = tested(study).into_iter();
        claims
            .map(|claim| (claim.text, claim.verdict))
            .collect::<Vec<_>>()
    };
    let before = judged(&study);
    // The paper has no `auto`, which is better than every variant here.
    let auto = Variant::preset(Preset::Auto);
    let hybrid = study.rows.iter().filter(|row| row.variant == "hybrid");
    let mut rows: Vec<Row> = hybrid.cloned().collect();
    for row in &mut rows {
        row.variant.clone_from(&auto.name);
        row.measured.as_mut().unwrap().vsd_final = 0.0;
    }
    study.rows.extend(rows);
    study.config.variants.push(auto);
    assert_eq!(judged(&study), before);
    assert!(
        before
            .iter()
            .any(|(text, _)| text.contains("lower mean VSD than each other"))
    );
    // Without another variant of the paper, hybrid is not the lowest of anything.
    study.rows.retain(|row| row.variant == "hybrid");
    study
        .config
        .variants
        .retain(|variant| variant.name == "hybrid");
    let alone = judged(&study);
    assert!(alone.is_empty(), "{alone:?}");
}

#[test]
fn the_best_alpha_is_compared_with_the_papers() {
    let valley = |at: f64| {
        move |_: &str, level: &str, _: u64| 0.1 + (level.parse::<f64>().unwrap() - at).abs()
    };
    let at = |alpha: f64| tested(&study(Experiment::Alpha, 10, valley(alpha), |_| 1.0)).remove(0);
    let paper = at(0.4);
    assert_eq!(paper.verdict, ClaimVerdict::Holds);
    assert!(
        paper.figures.contains("is at α = 0.40;"),
        "{}",
        paper.figures
    );
    let other = at(0.75);
    assert_eq!(other.verdict, ClaimVerdict::DoesNotHold);
    assert!(
        other.figures.contains("is at α = 0.75;"),
        "{}",
        other.figures
    );
}

#[test]
fn a_report_contains_figures_tables_and_cases_that_failed() {
    let mut study = study(Experiment::InitNoise, 10, as_in_the_paper, |_| 1.0);
    let unmade = study
        .rows
        .iter_mut()
        .find(|r| r.object == "can" && r.case == 9)
        .unwrap();
    unmade.measured = None;
    unmade.note = "bin 9 <was> empty".to_owned();
    let folder = tempfile::tempdir().unwrap();
    let report = Report::of(vec![("by-hand".to_owned(), study)]);
    report.write(folder.path()).unwrap();
    let page = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
    for part in [
        "<svg",
        "by-hand",
        "holds",
        "bin 9 &lt;was&gt; empty",
        "0.380",
        "bowl, can, tape, book",
    ] {
        assert!(page.contains(part), "no {part:?}");
    }
    // No share of cases is negative, and this study has all columns.
    assert!(!page.contains("-0.0 %") && page.contains("0.9-1.0"));
    // The page loads nothing.
    assert!(!page.contains("src=") && !page.contains("<link") && !page.contains("<script"));
    let claims = std::fs::read_to_string(folder.path().join("claims.csv")).unwrap();
    assert_eq!(claims.lines().count(), 1 + report.claims().count());
    let summary = std::fs::read_to_string(folder.path().join("summary.csv")).unwrap();
    assert_eq!(summary.lines().count(), 1 + 13 * 9);
    let differences = std::fs::read_to_string(folder.path().join("differences.csv")).unwrap();
    assert_eq!(differences.lines().count(), 1 + 13 * 8);
    // Of the cases of a bin of this study, all switch or none does.
    let switches = std::fs::read_to_string(folder.path().join("switches.csv")).unwrap();
    assert!(
        switches.contains("by-hand,0.1-0.2,hybrid,ma,4,1.0000,0.1500,"),
        "{switches}"
    );
    assert!(
        switches.contains("by-hand,all,hybrid,aa,20,0.5128,"),
        "{switches}"
    );
    let image = hicp_io::read_color(folder.path().join("figure.png")).unwrap();
    assert!(image.width() > 1000 && image.height() > 300);
    assert!(image.pixels().iter().any(|pixel| *pixel != [255; 3]));
    assert!(!folder.path().join("alpha.svg").exists());
}

#[test]
fn a_figure_has_a_row_per_study_with_every_curve_of_the_paper() {
    let init = study(Experiment::InitNoise, 20, as_in_the_paper, |_| 2.0);
    let depth = study(Experiment::DepthNoise, 12, as_in_the_paper, |_| 2.0);
    let report = Report::of(vec![("init".to_owned(), init), ("depth".to_owned(), depth)]);
    let (name, figure) = report.figures().remove(0);
    assert_eq!((name, figure.rows.len()), ("figure", 2));
    for row in &figure.rows {
        // Nearest neighbors, projective, and the other variants with the best of either.
        assert_eq!(row.len(), 3);
        assert_eq!(row[0].curves.len(), 4);
        assert_eq!(row[1].curves.len(), 4);
        assert!(row[2].curves.iter().any(|curve| curve.label == "hybrid"));
    }
    let timing = study(Experiment::Timing, 4, as_in_the_paper, |_| 2.0);
    let report = Report::of(vec![("timing".to_owned(), timing)]);
    assert!(report.figures().iter().all(|(_, figure)| figure.is_empty()));
}

/// If all cases are equal, the bootstrap gives a point, but other cases may still differ.
#[test]
fn a_share_that_no_case_shows_has_an_interval() {
    let wrong = |name: &str| f64::from(u8::from(name.starts_with("nn-")));
    let study = study(
        Experiment::DepthNoise,
        5,
        |name, _, _| 0.9 * wrong(name),
        |_| 1.0,
    );
    let analysis = Analysis::of(&study);
    let all = analysis.overall();
    let of = |name: &str| (all, analysis.variant(name).unwrap());
    let failing = |terms: &[(&str, f64)]| {
        let terms: Vec<_> = terms
            .iter()
            .map(|(name, f)| (of(name).0, of(name).1, *f))
            .collect();
        let found = analysis.contrast(Metric::Failure, &terms).unwrap();
        (found.estimate, found.low, found.high)
    };
    // Five cases of four objects count once each, although each has several conditions.
    let unseen = never_seen(20);
    assert!((unseen - (1.0 - 0.05_f64.powf(0.05))).abs() < 1e-12);
    assert_eq!(failing(&[("hybrid", 1.0)]), (0.0, 0.0, unseen));
    assert_eq!(
        failing(&[("nn-point-to-point", 1.0)]),
        (1.0, 1.0 - unseen, 1.0)
    );
    let neither = [("hybrid", 1.0), ("projective-point-to-plane", -1.0)];
    assert_eq!(failing(&neither), (0.0, -unseen, unseen));
    let one = [("hybrid", 1.0), ("nn-point-to-point", -1.0)];
    assert_eq!(failing(&one), (-1.0, -1.0, unseen - 1.0));
    // The rule of three. Without cases, every share is possible.
    assert!((never_seen(1000) - 0.003).abs() < 1e-4);
    assert_eq!(never_seen(0), 1.0);
}
