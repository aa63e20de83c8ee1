//! Measures the calibration of the confidence on simulated and real cases, as Markdown tables.
//!
//! Run `cargo run --release -p hicp-tests --example confidence [CASES]` for the report on the test
//! objects. With `-- fit [CASES]`, it prints the network, fitted on tuning and invented objects: so
//! many cases with white noise, as many with systematic errors of sensor and model, and half as
//! many of three other kinds: no measurement outside of the mask, and both errors in images of any
//! size. With `-- near [CASES]`, it prints the constants for poses near the initial one, fitted on
//! such cases to the results of the network. With `-- tuning [CASES]` or `-- distorted [CASES]`, it
//! reports on other cases of tuning objects. With `-- cropped [CASES]`, it reports on test objects
//! in images with no measurement outside of the mask, and with `-- resized [CASES]` or `--
//! resized-distorted [CASES]` in images of any size.

mod cases;
mod fit;
mod real;

use hicp_sim::Household;
use hybrid_icp::score::{LabeledScore, reliability, roc_area};

use crate::cases::{Case, Images, Kind, Objects};

/// Confidence at which a pose is accepted.
const ACCEPTED: f64 = 0.95;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let count = arguments
        .last()
        .and_then(|text| text.parse().ok())
        .unwrap_or(6000);
    match arguments.first().map(String::as_str) {
        Some(name @ ("fit" | "near")) => {
            let parts = [
                (Images::Noisy, count),
                (Images::Distorted, count),
                (Images::Cropped, count / 2),
                (Images::Resized, count / 2),
                (Images::ResizedDistorted, count / 2),
            ];
            let simulate = |(set, (images, count))| {
                let cases = cases::simulate(&Objects::ForFit(set), images, 0, count);
                cases.expect("the objects can be simulated")
            };
            let cases: Vec<Case> = std::thread::scope(|scope| {
                let parts = (0..).zip(parts);
                let threads: Vec<_> = parts
                    .map(|part| scope.spawn(move || simulate(part)))
                    .collect();
                let parts = threads
                    .into_iter()
                    .map(|thread| thread.join().expect("no panic"));
                parts.flatten().collect()
            });
            if name == "fit" {
                fit::print(&cases);
            } else {
                fit::print_near(&cases);
            }
        }
        Some(name @ ("tuning" | "distorted")) => {
            let objects = Objects::Household(&Household::TUNING);
            let images = match name {
                "distorted" => Images::Distorted,
                _ => Images::Noisy,
            };
            report(&cases::simulate(&objects, images, 1 << 20, count)?);
        }
        Some(name @ ("cropped" | "resized" | "resized-distorted")) => {
            let objects = Objects::Household(&Household::TEST);
            let images = match name {
                "cropped" => Images::Cropped,
                "resized" => Images::Resized,
                _ => Images::ResizedDistorted,
            };
            report(&cases::simulate(&objects, images, 0, count)?);
        }
        _ => {
            let objects = Objects::Household(&Household::TEST);
            report(&cases::simulate(&objects, Images::Noisy, 0, count)?);
            if let Some(cases) = real::cases() {
                println!("\n## Real frames\n");
                report(&cases);
            }
        }
    }
    Ok(())
}

/// Prints the reliability table and the figures of some cases.
fn report(cases: &[Case]) {
    let labeled: Vec<LabeledScore> = cases
        .iter()
        .map(|case| LabeledScore {
            score: case.confidence,
            correct: case.right(),
        })
        .collect();
    println!("| confidence | poses | mean confidence | right |");
    println!("|---|---:|---:|---:|");
    let mut error = 0.0;
    for bin in reliability(&labeled, 10) {
        let (Some(mean), Some(right)) = (bin.mean_score(), bin.share_correct()) else {
            continue;
        };
        error += (mean - right).abs() * bin.count as f64 / cases.len() as f64;
        let (low, high) = (bin.lower, bin.upper);
        println!(
            "| {low:.1} to {high:.1} | {} | {mean:.3} | {right:.3} |",
            bin.count
        );
    }
    println!("\n| figure | value |");
    println!("|---|---:|");
    println!("| poses | {} |", cases.len());
    println!("| expected calibration error | {error:.3} |");
    if let Some(area) = roc_area(&labeled) {
        println!("| ROC area | {area:.3} |");
    }
    let accepted = |case: &&Case| case.confidence >= ACCEPTED;
    let share = |of: &dyn Fn(&Case) -> bool, that: &dyn Fn(&Case) -> bool| {
        let all = cases.iter().filter(|case| of(case));
        let n = all.clone().count();
        let share = all.filter(|case| that(case)).count() as f64 / n.max(1) as f64;
        format!("{:.1} % of {n}", 100.0 * share)
    };
    let high = |case: &Case| accepted(&case);
    let seen = |case: &Case| case.right() && case.visible >= 0.5;
    println!(
        "| wrong, of those ≥ {ACCEPTED} | {} |",
        share(&high, &|case| !case.right())
    );
    println!(
        "| ≥ {ACCEPTED}, of the right ones half visible | {} |",
        share(&seen, &high)
    );
    let within = |which: usize| {
        let ratio = |case: &Case| Some(case.errors?[which] / case.expected[which]);
        let mut ratios: Vec<f64> = cases.iter().filter(accepted).filter_map(ratio).collect();
        ratios.sort_by(f64::total_cmp);
        let at = |share: f64| ratios.get((ratios.len() as f64 * share) as usize);
        let [low, middle, high] = [0.1, 0.5, 0.9].map(|s| at(s).copied().unwrap_or(f64::NAN));
        format!("{low:.2}, {middle:.2}, {high:.2}")
    };
    println!(
        "| true over expected distance: 10 %, median, 90 % | {} |",
        within(0)
    );
    println!(
        "| true over expected angle: 10 %, median, 90 % | {} |",
        within(1)
    );

    println!(
        "\n| poses | right | ≥ {ACCEPTED} and right | ≥ {ACCEPTED} and wrong | MVE < 0.3, no warning, and wrong |"
    );
    println!("|---|---:|---:|---:|---:|");
    for (kind, name) in Kind::ALL {
        let of = |case: &Case| case.kind == kind;
        if !cases.iter().any(of) {
            continue;
        }
        println!(
            "| {name} | {} | {} | {} | {} |",
            share(&of, &Case::right),
            share(&of, &|case| high(case) && case.right()),
            share(&of, &|case| high(case) && !case.right()),
            share(&of, &|case| case.mve < 0.3 && !case.warned && !case.right()),
        );
    }
}
