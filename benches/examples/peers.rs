//! The side of this project in the comparison with other libraries, run by `cargo xtask peers`.
//!
//! `peers FOLDER NOISE` reads commands from standard input and prints a line of JSON for each:
//!
//! - `load NUMBER` creates an instance and writes it to a folder of that name: raw little-endian
//!   arrays and a `meta.json`.
//! - `run ROW` runs a row once. The reply has the time in nanoseconds and, where they apply, the
//!   items, the iterations and the pose.

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use hicp_benches::forget_renders;
use hicp_benches::fused::Fused;
use hicp_benches::instances::{Instance, instance, with_10_000_triangles};
use hicp_benches::peer::{Failure, matrix, serve, write_floats};
use hicp_benches::selected;
use hybrid_icp::association::{
    DataAssociation, MaxDistance, NearestNeighbor, OutlierFilter, PointSelection, Projective,
    Stride, VisibleSurface,
};
use hybrid_icp::core::{
    Context, DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Problem, RenderedView,
    Renderer, Surfel, TriMesh,
};
use hybrid_icp::icp::{Icp, IterationLimit, Session, SmallMotion, Stage, Workspace};
use hybrid_icp::metric::{ErrorMetric, Generalized, PointToPlane, PointToPoint};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::{MeanVsd, Score};
use hybrid_icp::{Preset, presets};
use serde_json::{Value, json};

/// Maximum distance of a pair in all stages, meters.
///
/// It is larger than the error of any start. The other libraries use the same value.
const GATE_METERS: f64 = 0.03;

/// Stop rule: the next increment is below 0.1 mm and 0.01°, or there were 100 evaluations.
const STOP: (SmallMotion, IterationLimit) = (
    SmallMotion {
        translation_meters: 1e-4,
        rotation_degrees: 0.01,
    },
    IterationLimit(100),
);

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, noise] = &arguments[..] else {
        return Err("expected FOLDER NOISE".into());
    };
    let noise = noise.parse()?;
    let mut bench = Bench {
        workspace: Workspace::new(Rasterizer::default()),
        rasterizer: Rasterizer::default(),
        view: RenderedView::default(),
    };
    let mut loaded: Option<Loaded> = None;
    serve(|line| match line.split_once(' ') {
        Some(("load", number)) => {
            let instance = Loaded::new(instance(number.parse()?, noise))?;
            write(&Path::new(folder).join(number), &instance)?;
            loaded = Some(instance);
            Ok(json!({ "loaded": number }))
        }
        Some(("run", row)) => {
            let unloaded = "no instance is loaded: send `load NUMBER` first";
            bench.run(row, loaded.as_ref().ok_or(unloaded)?)
        }
        _ => Err(format!("unknown command {line:?}").into()),
    })
}

/// Writes the arrays that the other libraries register.
fn write(folder: &Path, loaded: &Loaded) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)?;
    let (instance, scene) = (&loaded.instance, &loaded.instance.scene);
    let (observation, camera) = (&scene.observation, scene.observation.camera());
    write_mesh(folder, loaded.fine.mesh())?;
    let depths = observation.depth().pixels().iter().copied();
    write_floats(folder, "depth", depths)?;
    let mask = observation.mask().pixels().iter().map(|m| u8::from(*m));
    std::fs::write(folder.join("mask.u8"), mask.collect::<Vec<_>>())?;
    write_surfels(folder, "source", &instance.source)?;
    // The other libraries register against every masked pixel that has a surfel.
    let target: Vec<Surfel> = observation.surfels(1).map(|(_, s)| *s).collect();
    write_surfels(folder, "target", &target)?;
    let meta = json!({
        "object": instance.object,
        "camera": [camera.fx(), camera.fy(), camera.cx(), camera.cy()],
        "size": [camera.width(), camera.height()],
        "diameter": scene.model.diameter(),
        "center": scene.model.center().coords.as_slice(),
        "truth": matrix(&scene.truth),
        "init": matrix(&instance.init),
    });
    std::fs::write(folder.join("meta.json"), serde_json::to_vec(&meta)?)?;
    Ok(())
}

fn write_mesh(folder: &Path, mesh: &TriMesh) -> Result<(), Failure> {
    let vertices = mesh.vertices().iter().flat_map(|p| [p.x, p.y, p.z]);
    write_floats(folder, "fine_vertices", vertices)?;
    let corners: Vec<u8> = mesh
        .triangles()
        .iter()
        .flatten()
        .flat_map(|i| i.to_le_bytes())
        .collect();
    std::fs::write(folder.join("fine_triangles.u32"), corners)?;
    Ok(())
}

fn write_surfels(folder: &Path, name: &str, surfels: &[Surfel]) -> Result<(), Failure> {
    let numbers = surfels.iter().flat_map(|s| {
        let (p, n) = (s.point, s.normal);
        [p.x, p.y, p.z, n.x, n.y, n.z]
    });
    write_floats(folder, name, numbers)
}

/// Selects the points that it holds.
#[derive(Clone)]
struct Given(Vec<Surfel>);

impl PointSelection for Given {
    fn select(&mut self, _: &mut Context<'_>, _: &Isometry3<f64>, source: &mut Vec<Surfel>) {
        source.extend_from_slice(&self.0);
    }
}

/// An instance and the data prepared from it.
struct Loaded {
    instance: Instance,
    /// The model with a mesh of 10,000 triangles.
    fine: Model,
    /// The same pixels of the object in an image of 1920×1080.
    wide: (DepthImage, Mask, PinholeCamera),
    every_pixel: Vec<Surfel>,
    fused: Option<Fused>,
}

impl Loaded {
    fn new(instance: Instance) -> Result<Self, Failure> {
        let (model, observation) = (&instance.scene.model, &instance.scene.observation);
        let mut selection = VisibleSurface::with_stride(Stride::Pixels(1));
        let (every_pixel, _) = selected(&instance.scene, &instance.init, &mut selection);
        Ok(Self {
            fine: with_10_000_triangles(model),
            wide: widened(observation)?,
            fused: Fused::new(observation, &every_pixel),
            every_pixel,
            instance,
        })
    }
}

fn widened(observation: &Observation) -> Result<(DepthImage, Mask, PinholeCamera), Failure> {
    let (left, top) = (640, 300);
    let c = observation.camera();
    let (cx, cy) = (c.cx() + left as f64, c.cy() + top as f64);
    let camera = PinholeCamera::new(c.fx(), c.fy(), cx, cy, 1920, 1080)?;
    let (mut depth, mut mask) = (vec![0.0; 1920 * 1080], vec![false; 1920 * 1080]);
    let width = c.width() as usize;
    for v in 0..c.height() as usize {
        let (from, to) = (v * width, (v + top) * 1920 + left);
        depth[to..to + width].copy_from_slice(&observation.depth().pixels()[from..from + width]);
        mask[to..to + width].copy_from_slice(&observation.mask().pixels()[from..from + width]);
    }
    let depth = DepthImage::from_meters(1920, 1080, depth)?;
    Ok((depth, Mask::new(1920, 1080, mask)?, camera))
}

/// Scratch memory that stays warm between runs, as in the other libraries.
struct Bench {
    workspace: Workspace,
    rasterizer: Rasterizer,
    view: RenderedView,
}

impl Bench {
    /// Runs a row once.
    fn run(&mut self, row: &str, loaded: &Loaded) -> Result<Value, Failure> {
        let Instance { scene, source, .. } = &loaded.instance;
        let (every_pixel, observation) = (&loaded.every_pixel, &scene.observation);
        let (wide_depth, wide_mask, wide_camera) = &loaded.wide;
        let camera = observation.camera();
        let nearest = NearestNeighbor::default();
        let gate = MaxDistance::meters(GATE_METERS);
        match row {
            "observe" => observe(observation.depth(), observation.mask(), camera),
            "observe-1080" => observe(wide_depth, wide_mask, wide_camera),
            "render" => Ok(self.render(&scene.model, camera, loaded)),
            "render-fine" => Ok(self.render(&loaded.fine, camera, loaded)),
            "render-fine-1080" => Ok(self.render(&loaded.fine, wide_camera, loaded)),
            "mve" => Ok(self.mve(loaded)),
            "fused" => fused(loaded),
            "projective-every-pixel" => self.icp(loaded, every_pixel, Projective, (), PointToPlane),
            "projective" => self.icp(loaded, source, Projective, (), PointToPlane),
            "nn-point-to-point" => self.icp(loaded, source, nearest, gate, PointToPoint),
            "nn-point-to-plane" => self.icp(loaded, source, nearest, gate, PointToPlane),
            "nn-generalized" => self.icp(loaded, source, nearest, gate, Generalized::default()),
            "depth-to-pose/estimate" => {
                self.depth_to_pose(presets::estimate_with(presets::local()), loaded)
            }
            _ => {
                let preset: Preset = row.strip_prefix("depth-to-pose/").unwrap_or(row).parse()?;
                self.depth_to_pose(preset.build(), loaded)
            }
        }
    }

    fn render(&mut self, model: &Model, camera: &PinholeCamera, loaded: &Loaded) -> Value {
        let (mesh, init) = (model.mesh(), &loaded.instance.init);
        let _ = mesh.facing();
        let start = Instant::now();
        self.rasterizer
            .render(mesh, camera, init, &camera.region(), &mut self.view);
        let elapsed = nanoseconds(start);
        let region = self.view.region();
        json!({
            "ns": elapsed,
            "items": self.view.n_rendered(),
            "box": [region.u_min, region.v_min, region.u_max, region.v_max],
        })
    }

    /// Scores without the render, which is in the cache. Items are the pixels of the union.
    fn mve(&mut self, loaded: &Loaded) -> Value {
        let Instance { scene, init, .. } = &loaded.instance;
        let observation = &scene.observation;
        let view = (self.workspace).view(&scene.model, observation.camera(), init);
        let union = view
            .covered()
            .filter(|&(u, v)| observation.mask().get(u, v) == Some(false))
            .count()
            + observation.n_measured();
        let start = Instant::now();
        let problem = Problem::new(&scene.model, observation);
        let mut context = self.workspace.context(&problem);
        let mve = MeanVsd::default().score(&mut context, init);
        json!({ "ns": nanoseconds(start), "items": union, "score": mve })
    }

    /// Runs a stage from given points, on an observation without a search tree.
    fn icp(
        &mut self,
        loaded: &Loaded,
        source: &[Surfel],
        association: impl DataAssociation,
        filter: impl OutlierFilter,
        metric: impl ErrorMetric,
    ) -> Result<Value, Failure> {
        let mut stage = Icp {
            selection: Given(source.to_vec()),
            association,
            filter,
            metric,
            stop: STOP,
        };
        let observation = loaded.instance.scene.observe_again();
        // The time of the normals is not measured here.
        black_box(observation.n_surfels());
        let start = Instant::now();
        Ok(self.refine(loaded, &observation, &mut stage, source.len(), start))
    }

    /// Refines from the depth image to the pose, including normals, renders, scores and trees.
    fn depth_to_pose(&mut self, mut stage: impl Stage, loaded: &Loaded) -> Result<Value, Failure> {
        let seen = &loaded.instance.scene.observation;
        // The cache must not contain a render of an earlier run.
        let problem = Problem::new(&loaded.instance.scene.model, seen);
        forget_renders(&mut self.workspace, &problem, &loaded.instance.init);
        let (depth, mask) = (seen.depth().clone(), seen.mask().clone());
        let start = Instant::now();
        let observation = Observation::new(depth, mask, *seen.camera())?;
        Ok(self.refine(loaded, &observation, &mut stage, 0, start))
    }

    /// Returns the pose and the time since `start`.
    fn refine(
        &mut self,
        loaded: &Loaded,
        observation: &Observation,
        stage: &mut dyn Stage,
        items: usize,
        start: Instant,
    ) -> Value {
        let Instance { scene, init, .. } = &loaded.instance;
        let problem = Problem::new(&scene.model, observation);
        let mut observer = ();
        let mut session = Session::new(&mut self.workspace, &mut observer);
        let outcome = stage.run(&problem, init, &mut session);
        json!({
            "ns": nanoseconds(start),
            "items": items,
            "iterations": outcome.iterations,
            "ended": outcome.termination.name(),
            "pose": matrix(&outcome.camera_from_object),
        })
    }
}

/// Observes a depth image and estimates its normals. Items are the pixels of the mask's box.
fn observe(depth: &DepthImage, mask: &Mask, camera: &PinholeCamera) -> Result<Value, Failure> {
    let (depth, mask) = (depth.clone(), mask.clone());
    let start = Instant::now();
    let observation = Observation::new(depth, mask, *camera)?;
    black_box(observation.n_surfels());
    Ok(json!({ "ns": nanoseconds(start), "items": observation.region().area() }))
}

/// Runs the hand-written loop with the stop rule of the stages.
fn fused(loaded: &Loaded) -> Result<Value, Failure> {
    let Some(fused) = &loaded.fused else {
        return Ok(Value::Null);
    };
    let start = Instant::now();
    let mut pose = loaded.instance.init;
    let mut iterations = 0;
    loop {
        let center = pose * loaded.instance.scene.model.center();
        let increment = fused
            .step(&pose, &center)
            .ok_or("the pairs do not determine a step")?;
        iterations += 1;
        let moved = (increment * center - center).norm();
        let small = moved < STOP.0.translation_meters
            && increment.rotation.angle().to_degrees() < STOP.0.rotation_degrees;
        if small || iterations >= STOP.1.0 {
            break;
        }
        pose = increment * pose;
    }
    Ok(json!({
        "ns": nanoseconds(start),
        "items": loaded.every_pixel.len(),
        "iterations": iterations,
        "pose": matrix(&pose),
    }))
}

fn nanoseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e9
}
