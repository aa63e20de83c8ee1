//! The paper's claims about single images, tested.

use super::aims::aims;
use super::experiment::Experiment;
use super::table_one::{projective_fastest, table_order};
use crate::analysis::{Analysis, FAILURE_VSD, Metric};
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
    let of_method = Judge {
        section: "§IV-B",
        ..judge
    };
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
        cascade_beats_metrics(of_method),
        nn_cascades_worse(of_method),
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

/// Compares hybrid with the best other variant of every step, by their paired difference.
fn lowest_everywhere(judge: Judge<'_>, along: &str) -> Option<Claim> {
    let mut others = judge.family("");
    others.retain(|name| *name != HYBRID);
    let (mut first, mut rest, mut figures) = (0, Vec::new(), Vec::new());
    for step in judge.steps() {
        let Some((best, mean)) = judge.lowest(step, &others) else {
            continue;
        };
        let difference = judge.difference(step, HYBRID, best)?;
        if difference.estimate <= 0.0 {
            first += 1;
            continue;
        }
        figures.push(format!(
            "{step}: {difference:+} to {best}, {:.3}",
            mean.estimate
        ));
        rest.push(difference);
    }
    let steps = first + rest.len();
    if steps == 0 {
        return None;
    }
    let verdict = match ClaimVerdict::negative(&rest) {
        // Within the interval of the lowest, and no more than the tolerance above it.
        ClaimVerdict::Equivalent => ClaimVerdict::Holds,
        other => other,
    };
    figures.insert(0, format!("lowest at {first} of {steps}"));
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

fn nn_cascades_worse(judge: Judge<'_>) -> Option<Claim> {
    let cascades = judge.family("nn-cascade-").into_iter();
    let against = |v| Some((format!("{NN} − {v}: "), judge.difference(ALL, NN, v)?));
    let text = "with nearest neighbors, cascading is worse than point-to-point";
    judge.decide(
        text,
        ClaimVerdict::negative,
        cascades.filter_map(against).collect(),
    )
}

fn cascade_beats_metrics(judge: Judge<'_>) -> Option<Claim> {
    let mut single = judge.family("projective-point-");
    single.push(CASCADE);
    let text = format!("with projective association, {CASCADE} is better than either metric alone");
    lower_than_each(judge, text, ALL, (CASCADE, single))
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
        "α = 0.4 is as good as the best threshold",
        ClaimVerdict::not_positive(&[loss]),
        format!("the minimum, {lowest}, is at α = {best}; at 0.4 {mean}, that is {loss:+} more; not distinguishable from the minimum: {near}"),
    )
}
