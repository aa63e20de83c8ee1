//! The fit of the confidence: logistic regression over piecewise linear curves.

use hybrid_icp::nalgebra::{DMatrix, DVector};
use hybrid_icp::score::N_FEATURES;

use crate::cases::Case;

/// Number of knots of a curve.
const KNOTS: usize = 6;
/// Shares of the cases below the knots.
const SHARES: [f64; KNOTS] = [0.02, 0.2, 0.45, 0.7, 0.9, 0.98];
/// Weight of a value's square, and of the square of a change of slope.
const SMALL: f64 = 0.3;
const SMOOTH: f64 = 3.0;

/// Fits the curves and prints them as the file `curves.rs` has them.
pub fn print(cases: &[Case]) {
    let knots: Vec<[f64; KNOTS]> = (0..N_FEATURES).map(|f| knots(cases, f)).collect();
    let rows = |cases: &[&Case]| {
        DMatrix::from_row_iterator(
            cases.len(),
            1 + N_FEATURES * KNOTS,
            cases.iter().flat_map(|case| row(case, &knots)),
        )
    };
    let all: Vec<&Case> = cases.iter().collect();
    let right = DVector::from_iterator(cases.len(), cases.iter().map(|c| f64::from(c.right())));
    let penalty = penalty(&knots);
    let odds = logistic(&rows(&all), &right, &penalty);
    // The errors of a wrong model are unknown.
    let own: Vec<&Case> = cases.iter().filter(|case| case.errors.is_some()).collect();
    let design = rows(&own);
    let error = |which: usize| {
        let logarithms = own.iter().map(|case| {
            case.errors
                .map_or(0.0, |errors| errors[which].max(1e-4).ln())
        });
        linear(
            &design,
            &DVector::from_iterator(own.len(), logarithms),
            &penalty,
        )
    };
    let fits = [odds, error(0), error(1)];
    println!(
        "pub(crate) const BASE: [f64; 3] = {:.4?};\n",
        fits.each_ref().map(|fit| fit[0])
    );
    println!("pub(crate) const CURVES: [Curve; {N_FEATURES}] = [");
    for (feature, knots) in knots.iter().enumerate() {
        println!("    Curve {{\n        knots: {knots:.4?},\n        values: [");
        for fit in &fits {
            let values = fit.rows(1 + feature * KNOTS, KNOTS);
            println!("            {:.4?},", values.as_slice());
        }
        println!("        ],\n    }},");
    }
    println!("];");
}

/// Returns the knots of a feature: quantiles, kept apart.
fn knots(cases: &[Case], feature: usize) -> [f64; KNOTS] {
    let mut sorted: Vec<f64> = cases.iter().map(|case| case.features[feature]).collect();
    sorted.sort_by(f64::total_cmp);
    let mut last = f64::NEG_INFINITY;
    SHARES.map(|share| {
        let quantile = sorted[(share * (sorted.len() - 1) as f64) as usize];
        last = quantile.max(last + 0.005);
        (last * 1e4).round() / 1e4
    })
}

/// Returns the row of a case: 1, and the weight of every knot.
fn row(case: &Case, knots: &[[f64; KNOTS]]) -> Vec<f64> {
    let mut row = vec![1.0];
    for (x, knots) in case.features.iter().zip(knots) {
        let x = x.clamp(knots[0], knots[KNOTS - 1]);
        let right = knots.iter().position(|knot| x < *knot).unwrap_or(KNOTS - 1);
        let (a, b) = (knots[right - 1], knots[right]);
        let mut weights = [0.0; KNOTS];
        weights[right] = (x - a) / (b - a);
        weights[right - 1] = 1.0 - weights[right];
        row.extend(weights);
    }
    row
}

/// Returns the penalty of large values and of changes of slope.
fn penalty(knots: &[[f64; KNOTS]]) -> DMatrix<f64> {
    let size = 1 + knots.len() * KNOTS;
    let mut penalty = DMatrix::identity(size, size) * SMALL;
    penalty[(0, 0)] = 1e-6;
    for (feature, knots) in knots.iter().enumerate() {
        let width = (knots[KNOTS - 1] - knots[0]) / (KNOTS - 1) as f64;
        for knot in 1..KNOTS - 1 {
            let left = width / (knots[knot] - knots[knot - 1]);
            let right = width / (knots[knot + 1] - knots[knot]);
            let mut change = DVector::zeros(size);
            let at = 1 + feature * KNOTS + knot;
            (change[at - 1], change[at], change[at + 1]) = (left, -left - right, right);
            // Narrow intervals must not stiffen the curve.
            let change = &change / change.norm().max(1.0);
            penalty += &change * change.transpose() * SMOOTH;
        }
    }
    penalty
}

/// Returns the coefficients of the penalized logistic regression, by Newton's method.
fn logistic(design: &DMatrix<f64>, right: &DVector<f64>, penalty: &DMatrix<f64>) -> DVector<f64> {
    let mut beta = DVector::zeros(design.ncols());
    for _ in 0..30 {
        let probability = (design * &beta).map(|odds| 1.0 / (1.0 + (-odds).exp()));
        let mut weighted = design.clone();
        for (mut row, p) in weighted.row_iter_mut().zip(probability.iter()) {
            row *= p * (1.0 - p) + 1e-6;
        }
        let gradient = design.transpose() * (right - &probability) - penalty * &beta;
        let hessian = design.transpose() * weighted + penalty;
        let step = hessian
            .cholesky()
            .expect("the penalty is positive")
            .solve(&gradient);
        beta += &step * (2.0 / step.amax()).min(1.0);
        if step.amax() < 1e-6 {
            break;
        }
    }
    beta
}

/// Returns the coefficients of the penalized linear regression.
fn linear(design: &DMatrix<f64>, values: &DVector<f64>, penalty: &DMatrix<f64>) -> DVector<f64> {
    let hessian = design.transpose() * design + penalty;
    let right = design.transpose() * values;
    hessian
        .cholesky()
        .expect("the penalty is positive")
        .solve(&right)
}
