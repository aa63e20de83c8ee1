//! The probability that an error lies within an ellipsoid.

/// Returns the probability that ξᵀΣ⁻¹ξ of a pose's error ξ is at most `mahalanobis_squared`.
///
/// With `degrees_of_freedom` ν, the error follows Student's distribution in six dimensions with
/// scale matrix Σ. Its heavy tails allow for outliers that no covariance predicts. ν = ∞ is the
/// normal distribution, with the result of χ²₆. A distance of 0 or less, or NaN, has probability 0,
/// and an infinite one 1. A ν that is not positive, or 10⁷ or more, counts as ∞.
///
/// The result is the regularized incomplete beta function I_u(3, b), with u = x/(x + ν) and b =
/// ν/2. In closed form it is 1 − (1 − u)ᵇ (1 + b u + b (b + 1) u²/2).
///
/// ```
/// use hicp_fusion::probability_within;
/// // The 99.9 % quantile of χ²₆.
/// assert!((probability_within(22.458, f64::INFINITY) - 0.999).abs() < 1e-5);
/// // 90 % of Student's distribution with ν = 4 is within 24.06, six times the quantile of F(6, 4).
/// assert!((probability_within(24.06, 4.0) - 0.9).abs() < 1e-4);
/// ```
#[must_use]
pub fn probability_within(mahalanobis_squared: f64, degrees_of_freedom: f64) -> f64 {
    let x = mahalanobis_squared;
    if x.is_nan() || x <= 0.0 {
        return 0.0;
    }
    if x.is_infinite() {
        return 1.0;
    }
    let nu = degrees_of_freedom;
    if nu > 0.0 && nu < 1e7 {
        let (u, b) = (x / (x + nu), 0.5 * nu);
        // (1 − u)ᵇ without the cancellation in 1 − u.
        let power = (-b * (x / nu).ln_1p()).exp();
        1.0 - power * (1.0 + b * u + 0.5 * b * (b + 1.0) * u * u)
    } else {
        let half = 0.5 * x;
        1.0 - (-half).exp() * (1.0 + half + 0.5 * half * half)
    }
}

#[cfg(test)]
mod tests {
    use super::probability_within;

    /// Compares with the integrated density of x = ξᵀΣ⁻¹ξ.
    #[test]
    fn the_probability_is_the_integral_of_the_density() {
        for nu in [1.0, 2.5, 4.0, 30.0] {
            // Γ((ν + 6)/2)/(Γ(ν/2) Γ(3) ν³) x² (1 + x/ν)^(−(ν + 6)/2), with Γ(b + 3)/Γ(b) = b (b +
            // 1) (b + 2).
            let b = 0.5 * nu;
            let factor = b * (b + 1.0) * (b + 2.0) / (2.0 * nu * nu * nu);
            let density = |x: f64| factor * x * x * (1.0 + x / nu).powf(-(b + 3.0));
            let (mut sum, step) = (0.0, 1e-3);
            for index in 0..40_000 {
                let x = (f64::from(index) + 0.5) * step;
                sum += density(x) * step;
                if index % 8000 == 7999 {
                    let found = probability_within(x + 0.5 * step, nu);
                    assert!((found - sum).abs() < 1e-6, "{nu} {x}: {found} {sum}");
                }
            }
        }
    }

    #[test]
    fn many_degrees_of_freedom_are_the_normal_distribution() {
        for x in [0.1, 5.348, 16.812, 80.0] {
            let normal = probability_within(x, f64::INFINITY);
            assert!((probability_within(x, 9e6) - normal).abs() < 1e-5, "{x}");
        }
        for nu in [0.0, -1.0, f64::NAN, 1e7, 1e300] {
            assert_eq!(
                probability_within(5.0, nu),
                probability_within(5.0, f64::INFINITY)
            );
        }
        let quantiles = [(5.348_12, 0.5), (10.644_64, 0.9), (16.811_89, 0.99)];
        for (x, expected) in quantiles {
            assert!((probability_within(x, f64::INFINITY) - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn invalid_distances_have_probability_zero() {
        for nu in [4.0, 0.0, f64::INFINITY, f64::NAN, -1.0] {
            assert_eq!(probability_within(0.0, nu), 0.0);
            assert_eq!(probability_within(-1.0, nu), 0.0);
            assert_eq!(probability_within(f64::NAN, nu), 0.0);
            assert_eq!(probability_within(f64::INFINITY, nu), 1.0);
        }
    }
}
