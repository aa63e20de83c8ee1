//! The points that are selected, and the pairs that are made of them.

use std::error::Error;

use hicp_sim::{Household, perturb, rng};
use hybrid_icp::association::{
    AllSamples, DataAssociation, MaxDistance, MaxNormalAngle, NearestNeighbor, OutlierFilter,
    PointSelection, Projective, Stride, VisibleSurface,
};
use hybrid_icp::core::{
    Context, Correspondences, Isometry3, Iteration, Observation, Pair, Point3, Problem, Surfel,
};
use hybrid_icp::icp::Workspace;
use hybrid_icp::raster::Rasterizer;

use crate::scene::{Scene, close};
use crate::svg::{AFTER, Anchor, BAD, BEFORE, GOOD, GRAY, INK, OTHER, Place, Svg};

type Drawn = Result<Svg, Box<dyn Error>>;

/// A mug with its handle to the left, and a pose that is 12 mm and 14° off.
fn mug() -> Result<(Scene, Observation, Isometry3<f64>), Box<dyn Error>> {
    let scene = Scene::on_a_table(0.5, &[(Household::Mug, 0.0, 0.0, 160.0)])?;
    let truth = scene.objects[0].camera_from_object;
    let rough = perturb(&mut rng(8), &truth, 0.012, 14_f64.to_radians());
    let observation = scene.observe(0)?;
    Ok((scene, observation, rough))
}

pub(crate) fn selection() -> Drawn {
    let (scene, observation, rough) = mug()?;
    let model = &scene.objects[0].model;
    let problem = Problem::new(model, &observation);
    let mut svg = Svg::new(840.0, 400.0);
    let seen = (10.0, BEFORE, "toward the camera");
    key(&mut svg, &[seen, (190.0, OTHER, "away from the camera")]);
    let mut visible = VisibleSurface::with_stride(Stride::Pixels(6));
    let panels: [(f64, &mut dyn PointSelection, &str); 2] = [
        (10.0, &mut AllSamples, "AllSamples: the whole surface"),
        (
            425.0,
            &mut visible,
            "VisibleSurface: what the camera sees at this pose",
        ),
    ];
    for (x, selection, caption) in panels {
        let mut workspace = Workspace::new(Rasterizer::default());
        let mut source = Vec::new();
        selection.select(&mut workspace.context(&problem), &rough, &mut source);
        scene.panel(&mut svg, (x, 40.0), 405.0, (205, 130, 240, 190))?;
        let step = source.len().div_ceil(500);
        for surfel in source.iter().step_by(step) {
            let point = rough * surfel.point.cast();
            let normal = rough.rotation * surfel.normal.cast::<f64>().into_inner();
            let Some(pixel) = scene.camera.project(&point) else {
                continue;
            };
            let is_seen = normal.dot(&point.coords) < 0.0;
            svg.dot(
                (pixel.x, pixel.y),
                1.1,
                if is_seen { BEFORE } else { OTHER },
            );
        }
        close(&mut svg);
        svg.text((x, 388.0), 15, INK, Anchor::Start, caption);
    }
    Ok(svg)
}

/// A slice of the scene seen from the side: the camera is far to the left.
struct Slice {
    center: Point3<f64>,
    left: f64,
}

/// Half the thickness of the slice, meters.
const HALF_METERS: f64 = 0.0011;
/// Pixels of the picture per meter, and the middle of a panel.
const SCALE: f64 = 2350.0;
const MIDDLE: Place = (200.0, 185.0);

impl Slice {
    fn holds(&self, point: &Point3<f32>) -> bool {
        (f64::from(point.x) - self.center.x).abs() < HALF_METERS
    }

    fn place(&self, point: &Point3<f32>) -> Place {
        let (z, y) = (
            f64::from(point.z) - self.center.z,
            f64::from(point.y) - self.center.y,
        );
        (self.left + MIDDLE.0 + SCALE * z, MIDDLE.1 + SCALE * y)
    }

    /// Draws the observed points, and pairs with their colors.
    fn draw(
        &self,
        svg: &mut Svg,
        observation: &Observation,
        pairs: &Correspondences,
        color: impl Fn(&Pair) -> &'static str,
    ) {
        for (_, surfel) in observation.surfels(1).filter(|(_, s)| self.holds(&s.point)) {
            svg.dot(self.place(&surfel.point), 1.6, AFTER);
        }
        let shown = pairs
            .as_slice()
            .iter()
            .filter(|pair| self.holds(&pair.source.point));
        for pair in shown.clone() {
            let (from, to) = (
                self.place(&pair.source.point),
                self.place(&pair.target.point),
            );
            svg.path(
                &[from, to],
                &format!(r#"stroke="{}" stroke-width="1.3""#, color(pair)),
            );
        }
        for pair in shown {
            svg.dot(self.place(&pair.target.point), 1.6, AFTER);
            svg.dot(self.place(&pair.source.point), 2.4, BEFORE);
        }
        let y = 330.0;
        let arrow = r##"fill="none" stroke="#7d8590" stroke-width="1.5""##;
        svg.path(&[(self.left + 6.0, y), (self.left + 46.0, y)], arrow);
        svg.path(
            &[
                (self.left + 38.0, y - 5.0),
                (self.left + 46.0, y),
                (self.left + 38.0, y + 5.0),
            ],
            arrow,
        );
        svg.text((self.left + 6.0, y - 10.0), 13, GRAY, Anchor::Start, "view");
    }
}

/// Pairs the visible surface at a pose.
fn paired(
    context: &mut Context<'_>,
    association: &mut dyn DataAssociation,
    pose: &Isometry3<f64>,
) -> Correspondences {
    let mut source: Vec<Surfel> = Vec::new();
    VisibleSurface::with_stride(Stride::Pixels(3)).select(context, pose, &mut source);
    let mut pairs = Correspondences::new();
    association.associate(context, &source, pose, &mut pairs);
    pairs
}

/// The colors of points in a slice.
const SLICE_KEY: [(f64, &str, &str); 2] = [
    (10.0, AFTER, "observed points"),
    (170.0, BEFORE, "model points at the rough pose"),
];

/// Explains colors of points.
fn key(svg: &mut Svg, entries: &[(f64, &str, &str)]) {
    for (x, color, text) in entries {
        svg.dot((x + 5.0, 20.0), 4.5, color);
        svg.text((x + 16.0, 25.0), 14, INK, Anchor::Start, text);
    }
}

pub(crate) fn correspondences() -> Drawn {
    let (scene, observation, rough) = mug()?;
    let model = &scene.objects[0].model;
    let problem = Problem::new(model, &observation);
    let center = scene.objects[0].camera_from_object * model.center();
    let mut workspace = Workspace::new(Rasterizer::default());
    let mut svg = Svg::new(840.0, 400.0);
    key(&mut svg, &SLICE_KEY);
    let panels: [(f64, &mut dyn DataAssociation, &str); 2] = [
        (
            10.0,
            &mut NearestNeighbor::default(),
            "NearestNeighbor: the closest point in space",
        ),
        (
            430.0,
            &mut Projective,
            "Projective: the point on the same ray of the camera",
        ),
    ];
    for (left, association, caption) in panels {
        let pairs = paired(&mut workspace.context(&problem), association, &rough);
        let slice = Slice { center, left };
        slice.draw(&mut svg, &observation, &pairs, |_| GRAY);
        svg.text((left, 388.0), 15, INK, Anchor::Start, caption);
    }
    Ok(svg)
}

pub(crate) fn rejection() -> Drawn {
    let (scene, observation, rough) = mug()?;
    let model = &scene.objects[0].model;
    let problem = Problem::new(model, &observation);
    let center = scene.objects[0].camera_from_object * model.center();
    let mut workspace = Workspace::new(Rasterizer::default());
    let pairs = paired(&mut workspace.context(&problem), &mut Projective, &rough);
    let mut kept = pairs.clone();
    let filter = &mut (MaxDistance::diameters(0.25), MaxNormalAngle::degrees(60.0));
    filter.filter(&Iteration::new(0, &rough, problem), &mut kept);
    let color = |pair: &Pair| {
        let same = |other: &Pair| other.source_index == pair.source_index;
        if kept.as_slice().iter().any(same) {
            GOOD
        } else {
            BAD
        }
    };
    let mut svg = Svg::new(840.0, 400.0);
    key(&mut svg, &SLICE_KEY);
    let panels = [
        (10.0, &pairs, "All pairs; the filters reject the red ones"),
        (430.0, &kept, "After MaxDistance and MaxNormalAngle"),
    ];
    for (left, pairs, caption) in panels {
        Slice { center, left }.draw(&mut svg, &observation, pairs, color);
        svg.text((left, 388.0), 15, INK, Anchor::Start, caption);
    }
    Ok(svg)
}
