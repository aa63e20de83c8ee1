//! Subsets that keep the object from sliding.

use hicp_core::internal::Scratch;
use hicp_core::internal::small::eigen6;
use hicp_core::{Context, Isometry3, Matrix6, Point3, Problem, Surfel, Vector3, Vector6};

use crate::selection::all_samples::AllSamples;
use crate::selection::keep::keep_positions;
use crate::selection::point_selection::PointSelection;

/// Keeps `count` points of another selection that constrain all six degrees of freedom alike.
///
/// Source: geometrically stable sampling, Gelfand, Ikemoto, Rusinkiewicz & Levoy 2003. With vᵢ =
/// [pᵢ × nᵢ; nᵢ], the point-to-plane error of a small motion x is Σ (vᵢ·x)². The eigenvectors xₖ of
/// Σ vᵢvᵢᵀ with small eigenvalues are motions in which the surfaces slide along each other.
///
/// Points are drawn one after the other. Each draw serves the eigenvector with the smallest sum of
/// (vᵢ·xₖ)² over the points drawn so far: it draws the remaining point with the largest
/// contribution. Positions are relative to their mean and divided by their mean distance from it,
/// which makes rotations and translations comparable.
///
/// The order of the inner selection does not change. Of equal contributions, the first is drawn. If
/// there are at most `count` points, all are kept. It works best on visible points
/// ([`VisibleSurface`](crate::VisibleSurface) inside), because the hidden side constrains nothing.
///
/// Cost: the inner selection, and O(6 n log n).
#[derive(Clone, Debug, PartialEq)]
pub struct StableSampling<P> {
    /// The selection to select from.
    pub selection: P,
    /// Number of points to keep.
    pub count: usize,
    scratch: Scratch<Buffers>,
}

#[derive(Debug, Default)]
struct Buffers {
    /// (vᵢ·xₖ)² for every point and eigenvector.
    contributions: Vec<[f64; 6]>,
    /// For every eigenvector, the points by decreasing contribution.
    rankings: [Vec<u32>; 6],
    taken: Vec<bool>,
}

impl<P> StableSampling<P> {
    /// Creates the selection.
    #[must_use]
    pub fn new(selection: P, count: usize) -> Self {
        Self {
            selection,
            count,
            scratch: Scratch::default(),
        }
    }
}

impl Default for StableSampling<AllSamples> {
    /// 500 of the model's samples.
    fn default() -> Self {
        Self::new(AllSamples, 500)
    }
}

impl<P: PointSelection> PointSelection for StableSampling<P> {
    fn select(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        self.selection.select(context, camera_from_object, source);
        // Points that are not finite constrain nothing, and an eigendecomposition must not receive
        // them.
        source.retain(is_finite);
        if source.len() <= self.count {
            return;
        }
        self.scratch.0.choose(source, self.count);
        let taken = &self.scratch.0.taken;
        keep_positions(source, (0..source.len()).filter(|i| taken[*i]));
    }

    fn name(&self) -> &'static str {
        "stable-sampling"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        self.selection.unsupported(problem)
    }
}

impl Buffers {
    /// Marks `count` of the points as taken, which is less than their number.
    fn choose(&mut self, source: &[Surfel], count: usize) {
        self.rank(source);
        self.taken.clear();
        self.taken.resize(source.len(), false);
        let mut sums = [0.0_f64; 6];
        let mut next = [0_usize; 6];
        for _ in 0..count {
            let weakest = (1..6).fold(0, |k, other| if sums[other] < sums[k] { other } else { k });
            // There are more points than draws, so every ranking holds a remaining one.
            let Some(point) = self.rankings[weakest][next[weakest]..]
                .iter()
                .map(|point| *point as usize)
                .inspect(|_| next[weakest] += 1)
                .find(|point| !self.taken[*point])
            else {
                return;
            };
            self.taken[point] = true;
            for (sum, contribution) in sums.iter_mut().zip(&self.contributions[point]) {
                *sum += contribution;
            }
        }
    }

    fn rank(&mut self, source: &[Surfel]) {
        let scale = 1.0 / source.len().max(1) as f64;
        let mean = source
            .iter()
            .map(|surfel| surfel.point.coords.cast::<f64>())
            .sum::<Vector3<f64>>()
            * scale;
        let size = source
            .iter()
            .map(|surfel| (surfel.point.coords.cast::<f64>() - mean).norm())
            .sum::<f64>()
            * scale;
        let (center, per_size) = (
            Point3::from(mean),
            if size > 0.0 { 1.0 / size } else { 1.0 },
        );
        let constraint = |surfel: &Surfel| {
            let arm = (surfel.point.cast::<f64>() - center) * per_size;
            let normal = surfel.normal.into_inner().cast::<f64>();
            let turn = arm.cross(&normal);
            Vector6::new(turn.x, turn.y, turn.z, normal.x, normal.y, normal.z)
        };
        let covariance = source.iter().fold(Matrix6::zeros(), |sum, surfel| {
            let v = constraint(surfel);
            sum + v * v.transpose()
        });
        let motions =
            eigen6(&covariance).map_or_else(Matrix6::identity, |eigen| eigen.eigenvectors);

        self.contributions.clear();
        self.contributions
            .extend(source.iter().map(|surfel| -> [f64; 6] {
                let along = motions.tr_mul(&constraint(surfel));
                along.component_mul(&along).into()
            }));
        for (k, ranking) in self.rankings.iter_mut().enumerate() {
            let contributions = &self.contributions;
            ranking.clear();
            ranking.extend((0_u32..).take(contributions.len()));
            ranking.sort_unstable_by(|a, b| {
                contributions[*b as usize][k]
                    .total_cmp(&contributions[*a as usize][k])
                    .then_with(|| a.cmp(b))
            });
        }
    }
}

fn is_finite(surfel: &Surfel) -> bool {
    surfel.point.iter().all(|x| x.is_finite()) && surfel.normal.iter().all(|x| x.is_finite())
}
