//! The paper's claims about single images, tested.

use super::aims::aims;
use super::experiment::Experiment;
use super::table_one::{projective_fastest, table_order};
use crate::analysis::{Analysis, FAILURE_VSD, Interval, Metric};
use crate::claims::{Claim, ClaimVerdict, Evidence, Judge, listed};
use crate::study::{ALL, HIGH, LOW, NOISY};

const HYBRID: &str = "hybrid";
const NN: &str = "nn-point-to-point";
const CASCADE: &str = "projective-cascade-point-plane";

/// Tests the claims about a study. Claims about variants that the study lacks are left out.
#[must_use]
pub fn claims(experiment: Experiment, analysis: &Analysis) -> Vec<Claim> {
    let digits = 3;
    let judge = |section| Judge {
        analysis,
        section,
        digits,
    };
    let found = match experiment {
        Experiment::InitNoise => of_initial_poses(judge("§VI-B.1")),
        Experiment::DepthNoise => {
            let judge = judge("§VI-B.2");
            let found = of_noise(judge, "depth noise", "1 to 5 % depth noise").into_iter();
            let names = judge.family("").into_iter();
            let names = names.filter(|n| n.ends_with("point-to-plane") || n.contains("-cascade-"));
            let improving = names.map(|name| {
                let change = judge.contrast(Metric::Vsd, &[("1", name, 1.0), ("0", name, -1.0)]);
                judge.negative(
                    format!("{name} improves from 0 % to 1 % depth noise"),
                    change,
                )
            });
            found.chain(improving).collect()
        }
        Experiment::ModelNoise => {
            of_noise(judge("§VI-B.3"), "model noise", "reconstructions 1 to 4")
        }
        Experiment::Timing => vec![
            projective_fastest(judge("§VI-B.4")),
            table_order(judge("Table I")),
        ],
        Experiment::Alpha => vec![alpha(judge("§IV-A"))],
        Experiment::Beyond => aims(judge("aim")),
    };
    found.into_iter().flatten().collect()
}

fn of_initial_poses(judge: Judge<'_>) -> Vec<Option<Claim>> {
    vec![
        lowest_everywhere(judge, "initial VSD"),
        hybrid_lowest(judge, ALL, "all bins"),
        judge.negative(
            format!("hybrid outperforms {CASCADE} even at low initial VSD (below 0.3)"),
            judge.difference(LOW, HYBRID, CASCADE),
        ),
        projective_best_low(judge),
        nn_best_high(judge),
        fails_high(judge, "projective-", "projective"),
        fails_high(judge, "nn-", "nearest-neighbor"),
        nn_cascades(judge),
    ]
}

fn of_noise(judge: Judge<'_>, noise: &str, over: &str) -> Vec<Option<Claim>> {
    vec![
        lowest_everywhere(judge, noise),
        hybrid_lowest(judge, NOISY, over),
        less_susceptible(judge, noise),
    ]
}

/// Decides whether a variant is lower than each other one, and lists the differences, highest
/// first.
fn lower_than_each(
    judge: Judge<'_>,
    text: String,
    group: &str,
    (name, others): (&str, Vec<&str>),
) -> Option<Claim> {
    let against = |b: &&str| Some((format!("against {b}: "), judge.difference(group, name, b)?));
    let others = others.iter().filter(|other| **other != name);
    let mut evidence: Evidence = others.filter_map(against).collect();
    evidence.sort_by(|x, y| y.1.estimate.total_cmp(&x.1.estimate));
    judge.decide(text, ClaimVerdict::negative, evidence)
}

fn hybrid_lowest(judge: Judge<'_>, group: &str, over: &str) -> Option<Claim> {
    let text = format!("hybrid has a lower mean VSD than each other variant over {over}");
    lower_than_each(judge, text, group, (HYBRID, judge.family("")))
}

fn lowest_everywhere(judge: Judge<'_>, along: &str) -> Option<Claim> {
    judge.analysis.variant(HYBRID)?;
    let (mut first, mut tied, mut behind) = (0, Vec::new(), Vec::new());
    for step in judge.steps() {
        let Some((best, mean)) = judge.lowest(step, &judge.family("")) else {
            continue;
        };
        let ours = judge.vsd(step, HYBRID)?.estimate;
        let text = format!("{step}: {ours:.3}, {best} {mean}");
        match best == HYBRID {
            true => first += 1,
            false if ours <= mean.high => tied.push(text),
            false => behind.push(text),
        }
    }
    let verdict = ClaimVerdict::of(behind.is_empty(), !behind.is_empty());
    let steps = first + tied.len() + behind.len();
    let mut figures = vec![format!("lowest at {first} of {steps}")];
    let others = [("within the interval", tied), ("behind", behind)];
    let others = others.into_iter().filter(|(_, items)| !items.is_empty());
    figures.extend(others.map(|(what, items)| format!("{what} ({})", listed(items))));
    let text = "hybrid is the lowest, or within the interval of the lowest, at every step of";
    judge.claim(format!("{text} {along}"), verdict, listed(figures))
}

fn projective_best_low(judge: Judge<'_>) -> Option<Claim> {
    let (best, mean) = judge.lowest(LOW, &judge.family("projective-"))?;
    let text = format!(
        "at low initial VSD (below 0.3) a projective variant is best among those with a fixed association (here {best}, {mean})"
    );
    lower_than_each(judge, text, LOW, (best, judge.family("nn-")))
}

fn nn_best_high(judge: Judge<'_>) -> Option<Claim> {
    let text = format!(
        "at high initial VSD (0.7 and above) {NN} ({}) is best among those with a fixed association",
        judge.vsd(HIGH, NN)?
    );
    let mut fixed = judge.family("");
    fixed.retain(|name| *name != HYBRID);
    lower_than_each(judge, text, HIGH, (NN, fixed))
}

fn fails_high(judge: Judge<'_>, prefix: &str, kind: &str) -> Option<Claim> {
    let (mut missing, mut figures) = (Vec::new(), Vec::new());
    for name in judge.family(prefix) {
        let Some(mean) = judge.vsd(HIGH, name) else {
            continue;
        };
        let failed = judge.contrast(Metric::Failure, &[(HIGH, name, 1.0)])?;
        let percent = 100.0 * failed.estimate;
        missing.push(mean.from(FAILURE_VSD));
        figures.push(format!("{name}: {mean}, {percent:.0} % above 0.3"));
    }
    missing.first()?;
    let text = format!("every {kind} variant fails (mean VSD above 0.3) at high initial VSD");
    judge.claim(text, ClaimVerdict::negative(&missing), listed(figures))
}

/// Tests "no better". A significantly lower mean refutes it; means that are not lower confirm it.
fn nn_cascades(judge: Judge<'_>) -> Option<Claim> {
    let cascades = judge.family("nn-cascade-").into_iter();
    let against_nn = |v| Some((format!("{v} − {NN}: "), judge.difference(ALL, v, NN)?));
    let no_better = |differences: &[Interval]| {
        let holds = differences.iter().all(|i| i.estimate >= 0.0);
        ClaimVerdict::of(holds, differences.iter().any(|i| i.high < 0.0))
    };
    let text = "cascading is no better than point-to-point with nearest neighbors";
    judge.decide(text, no_better, cascades.filter_map(against_nn).collect())
}

/// Compares the rise of the mean due to noise between projective and nearest-neighbor variants.
fn less_susceptible(judge: Judge<'_>, noise: &str) -> Option<Claim> {
    let none = judge.steps().next()?;
    let rise = |prefix: &str, factor: f64| {
        let family = judge.family(prefix);
        let share = factor / family.len() as f64;
        let terms = family
            .into_iter()
            .flat_map(|v| [(NOISY, v, share), (none, v, -share)]);
        Some(terms.collect::<Vec<_>>()).filter(|terms| !terms.is_empty())
    };
    let of = |terms: &[(&str, &str, f64)]| judge.contrast(Metric::Vsd, terms);
    let (projective, nearest) = (rise("projective-", 1.0)?, rise("nn-", 1.0)?);
    let difference = of(&[projective.clone(), rise("nn-", -1.0)?].concat())?;
    let (projective, nearest) = (of(&projective)?, of(&nearest)?);
    judge.claim(
        format!("projective variants are less susceptible to {noise} than those with nearest neighbors (rise of the mean VSD from none)"),
        ClaimVerdict::negative(&[difference]),
        format!("projective {projective:+}, nearest neighbors {nearest:+}, difference {difference:+}"),
    )
}

fn alpha(judge: Judge<'_>) -> Option<Claim> {
    let name = judge.family("").into_iter().next()?;
    let means = judge
        .steps()
        .filter_map(|step| Some((step, judge.vsd(step, name)?)));
    let (best, lowest) = means.min_by(|a, b| a.1.estimate.total_cmp(&b.1.estimate))?;
    let loss = |step| judge.contrast(Metric::Vsd, &[(step, name, 1.0), (best, name, -1.0)]);
    let near = judge
        .steps()
        .filter(|step| loss(step).is_some_and(|loss| loss.low <= 0.0));
    let near = near.collect::<Vec<_>>().join(", ");
    let (mean, loss) = (judge.vsd("0.40", name)?, loss("0.40")?);
    judge.claim(
        "α = 0.4 is not significantly worse than the best threshold",
        ClaimVerdict::of(loss.low <= 0.0, loss.low > 0.0),
        format!("the minimum, {lowest}, is at α = {best}; at 0.4 {mean}, that is {loss:+} more; not distinguishable from the minimum: {near}"),
    )
}
