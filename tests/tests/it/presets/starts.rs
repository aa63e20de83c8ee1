//! Hybrid ICP from the paper's mean initialization error (§VI-A.5), without noise and with full
//! masks.

use hicp_tests::starts::{measure_stage, starts};
use hybrid_icp::Preset;

#[test]
fn the_median_start_is_refined_to_a_fraction_of_a_degree_and_a_millimeter() {
    let row = measure_stage(&mut *Preset::Hybrid.build(), &starts(20, 0.0));
    assert!(row.degrees < 0.2 && row.millimeters < 0.3, "{row:?}");
}
