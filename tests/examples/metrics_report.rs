//! Prints the accuracy and the iterations of each metric on 200 starts, as a Markdown table.
//!
//! The starts are those of `synthetic_starts` (6.2 mm, 9.5°).
//!
//! Run `cargo run --release -p hicp-tests --example metrics_report [NOISE_PERCENT [STARTS]]`. The
//! noise is a share of the depth, and the starts are per object.
//!
//! Every row is one ICP stage on about 2,000 points of the visible surface, without filters or
//! divergence rules. A stage ends if the next increment moves the object by less than 0.1 mm and
//! 0.01°, or after 50 evaluations. Iterations are evaluations, including the first one at the
//! initial pose. Errors are up to the declared symmetries.

use hicp_tests::starts::{NEAREST_OF_ALL, measure, plain_icp, starts};

fn main() {
    let mut arguments = std::env::args().skip(1);
    let noise = arguments
        .next()
        .map_or(0.0, |text| text.parse().expect("NOISE_PERCENT is a number"));
    let per_object = arguments
        .next()
        .map_or(20, |text| text.parse().expect("STARTS is a whole number"));
    let starts = starts(per_object, noise);
    println!(
        "| metric | association | median rotation error | 90th percentile | median translation error | median iterations |"
    );
    println!("|---|---|---|---|---|---|");
    for (label, association) in [
        ("nearest of all pixels", NEAREST_OF_ALL),
        ("nearest of about 4000", "\"nearest-neighbor\""),
        ("projective", "\"projective\""),
        ("projective, interpolated", "\"projective-interpolated\""),
    ] {
        for metric in [
            "generalized",
            "symmetric",
            "point-to-plane",
            "plane-to-point",
            "point-to-point",
        ] {
            let row = measure(&plain_icp(association, &format!("\"{metric}\"")), &starts);
            println!(
                "| {metric} | {label} | {:.4}° | {:.3}° | {:.4} mm | {} |",
                row.degrees, row.degrees_p90, row.millimeters, row.iterations
            );
        }
    }
}
