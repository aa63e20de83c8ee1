//! Tests of the provided methods of a custom metric.

use crate::scenes::{AtStart, Numbers, ellipsoid, exact, messy, same_information};
use hicp_core::Iteration;
use hicp_core::{Correspondences, Isometry3, Pair, Vector3};
use hicp_metric::Minimize;
use hicp_metric::{
    ErrorMetric, NO_ROWS, NormalEquations, PlaneToPoint, PointToPlane, PointToPoint, Symmetric,
    WeightedSum,
};

/// The point at which a pair's rows act.
type Place = fn(&Pair) -> Vector3<f64>;

/// The difference of depths.
struct DepthDifference;

impl ErrorMetric for DepthDifference {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        let (p, c) = (
            pair.source.point.cast::<f64>(),
            pair.target.point.cast::<f64>(),
        );
        system.add_row(&p, &Vector3::z(), p.z - c.z, f64::from(pair.weight));
    }
}

/// The rows of another metric, without its other methods.
struct Rows<M>(M);

impl<M: ErrorMetric> ErrorMetric for Rows<M> {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        self.0.linearize(pair, system);
    }
}

#[test]
fn squared_errors_sum_the_squares_of_unweighted_rows() {
    let mut numbers = Numbers(401);
    let mut pairs = messy(&mut numbers, 30);
    pairs.as_mut_slice()[0].weight = 0.0;
    for pair in pairs.as_slice() {
        let depth = f64::from(pair.source.point.z) - f64::from(pair.target.point.z);
        let found = DepthDifference.squared_error(pair);
        assert!((found - depth * depth).abs() <= 1e-15 * found && found > 0.0);
        let unweighted = Pair {
            weight: 1.0,
            ..*pair
        };
        let mut whole = NormalEquations::new(pair.source.point.cast(), 1.0);
        PointToPoint.linearize(&unweighted, &mut whole);
        assert_eq!(Rows(PointToPoint).squared_error(pair), whole.loss());
        let inner: [(Box<dyn ErrorMetric>, f64); 2] = [
            (
                Box::new(Rows(PointToPoint)),
                PointToPoint.squared_error(pair),
            ),
            (Box::new(Rows(Symmetric)), Symmetric.squared_error(pair)),
        ];
        for (rows, expected) in inner {
            assert!((rows.squared_error(pair) - expected).abs() <= 1e-15 * expected);
        }
    }
}

#[test]
fn the_default_name_is_that_of_the_type() {
    assert_eq!(DepthDifference.name(), "DepthDifference");
    assert_eq!(Rows(PointToPoint).name(), "Rows");
}

/// Points that are not finite are detected, even if no residual shows it.
#[test]
fn points_that_are_not_finite_give_no_system() {
    let mut numbers = Numbers(402);
    let mut pairs = messy(&mut numbers, 30);
    assert!(DepthDifference.normal_equations(&pairs).is_some());
    pairs.as_mut_slice()[7].source.point.x = f32::INFINITY;
    assert!(DepthDifference.normal_equations(&pairs).is_none());
    assert_eq!(DepthDifference.step(&pairs), None);
}

/// The pivot is the centroid of the points at which the rows act, and the length their RMS radius.
#[test]
fn systems_are_centered_and_scaled() {
    let mut numbers = Numbers(403);
    let pairs = messy(&mut numbers, 70);
    let expected = |of: Place| {
        let weight: f64 = pairs.as_slice().iter().map(|p| f64::from(p.weight)).sum();
        let mean = |value: &dyn Fn(&Pair) -> Vector3<f64>| {
            let sum: Vector3<f64> = pairs
                .as_slice()
                .iter()
                .map(|p| value(p) * f64::from(p.weight))
                .sum();
            sum / weight
        };
        let centroid = mean(&of);
        let squares = mean(&|p| (of(p) - centroid).map(|x| x * x));
        (centroid, squares.sum().sqrt())
    };
    let source: Place = |pair| pair.source.point.coords.cast();
    let target: Place = |pair| pair.target.point.coords.cast();
    let metrics: [(Box<dyn Minimize>, Place); 4] = [
        (Box::new(DepthDifference), source),
        (Box::new(PointToPoint), source),
        (Box::new(PointToPlane), source),
        (Box::new(PlaneToPoint), target),
    ];
    for (mut metric, of) in metrics {
        let system = metric.normal_equations(&pairs).unwrap();
        let (centroid, radius) = expected(of);
        assert!(
            (system.pivot().coords - centroid).norm() < 1e-14,
            "{}",
            metric.label()
        );
        assert!(
            (system.length() - radius).abs() < 1e-14,
            "{}",
            metric.label()
        );
    }
    // Points at one place have a radius of zero.
    let one = exact(
        &vec![ellipsoid(&mut numbers, 1)[0]; 9],
        &Isometry3::identity(),
    );
    assert_eq!(PointToPoint.normal_equations(&one).unwrap().length(), 1.0);
}

/// A pair without weight costs no digits, at any distance and at any position in the list.
#[test]
fn pairs_without_weight_do_not_matter_anywhere() {
    let mut numbers = Numbers(404);
    let pairs = messy(&mut numbers, 60);
    let mut far = pairs.as_slice()[0];
    far.weight = 0.0;
    far.source.point += Vector3::new(600.0, -700.0, 400.0);
    far.target.point = far.source.point;
    let with: Correspondences = std::iter::once(far)
        .chain(pairs.as_slice().iter().copied())
        .collect();
    let metrics: [Box<dyn Minimize>; 5] = [
        Box::new(Rows(PointToPlane)),
        Box::new(PointToPoint),
        Box::new(PointToPlane),
        Box::new(PlaneToPoint),
        Box::new(Symmetric),
    ];
    for mut metric in metrics {
        let (a, b) = (
            metric.normal_equations(&pairs).unwrap(),
            metric.normal_equations(&with).unwrap(),
        );
        assert!(
            (a.length() - b.length()).abs() < 1e-14,
            "{}",
            metric.label()
        );
        assert!((a.pivot() - b.pivot()).norm() < 1e-14, "{}", metric.label());
        assert!(same_information(&a, &b, 1e-13), "{}", metric.label());
        let (a, b) = (metric.step(&pairs).unwrap(), metric.step(&with).unwrap());
        let (angle, distance) = crate::scenes::difference(&a.increment, &b.increment);
        assert!(
            angle < 1e-10 && distance < 1e-11,
            "{}: {angle} {distance}",
            metric.label()
        );
    }
}

/// A metric that must not be called.
struct Never;

impl ErrorMetric for Never {
    fn linearize(&self, _: &Pair, _: &mut NormalEquations) {
        unreachable!("rows were requested");
    }
    fn mean_squared_error(&self, _: &Correspondences) -> Option<f64> {
        None
    }
}

#[test]
fn a_term_of_factor_zero_is_skipped() {
    let mut numbers = Numbers(405);
    let pairs = messy(&mut numbers, 30);
    let mut sum = WeightedSum {
        terms: ((1.0, PointToPlane), (0.0, Never)),
    };
    // A sum has the loss of its system, whose last digit may differ from that of a single metric.
    let mut alone = WeightedSum {
        terms: vec![(1.0, PointToPlane)],
    };
    assert_eq!(sum.step(&pairs), alone.step(&pairs));
    assert_eq!(sum.loss(&pairs), PointToPlane.loss(&pairs));
    let squared_errors = |metric: &mut dyn Minimize| {
        let mut errors = vec![0.0; pairs.len()];
        metric.add_squared_errors(&Iteration::default(), &pairs, 1.0, &mut errors);
        errors
    };
    assert_eq!(squared_errors(&mut sum), squared_errors(&mut PointToPlane));
    let information = |metric: &mut dyn Minimize| {
        let system = metric.normal_equations(&pairs);
        system.map(|system| system.information())
    };
    assert_eq!(information(&mut sum), information(&mut PointToPlane));
}

/// Returns pairs, and the same ones followed by pairs with opposite normals.
fn with_opposite_normals(numbers: &mut Numbers, count: usize) -> [Correspondences; 2] {
    let pairs = messy(numbers, 60);
    let mut more = pairs.clone();
    for pair in messy(numbers, count).as_slice() {
        let mut opposite = *pair;
        opposite.target.normal = -opposite.source.normal;
        more.push(opposite);
    }
    [pairs, more]
}

#[test]
fn the_provided_means_leave_out_pairs_without_rows() {
    let [few, more] = with_opposite_normals(&mut Numbers(406), 90);
    let skipped = &more.as_slice()[few.len()];
    let found = Rows(Symmetric).squared_error(skipped);
    assert_eq!(found.to_bits(), NO_ROWS.to_bits());
    // An exact fit has rows.
    let exact = Pair {
        target: skipped.source,
        ..*skipped
    };
    assert_eq!(Rows(Symmetric).squared_error(&exact).to_bits(), 0);
    let [expected, found] = [&few, &more].map(|pairs| Rows(Symmetric).mean_squared_error(pairs));
    assert_eq!(expected, found);
    assert_eq!(found, Symmetric.mean_squared_error(&more));
    let [expected, found] =
        [&few, &more].map(|pairs| Rows(Symmetric).step(pairs).unwrap().mean_loss);
    assert!((found - expected).abs() < 1e-12 * expected);
}

/// A sum has no rows for a pair only if no term has one.
#[test]
fn a_pair_that_one_term_skips_has_the_error_of_the_others() {
    let [few, more] = with_opposite_normals(&mut Numbers(407), 3);
    let errors = |terms: Vec<(f64, Box<dyn Minimize>)>| {
        let mut errors = vec![NO_ROWS; more.len()];
        let mut sum = WeightedSum { terms };
        sum.add_squared_errors(&Iteration::default(), &more, 1.0, &mut errors);
        errors.split_off(few.len())
    };
    let both = errors(vec![
        (2.0, Box::new(Symmetric)),
        (0.5, Box::new(PointToPoint)),
    ]);
    for (found, pair) in both.iter().zip(&more.as_slice()[few.len()..]) {
        assert_eq!(*found, 0.5 * PointToPoint.squared_error(pair));
    }
    for found in errors(vec![(2.0, Box::new(Symmetric)), (0.5, Box::new(Symmetric))]) {
        assert_eq!(found.to_bits(), NO_ROWS.to_bits());
    }
}
