//! The paper's claims about single images, tested.

use super::aims::aims;
use super::experiment::Experiment;
use crate::analysis::{Analysis, FAILURE_VSD, Interval, Metric};
use crate::claims::{Claim, ClaimVerdict, listed};
use crate::study::{HIGH, LOW, NOISY};

/// The order of Table I, fastest first: means and standard deviations of the times, seconds.
pub const TABLE_I: [(&str, f64, f64); 9] = [
    ("projective-point-to-plane", 0.061, 0.023),
    ("projective-point-to-point", 0.085, 0.038),
    ("projective-cascade-plane-point", 0.094, 0.035),
    ("projective-cascade-point-plane", 0.101, 0.040),
    ("nn-point-to-point", 0.401, 0.516),
    ("hybrid", 0.542, 0.436),
    ("nn-point-to-plane", 0.786, 3.535),
    ("nn-cascade-plane-point", 0.879, 3.713),
    ("nn-cascade-point-plane", 1.090, 3.869),
];

const HYBRID: &str = "hybrid";
const NN: &str = "nn-point-to-point";
const CASCADE: &str = "projective-cascade-point-plane";

/// Tests the claims about a study; those whose variants it lacks are left out.
#[must_use]
pub fn claims(experiment: Experiment, analysis: &Analysis) -> Vec<Claim> {
    let judge = |section| Judge { analysis, section };
    let found = match experiment {
        Experiment::InitNoise => {
            let judge = judge("§VI-B.1");
            vec![
                judge.lowest_everywhere("initial VSD"),
                judge.hybrid_lowest(Some(analysis.overall()), "over all bins"),
                judge.hybrid_beats_cascade(),
                judge.projective_best_low(),
                judge.nn_best_high(),
                judge.fails_high("projective-", "projective"),
                judge.fails_high("nn-", "nearest-neighbour"),
                judge.nn_cascades(),
            ]
        }
        Experiment::DepthNoise => {
            let judge = judge("§VI-B.2");
            let mut found = judge.noise("depth noise", "over 1 to 5 % depth noise");
            let all = judge.family("").into_iter();
            found.extend(all.map(|variant| judge.improves_with_little_noise(variant)));
            found
        }
        Experiment::ModelNoise => {
            judge("§VI-B.3").noise("model noise", "over reconstructions 1 to 4")
        }
        Experiment::Timing => {
            vec![
                judge("§VI-B.4").projective_fastest(),
                judge("Table I").table_order(),
            ]
        }
        Experiment::Alpha => vec![judge("§IV-A").alpha()],
        Experiment::Beyond => return aims(analysis),
    };
    found.into_iter().flatten().collect()
}

struct Judge<'a> {
    analysis: &'a Analysis,
    /// The section of the claims.
    section: &'static str,
}

impl Judge<'_> {
    #[allow(clippy::unnecessary_wraps, reason = "how every test of a claim ends")]
    fn claim(
        &self,
        text: impl Into<String>,
        verdict: ClaimVerdict,
        figures: impl Into<String>,
    ) -> Option<Claim> {
        Some(Claim::new(self.section, text, verdict, figures))
    }

    fn name(&self, variant: usize) -> &str {
        &self.analysis.variants()[variant]
    }

    fn vsd(&self, group: usize, variant: usize) -> Option<Interval> {
        self.analysis.mean(Metric::Vsd, group, variant)
    }

    /// Returns the variants whose names start with a prefix.
    fn family(&self, prefix: &str) -> Vec<usize> {
        let all = 0..self.analysis.variants().len();
        all.filter(|v| self.name(*v).starts_with(prefix)).collect()
    }

    /// Returns the variant with the lowest mean in a group, with that mean.
    fn lowest(&self, group: usize, among: &[usize]) -> Option<(usize, Interval)> {
        let means = among
            .iter()
            .filter_map(|v| Some((*v, self.vsd(group, *v)?)));
        means.min_by(|a, b| a.1.estimate.total_cmp(&b.1.estimate))
    }

    /// Returns the differences of a variant from others that are there, with their names.
    fn against(&self, group: usize, a: usize, others: &[usize]) -> Vec<(&str, Interval)> {
        let difference = |b: &usize| self.analysis.difference(Metric::Vsd, group, a, *b);
        let others = others.iter();
        others
            .filter_map(|b| Some((self.name(*b), difference(b)?)))
            .collect()
    }

    /// Decides "a is lower than each of the others"; the figures list the differences, worst first.
    fn lower_than_each(
        &self,
        group: usize,
        a: usize,
        others: &[usize],
    ) -> Option<(ClaimVerdict, String)> {
        let mut differences = self.against(group, a, others);
        differences.sort_by(|x, y| y.1.estimate.total_cmp(&x.1.estimate));
        differences.first()?;
        let verdict = ClaimVerdict::negative(differences.iter().map(|d| &d.1));
        let figures = differences
            .iter()
            .map(|(name, i)| format!("against {name}: {i:+}"));
        Some((verdict, listed(figures)))
    }

    fn hybrid_lowest(&self, group: Option<usize>, over: &str) -> Option<Claim> {
        let hybrid = self.analysis.variant(HYBRID)?;
        let others: Vec<usize> = self
            .family("")
            .into_iter()
            .filter(|v| *v != hybrid)
            .collect();
        let (verdict, figures) = self.lower_than_each(group?, hybrid, &others)?;
        let text = format!("hybrid has a lower mean VSD than each other variant {over}");
        self.claim(text, verdict, figures)
    }

    fn lowest_everywhere(&self, along: &str) -> Option<Claim> {
        let hybrid = self.analysis.variant(HYBRID)?;
        let (mut first, mut tied, mut behind) = (0, Vec::new(), Vec::new());
        for (group, described) in self.analysis.groups().iter().enumerate() {
            let best = self
                .lowest(group, &self.family(""))
                .filter(|_| described.single);
            let Some((best, lowest)) = best else {
                continue;
            };
            let (label, ours) = (&described.label, self.vsd(group, hybrid)?.estimate);
            let text = format!("{label}: {ours:.3}, {} {lowest}", self.name(best));
            if best == hybrid {
                first += 1;
            } else if ours <= lowest.high {
                tied.push(text);
            } else {
                behind.push(text);
            }
        }
        let steps = first + tied.len() + behind.len();
        let verdict = ClaimVerdict::of(behind.is_empty());
        let mut figures = vec![format!("lowest at {first} of {steps}")];
        for (what, items) in [("within the interval", tied), ("behind", behind)] {
            if !items.is_empty() {
                figures.push(format!("{what} ({})", listed(items)));
            }
        }
        let text = format!(
            "hybrid is the lowest, or within the interval of the lowest, at every step of {along}"
        );
        self.claim(text, verdict, listed(figures))
    }

    fn hybrid_beats_cascade(&self) -> Option<Claim> {
        let (low, hybrid) = (self.analysis.group(LOW)?, self.analysis.variant(HYBRID)?);
        let cascade = self.analysis.variant(CASCADE)?;
        let difference = self
            .analysis
            .difference(Metric::Vsd, low, hybrid, cascade)?;
        let text = format!("hybrid outperforms {CASCADE} even at low initial VSD (below 0.3)");
        self.claim(
            text,
            ClaimVerdict::negative([&difference]),
            format!("{difference:+}"),
        )
    }

    fn projective_best_low(&self) -> Option<Claim> {
        let low = self.analysis.group(LOW)?;
        let (projective, mean) = self.lowest(low, &self.family("projective-"))?;
        let (verdict, figures) = self.lower_than_each(low, projective, &self.family("nn-"))?;
        let text = format!(
            "at low initial VSD (below 0.3) a projective variant is best among those with a fixed association (here {}, {mean})",
            self.name(projective)
        );
        self.claim(text, verdict, figures)
    }

    fn nn_best_high(&self) -> Option<Claim> {
        let (high, nn) = (self.analysis.group(HIGH)?, self.analysis.variant(NN)?);
        let mut fixed = self.family("");
        fixed.retain(|v| *v != nn && self.name(*v) != HYBRID);
        let (verdict, figures) = self.lower_than_each(high, nn, &fixed)?;
        let text = format!(
            "at high initial VSD (0.7 and above) {NN} ({}) is best among those with a fixed association",
            self.vsd(high, nn)?
        );
        self.claim(text, verdict, figures)
    }

    fn fails_high(&self, prefix: &str, kind: &str) -> Option<Claim> {
        let high = self.analysis.group(HIGH)?;
        let family = self.family(prefix).into_iter();
        let means: Vec<(usize, Interval)> = family
            .filter_map(|v| Some((v, self.vsd(high, v)?)))
            .collect();
        means.first()?;
        let missing: Vec<Interval> = means.iter().map(|m| m.1.from(FAILURE_VSD)).collect();
        let figures = means.iter().map(|(v, mean)| {
            let failed = self.analysis.mean(Metric::Failure, high, *v);
            let percent = 100.0 * failed.map_or(0.0, |f| f.estimate);
            format!("{}: {mean}, {percent:.0} % above 0.3", self.name(*v))
        });
        let text = format!("every {kind} variant fails (mean VSD above 0.3) at high initial VSD");
        self.claim(text, ClaimVerdict::negative(&missing), listed(figures))
    }

    /// Decides "no better": a significantly lower mean refutes it, means that are not lower confirm it.
    fn nn_cascades(&self) -> Option<Claim> {
        let (all, nn) = (self.analysis.overall(), self.analysis.variant(NN)?);
        let family = self.family("nn-cascade-").into_iter();
        let difference = |v| self.analysis.difference(Metric::Vsd, all, v, nn);
        let differences: Vec<(usize, Interval)> =
            family.filter_map(|v| Some((v, difference(v)?))).collect();
        differences.first()?;
        let verdict = if differences.iter().any(|(_, i)| i.high < 0.0) {
            ClaimVerdict::DoesNotHold
        } else if differences.iter().all(|(_, i)| i.estimate >= 0.0) {
            ClaimVerdict::Holds
        } else {
            ClaimVerdict::NotSignificant
        };
        let figures = differences.iter();
        let figures = figures.map(|(v, i)| format!("{} − {NN}: {i:+}", self.name(*v)));
        let text = "cascading is no better than point-to-point with nearest neighbours";
        self.claim(text, verdict, listed(figures))
    }

    /// Tests the claims about a kind of noise.
    fn noise(&self, noise: &str, over: &str) -> Vec<Option<Claim>> {
        vec![
            self.lowest_everywhere(noise),
            self.hybrid_lowest(self.analysis.group(NOISY), over),
            self.less_susceptible(noise),
        ]
    }

    /// Compares the rise of the mean from no noise to noise, projective against nearest neighbors.
    fn less_susceptible(&self, noise: &str) -> Option<Claim> {
        let (none, noisy) = (0, self.analysis.group(NOISY)?);
        let rise = |prefix: &str, factor: f64| -> Option<Vec<(usize, usize, f64)>> {
            let family = self.family(prefix);
            family.first()?;
            let share = factor / family.len() as f64;
            let terms = family
                .iter()
                .flat_map(|v| [(noisy, *v, share), (none, *v, -share)]);
            Some(terms.collect())
        };
        let of = |terms: &[(usize, usize, f64)]| self.analysis.contrast(Metric::Vsd, terms);
        let (projective, nearest) = (rise("projective-", 1.0)?, rise("nn-", 1.0)?);
        let difference = of(&[&projective[..], &rise("nn-", -1.0)?].concat())?;
        let (projective, nearest) = (of(&projective)?, of(&nearest)?);
        self.claim(
            format!("projective variants are less susceptible to {noise} than those with nearest neighbours (rise of the mean VSD from none)"),
            ClaimVerdict::negative([&difference]),
            format!("projective {projective:+}, nearest neighbours {nearest:+}, difference {difference:+}"),
        )
    }

    fn improves_with_little_noise(&self, variant: usize) -> Option<Claim> {
        let name = self.name(variant);
        if !(name.ends_with("point-to-plane") || name.contains("-cascade-")) {
            return None;
        }
        let (none, little) = (self.analysis.group("0")?, self.analysis.group("1")?);
        let terms = [(little, variant, 1.0), (none, variant, -1.0)];
        let change = self.analysis.contrast(Metric::Vsd, &terms)?;
        let text = format!("{name} improves from 0 % to 1 % depth noise");
        self.claim(
            text,
            ClaimVerdict::negative([&change]),
            format!("{change:+}"),
        )
    }

    /// Returns the difference of the mean times of two variants.
    fn time(&self, a: usize, b: usize) -> Option<Interval> {
        let all = self.analysis.overall();
        self.analysis.difference(Metric::CpuMs, all, a, b)
    }

    fn projective_fastest(&self) -> Option<Claim> {
        let projective = self.family("projective-");
        let mut slow = self.family("");
        slow.retain(|v| !projective.contains(v));
        let pairs = projective
            .iter()
            .flat_map(|p| slow.iter().map(|s| (*p, *s)));
        let contrasts: Vec<Interval> = pairs.filter_map(|(p, s)| self.time(p, s)).collect();
        let nearest = contrasts
            .iter()
            .max_by(|a, b| a.estimate.total_cmp(&b.estimate))?;
        self.claim(
            "every projective variant is faster than hybrid and than every variant with nearest neighbours",
            ClaimVerdict::negative(&contrasts),
            format!("the nearest pair differs by {nearest:+} ms"),
        )
    }

    fn table_order(&self) -> Option<Claim> {
        let all = self.analysis.overall();
        let order = TABLE_I.iter().map(|(name, ..)| self.analysis.variant(name));
        let order: Vec<usize> = order.collect::<Option<_>>()?;
        let pairs = order.windows(2).map(|pair| self.time(pair[0], pair[1]));
        let pairs: Vec<Interval> = pairs.collect::<Option<_>>()?;
        let mean = |v| Some(self.analysis.mean(Metric::CpuMs, all, v)?.estimate);
        let unit = mean(self.analysis.variant(NN)?)?;
        let ratios = order.iter().map(|v| Some((*v, mean(*v)? / unit)));
        // The places in Table I, fastest here first.
        let mut ranked: Vec<(usize, (usize, f64))> = ratios.flatten().enumerate().collect();
        ranked.sort_by(|a, b| a.1.1.total_cmp(&b.1.1));
        let agreeing = (0..ranked.len()).map(|i| {
            ranked[i..]
                .iter()
                .filter(|later| later.0 > ranked[i].0)
                .count()
        });
        let agreeing: usize = agreeing.sum();
        let ranked = ranked
            .iter()
            .map(|(_, (v, ratio))| format!("{} {ratio:.2}", self.name(*v)));
        let ranked = ranked.collect::<Vec<_>>().join(", ");
        self.claim(
            "the order of Table I, every neighbouring pair of it",
            ClaimVerdict::negative(&pairs),
            format!("{agreeing} of 36 pairs are in the paper's order; fastest first, time in units of {NN}: {ranked}"),
        )
    }

    fn alpha(&self) -> Option<Claim> {
        let (variant, paper) = (0, self.analysis.group("0.40")?);
        let groups = self.analysis.groups();
        let steps = || (0..groups.len()).filter(|g| groups[*g].single);
        let means = steps().filter_map(|g| Some((g, self.vsd(g, variant)?)));
        let (best, lowest) = means.min_by(|a, b| a.1.estimate.total_cmp(&b.1.estimate))?;
        let loss = |group| {
            let terms = [(group, variant, 1.0), (best, variant, -1.0)];
            self.analysis.contrast(Metric::Vsd, &terms)
        };
        let is_near = |group: &usize| loss(*group).is_some_and(|loss| loss.low <= 0.0);
        let near: Vec<&str> = steps().filter(is_near).map(|g| &*groups[g].label).collect();
        let loss = loss(paper)?;
        self.claim(
            "α = 0.4 is not significantly worse than the best threshold",
            ClaimVerdict::of(loss.low <= 0.0),
            format!(
                "the minimum, {lowest}, is at α = {}; at 0.4 {}, that is {loss:+} more; not distinguishable from the minimum: {}",
                groups[best].label,
                self.vsd(paper, variant)?,
                near.join(", ")
            ),
        )
    }
}
