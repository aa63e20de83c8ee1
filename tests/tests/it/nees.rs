//! Covariances against what Monte-Carlo runs really do: the mean of ξᵀΣ⁻¹ξ over 500 of them, that of χ²₆ if Σ is right.
//!
//! The whole table: `cargo run --release -p hicp-tests --example nees_report`.

use hicp_sim::Household;
use hicp_tests::nees::{Nees, Pairs, measure};
use hybrid_icp::association::{Projective, Stride, VisibleSurface};
use hybrid_icp::metric::{Generalized, PlaneToPoint, PointToPlane};

const RUNS: usize = 500;
const VISIBLE: VisibleSurface = VisibleSurface {
    stride: Stride::Pixels(1),
};

fn assert_in_band(name: &str, mean: f64, nees: &Nees) {
    let (low, high) = nees.band();
    assert_eq!(nees.runs, RUNS);
    assert!(
        (low..=high).contains(&mean),
        "{name}: {mean} outside {low} to {high}: {nees:?}"
    );
}

#[test]
fn the_covariance_is_right_where_its_assumptions_hold() {
    // Right pairs, exact normals, weights inverse to the variances: nothing but the formula is left.
    for object in [Household::Hammer, Household::Iron, Household::Car] {
        let parts = (VISIBLE, Projective, PointToPlane);
        let nees = measure(
            object,
            (0.5, (0.0, 0.0)),
            RUNS,
            Pairs::FixedExactNormals,
            parts,
        );
        assert_in_band(object.name(), nees.mean, &nees);
    }
}

/// 0.2 % of noise, from 1 mm and 1° off, the visible points selected anew for each of five stages.
///
/// Selected once, at the initial pose, pixels beside the silhouette keep wrong pairs, which no covariance knows of: the same
/// runs then show 9 to 20.
const START: (f64, (f64, f64)) = (0.2, (0.001, 1.0));

#[test]
fn the_covariance_of_plane_to_point_icp_is_not_optimistic_and_pessimistic_by_a_sixth_at_most() {
    // Tilted pixels have a smaller variance than their equal weights say: 5.59 and 5.6 where 6 would be right.
    for object in [Household::Iron, Household::Car] {
        let parts = (VISIBLE, Projective, PlaneToPoint);
        let nees = measure(object, START, RUNS, Pairs::Reselected, parts);
        let (_, high) = nees.band();
        assert_eq!(nees.runs, RUNS);
        assert!(
            (5.0..=high).contains(&nees.mean),
            "{}: {nees:?}",
            object.name()
        );
    }
}

#[test]
fn the_sandwich_covariance_of_generalized_icp_is_right_and_the_plain_one_is_not() {
    for object in [Household::Hammer, Household::Iron] {
        let parts = (VISIBLE, Projective, Generalized::default());
        let nees = measure(object, START, RUNS, Pairs::Reselected, parts);
        assert_in_band(object.name(), nees.sandwich, &nees);
        // What its documentation warns of; if this ever fails, correct that.
        assert!(nees.mean > 15.0, "{}: {nees:?}", object.name());
    }
}
