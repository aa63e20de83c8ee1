//! What the paper claims, held against a study.

use crate::aims::aims;
use crate::analysis::{Analysis, HIGH, Interval, LOW, Metric, NOISY};
use crate::experiment::Experiment;

/// Whether a claim holds in a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClaimVerdict {
    /// It holds, and the intervals exclude the opposite.
    Holds,
    /// It does not, and the intervals exclude that it does.
    DoesNotHold,
    /// The study cannot tell.
    NotSignificant,
}

impl ClaimVerdict {
    /// In words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::DoesNotHold => "does not hold",
            Self::NotSignificant => "not significant",
        }
    }
}

/// A claim and what became of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Claim {
    /// Where the paper makes it; `aim` where it is not the paper's.
    pub section: &'static str,
    /// In words, with what was tested.
    pub text: String,
    /// What became of it.
    pub verdict: ClaimVerdict,
    /// The figures that decided.
    pub figures: String,
}

/// The order of Table I, fastest first, with the mean times in seconds.
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

/// Tests the paper's claims about a study; those whose variants it lacks are left out.
#[must_use]
pub fn claims(analysis: &Analysis) -> Vec<Claim> {
    let tester = Tester { analysis };
    let found = match analysis.experiment() {
        Experiment::InitNoise => vec![
            tester.lowest_everywhere("§VI-B.1", "initial VSD"),
            tester.hybrid_lowest("§VI-B.1", analysis.overall(), "over all bins"),
            analysis
                .group(LOW)
                .and_then(|low| tester.hybrid_beats_cascade(low)),
            tester.projective_best_low(),
            tester.nn_best_high(),
            tester.fails_high(
                "projective-",
                "every projective variant fails (mean VSD above 0.3) at high initial VSD",
            ),
            tester.fails_high(
                "nn-",
                "every nearest-neighbour variant fails (mean VSD above 0.3) at high initial VSD",
            ),
            tester.nn_cascades(),
        ],
        Experiment::DepthNoise => {
            let mut found = vec![
                tester.lowest_everywhere("§VI-B.2", "depth noise"),
                analysis
                    .group(NOISY)
                    .and_then(|g| tester.hybrid_lowest("§VI-B.2", g, "over 1 to 5 % depth noise")),
                tester.less_susceptible("§VI-B.2", "depth noise"),
            ];
            found.extend(tester.improve_with_little_noise());
            found
        }
        Experiment::ModelNoise => vec![
            tester.lowest_everywhere("§VI-B.3", "model noise"),
            analysis
                .group(NOISY)
                .and_then(|g| tester.hybrid_lowest("§VI-B.3", g, "over reconstructions 1 to 4")),
            tester.less_susceptible("§VI-B.3", "model noise"),
        ],
        Experiment::Timing => vec![tester.projective_fastest(), tester.table_order()],
        Experiment::Alpha => vec![tester.alpha()],
        Experiment::Beyond => return aims(analysis),
    };
    found.into_iter().flatten().collect()
}

/// The verdict on "all of these are negative".
pub(crate) fn all_negative(contrasts: impl IntoIterator<Item = Interval>) -> ClaimVerdict {
    let mut verdict = ClaimVerdict::Holds;
    for contrast in contrasts {
        if contrast.low > 0.0 {
            return ClaimVerdict::DoesNotHold;
        }
        if contrast.high >= 0.0 {
            verdict = ClaimVerdict::NotSignificant;
        }
    }
    verdict
}

/// An interval as text, with its sign.
pub(crate) fn signed(i: &Interval) -> String {
    format!("{:+.3} [{:+.3}, {:+.3}]", i.estimate, i.low, i.high)
}

/// An interval as text.
pub(crate) fn plain(i: &Interval) -> String {
    format!("{:.3} [{:.3}, {:.3}]", i.estimate, i.low, i.high)
}

struct Tester<'a> {
    analysis: &'a Analysis,
}

impl Tester<'_> {
    fn name(&self, variant: usize) -> &str {
        &self.analysis.variants()[variant]
    }

    fn difference(&self, metric: Metric, group: usize, a: usize, b: usize) -> Option<Interval> {
        self.analysis
            .contrast(metric, &[(group, a, 1.0), (group, b, -1.0)])
    }

    fn vsd(&self, group: usize, variant: usize) -> Option<Interval> {
        self.analysis.mean(Metric::Vsd, group, variant)
    }

    /// The variants whose names begin so.
    fn family(&self, prefix: &str) -> Vec<usize> {
        let names = self.analysis.variants().iter().enumerate();
        names
            .filter(|(_, name)| name.starts_with(prefix))
            .map(|(index, _)| index)
            .collect()
    }

    /// The variant with the lowest mean in a group.
    fn lowest(&self, group: usize, among: &[usize]) -> Option<usize> {
        let means = among
            .iter()
            .filter_map(|v| Some((*v, self.vsd(group, *v)?.estimate)));
        means.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(v, _)| v)
    }

    fn others(&self, variant: usize) -> Vec<usize> {
        (0..self.analysis.variants().len())
            .filter(|v| *v != variant)
            .collect()
    }

    /// "a is lower than each of the others": the differences, worst first, and the verdict.
    fn lower_than_each(
        &self,
        group: usize,
        a: usize,
        others: &[usize],
    ) -> Option<(ClaimVerdict, String)> {
        let mut differences: Vec<(usize, Interval)> = others
            .iter()
            .filter_map(|b| Some((*b, self.difference(Metric::Vsd, group, a, *b)?)))
            .collect();
        differences.sort_by(|x, y| y.1.estimate.total_cmp(&x.1.estimate));
        if differences.is_empty() {
            return None;
        }
        let verdict = all_negative(differences.iter().map(|(_, i)| *i));
        let figures = differences
            .iter()
            .map(|(b, i)| format!("against {}: {}", self.name(*b), signed(i)))
            .collect::<Vec<_>>()
            .join("; ");
        Some((verdict, figures))
    }

    fn hybrid_lowest(&self, section: &'static str, group: usize, over: &str) -> Option<Claim> {
        let hybrid = self.analysis.variant(HYBRID)?;
        let (verdict, figures) = self.lower_than_each(group, hybrid, &self.others(hybrid))?;
        Some(Claim {
            section,
            text: format!("hybrid has a lower mean VSD than each other variant {over}"),
            verdict,
            figures,
        })
    }

    fn lowest_everywhere(&self, section: &'static str, along: &str) -> Option<Claim> {
        let hybrid = self.analysis.variant(HYBRID)?;
        let all = self.family("");
        let (mut first, mut tied, mut behind) = (0, Vec::new(), Vec::new());
        for (group, described) in self
            .analysis
            .groups()
            .iter()
            .enumerate()
            .filter(|(_, g)| g.single)
        {
            let Some(best) = self.lowest(group, &all) else {
                continue;
            };
            let (ours, lowest) = (self.vsd(group, hybrid)?, self.vsd(group, best)?);
            let text = || {
                format!(
                    "{}: {:.3}, {} {}",
                    described.label,
                    ours.estimate,
                    self.name(best),
                    plain(&lowest)
                )
            };
            if best == hybrid {
                first += 1;
            } else if ours.estimate <= lowest.high {
                tied.push(text());
            } else {
                behind.push(text());
            }
        }
        let list = |what: &str, items: &[String]| match items {
            [] => String::new(),
            items => format!("; {what} ({})", items.join("; ")),
        };
        Some(Claim {
            section,
            text: format!(
                "hybrid is the lowest, or within the interval of the lowest, at every step of {along}"
            ),
            verdict: if behind.is_empty() {
                ClaimVerdict::Holds
            } else {
                ClaimVerdict::DoesNotHold
            },
            figures: format!(
                "lowest at {first} of {}{}{}",
                first + tied.len() + behind.len(),
                list("within the interval", &tied),
                list("behind", &behind)
            ),
        })
    }

    fn hybrid_beats_cascade(&self, low: usize) -> Option<Claim> {
        let hybrid = self.analysis.variant(HYBRID)?;
        let cascade = self.analysis.variant("projective-cascade-point-plane")?;
        let difference = self.difference(Metric::Vsd, low, hybrid, cascade)?;
        Some(Claim {
            section: "§VI-B.1",
            text: "hybrid outperforms projective-cascade-point-plane even at low initial VSD (below 0.3)".to_owned(),
            verdict: all_negative([difference]),
            figures: signed(&difference),
        })
    }

    fn projective_best_low(&self) -> Option<Claim> {
        let low = self.analysis.group(LOW)?;
        let projective = self.lowest(low, &self.family("projective-"))?;
        let nearest = self.family("nn-");
        let (verdict, figures) = self.lower_than_each(low, projective, &nearest)?;
        Some(Claim {
            section: "§VI-B.1",
            text: format!(
                "at low initial VSD (below 0.3) a projective variant is best among those with a fixed association (here {}, {})",
                self.name(projective),
                plain(&self.vsd(low, projective)?)
            ),
            verdict,
            figures,
        })
    }

    fn nn_best_high(&self) -> Option<Claim> {
        let high = self.analysis.group(HIGH)?;
        let nn = self.analysis.variant("nn-point-to-point")?;
        let fixed: Vec<usize> = self
            .others(nn)
            .into_iter()
            .filter(|v| self.name(*v) != HYBRID)
            .collect();
        let (verdict, figures) = self.lower_than_each(high, nn, &fixed)?;
        Some(Claim {
            section: "§VI-B.1",
            text: format!(
                "at high initial VSD (0.7 and above) nn-point-to-point ({}) is best among those with a fixed association",
                plain(&self.vsd(high, nn)?)
            ),
            verdict,
            figures,
        })
    }

    fn fails_high(&self, prefix: &str, text: &str) -> Option<Claim> {
        let high = self.analysis.group(HIGH)?;
        let means: Vec<(usize, Interval)> = self
            .family(prefix)
            .into_iter()
            .filter_map(|v| Some((v, self.vsd(high, v)?)))
            .collect();
        if means.is_empty() {
            return None;
        }
        let limit = crate::analysis::FAILURE_VSD;
        let verdict = all_negative(means.iter().map(|(_, i)| Interval {
            estimate: limit - i.estimate,
            low: limit - i.high,
            high: limit - i.low,
        }));
        let figures = means.iter().map(|(v, i)| {
            let failed = self
                .analysis
                .mean(Metric::Failure, high, *v)
                .map_or(0.0, |f| f.estimate);
            format!(
                "{}: {}, {:.0} % above 0.3",
                self.name(*v),
                plain(i),
                100.0 * failed
            )
        });
        Some(Claim {
            section: "§VI-B.1",
            text: text.to_owned(),
            verdict,
            figures: figures.collect::<Vec<_>>().join("; "),
        })
    }

    /// "No better": significantly lower refutes it, not lower confirms it.
    fn nn_cascades(&self) -> Option<Claim> {
        let all = self.analysis.overall();
        let nn = self.analysis.variant("nn-point-to-point")?;
        let differences: Vec<(usize, Interval)> = self
            .family("nn-cascade-")
            .into_iter()
            .filter_map(|v| Some((v, self.difference(Metric::Vsd, all, v, nn)?)))
            .collect();
        if differences.is_empty() {
            return None;
        }
        let verdict = if differences.iter().any(|(_, i)| i.high < 0.0) {
            ClaimVerdict::DoesNotHold
        } else if differences.iter().all(|(_, i)| i.estimate >= 0.0) {
            ClaimVerdict::Holds
        } else {
            ClaimVerdict::NotSignificant
        };
        let figures = differences
            .iter()
            .map(|(v, i)| format!("{} − nn-point-to-point: {}", self.name(*v), signed(i)));
        Some(Claim {
            section: "§VI-B.1",
            text: "cascading is no better than point-to-point with nearest neighbours".to_owned(),
            verdict,
            figures: figures.collect::<Vec<_>>().join("; "),
        })
    }

    /// How much the mean rises from no noise to noise, projective against nearest neighbours.
    fn less_susceptible(&self, section: &'static str, noise: &str) -> Option<Claim> {
        let (none, noisy) = (0, self.analysis.group(NOISY)?);
        let rise = |family: &[usize], factor: f64| -> Vec<(usize, usize, f64)> {
            let share = factor / family.len().max(1) as f64;
            family
                .iter()
                .flat_map(|v| [(noisy, *v, share), (none, *v, -share)])
                .collect()
        };
        let (projective, nearest) = (self.family("projective-"), self.family("nn-"));
        if projective.is_empty() || nearest.is_empty() {
            return None;
        }
        let of = |terms: &[(usize, usize, f64)]| self.analysis.contrast(Metric::Vsd, terms);
        let difference = of(&[rise(&projective, 1.0), rise(&nearest, -1.0)].concat())?;
        Some(Claim {
            section,
            text: format!(
                "projective variants are less susceptible to {noise} than those with nearest neighbours (rise of the mean VSD from none)"
            ),
            verdict: all_negative([difference]),
            figures: format!(
                "projective {}, nearest neighbours {}, difference {}",
                signed(&of(&rise(&projective, 1.0))?),
                signed(&of(&rise(&nearest, 1.0))?),
                signed(&difference)
            ),
        })
    }

    fn improve_with_little_noise(&self) -> Vec<Option<Claim>> {
        let variants = self.family("").into_iter().filter(|v| {
            let name = self.name(*v);
            name.ends_with("point-to-plane") || name.contains("-cascade-")
        });
        let claim = |variant: usize| {
            let (none, little) = (self.analysis.group("0")?, self.analysis.group("1")?);
            let change = self.analysis.contrast(
                Metric::Vsd,
                &[(little, variant, 1.0), (none, variant, -1.0)],
            )?;
            Some(Claim {
                section: "§VI-B.2",
                text: format!(
                    "{} improves from 0 % to 1 % depth noise",
                    self.name(variant)
                ),
                verdict: all_negative([change]),
                figures: signed(&change),
            })
        };
        variants.map(claim).collect()
    }

    fn ratio(&self, variant: usize, to: usize) -> Option<f64> {
        let all = self.analysis.overall();
        let time = |v| Some(self.analysis.mean(Metric::CpuMs, all, v)?.estimate);
        Some(time(variant)? / time(to)?)
    }

    fn projective_fastest(&self) -> Option<Claim> {
        let all = self.analysis.overall();
        let projective = self.family("projective-");
        let slow: Vec<usize> = self
            .family("")
            .into_iter()
            .filter(|v| !projective.contains(v))
            .collect();
        let contrasts: Vec<Interval> = projective
            .iter()
            .flat_map(|p| slow.iter().map(|s| (*p, *s)))
            .filter_map(|(p, s)| self.difference(Metric::CpuMs, all, p, s))
            .collect();
        let nearest = contrasts
            .iter()
            .max_by(|a, b| a.estimate.total_cmp(&b.estimate))?;
        Some(Claim {
            section: "§VI-B.4",
            text: "every projective variant is faster than hybrid and than every variant with nearest neighbours".to_owned(),
            verdict: all_negative(contrasts.iter().copied()),
            figures: format!("the nearest pair differs by {} ms", signed(nearest)),
        })
    }

    fn table_order(&self) -> Option<Claim> {
        let all = self.analysis.overall();
        let order: Option<Vec<usize>> = TABLE_I
            .iter()
            .map(|(name, ..)| self.analysis.variant(name))
            .collect();
        let order = order?;
        let yardstick = self.analysis.variant("nn-point-to-point")?;
        let pairs: Option<Vec<Interval>> = order
            .windows(2)
            .map(|w| self.difference(Metric::CpuMs, all, w[0], w[1]))
            .collect();
        let mut ranked: Vec<(usize, f64)> = order
            .iter()
            .filter_map(|v| Some((*v, self.ratio(*v, yardstick)?)))
            .collect();
        ranked.sort_by(|a, b| a.1.total_cmp(&b.1));
        let agreeing = (0..order.len())
            .flat_map(|i| (i + 1..order.len()).map(move |j| (i, j)))
            .filter(|(i, j)| {
                let place = |v: usize| ranked.iter().position(|(r, _)| *r == v);
                place(order[*i]) < place(order[*j])
            })
            .count();
        let listed: Vec<String> = ranked
            .iter()
            .map(|(v, r)| format!("{} {r:.2}", self.name(*v)))
            .collect();
        Some(Claim {
            section: "Table I",
            text: "the order of Table I, every neighbouring pair of it".to_owned(),
            verdict: all_negative(pairs?),
            figures: format!(
                "{agreeing} of 36 pairs are in the paper's order; fastest first, time in units of nn-point-to-point: {}",
                listed.join(", ")
            ),
        })
    }

    fn alpha(&self) -> Option<Claim> {
        let variant = 0;
        let paper = self.analysis.group("0.40")?;
        let groups: Vec<usize> = (0..self.analysis.groups().len())
            .filter(|g| self.analysis.groups()[*g].single)
            .collect();
        let means = groups
            .iter()
            .filter_map(|g| Some((*g, self.vsd(*g, variant)?.estimate)));
        let (best, _) = means.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let loss = self
            .analysis
            .contrast(Metric::Vsd, &[(paper, variant, 1.0), (best, variant, -1.0)])?;
        let near: Vec<&str> = groups
            .iter()
            .filter(|g| {
                let d = self
                    .analysis
                    .contrast(Metric::Vsd, &[(**g, variant, 1.0), (best, variant, -1.0)]);
                d.is_some_and(|d| d.low <= 0.0)
            })
            .map(|g| self.analysis.groups()[*g].label.as_str())
            .collect();
        Some(Claim {
            section: "§IV-A",
            text: "α = 0.4 is not significantly worse than the best threshold".to_owned(),
            verdict: if loss.low <= 0.0 {
                ClaimVerdict::Holds
            } else {
                ClaimVerdict::DoesNotHold
            },
            figures: format!(
                "the minimum, {}, is at α = {}; at 0.4 {}, that is {} more; not distinguishable from the minimum: {}",
                plain(&self.vsd(best, variant)?),
                self.analysis.groups()[best].label,
                plain(&self.vsd(paper, variant)?),
                signed(&loss),
                near.join(", ")
            ),
        })
    }
}
