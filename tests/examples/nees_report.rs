//! Prints how consistent covariances are, as a Markdown table.
//!
//! The measure is the mean normalized estimation error squared (NEES) over Monte-Carlo runs.
//!
//! Run `cargo run --release -p hicp-tests --example nees_report [RUNS]`.
//!
//! The mean of ξᵀΣ⁻¹ξ is 6 for a correct covariance and larger for an optimistic one. Rows name the
//! origin of the pairs, the association and the metric. Images have 160×120 pixels, all of which
//! are used. ICP starts 1 mm and 1° off.

use hicp_sim::Household;
use hicp_tests::nees::{Nees, Pairs, measure};
use hybrid_icp::association::{NearestNeighbor, Projective, SearchIndex, Stride, VisibleSurface};
use hybrid_icp::metric::{Generalized, PlaneToPoint, PointToPlane};

fn main() {
    let runs = std::env::args()
        .nth(1)
        .map_or(500, |text| text.parse().expect("RUNS is a whole number"));
    let visible = VisibleSurface::with_stride(Stride::Pixels(1));
    let nearest = || NearestNeighbor::new(Stride::Pixels(1), SearchIndex::default());
    println!(
        "| pairs | object | noise | NEES of `covariance` | NEES of `sandwich_covariance` | 99 % band | RMS error of the center |"
    );
    println!("|---|---|---|---|---|---|---|");
    for object in [Household::Hammer, Household::Iron, Household::Car] {
        for percent in [0.2, 0.5] {
            let row = |label: &str, nees: Nees| {
                let (low, high) = nees.band();
                println!(
                    "| {label} | {} | {percent} % | {:.2} | {:.2} | {low:.2} to {high:.2} | {:.3} mm |",
                    object.name(),
                    nees.mean,
                    nees.sandwich,
                    nees.millimeters
                );
            };
            let (exact, off) = ((percent, (0.0, 0.0)), (percent, (0.001, 1.0)));
            let plane = (visible, Projective, PointToPlane);
            let model_plane = (visible, Projective, PlaneToPoint);
            let generalized = (visible, Projective, Generalized::default());
            let nearest_generalized = (visible, nearest(), Generalized::default());
            for (label, made, start) in [
                (
                    "fixed, exact normals and weights",
                    Pairs::FixedExactNormals,
                    exact,
                ),
                ("fixed", Pairs::FixedAtTruth, exact),
                ("ICP", Pairs::Icp, off),
                ("ICP, selected again", Pairs::Reselected, off),
                (
                    "ICP, selected again, without boundary targets",
                    Pairs::ReselectedInside,
                    off,
                ),
            ] {
                row(
                    &format!("{label}; projective, point-to-plane"),
                    measure(object, start, runs, made, plane),
                );
                if made == Pairs::FixedExactNormals {
                    continue;
                }
                row(
                    &format!("{label}; projective, plane-to-point"),
                    measure(object, start, runs, made, model_plane),
                );
                row(
                    &format!("{label}; projective, generalized"),
                    measure(object, start, runs, made, generalized),
                );
                row(
                    &format!("{label}; nearest, generalized"),
                    measure(object, start, runs, made, nearest_generalized.clone()),
                );
            }
        }
    }
}
