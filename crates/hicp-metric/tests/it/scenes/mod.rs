//! Pairs on known surfaces.

pub(crate) use crate::support::Numbers;

use hicp_core::{
    Correspondences, Isometry3, Iteration, Pair, Point3, Surfel, UnitVector3, Vector3, Vector6, se3,
};
use hicp_metric::{ErrorMetric, Minimize, NormalEquations, Step};

/// Evaluates a metric in the first iteration of a run.
pub trait AtStart: Minimize {
    fn step(&mut self, pairs: &Correspondences) -> Option<Step> {
        self.minimize(&Iteration::default(), pairs)
    }

    fn loss(&mut self, pairs: &Correspondences) -> Option<f64> {
        self.mean_loss(&Iteration::default(), pairs)
    }

    fn normal_equations(&mut self, pairs: &Correspondences) -> Option<NormalEquations> {
        self.system(&Iteration::default(), pairs)
    }
}

impl<M: Minimize + ?Sized> AtStart for M {}

impl Numbers {
    /// Returns a number in [−1, 1).
    pub fn sign(&mut self) -> f64 {
        self.between(-1.0, 1.0)
    }

    /// Returns a vector in the cube from −1 to 1.
    pub fn signs(&mut self) -> Vector3<f64> {
        Vector3::new(self.sign(), self.sign(), self.sign())
    }

    /// Returns a rotation by `degrees` around a random axis through `center`, and a shift of
    /// `meters`.
    pub fn motion(&mut self, center: &Point3<f64>, degrees: f64, meters: f64) -> Isometry3<f64> {
        let turn = self.direction() * degrees.to_radians();
        let c = center.coords;
        let shift = self.direction() * meters;
        let about = Isometry3::new(Vector3::zeros(), turn);
        Isometry3::translation(c.x + shift.x, c.y + shift.y, c.z + shift.z)
            * about
            * Isometry3::translation(-c.x, -c.y, -c.z)
    }
}

pub fn surfel(point: Point3<f64>, normal: Vector3<f64>) -> Surfel {
    Surfel {
        point: point.cast(),
        normal: UnitVector3::new_unchecked(normal.normalize().cast()),
    }
}

pub fn transformed(motion: &Isometry3<f64>, surfel: &Surfel) -> Surfel {
    Surfel {
        point: (motion * surfel.point.cast::<f64>()).cast(),
        normal: UnitVector3::new_unchecked(
            (motion.rotation * surfel.normal.cast::<f64>().into_inner()).cast(),
        ),
    }
}

/// The center of all scenes.
pub fn center() -> Point3<f64> {
    Point3::new(0.02, -0.03, 0.6)
}

/// An ellipsoid of 4, 6 and 9 cm around the center, which determines every direction.
pub fn ellipsoid(numbers: &mut Numbers, count: usize) -> Vec<Surfel> {
    let radii = Vector3::new(0.04, 0.06, 0.09);
    (0..count)
        .map(|_| {
            let d = numbers.direction();
            surfel(center() + d.component_mul(&radii), d.component_div(&radii))
        })
        .collect()
}

/// Returns model points and their counterparts at `motion * point`.
pub fn exact(source: &[Surfel], motion: &Isometry3<f64>) -> Correspondences {
    let pairs = source.iter().zip(0..);
    pairs
        .map(|(s, i)| Pair::new(i, *s, i, transformed(motion, s)))
        .collect()
}

/// Returns pairs with independent noise of the target points, random weights, and different
/// normals.
pub fn messy(numbers: &mut Numbers, count: usize) -> Correspondences {
    let source = ellipsoid(numbers, count);
    let motion = numbers.motion(&center(), 4.0, 0.01);
    let mut pairs = exact(&source, &motion);
    for pair in pairs.as_mut_slice() {
        pair.target.point += (numbers.signs() * 0.003).cast::<f32>();
        let normal = pair.target.normal.cast::<f64>().into_inner() + numbers.signs() * 0.2;
        pair.target.normal = UnitVector3::new_unchecked(normal.normalize().cast());
        pair.weight = 0.2 + numbers.unit() as f32;
    }
    pairs
}

/// Returns the pairs with sources, targets and pose moved by one motion.
pub fn carried(pairs: &Correspondences, motion: &Isometry3<f64>) -> Correspondences {
    let mut moved = Correspondences::new();
    moved.begin(&(motion * pairs.camera_from_object()), pairs.n_candidates());
    moved.extend(pairs.as_slice().iter().map(|pair| Pair {
        source: transformed(motion, &pair.source),
        target: transformed(motion, &pair.target),
        ..*pair
    }));
    moved
}

/// Returns the pairs with sources moved by one motion.
pub fn advanced(pairs: &Correspondences, motion: &Isometry3<f64>) -> Correspondences {
    let mut moved = Correspondences::new();
    moved.begin(&(motion * pairs.camera_from_object()), pairs.n_candidates());
    moved.extend(pairs.as_slice().iter().map(|pair| Pair {
        source: transformed(motion, &pair.source),
        ..*pair
    }));
    moved
}

/// Returns the pairs with all lengths multiplied by a factor.
pub fn resized(pairs: &Correspondences, factor: f32) -> Correspondences {
    let mut resized = pairs.clone();
    for pair in resized.as_mut_slice() {
        pair.source.point *= factor;
        pair.target.point *= factor;
    }
    resized
}

/// Returns the pairs with another pose.
pub fn at(pose: &Isometry3<f64>, pairs: &Correspondences) -> Correspondences {
    let mut posed = Correspondences::new();
    posed.begin(pose, pairs.n_candidates());
    posed.extend(pairs.as_slice().iter().copied());
    posed
}

/// Returns messy pairs at a pose whose rotation is not the identity.
pub fn posed(numbers: &mut Numbers, count: usize) -> Correspondences {
    let pose =
        Isometry3::translation(0.02, -0.03, 0.58) * numbers.motion(&Point3::origin(), 80.0, 0.0);
    at(&pose, &messy(numbers, count))
}

/// Returns the rotation (radians) and the displacement of the scene's center (meters) between
/// motions.
pub fn difference(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    let (angle, _) = se3::pose_distance(a, b);
    (angle, (a * center() - b * center()).norm())
}

/// Checks a metric's rows: the gradient against central differences, one pair at a time.
///
/// `residual` is the definition of E, exact in the twist.
pub fn check_rows<M: ErrorMetric>(
    metric: &M,
    pair: &Pair,
    squared: impl Fn(&Isometry3<f64>) -> f64,
    tolerance: f64,
) {
    let mut system = NormalEquations::new(center(), 0.05);
    metric.linearize(pair, &mut system);
    let weight = f64::from(pair.weight);
    let at_rest = squared(&Isometry3::identity());
    assert!((system.loss() - weight * at_rest).abs() <= tolerance * weight * at_rest.max(1e-9));
    assert!((metric.squared_error(pair) - at_rest).abs() <= tolerance * at_rest.max(1e-9));
    // E = rᵀr: half of its derivative is Jᵀr. If r is nearly linear, its second difference is JᵀJ.
    let step = 1e-5;
    let gradient = system.gradient();
    for i in 0..6 {
        let mut twist = Vector6::zeros();
        twist[i] = step;
        let (plus, minus) = (squared(&se3::exp(&twist)), squared(&se3::exp(&-twist)));
        let numeric = weight * (plus - minus) / (4.0 * step);
        let scale = gradient.amax().max(1e-6);
        assert!(
            (numeric - gradient[i]).abs() <= tolerance * scale,
            "{i}: {numeric} {}",
            gradient[i]
        );
    }
}

/// Returns whether two systems hold the same information, to a relative tolerance.
pub fn same_information(a: &NormalEquations, b: &NormalEquations, tolerance: f64) -> bool {
    let (a, b) = (a.information(), b.information());
    (a - b).amax() <= tolerance * a.amax()
}
