//! An error metric of one's own: depth along the viewing ray, where surface before the measurement costs more than surface behind.

use hicp_testkit::{MetricLaws, check_metric};
use hicp_tests::starts::{Start, measure_stage, starts};
use hybrid_icp::{
    ErrorMetric, Icp, IterationLimit, Motion, NormalEquations, Pair, PointToPlane, Projective,
    Stage, VisibleSurface, WeightedSum,
};

// --- The component ---

/// How far the model lies from the observed tangent plane *along the viewing ray*, r = nᵀ(p − c) / nᵀd, d the unit ray to c:
/// what the sensor measures and its noise adds to. Where r < 0 the camera saw through the model, which is impossible; where
/// r > 0 the model may merely be hidden. Such a pair counts only a share, E = r² or `hidden_share`·r².
#[derive(Clone, Copy, Debug)]
pub struct FreeSpace {
    /// What a model point behind the measured surface counts, 0 to 1.
    pub hidden_share: f64,
}

impl ErrorMetric for FreeSpace {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        let (p, c) = (
            pair.source.point.cast::<f64>(),
            pair.target.point.cast::<f64>(),
        );
        let normal = pair.target.normal.cast::<f64>().into_inner();
        // Grazing rays say little; their cosine is kept from vanishing, with the normal toward the camera.
        let cosine = (normal.dot(&c.coords) / c.coords.norm()).min(-0.2);
        let direction = normal / cosine;
        let residual = direction.dot(&(p - c));
        let share = if residual < 0.0 {
            1.0
        } else {
            self.hidden_share
        };
        system.add_row(&p, &direction, residual, share * f64::from(pair.weight));
    }
}

// --- Its tests ---

const FREE_SPACE: FreeSpace = FreeSpace { hidden_share: 0.05 };

fn sum() -> impl ErrorMetric {
    WeightedSum {
        terms: ((0.2, PointToPlane), (1.0, FREE_SPACE)),
    }
}

fn projective<M: ErrorMetric>(metric: M) -> impl Stage {
    Icp {
        selection: VisibleSurface::default(),
        association: Projective,
        filter: (),
        metric,
        stop: (Motion::default(), IterationLimit(50)),
    }
}

#[test]
fn it_keeps_the_laws() {
    // The rays start at the camera: moving model and image together is another measurement.
    let laws = MetricLaws {
        frame: false,
        ..MetricLaws::default()
    };
    check_metric(|| FREE_SPACE, laws);
    check_metric(sum, laws);
}

#[test]
fn what_stands_before_the_object_pulls_it_less() {
    let mut starts = starts(3, 0.5);
    for Start { scene, .. } in &mut starts {
        scene.observation = scene.behind_a_bar(0.2, 0.01, true);
    }
    let plain = measure_stage(&mut projective(PointToPlane), &starts);
    let both = measure_stage(&mut projective(sum()), &starts);
    let mine = measure_stage(&mut projective(FREE_SPACE), &starts);
    eprintln!("{mine:?}\n{both:?}\n{plain:?}");
    assert!(
        mine.millimeters < 0.5 * plain.millimeters,
        "{mine:?}\n{plain:?}"
    );
    assert!(both.millimeters < plain.millimeters, "{both:?}\n{plain:?}");
}
