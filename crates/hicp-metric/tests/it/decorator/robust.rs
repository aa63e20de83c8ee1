//! Tests of the properties of kernels, and of their effect on outliers.

use std::f64::consts::PI;

use crate::scenes::{
    AtStart, Numbers, advanced, center, difference, ellipsoid, exact, messy, resized,
};
use hicp_core::Iteration;
use hicp_core::{Correspondences, Isometry3};
use hicp_metric::Minimize;
use hicp_metric::{
    ErrorMetric, Kernel, PointToPlane, PointToPoint, Robust, RobustKernel, Scale, Symmetric,
};

const KERNELS: [Kernel; 7] = [
    Kernel::L2,
    Kernel::HUBER,
    Kernel::FAIR,
    Kernel::CAUCHY,
    Kernel::GEMAN_MCCLURE,
    Kernel::WELSCH,
    Kernel::TUKEY,
];

/// Numbers from 0 to far away, dense near the tuning constants.
fn grid() -> impl Iterator<Item = f64> {
    let far = [20.0, 1e3, 1e8, 1e12, 1e200, f64::MAX, f64::INFINITY];
    (0..2000).map(|i| f64::from(i) * 0.005).chain(far)
}

#[test]
fn weights_are_one_at_zero_even_finite_and_not_increasing() {
    for kernel in KERNELS {
        assert_eq!(
            kernel.weight(0.0).to_bits(),
            1.0_f64.to_bits(),
            "{kernel:?}"
        );
        assert_eq!(kernel.loss(0.0).to_bits(), 0.0_f64.to_bits(), "{kernel:?}");
        let (mut last, mut last_loss) = (1.0, 0.0);
        for x in grid() {
            let (w, rho) = (kernel.weight(x), kernel.loss(x));
            assert!(
                (0.0..=last).contains(&w),
                "{kernel:?} {x}: {w} after {last}"
            );
            assert_eq!(w.to_bits(), kernel.weight(-x).to_bits());
            assert_eq!(rho.to_bits(), kernel.loss(-x).to_bits());
            assert!(rho >= last_loss * (1.0 - 1e-15), "{kernel:?} {x}");
            assert!(rho <= 0.5 * x * x * (1.0 + 1e-12), "{kernel:?} {x}");
            (last, last_loss) = (w, rho);
        }
    }
}

#[test]
fn the_weight_is_the_slope_of_the_loss_over_the_residual() {
    for kernel in KERNELS {
        for x in (1..2000).map(|i| f64::from(i) * 0.005 + 0.0013) {
            let h = 1e-5;
            let slope = (kernel.loss(x + h) - kernel.loss(x - h)) / (2.0 * h);
            assert!(
                (slope - kernel.weight(x) * x).abs() < 1e-6,
                "{kernel:?} {x}"
            );
        }
        // ρ(x) ≈ x²/2 near zero, without cancellation.
        for x in [1e-9, 1e-6, 1e-5, 1.3e-4, 2e-4] {
            let ratio = kernel.loss(x) / (0.5 * x * x);
            assert!((ratio - 1.0).abs() < 2e-4, "{kernel:?} {x}: {ratio}");
        }
    }
}

/// Near zero, Fair's loss is a difference of nearly equal numbers.
///
/// Its series is c² (u²/2 − u³/3 + u⁴/4 − …), to the last term that counts.
#[test]
fn fairs_loss_keeps_its_digits_near_zero() {
    for c in [1.3998, 0.02, 50.0] {
        for u in [1e-12_f64, 1e-9, 1e-6, 3e-5, 9.9e-5, 1.1e-4, 1e-3, 1e-2] {
            let series: f64 = (2..20)
                .rev()
                .map(|n| (-u).powi(n) / f64::from(n) * c * c)
                .sum();
            let found = Kernel::Fair(c).loss(c * u);
            // At the switch to the difference, 4 of 16 digits are lost.
            assert!((found - series).abs() < 1e-11 * series, "{c} {u}: {found}");
        }
    }
}

/// The losses of rejecting kernels approach c²/2, and c²/6 for Tukey's.
#[test]
fn bounded_losses_approach_their_limits() {
    for c in [0.3, 1.0, 4.6851] {
        let half = 0.5 * c * c;
        let kernels = [
            (Kernel::GemanMcClure(c), half),
            (Kernel::Welsch(c), half),
            (Kernel::Tukey(c), half / 3.0),
        ];
        for (kernel, limit) in kernels {
            for x in [1e9, 1e200, f64::MAX, f64::INFINITY] {
                let loss = kernel.loss(x);
                assert!(
                    (loss - limit).abs() < 1e-12 * limit,
                    "{kernel:?} {x}: {loss}"
                );
            }
        }
    }
}

/// The constants have 95 % efficiency: (E ψ′)² / E ψ² over a Gaussian, with ψ = x w.
#[test]
fn tuning_constants_have_95_percent_efficiency() {
    for kernel in &KERNELS[1..] {
        let (mut slope, mut square) = (0.0, 0.0);
        let h = 1e-3;
        for i in -10_000..10_000 {
            let x = (f64::from(i) + 0.5) * h;
            let density = (-0.5 * x * x).exp() / (2.0 * PI).sqrt() * h;
            let psi = x * kernel.weight(x);
            // E ψ′ = E x ψ for a Gaussian, by integration by parts.
            slope += x * psi * density;
            square += psi * psi * density;
        }
        let efficiency = slope * slope / square;
        assert!((efficiency - 0.95).abs() < 2e-4, "{kernel:?}: {efficiency}");
    }
}

#[test]
fn invalid_constants_give_finite_numbers() {
    type Make = fn(f64) -> Kernel;
    let make: [Make; 6] = [
        Kernel::Huber,
        Kernel::Fair,
        Kernel::Cauchy,
        Kernel::GemanMcClure,
        Kernel::Welsch,
        Kernel::Tukey,
    ];
    for kernel in make {
        for c in [0.0, -1.0, f64::NAN, f64::MIN_POSITIVE] {
            for x in [0.0, 1e-3, 1.0, 1e12] {
                let kernel = kernel(c);
                assert!((0.0..=1.0).contains(&kernel.weight(x)), "{kernel:?} {x}");
                assert!(kernel.loss(x).is_finite(), "{kernel:?} {x}");
            }
        }
    }
}

/// Returns pairs of a motion with Gaussian noise, and a share of gross outliers on one side.
fn contaminated(numbers: &mut Numbers, motion: &Isometry3<f64>, share: f64) -> Correspondences {
    let source = ellipsoid(numbers, 400);
    let mut pairs = exact(&source, motion);
    for pair in pairs.as_mut_slice() {
        let normal = pair.target.normal.cast::<f64>().into_inner();
        let off = if numbers.unit() < share {
            normal * 0.05 + hicp_core::Vector3::x() * 0.05
        } else {
            normal * (0.0005 * numbers.normal())
        };
        pair.target.point += off.cast::<f32>();
    }
    pairs
}

fn settle(metric: &mut dyn Minimize, pairs: &Correspondences) -> Isometry3<f64> {
    let mut increment = Isometry3::identity();
    for _ in 0..30 {
        let step = metric.step(&advanced(pairs, &increment)).unwrap();
        increment = step.increment * increment;
    }
    increment
}

fn robust<M: Minimize + Clone + 'static>(metric: &M, kernel: Kernel) -> Robust<M> {
    Robust::new(metric.clone(), kernel, Scale::default())
}

#[test]
fn with_30_percent_gross_outliers_robust_is_better_than_plain() {
    fn check<M: Minimize + Clone + 'static>(metric: &M) {
        let mut numbers = Numbers(41);
        let motion = numbers.motion(&center(), 3.0, 0.005);
        let pairs = contaminated(&mut numbers, &motion, 0.3);
        let plain = difference(&settle(&mut metric.clone(), &pairs), &motion).1;
        for kernel in &KERNELS[1..] {
            let mut robust = robust(metric, *kernel);
            let found = difference(&settle(&mut robust, &pairs), &motion).1;
            // Convex kernels bound the influence of an outlier; the others end it.
            let bound = match kernel {
                Kernel::Huber(_) | Kernel::Fair(_) => 0.5,
                Kernel::Cauchy(_) => 0.1,
                _ => 0.05,
            };
            assert!(
                found < bound * plain,
                "{} {kernel:?}: {found} {plain}",
                metric.label()
            );
        }
    }
    check(&PointToPoint);
    check(&PointToPlane);
    check(&Symmetric);
}

#[test]
fn without_a_kernel_it_equals_the_inner_metric() {
    let mut numbers = Numbers(42);
    let pairs = messy(&mut numbers, 60);
    for scale in [Scale::Meters(0.002), Scale::default()] {
        let mut robust = Robust::new(PointToPoint, Kernel::L2, scale);
        let (found, plain) = (
            robust.step(&pairs).unwrap(),
            PointToPoint.step(&pairs).unwrap(),
        );
        assert_eq!(found.increment, plain.increment);
        assert!((found.mean_loss - plain.mean_loss).abs() < 1e-14);
        assert_eq!(
            robust.normal_equations(&pairs),
            PointToPoint.normal_equations(&pairs)
        );
    }
}

/// Doubling residuals and scale keeps the weights. So does a change from meters to millimeters.
#[test]
fn weights_depend_on_the_residual_in_units_of_the_scale() {
    let mut numbers = Numbers(43);
    let pairs = messy(&mut numbers, 60);
    for kernel in KERNELS {
        for (here, there) in [
            (Scale::Meters(0.002), Scale::Meters(0.002 * 1024.0)),
            (
                Scale::Mad { floor_meters: 0.0 },
                Scale::Mad { floor_meters: 0.0 },
            ),
        ] {
            let a = Robust::new(PointToPlane, kernel, here)
                .step(&pairs)
                .unwrap();
            let b = Robust::new(PointToPlane, kernel, there)
                .step(&resized(&pairs, 1024.0))
                .unwrap();
            assert!((a.increment.rotation.inverse() * b.increment.rotation).angle() < 1e-7);
            assert!((b.mean_loss / a.mean_loss / 1024.0_f64.powi(2) - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn the_scale_is_the_median_of_pairs_with_weight() {
    let mut numbers = Numbers(44);
    let mut pairs = messy(&mut numbers, 101);
    for pair in &mut pairs.as_mut_slice()[..50] {
        pair.weight = 0.0;
        pair.target.point.x += 1.0;
    }
    let mut residuals: Vec<f64> = pairs.as_slice()[50..]
        .iter()
        .map(|p| PointToPlane.squared_error(p).sqrt())
        .collect();
    residuals.sort_by(f64::total_cmp);
    let sigma = 1.4826 * residuals[25];
    let mad = Scale::Mad { floor_meters: 0.0 };
    let a = Robust::new(PointToPlane, Kernel::TUKEY, mad).step(&pairs);
    let b = Robust::new(PointToPlane, Kernel::TUKEY, Scale::Meters(sigma)).step(&pairs);
    assert_eq!(a, b);
}

/// Skipped pairs have neither a residual of zero nor a weight.
#[test]
fn pairs_without_rows_change_nothing() {
    let mut numbers = Numbers(49);
    let pairs = messy(&mut numbers, 100);
    let mut more = pairs.clone();
    for count in [0, 60, 100, 150] {
        for pair in messy(&mut numbers, count).as_slice() {
            let mut opposite = *pair;
            opposite.target.normal = -opposite.source.normal;
            more.push(opposite);
        }
        for kernel in KERNELS {
            for scale in [Scale::Mad { floor_meters: 1e-4 }, Scale::Meters(1e-3)] {
                let mut metric = Robust::new(Symmetric, kernel, scale);
                let mut answers = |pairs| {
                    let iteration = Iteration::default();
                    let mean_loss = metric.mean_loss(&iteration, pairs);
                    let step = metric.minimize(&iteration, pairs);
                    (
                        mean_loss.unwrap(),
                        step.unwrap(),
                        metric.system(&iteration, pairs),
                    )
                };
                assert_eq!(
                    answers(&more),
                    answers(&pairs),
                    "{kernel:?} {scale:?} {count}"
                );
                if kernel == Kernel::L2 {
                    let inner = Symmetric.mean_squared_error(&more).unwrap();
                    assert!((answers(&more).0 - inner).abs() < 1e-14 * inner);
                }
            }
        }
    }
}

/// At a fixed scale, the loss that the divergence rules judge does not rise.
///
/// It shows a drift into the tail.
#[test]
fn the_mean_loss_falls_with_every_step_and_rises_with_drift() {
    let mut numbers = Numbers(45);
    let motion = numbers.motion(&center(), 5.0, 0.01);
    let pairs = contaminated(&mut numbers, &motion, 0.2);
    for kernel in KERNELS {
        let mut metric = Robust::new(PointToPoint, kernel, Scale::Meters(0.002));
        let mut increment = Isometry3::identity();
        let mut last = f64::INFINITY;
        for _ in 0..15 {
            let step = metric.step(&advanced(&pairs, &increment)).unwrap();
            assert!(step.mean_loss <= last * (1.0 + 1e-5), "{kernel:?}");
            last = step.mean_loss;
            increment = step.increment * increment;
        }
        let drift = Isometry3::translation(0.1, 0.0, 0.0) * increment;
        let drifted = metric.loss(&advanced(&pairs, &drift)).unwrap();
        assert!(drifted > last, "{kernel:?}");
    }
}

#[test]
fn residuals_may_be_zero_equal_single_or_infinite() {
    let mut numbers = Numbers(46);
    let fitting = exact(&ellipsoid(&mut numbers, 50), &Isometry3::identity());
    let shift = Isometry3::translation(0.0, 0.0, 0.004);
    let equal = exact(&ellipsoid(&mut numbers, 50), &shift);
    let alone: Correspondences = equal.as_slice()[..1].iter().copied().collect();
    let mut infinite = equal.clone();
    for pair in infinite.as_mut_slice() {
        pair.target.point.x = f32::INFINITY;
    }
    let scales = [
        Scale::default(),
        Scale::Mad { floor_meters: 0.0 },
        Scale::Meters(0.0),
        Scale::Meters(1e-3),
    ];
    for kernel in KERNELS {
        for scale in scales {
            let mut metric = Robust::new(PointToPoint, kernel, scale);
            let step = metric.step(&fitting).unwrap();
            assert!(difference(&step.increment, &Isometry3::identity()).1 < 1e-12);
            assert_eq!(step.mean_loss.to_bits(), 0.0_f64.to_bits());
            assert_eq!(metric.step(&alone), None);
            assert_eq!(metric.step(&infinite), None, "{kernel:?} {scale:?}");
            assert_eq!(metric.step(&Correspondences::new()), None);
            assert_eq!(metric.loss(&Correspondences::new()), None);
            // With a median, equal distances are not all outliers.
            if matches!(scale, Scale::Mad { .. }) {
                let step = metric.step(&equal).unwrap();
                assert!(
                    difference(&step.increment, &shift).1 < 1e-6,
                    "{kernel:?} {scale:?}"
                );
            }
        }
    }
}

/// Student's t with ν degrees of freedom, which is not a built-in kernel.
#[derive(Clone, Copy)]
struct StudentT(f64);

impl RobustKernel for StudentT {
    fn weight(&self, x: f64) -> f64 {
        self.0 / (self.0 + x * x)
    }

    fn loss(&self, x: f64) -> f64 {
        0.5 * self.0 * (x * x / self.0).ln_1p()
    }
}

/// Cauchy's kernel is Student's with c² degrees of freedom.
///
/// The custom kernel must therefore give the steps of the built-in one.
#[test]
fn a_custom_kernel_takes_the_steps_of_its_definition() {
    let mut numbers = Numbers(91);
    let pairs = messy(&mut numbers, 80);
    let c = 2.0;
    let scale = Scale::Mad { floor_meters: 1e-3 };
    let first = Iteration::default();
    let mut own = Robust::new(PointToPlane, StudentT(c * c), scale);
    let mut shipped = Robust::new(PointToPlane, Kernel::Cauchy(c), scale);
    let (own, shipped) = (
        own.minimize(&first, &pairs),
        shipped.minimize(&first, &pairs),
    );
    let (own, shipped) = (own.unwrap(), shipped.unwrap());
    let (angle, distance) = hicp_core::se3::pose_distance(&own.increment, &shipped.increment);
    // Weights are rounded to f32, and 4/(4 + x²) rounds differently from 1/(1 + (x/2)²).
    assert!(angle < 1e-6 && distance < 1e-6, "{angle} {distance}");
    assert!((own.mean_loss - shipped.mean_loss).abs() < 1e-12 * shipped.mean_loss);
    let plain = PointToPlane.step(&pairs).unwrap();
    assert!(hicp_core::se3::pose_distance(&plain.increment, &own.increment).0 > 1e-4);
}
