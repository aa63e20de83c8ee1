//! The paper's claims about single images, tested.

use super::aims::aims;
use super::experiment::Experiment;
use super::table_one::{projective_fastest, table_order};
use crate::analysis::{Analysis, FAILURE_VSD, Interval, Metric};
use crate::claims::{Claim, ClaimVerdict, Evidence, Judge, listed};
use crate::study::{HIGH, LOW, NOISY};

const HYBRID: &str = "hybrid";
const NN: &str = "nn-point-to-point";
const CASCADE: &str = "projective-cascade-point-plane";

/// Tests the claims about a study; those whose variants it lacks are left out.
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
            let mut found = of_noise(judge, "depth noise", "1 to 5 % depth noise");
            found.extend(
                judge
                    .family("")
                    .iter()
                    .map(|v| improves_with_little_noise(judge, *v)),
            );
            found
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
        hybrid_lowest(judge, Some(judge.analysis.overall()), "all bins"),
        hybrid_beats_cascade(judge),
        projective_best_low(judge),
        nn_best_high(judge),
        fails_high(judge, "projective-", "projective"),
        fails_high(judge, "nn-", "nearest-neighbour"),
        nn_cascades(judge),
    ]
}

fn of_noise(judge: Judge<'_>, noise: &str, over: &str) -> Vec<Option<Claim>> {
    vec![
        lowest_everywhere(judge, noise),
        hybrid_lowest(judge, judge.analysis.group(NOISY), over),
        less_susceptible(judge, noise),
    ]
}

/// Returns the variant with the lowest mean in a group, with that mean.
fn lowest(judge: Judge<'_>, group: usize, among: &[usize]) -> Option<(usize, Interval)> {
    let means = among
        .iter()
        .filter_map(|v| Some((*v, judge.vsd(group, *v)?)));
    means.min_by(|a, b| a.1.estimate.total_cmp(&b.1.estimate))
}

/// Decides that a variant is lower than each of the others; lists the differences, worst first.
fn lower_than_each(
    judge: Judge<'_>,
    text: String,
    group: usize,
    (a, others): (usize, &[usize]),
) -> Option<Claim> {
    let label = |b: usize| format!("against {}: ", judge.name(b));
    let difference = |b: &usize| Some((label(*b), judge.difference(group, a, *b)?));
    let mut evidence: Evidence = others.iter().filter_map(difference).collect();
    evidence.sort_by(|x, y| y.1.estimate.total_cmp(&x.1.estimate));
    judge.decide(text, ClaimVerdict::negative, evidence)
}

fn hybrid_lowest(judge: Judge<'_>, group: Option<usize>, over: &str) -> Option<Claim> {
    let hybrid = judge.analysis.variant(HYBRID)?;
    let mut others = judge.family("");
    others.retain(|v| *v != hybrid);
    let text = format!("hybrid has a lower mean VSD than each other variant over {over}");
    lower_than_each(judge, text, group?, (hybrid, &others))
}

fn lowest_everywhere(judge: Judge<'_>, along: &str) -> Option<Claim> {
    let hybrid = judge.analysis.variant(HYBRID)?;
    let (mut first, mut tied, mut behind) = (0, Vec::new(), Vec::new());
    let groups = judge.analysis.groups().iter().enumerate();
    for (group, described) in groups.filter(|(_, group)| group.single) {
        let Some((best, mean)) = lowest(judge, group, &judge.family("")) else {
            continue;
        };
        let ours = judge.vsd(group, hybrid)?.estimate;
        let text = format!(
            "{}: {ours:.3}, {} {mean}",
            described.label,
            judge.name(best)
        );
        match best == hybrid {
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

fn hybrid_beats_cascade(judge: Judge<'_>) -> Option<Claim> {
    let (low, cascade) = (judge.analysis.group(LOW)?, judge.analysis.variant(CASCADE)?);
    let difference = judge.difference(low, judge.analysis.variant(HYBRID)?, cascade)?;
    let text = format!("hybrid outperforms {CASCADE} even at low initial VSD (below 0.3)");
    judge.decide(
        text,
        ClaimVerdict::negative,
        vec![(String::new(), difference)],
    )
}

fn projective_best_low(judge: Judge<'_>) -> Option<Claim> {
    let low = judge.analysis.group(LOW)?;
    let (best, mean) = lowest(judge, low, &judge.family("projective-"))?;
    let text = format!(
        "at low initial VSD (below 0.3) a projective variant is best among those with a fixed association (here {}, {mean})",
        judge.name(best)
    );
    lower_than_each(judge, text, low, (best, &judge.family("nn-")))
}

fn nn_best_high(judge: Judge<'_>) -> Option<Claim> {
    let (high, nn) = (judge.analysis.group(HIGH)?, judge.analysis.variant(NN)?);
    let mut fixed = judge.family("");
    fixed.retain(|v| *v != nn && judge.name(*v) != HYBRID);
    let text = format!(
        "at high initial VSD (0.7 and above) {NN} ({}) is best among those with a fixed association",
        judge.vsd(high, nn)?
    );
    lower_than_each(judge, text, high, (nn, &fixed))
}

fn fails_high(judge: Judge<'_>, prefix: &str, kind: &str) -> Option<Claim> {
    let high = judge.analysis.group(HIGH)?;
    let (mut missing, mut figures) = (Vec::new(), Vec::new());
    for variant in judge.family(prefix) {
        let Some(mean) = judge.vsd(high, variant) else {
            continue;
        };
        let failed = judge.analysis.mean(Metric::Failure, high, variant)?;
        let (name, percent) = (judge.name(variant), 100.0 * failed.estimate);
        missing.push(mean.from(FAILURE_VSD));
        figures.push(format!("{name}: {mean}, {percent:.0} % above 0.3"));
    }
    missing.first()?;
    let text = format!("every {kind} variant fails (mean VSD above 0.3) at high initial VSD");
    judge.claim(text, ClaimVerdict::negative(&missing), listed(figures))
}

/// Tests "no better": a significantly lower mean refutes it, means that are not lower confirm it.
fn nn_cascades(judge: Judge<'_>) -> Option<Claim> {
    let (all, nn) = (judge.analysis.overall(), judge.analysis.variant(NN)?);
    let label = |v: usize| format!("{} − {NN}: ", judge.name(v));
    let difference = |v: &usize| Some((label(*v), judge.difference(all, *v, nn)?));
    let cascades = judge.family("nn-cascade-");
    let no_better = |differences: &[Interval]| {
        let holds = differences.iter().all(|i| i.estimate >= 0.0);
        ClaimVerdict::of(holds, differences.iter().any(|i| i.high < 0.0))
    };
    let text = "cascading is no better than point-to-point with nearest neighbours";
    judge.decide(
        text,
        no_better,
        cascades.iter().filter_map(difference).collect(),
    )
}

/// Compares the rise of the mean from no noise to noise, projective against nearest neighbors.
fn less_susceptible(judge: Judge<'_>, noise: &str) -> Option<Claim> {
    let (none, noisy) = (0, judge.analysis.group(NOISY)?);
    let rise = |prefix: &str, factor: f64| {
        let family = judge.family(prefix);
        let share = factor / family.len() as f64;
        let terms = |v: &usize| [(noisy, *v, share), (none, *v, -share)];
        let terms: Vec<(usize, usize, f64)> = family.iter().flat_map(terms).collect();
        Some(terms).filter(|terms| !terms.is_empty())
    };
    let of = |terms: &[(usize, usize, f64)]| judge.analysis.contrast(Metric::Vsd, terms);
    let (projective, nearest) = (rise("projective-", 1.0)?, rise("nn-", 1.0)?);
    let difference = of(&[projective.clone(), rise("nn-", -1.0)?].concat())?;
    let (projective, nearest) = (of(&projective)?, of(&nearest)?);
    judge.claim(
        format!("projective variants are less susceptible to {noise} than those with nearest neighbours (rise of the mean VSD from none)"),
        ClaimVerdict::negative(&[difference]),
        format!("projective {projective:+}, nearest neighbours {nearest:+}, difference {difference:+}"),
    )
}

fn improves_with_little_noise(judge: Judge<'_>, variant: usize) -> Option<Claim> {
    let name = judge.name(variant);
    let has_planes = name.ends_with("point-to-plane") || name.contains("-cascade-");
    let none = judge.analysis.group("0").filter(|_| has_planes)?;
    let terms = [
        (judge.analysis.group("1")?, variant, 1.0),
        (none, variant, -1.0),
    ];
    let change = judge.analysis.contrast(Metric::Vsd, &terms)?;
    let text = format!("{name} improves from 0 % to 1 % depth noise");
    judge.decide(text, ClaimVerdict::negative, vec![(String::new(), change)])
}

fn alpha(judge: Judge<'_>) -> Option<Claim> {
    let (variant, groups) = (0, judge.analysis.groups());
    let steps = || (0..groups.len()).filter(|g| groups[*g].single);
    let means = steps().filter_map(|g| Some((g, judge.vsd(g, variant)?)));
    let (best, lowest) = means.min_by(|a, b| a.1.estimate.total_cmp(&b.1.estimate))?;
    let loss = |group: usize| {
        let terms = [(group, variant, 1.0), (best, variant, -1.0)];
        judge.analysis.contrast(Metric::Vsd, &terms)
    };
    let near = steps().filter(|g| loss(*g).is_some_and(|loss| loss.low <= 0.0));
    let near = near
        .map(|g| &*groups[g].label)
        .collect::<Vec<_>>()
        .join(", ");
    let paper = judge.analysis.group("0.40")?;
    let (best, mean, loss) = (
        &groups[best].label,
        judge.vsd(paper, variant)?,
        loss(paper)?,
    );
    judge.claim(
        "α = 0.4 is not significantly worse than the best threshold",
        ClaimVerdict::of(loss.low <= 0.0, loss.low > 0.0),
        format!("the minimum, {lowest}, is at α = {best}; at 0.4 {mean}, that is {loss:+} more; not distinguishable from the minimum: {near}"),
    )
}
