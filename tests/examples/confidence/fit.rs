//! The fit of the confidence: a network with one hidden layer.

use hicp_sim::{SimRng, stream};
use hybrid_icp::core::nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use hybrid_icp::score::{Confidence, N_FEATURES};
use rand::RngExt;

use crate::cases::Case;

/// Number of hidden units.
const UNITS: usize = 32;
/// The outputs: the log-odds, and the logarithms of the two errors.
const OUTPUTS: usize = 3;
/// The parameters of a unit: its bias and weights, and its factors in the outputs.
const UNIT: usize = 1 + N_FEATURES + OUTPUTS;
/// All parameters: of the units, and the outputs without units.
const PARAMETERS: usize = UNITS * UNIT + OUTPUTS;
/// Weight of a squared error of a logarithm, relative to the cross-entropy.
const ERROR_WEIGHT: f64 = 0.125;
/// Weight of the sum of the squared parameters.
const DECAY: f64 = 5e-5;
/// Steps of Adam, and the size of the first ones. The size falls to 0 as a cosine.
const STEPS: i32 = 2000;
const STEP: f64 = 0.02;
/// Seed of the initial parameters. Of the seeds 0 to 3, this one leads to the lowest calibration
/// errors on other cases of tuning objects.
const SEED: u64 = 1;

type Parameters = [f64; PARAMETERS];

/// A case with standardized features.
struct Row {
    features: [f64; N_FEATURES],
    right: f64,
    /// The logarithms of the errors, relative to their means; `None` if the model is wrong.
    errors: Option<[f64; 2]>,
}

/// Fits the network and prints it as the file `network.rs` has it.
pub fn print(cases: &[Case]) {
    let scales: Vec<(f64, f64)> = (0..N_FEATURES)
        .map(|k| mean_and_deviation(cases.iter().map(|case| case.features[k])))
        .collect();
    let logarithms = |which: usize| {
        let errors = cases.iter().filter_map(move |case| case.errors);
        errors.map(move |errors| errors[which].max(1e-4).ln())
    };
    let means = [0, 1].map(|which| mean_and_deviation(logarithms(which)).0);
    let rows: Vec<Row> = cases
        .iter()
        .map(|case| Row {
            features: std::array::from_fn(|k| (case.features[k] - scales[k].0) / scales[k].1),
            right: f64::from(case.right()),
            errors: case
                .errors
                .map(|errors| [0, 1].map(|which| errors[which].max(1e-4).ln() - means[which])),
        })
        .collect();
    let fitted = fit(&rows);

    let base = &fitted[UNITS * UNIT..];
    let base = [base[0], base[1] + means[0], base[2] + means[1]];
    println!("pub(crate) const BASE: [f64; 3] = {base:.4?};\n");
    println!("pub(crate) const UNITS: [Unit; {UNITS}] = [");
    for unit in fitted[..UNITS * UNIT].chunks(UNIT) {
        let (input, outputs) = unit.split_at(1 + N_FEATURES);
        // The scales of the features become part of the weights.
        let weights: Vec<f64> = input[1..]
            .iter()
            .zip(&scales)
            .map(|(weight, (_, deviation))| weight / deviation)
            .collect();
        let shift = weights.iter().zip(&scales).map(|(w, (mean, _))| w * mean);
        let bias = input[0] - shift.sum::<f64>();
        let words: Vec<String> = weights.iter().map(|w| format!("{w:.4}")).collect();
        let [first, second] = [&words[..8], &words[8..]].map(|words| words.join(", "));
        println!("    ({bias:.4}, [{first},\n     {second}], {outputs:.4?}),");
    }
    println!("];");
}

/// Fits the confidence in poses near the initial one, and prints its constants.
pub fn print_near(cases: &[Case]) {
    let near: Vec<(f64, Confidence, &Case)> = cases
        .iter()
        .filter_map(|case| {
            let base = Confidence::of(&case.features, 1.0);
            Some((case.near?.ln_1p(), base, case))
        })
        .collect();
    let rows = near.iter().filter(|(_, base, _)| base.probability > 0.0);
    let rows = rows.map(|(poses, base, case)| {
        let log_odds = (base.probability / (1.0 - base.probability)).ln();
        let row = Vector4::new(1.0, log_odds, *poses, poses * log_odds);
        (row, f64::from(case.right()))
    });
    // Newton's method from the confidence as it is.
    let mut odds = Vector4::new(0.0, 1.0, 0.0, 0.0);
    for _ in 0..20 {
        let (mut gradient, mut hessian) = (Vector4::zeros(), Matrix4::zeros());
        for (row, right) in rows.clone() {
            let probability = 1.0 / (1.0 + (-odds.dot(&row)).exp());
            gradient += row * (probability - right);
            hessian += row * row.transpose() * (probability * (1.0 - probability));
        }
        odds -= hessian.lu().solve(&gradient).expect("cases that differ");
    }
    println!("const NEAR_ODDS: [f64; 4] = {:.3?};", odds.as_slice());
    let errors = [0, 1].map(|which| {
        let (mut sides, mut squares) = (Vector2::zeros(), Matrix2::zeros());
        for (poses, base, case) in &near {
            let Some(errors) = case.errors else { continue };
            let expected = [base.error_meters, base.error_degrees][which];
            let row = Vector2::new(1.0, *poses);
            sides += row * (errors[which].max(1e-4) / expected).ln();
            squares += row * row.transpose();
        }
        let fitted = squares.lu().solve(&sides).expect("cases that differ");
        [fitted.x, fitted.y]
    });
    println!("const NEAR_ERRORS: [[f64; 2]; 2] = {errors:.2?};");
}

fn mean_and_deviation(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for value in values {
        (count, sum, squares) = (count + 1.0, sum + value, squares + value * value);
    }
    let mean: f64 = sum / count;
    (mean, (squares / count - mean * mean).max(1e-12).sqrt())
}

/// Minimizes the loss by Adam over all rows.
fn fit(rows: &[Row]) -> Parameters {
    let mut random: SimRng = stream(SEED, &["network"], 0);
    let mut parameters: Parameters = std::array::from_fn(|_| 0.5 * (random.random::<f64>() - 0.5));
    let (mut mean, mut square) = ([0.0; PARAMETERS], [0.0; PARAMETERS]);
    for step in 1..=STEPS {
        let gradient = gradient(&parameters, rows);
        let turn = std::f64::consts::PI * f64::from(step) / f64::from(STEPS);
        let size = STEP * 0.5 * (1.0 + turn.cos());
        for (k, g) in gradient.iter().enumerate() {
            mean[k] = 0.9 * mean[k] + 0.1 * g;
            square[k] = 0.999 * square[k] + 0.001 * g * g;
            let first: f64 = mean[k] / (1.0 - 0.9_f64.powi(step));
            let second: f64 = square[k] / (1.0 - 0.999_f64.powi(step));
            parameters[k] -= size * first / (second.sqrt() + 1e-8);
        }
    }
    parameters
}

/// Returns the gradient of the mean loss.
fn gradient(parameters: &Parameters, rows: &[Row]) -> Parameters {
    let mut gradient = [0.0; PARAMETERS];
    let base = UNITS * UNIT;
    for row in rows {
        let mut values = [0.0; UNITS];
        let mut outputs: [f64; OUTPUTS] = std::array::from_fn(|k| parameters[base + k]);
        for (value, unit) in values.iter_mut().zip(parameters.chunks(UNIT)) {
            let products = unit[1..].iter().zip(&row.features).map(|(w, x)| w * x);
            *value = (unit[0] + products.sum::<f64>()).max(0.0);
            for (output, factor) in outputs.iter_mut().zip(&unit[1 + N_FEATURES..]) {
                *output += *value * factor;
            }
        }
        let probability = 1.0 / (1.0 + (-outputs[0]).exp());
        let mut slopes = [probability - row.right, 0.0, 0.0];
        if let Some(errors) = row.errors {
            slopes[1] = 2.0 * ERROR_WEIGHT * (outputs[1] - errors[0]);
            slopes[2] = 2.0 * ERROR_WEIGHT * (outputs[2] - errors[1]);
        }
        for (k, slope) in slopes.iter().enumerate() {
            gradient[base + k] += slope;
        }
        let units = parameters.chunks(UNIT).zip(gradient.chunks_mut(UNIT));
        for ((unit, gradient), value) in units.zip(values) {
            if value <= 0.0 {
                continue;
            }
            let mut slope = 0.0;
            for (k, own) in slopes.iter().enumerate() {
                gradient[1 + N_FEATURES + k] += own * value;
                slope += own * unit[1 + N_FEATURES + k];
            }
            gradient[0] += slope;
            for (g, x) in gradient[1..].iter_mut().zip(&row.features) {
                *g += slope * x;
            }
        }
    }
    let count = rows.len() as f64;
    std::array::from_fn(|k| gradient[k] / count + 2.0 * DECAY * parameters[k])
}
