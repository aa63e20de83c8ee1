//! Error metrics.

use hicp_metric::{
    Conditioned, Degeneracy, Frame, Frozen, GaussNewton, Generalized, Kernel, LevenbergMarquardt,
    MetricSchedule, Photometric, PlaneToPoint, PointToPlane, PointToPoint, PosePrior, Prior,
    Robust, Scale, Symmetric, WeightedSum,
};

use crate::build::Parameters;
use crate::catalog::{BoxedMetric, Catalog};
use crate::error::PipelineError;
use crate::range::{FACTOR, METERS, Range};
use crate::work::Limited::Samples;

pub(super) fn add(catalog: &mut Catalog) {
    catalog.add_metric("point-to-point", |p| {
        p.about = "‖T o − c‖², in closed form. Source: §III-A.2; Besl & McKay 1992, Umeyama 1991. \
            Cost: O(n).";
        Ok(PointToPoint)
    });
    catalog.add_metric("point-to-plane", |p| {
        p.about = "(nᵀ(T o − c))², by Gauss–Newton. Source: §III-A.2; Chen & Medioni 1991, Low \
            2004. Cost: O(n).";
        Ok(PointToPlane)
    });
    catalog.add_metric("plane-to-point", |p| {
        p.about = "(mᵀ(T o − c))², the model's tangent planes. Cost: O(n).";
        Ok(PlaneToPoint)
    });
    catalog.add_metric("symmetric", |p| {
        p.about = "((T o − c)ᵀ(n + m)/2)², the planes of both sides, half the rotation each. \
            Source: Rusinkiewicz 2019. Cost: O(n).";
        Ok(Symmetric)
    });
    catalog.add_metric("generalized", |p| {
        p.about = "The Mahalanobis distance of two flat Gaussians (GICP). Source: Segal, Haehnel \
            & Thrun 2009. Cost: O(n).";
        let flat = Range::new(1e-9, 1.0, "");
        let ratio = "variance along the normal over that in the plane";
        Ok(Generalized {
            epsilon: p.number("epsilon", flat, 1e-3, ratio)?,
        })
    });
    catalog.add_metric("weighted-sum", |p| {
        p.about = "Minimizes several metrics in one system. Source: Lee, Lim & Han 2024 for two. \
            Cost: their sum.";
        let metrics = p.parts::<BoxedMetric>("metrics", None, "the metrics")?;
        let weights = p.numbers("weights", "their factors, in order")?;
        if weights.len() != metrics.len() || weights.iter().any(|weight| *weight < 0.0) {
            let expected = format!("{} numbers of 0 or more, one per metric", metrics.len());
            return Err(p.refuse("weights", expected));
        }
        Ok(WeightedSum {
            terms: weights.into_iter().zip(metrics).collect::<Vec<_>>(),
        })
    });
    catalog.add_metric("robust", |p| {
        p.about = "Re-weights a metric by a robust kernel of its residuals. Source: Holland & \
            Welsch 1977. Cost: twice the metric; MAD: O(n) more.";
        let metric = inner(p)?;
        let (usual, tuned) = p.word("kernel", &KERNELS, "w = ρ′(r)/r with r in units of σ")?;
        let constant = "tuning constant; 0 is the kernel's own, for 95 % efficiency";
        let tuning = p.number("tuning", Range::positive("σ"), 0.0, constant)?;
        let kernel = if tuning > 0.0 { tuned(tuning) } else { usual };
        let scale = p.word("scale", &SCALES, "source of σ")?;
        let meters = p.number("meters", METERS, 1e-3, "σ, or its least value for MAD")?;
        Ok(Robust::new(metric, kernel, scale(meters)))
    });
    catalog.add_metric("pose-prior", |p| {
        p.about = "Adds a Gaussian prior around the stage's initial pose to a metric. \
            Source: Barfoot & Furgale 2014 for its linearization. Cost: the metric, by \
            Gauss–Newton.";
        let metric = inner(p)?;
        let deviation = "standard deviation per axis; inf for no prior";
        let positive = |unit| Range::new(1e-9, f64::INFINITY, unit);
        let (meters, degrees) = (positive("m"), positive("degrees"));
        let prior = Prior::AboutInitial {
            translation_meters: p.number("translation_meters", meters, 0.01, deviation)?,
            rotation_degrees: p.number("rotation_degrees", degrees, 10.0, deviation)?,
        };
        let sigma = "standard deviation of a residual, times √(pixels per independent one)";
        let sigma = p.number("sigma_meters", METERS, 1e-3, sigma)?;
        Ok(PosePrior::new(metric, prior, sigma))
    });
    catalog.add_metric("photometric", |p| {
        p.about = "Adds the colors of the image to a metric; without colors, it is the metric. \
            Source: Park, Zhou & Koltun 2017, on images. Cost: the metric, by Gauss–Newton, and \
            two passes over the samples.";
        let mut photometric = Photometric::new(inner(p)?);
        let weight = "the RMS residual that counts as much as colors that do not agree";
        let diameters = Range::new(0.0, 1.0, "diameters");
        photometric.weight_diameters = p.number("weight_diameters", diameters, 0.01, weight)?;
        photometric.samples = p.limited(Samples, "samples", 1, 2000, "points on the model")?;
        Ok(photometric)
    });
    catalog.add_metric("metric-schedule", |p| {
        p.about = "Minimizes one metric per iteration, the last from then on. Source: Blake & \
            Zisserman 1987 for a falling kernel scale. Cost: that of the metric.";
        let metrics = p.parts::<BoxedMetric>("metrics", None, "the metrics, by iteration")?;
        Ok(MetricSchedule::new(metrics))
    });
    catalog.add_metric("frozen", |p| {
        p.about = "Keeps some directions of a metric's increments fixed. Cost: the \
            metric, by Gauss–Newton.";
        let frames = [("camera", Frame::Camera), ("object", Frame::Object)];
        Ok(Frozen {
            metric: inner(p)?,
            frame: p.word("frame", &frames, "frame of the axes")?,
            translation: p.flags("translation", "x, y, z that do not move")?,
            rotation: p.flags("rotation", "x, y, z that do not rotate")?,
        })
    });
    catalog.add_metric("conditioned", |p| {
        p.about = "Treats directions that the pairs of a metric do not determine. Source: Zhang, \
            Kaess & Singh 2016. Cost: the metric and a 6×6 eigendecomposition.";
        let policies = [
            ("freeze", Degeneracy::Freeze),
            ("freeze-rotations", Degeneracy::FreezeRotations),
            ("freeze-unexplained", Degeneracy::FreezeUnexplained),
            ("damp", Degeneracy::Damp),
            ("refuse", Degeneracy::Refuse),
            ("ignore", Degeneracy::Ignore),
        ];
        let share = Range::new(0.0, 1.0, "share of the largest eigenvalue");
        Ok(Conditioned {
            metric: inner(p)?,
            policy: p.word("policy", &policies, "treatment of these directions")?,
            threshold: p.number(
                "threshold",
                share,
                1e-3,
                "a direction is undetermined below this",
            )?,
        })
    });
    catalog.add_metric("gauss-newton", |p| {
        p.about = "Takes several Gauss–Newton steps over the same pairs. Cost: iterations × the \
            metric.";
        let mut solver = GaussNewton::new(inner(p)?);
        (solver.max_iterations, solver.tolerance) = steps(p, 10)?;
        Ok(solver)
    });
    catalog.add_metric("levenberg-marquardt", |p| {
        p.about = "Takes damped steps over the same pairs, and rejects those that raise the loss. \
            Source: Levenberg 1944, Marquardt 1963. Cost: iterations × the metric.";
        let mut solver = LevenbergMarquardt::new(inner(p)?);
        (solver.max_iterations, solver.tolerance) = steps(p, 20)?;
        solver.initial_damping = p.number("initial_damping", FACTOR, 1e-3, "first λ")?;
        Ok(solver)
    });
}

/// A kernel with its usual tuning constant, and one with another.
type KernelWord = (Kernel, fn(f64) -> Kernel);

const KERNELS: [(&str, KernelWord); 7] = [
    ("huber", (Kernel::HUBER, Kernel::Huber)),
    ("fair", (Kernel::FAIR, Kernel::Fair)),
    ("cauchy", (Kernel::CAUCHY, Kernel::Cauchy)),
    (
        "geman-mcclure",
        (Kernel::GEMAN_MCCLURE, Kernel::GemanMcClure),
    ),
    ("welsch", (Kernel::WELSCH, Kernel::Welsch)),
    ("tukey", (Kernel::TUKEY, Kernel::Tukey)),
    ("l2", (Kernel::L2, |_| Kernel::L2)),
];

/// A scale from a length in meters.
type ScaleWord = fn(f64) -> Scale;

const SCALES: [(&str, ScaleWord); 2] = [
    ("mad", |floor_meters| Scale::Mad { floor_meters }),
    ("meters", Scale::Meters),
];

fn inner(p: &mut Parameters<'_>) -> Result<BoxedMetric, PipelineError> {
    p.part("metric", "point-to-plane", "the metric")
}

/// The number of steps of a solver and the step at which it has converged.
fn steps(p: &mut Parameters<'_>, usual: u32) -> Result<(usize, f64), PipelineError> {
    let iterations = p.count("iterations", 1, usual, "largest number of steps")?;
    p.repeats("iterations", iterations)?;
    Ok((
        iterations,
        p.number(
            "tolerance",
            Range::positive("RMS radii"),
            1e-6,
            "converged below this step",
        )?,
    ))
}
