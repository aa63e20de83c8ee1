//! Charts: errors and scores over iterations, and how far starts may be off.

use std::error::Error;
use std::ops::ControlFlow;

use hicp_sim::{Household, perturb, rng};
use hicp_tests::starts::{Start, starts};
use hicp_tests::{OBJECTS, median, scene, symmetric_pose_distance};
use hybrid_icp::association::{DataAssociation, NearestNeighbor, Projective, VisibleSurface};
use hybrid_icp::core::Isometry3;
use hybrid_icp::icp::{Icp, IterationEvent, IterationLimit, Observer, Regime, RegimeEvent};
use hybrid_icp::metric::{Minimize, PointToPlane, PointToPoint, Symmetric};
use hybrid_icp::score::ModelPoints;
use hybrid_icp::{Preset, Refiner, presets};

use crate::chart::{Axes, Line};
use crate::svg::{AFTER, Anchor, BAD, BEFORE, GOOD, GRAY, INK, OTHER, Svg};

type Drawn = Result<Svg, Box<dyn Error>>;

/// The poses that were evaluated, and the branches that were taken.
#[derive(Default)]
struct Path {
    poses: Vec<Isometry3<f64>>,
    branches: Vec<(usize, Regime)>,
}

impl Observer for Path {
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
        self.poses.push(*event.camera_from_object);
        ControlFlow::Continue(())
    }

    fn on_regime(&mut self, event: &RegimeEvent) {
        self.branches.push((self.poses.len(), event.regime));
    }
}

/// Iterations of the chart of convergence.
const ITERATIONS: usize = 26;

pub(crate) fn convergence() -> Drawn {
    fn icp(
        association: impl DataAssociation + Send + 'static,
        metric: impl Minimize + Send + 'static,
    ) -> Refiner {
        Refiner::boxed(Icp {
            selection: VisibleSurface::default(),
            association,
            filter: (),
            metric,
            stop: IterationLimit(ITERATIONS),
        })
    }
    let nearest = icp(NearestNeighbor::default(), PointToPoint);
    let mut stages: [(&str, &'static str, Refiner); 4] = [
        ("nearest, point-to-point", BAD, nearest),
        (
            "projective, point-to-point",
            BEFORE,
            icp(Projective, PointToPoint),
        ),
        (
            "projective, point-to-plane",
            AFTER,
            icp(Projective, PointToPlane),
        ),
        ("projective, symmetric", GOOD, icp(Projective, Symmetric)),
    ];
    let starts = starts(4, 0.0);
    let mut lines = Vec::new();
    for (name, color, refiner) in &mut stages {
        let mut errors = vec![Vec::new(); ITERATIONS];
        for Start { scene, init } in &starts {
            let model = ModelPoints::new(&scene.model);
            let mut path = Path::default();
            refiner.refine_observed(&scene.model, &scene.observation, init, &mut path);
            let last = path.poses.last().copied().unwrap_or(*init);
            let poses = path.poses.iter().chain(std::iter::repeat(&last));
            for (errors, pose) in errors.iter_mut().zip(poses) {
                errors.push(model.mssd(pose, &scene.truth) * 1e3);
            }
        }
        let medians = errors.iter_mut().map(|errors| median(errors));
        let points = (0..).map(f64::from).zip(medians).collect();
        lines.push(Line {
            name: (*name).to_owned(),
            color,
            points,
        });
    }
    let axes = Axes {
        title: "Median over 40 starts, 6.2 mm and 9.5° off",
        x: (
            "iteration",
            0.0..25.0,
            (0..=25).step_by(5).map(f64::from).collect(),
        ),
        y: (
            "largest distance to the true pose, mm",
            0.5..30.0,
            vec![0.5, 1.0, 2.0, 5.0, 10.0, 20.0],
        ),
        log: true,
    };
    let mut svg = axes.draw();
    axes.plot(&mut svg, &lines);
    Ok(svg)
}

pub(crate) fn switch() -> Drawn {
    // The first start from which hybrid switches and succeeds, and the cascade alone does not.
    for seed in 0..200 {
        let mut random = rng(seed);
        let scene = scene(Household::Iron, 0.2, &mut random);
        let init = perturb(&mut random, &scene.truth, 0.06, 60_f64.to_radians());
        let mut refiner = Refiner::preset(Preset::Hybrid);
        let mut path = Path::default();
        let refined = refiner.refine_observed(&scene.model, &scene.observation, &init, &mut path);
        let mut alone = Path::default();
        let cascade = Refiner::new(presets::projective_cascade_point_plane()).refine_observed(
            &scene.model,
            &scene.observation,
            &init,
            &mut alone,
        );
        let [(_, Regime::MISALIGNED), (switched, Regime::ALIGNED)] = path.branches[..] else {
            continue;
        };
        if refined.mve > 0.05 || cascade.mve < 0.5 || switched < 8 {
            continue;
        }
        let mut scores = |poses: &[Isometry3<f64>]| -> Vec<(f64, f64)> {
            let mve = |pose| refiner.mve(&scene.model, &scene.observation, pose);
            (0..).map(f64::from).zip(poses.iter().map(mve)).collect()
        };
        let lines = [
            Line {
                name: "Hybrid ICP".to_owned(),
                color: AFTER,
                points: scores(&path.poses),
            },
            Line {
                name: "projective cascade alone".to_owned(),
                color: BAD,
                points: scores(&alone.poses),
            },
        ];
        let last = path.poses.len() as f64 - 1.0;
        let axes = Axes {
            title: "MVE over the iterations, from a start that is far off",
            x: (
                "iteration",
                0.0..last,
                (0..=200)
                    .step_by(10)
                    .map(f64::from)
                    .filter(|x| *x <= last)
                    .collect(),
            ),
            y: (
                "mean VSD estimate (MVE)",
                0.0..1.0,
                vec![0.0, 0.2, 0.4, 0.6, 0.8, 1.0],
            ),
            log: false,
        };
        let mut svg = axes.draw();
        let (u, top) = axes.place((switched as f64 - 0.5, 1.0));
        let (_, bottom) = axes.place((0.0, 0.0));
        let (left, alpha) = axes.place((0.0, 0.4));
        let (right, _) = axes.place((last, 0.4));
        for (from, to, fill) in [(left, u, "#fdf1dc"), (u, right, "#e5f1f9")] {
            svg.add(&format!(
                r#"<rect x="{from:.1}" y="{top}" width="{:.1}" height="{:.1}" fill="{fill}"/>"#,
                to - from,
                bottom - top
            ));
        }
        let dashed = format!(r#"stroke="{INK}" stroke-dasharray="5 4""#);
        svg.path(&[(left, alpha), (right, alpha)], &dashed);
        svg.text(
            (right + 12.0, alpha + 5.0),
            14,
            INK,
            Anchor::Start,
            "α = 0.4",
        );
        svg.path(
            &[(u, top), (u, bottom)],
            &format!(r#"stroke="{INK}" stroke-width="1.5""#),
        );
        svg.text(
            (u - 8.0, top + 18.0),
            14,
            GRAY,
            Anchor::End,
            "nearest neighbors",
        );
        svg.text((u + 8.0, top + 18.0), 14, GRAY, Anchor::Start, "projective");
        axes.plot(&mut svg, &lines);
        return Ok(svg);
    }
    Err("no start in 200 shows the switch".into())
}

pub(crate) fn basin() -> Drawn {
    const STARTS: u64 = 8;
    let angles = [10.0, 30.0, 50.0, 70.0, 90.0, 120.0, 150.0, 180.0];
    let compared = [
        (Preset::NnPointToPoint, OTHER),
        (Preset::ProjectivePointToPlane, BEFORE),
        (Preset::Hybrid, BAD),
        (Preset::Local, GOOD),
        (Preset::Auto, AFTER),
    ];
    let mut refiners = compared.map(|(preset, color)| (preset, color, Refiner::preset(preset)));
    let mut lines = compared.map(|(preset, color)| Line {
        name: preset.to_string(),
        color,
        points: Vec::new(),
    });
    for degrees in angles {
        let mut found = [0.0; 5];
        for (seed, object) in (0..).zip(OBJECTS) {
            let mut random = rng(seed);
            for _ in 0..STARTS {
                let scene = scene(object, 0.2, &mut random);
                let center = scene.model.center();
                let init = perturb(&mut random, &scene.truth, 0.0, f64::to_radians(degrees));
                // Rotated around the center, and 2 cm away.
                let shift = scene.truth * center - init * center;
                let init = Isometry3::translation(shift.x, shift.y, shift.z) * init;
                let init = perturb(&mut random, &init, 0.02, 0.0);
                for ((_, _, refiner), found) in refiners.iter_mut().zip(&mut found) {
                    let refined = refiner.refine(&scene.model, &scene.observation, &init);
                    let pose = refined.outcome.camera_from_object;
                    let symmetries = scene.model.symmetries();
                    let (angle, distance) =
                        symmetric_pose_distance(&pose, &scene.truth, symmetries);
                    if angle.to_degrees() < 5.0 && distance < 0.005 {
                        *found += 100.0 / (STARTS as f64 * OBJECTS.len() as f64);
                    }
                }
            }
        }
        for (line, found) in lines.iter_mut().zip(found) {
            line.points.push((degrees, found));
        }
    }
    let axes = Axes {
        title: "Starts, all 20 mm off, that end within 5° and 5 mm of the truth",
        x: (
            "initial rotation error, degrees",
            0.0..180.0,
            vec![0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0],
        ),
        y: (
            "found, % of 80 starts",
            0.0..100.0,
            vec![0.0, 20.0, 40.0, 60.0, 80.0, 100.0],
        ),
        log: false,
    };
    let mut svg = axes.draw();
    axes.plot(&mut svg, &lines);
    Ok(svg)
}
