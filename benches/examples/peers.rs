//! Our side of the comparison with other libraries: `benches/peers/peers.py` starts it, `cargo xtask peers` starts both.
//!
//! - `peers generate FOLDER COUNT NOISE` writes the instances, a folder each: raw little-endian arrays and a `meta.json`.
//! - `peers serve FOLDER` reads commands from the standard input: `load NUMBER` reads an instance, `run ROW` does one thing once
//!   and answers with a line of JSON: nanoseconds, and, where they make sense, items, iterations and the pose found.

use std::io::{BufRead as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::Instant;

use hicp_benches::forget_renders;
use hicp_benches::fused::Fused;
use hicp_benches::instances::{Instance, instance, with_10_000_triangles};
use hicp_benches::stages::{GATE_METERS, STOP};
use hybrid_icp::Preset;
use hybrid_icp::association::{
    DataAssociation, MaxDistance, NearestNeighbor, OutlierFilter, PointSelection, Projective,
    Stride, VisibleSurface,
};
use hybrid_icp::core::{
    Context, DepthImage, Isometry3, Mask, Matrix3, Model, ModelConfig, Observation, PinholeCamera,
    Point3, Problem, RenderedView, Renderer, Surfel, Translation3, TriMesh, UnitVector3, Vector3,
    rotation_from_matrix, se3,
};
use hybrid_icp::icp::{Icp, Outcome, Session, Stage, Workspace};
use hybrid_icp::metric::{ErrorMetric, Generalized, PointToPlane, PointToPoint};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::{MeanVsd, Score};
use serde_json::{Value, json};

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["generate", folder, count, noise] => {
            let noise = noise.parse()?;
            for number in 0..count.parse::<usize>()? {
                let folder = Path::new(folder).join(number.to_string());
                write(&folder, &instance(number, noise))?;
            }
            Ok(())
        }
        ["serve", folder] => serve(Path::new(folder)),
        _ => Err("expected `generate FOLDER COUNT NOISE` or `serve FOLDER`".into()),
    }
}

// ---- files

fn write(folder: &Path, instance: &Instance) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)?;
    let (scene, observation) = (&instance.scene, &instance.scene.observation);
    let fine = with_10_000_triangles(&scene.model);
    write_mesh(folder, "", scene.model.mesh())?;
    write_mesh(folder, "fine_", fine.mesh())?;
    write_floats(
        folder,
        "depth",
        observation.depth().pixels().iter().copied(),
    )?;
    let mask: Vec<u8> = observation
        .mask()
        .pixels()
        .iter()
        .map(|m| u8::from(*m))
        .collect();
    std::fs::write(folder.join("mask.u8"), mask)?;
    write_surfels(folder, "source", &instance.source)?;
    // What the others register against: every masked pixel that has a surfel.
    let target: Vec<Surfel> = observation.surfels(1).map(|(_, s)| *s).collect();
    write_surfels(folder, "target", &target)?;
    let camera = observation.camera();
    let meta = json!({
        "object": instance.object,
        "camera": [camera.fx(), camera.fy(), camera.cx(), camera.cy()],
        "size": [camera.width(), camera.height()],
        "diameter": scene.model.diameter(),
        "center": scene.model.center().coords.as_slice(),
        "truth": scene.truth.to_homogeneous().transpose().as_slice(),
        "init": instance.init.to_homogeneous().transpose().as_slice(),
    });
    std::fs::write(folder.join("meta.json"), serde_json::to_vec(&meta)?)?;
    Ok(())
}

fn write_mesh(folder: &Path, prefix: &str, mesh: &TriMesh) -> Result<(), Failure> {
    let vertices = mesh.vertices().iter().flat_map(|p| [p.x, p.y, p.z]);
    write_floats(folder, &format!("{prefix}vertices"), vertices)?;
    let corners: Vec<u8> = mesh
        .triangles()
        .iter()
        .flatten()
        .flat_map(|i| i.to_le_bytes())
        .collect();
    std::fs::write(folder.join(format!("{prefix}triangles.u32")), corners)?;
    Ok(())
}

fn write_surfels(folder: &Path, name: &str, surfels: &[Surfel]) -> Result<(), Failure> {
    let numbers = surfels.iter().flat_map(|s| {
        let (p, n) = (s.point, s.normal);
        [p.x, p.y, p.z, n.x, n.y, n.z]
    });
    write_floats(folder, name, numbers)
}

fn write_floats(
    folder: &Path,
    name: &str,
    numbers: impl Iterator<Item = f32>,
) -> Result<(), Failure> {
    let bytes: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
    Ok(std::fs::write(folder.join(format!("{name}.f32")), bytes)?)
}

fn read_floats(folder: &Path, name: &str) -> Result<Vec<f32>, Failure> {
    let bytes = std::fs::read(folder.join(format!("{name}.f32")))?;
    let (chunks, _) = bytes.as_chunks::<4>();
    Ok(chunks.iter().map(|c| f32::from_le_bytes(*c)).collect())
}

fn read_mesh(folder: &Path, prefix: &str) -> Result<TriMesh, Failure> {
    let numbers = read_floats(folder, &format!("{prefix}vertices"))?;
    let (vertices, _) = numbers.as_chunks::<3>();
    let bytes = std::fs::read(folder.join(format!("{prefix}triangles.u32")))?;
    let (chunks, _) = bytes.as_chunks::<4>();
    let indices: Vec<u32> = chunks.iter().map(|c| u32::from_le_bytes(*c)).collect();
    let (triangles, _) = indices.as_chunks::<3>();
    let vertices = vertices.iter().map(|v| Point3::from(*v)).collect();
    Ok(TriMesh::new(vertices, triangles.to_vec())?)
}

fn read_pose(numbers: &Value) -> Result<Isometry3<f64>, Failure> {
    let m: Vec<f64> = serde_json::from_value(numbers.clone())?;
    if m.len() != 16 {
        return Err(format!("a pose holds {} numbers, expected 16", m.len()).into());
    }
    let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    let translation = Translation3::from(Vector3::new(m[3], m[7], m[11]));
    Ok(Isometry3::from_parts(
        translation,
        rotation_from_matrix(&rotation)?,
    ))
}

// ---- what is measured

/// Registers the points that it is given.
#[derive(Clone)]
struct Given(Vec<Surfel>);

impl PointSelection for Given {
    fn select(&mut self, _: &mut Context<'_>, _: &Isometry3<f64>, source: &mut Vec<Surfel>) {
        source.extend_from_slice(&self.0);
    }
}

struct Loaded {
    model: Model,
    fine: Model,
    depth: DepthImage,
    mask: Mask,
    camera: PinholeCamera,
    wide: (DepthImage, Mask, PinholeCamera),
    observation: Observation,
    init: Isometry3<f64>,
    source: Vec<Surfel>,
    every_pixel: Vec<Surfel>,
    fused: Option<Fused>,
}

fn load(folder: &Path) -> Result<Loaded, Failure> {
    let meta: Value = serde_json::from_slice(&std::fs::read(folder.join("meta.json"))?)?;
    let numbers: [f64; 4] = serde_json::from_value(meta["camera"].clone())?;
    let [width, height]: [u32; 2] = serde_json::from_value(meta["size"].clone())?;
    let [fx, fy, cx, cy] = numbers;
    let camera = PinholeCamera::new(fx, fy, cx, cy, width, height)?;
    let depth = read_floats(folder, "depth")?;
    let mask: Vec<bool> = std::fs::read(folder.join("mask.u8"))?
        .iter()
        .map(|m| *m != 0)
        .collect();

    // The same pixels of the object in an image of 1920×1080.
    let (left, top) = (640, 300);
    let wide_camera = PinholeCamera::new(fx, fy, cx + 640.0, cy + 300.0, 1920, 1080)?;
    let mut wide_depth = vec![0.0; 1920 * 1080];
    let mut wide_mask = vec![false; 1920 * 1080];
    for v in 0..height as usize {
        for u in 0..width as usize {
            let (from, to) = (v * width as usize + u, (v + top) * 1920 + u + left);
            wide_depth[to] = depth[from];
            wide_mask[to] = mask[from];
        }
    }
    let wide = (
        DepthImage::from_meters(1920, 1080, wide_depth)?,
        Mask::new(1920, 1080, wide_mask)?,
        wide_camera,
    );

    let depth = DepthImage::from_meters(width, height, depth)?;
    let mask = Mask::new(width, height, mask)?;
    let config = ModelConfig {
        diameter: meta["diameter"].as_f64(),
        ..ModelConfig::default()
    };
    let model = Model::with_config(read_mesh(folder, "")?, config.clone());
    let fine = Model::with_config(read_mesh(folder, "fine_")?, config);
    let numbers = read_floats(folder, "source")?;
    let (surfels, _) = numbers.as_chunks::<6>();
    let source = surfels
        .iter()
        .map(|s| Surfel {
            point: Point3::new(s[0], s[1], s[2]),
            normal: UnitVector3::new_unchecked(Vector3::new(s[3], s[4], s[5])),
        })
        .collect();
    let observation = Observation::new(depth.clone(), mask.clone(), camera)?;
    let init = read_pose(&meta["init"])?;
    let mut every_pixel = Vec::new();
    let stride = Stride::Pixels(1);
    VisibleSurface { stride }.select(
        &mut Workspace::new(Rasterizer::default()).context(&Problem::new(&model, &observation)),
        &init,
        &mut every_pixel,
    );
    Ok(Loaded {
        fused: Fused::new(&observation, &every_pixel),
        model,
        fine,
        depth,
        mask,
        camera,
        wide,
        observation,
        init,
        source,
        every_pixel,
    })
}

/// Scratch memory that stays warm from run to run, as that of the other libraries does.
struct Bench {
    workspace: Workspace,
    rasterizer: Rasterizer,
    view: RenderedView,
}

impl Bench {
    /// Does what a row names, once.
    fn run(&mut self, row: &str, loaded: &Loaded) -> Result<Value, Failure> {
        let nearest = NearestNeighbor::default();
        let gate = MaxDistance::meters(GATE_METERS);
        match row {
            "observe" => observe(&loaded.depth, &loaded.mask, loaded.camera),
            "observe-1080" => observe(&loaded.wide.0, &loaded.wide.1, loaded.wide.2),
            "render" => Ok(self.render(&loaded.model, loaded.camera, loaded)),
            "render-fine" => Ok(self.render(&loaded.fine, loaded.camera, loaded)),
            "render-fine-1080" => Ok(self.render(&loaded.fine, loaded.wide.2, loaded)),
            "mve" => Ok(self.mve(loaded)),
            "fused" => fused(loaded),
            "projective-every-pixel" => {
                Ok(self.icp(loaded, &loaded.every_pixel, Projective, (), PointToPlane))
            }
            "projective" => Ok(self.icp(loaded, &loaded.source, Projective, (), PointToPlane)),
            "nn-point-to-point" => {
                Ok(self.icp(loaded, &loaded.source, nearest, gate, PointToPoint))
            }
            "nn-point-to-plane" => {
                Ok(self.icp(loaded, &loaded.source, nearest, gate, PointToPlane))
            }
            "nn-generalized" => {
                let metric = Generalized::default();
                Ok(self.icp(loaded, &loaded.source, nearest, gate, metric))
            }
            _ => {
                let preset: Preset = row.strip_prefix("depth-to-pose/").unwrap_or(row).parse()?;
                self.depth_to_pose(preset, loaded)
            }
        }
    }

    fn render(&mut self, model: &Model, camera: PinholeCamera, loaded: &Loaded) -> Value {
        let _ = model.mesh().facing();
        let start = Instant::now();
        self.rasterizer.render(
            model.mesh(),
            &camera,
            &loaded.init,
            &camera.region(),
            &mut self.view,
        );
        let elapsed = nanoseconds(start);
        let filled = self.view.n_rendered();
        let region = self.view.region();
        json!({
            "ns": elapsed,
            "items": filled,
            "box": [region.u_min, region.v_min, region.u_max, region.v_max],
        })
    }

    /// The score beyond its render, which is in the cache; items are the pixels of the union.
    fn mve(&mut self, loaded: &Loaded) -> Value {
        let camera = loaded.observation.camera();
        let view = self.workspace.view(&loaded.model, camera, &loaded.init);
        let region = view.region();
        let width = loaded.mask.width();
        let union = (region.v_min..region.v_max)
            .flat_map(|v| (region.u_min..region.u_max).map(move |u| (u, v)))
            .filter(|&(u, v)| view.depth_at(u, v) > 0.0)
            .filter(|&(u, v)| !loaded.mask.pixels()[(v * width + u) as usize])
            .count()
            + loaded.observation.n_measured();
        let start = Instant::now();
        let problem = Problem::new(&loaded.model, &loaded.observation);
        let mut context = self.workspace.context(&problem);
        let mve = MeanVsd::default().score(&mut context, &loaded.init);
        json!({ "ns": nanoseconds(start), "items": union, "score": mve })
    }

    /// A stage from given points, on an observation whose search tree is yet to be built.
    fn icp<A, F, M>(
        &mut self,
        loaded: &Loaded,
        source: &[Surfel],
        association: A,
        filter: F,
        metric: M,
    ) -> Value
    where
        A: DataAssociation,
        F: OutlierFilter,
        M: ErrorMetric,
    {
        let observed = Observation::new(loaded.depth.clone(), loaded.mask.clone(), loaded.camera);
        let Ok(observation) = observed else {
            return Value::Null;
        };
        let mut stage = Icp {
            selection: Given(source.to_vec()),
            association,
            filter,
            metric,
            stop: STOP,
        };
        let problem = Problem::new(&loaded.model, &observation);
        let mut nobody = ();
        let mut session = Session::new(&mut self.workspace, &mut nobody);
        let start = Instant::now();
        let outcome = stage.run(&problem, &loaded.init, &mut session);
        answer(nanoseconds(start), source.len(), &outcome)
    }

    /// Everything from the depth image to the pose: normals, renders, scores and trees.
    fn depth_to_pose(&mut self, preset: Preset, loaded: &Loaded) -> Result<Value, Failure> {
        let mut stage = preset.build();
        // The renders of the run before would be found in the cache.
        let problem = Problem::new(&loaded.model, &loaded.observation);
        forget_renders(&mut self.workspace, &problem, &loaded.init);
        let (depth, mask) = (loaded.depth.clone(), loaded.mask.clone());
        let start = Instant::now();
        let observation = Observation::new(depth, mask, loaded.camera)?;
        let problem = Problem::new(&loaded.model, &observation);
        let mut nobody = ();
        let mut session = Session::new(&mut self.workspace, &mut nobody);
        let outcome = stage.run(&problem, &loaded.init, &mut session);
        Ok(answer(nanoseconds(start), 0, &outcome))
    }
}

/// Items are the pixels of the mask's box.
fn observe(depth: &DepthImage, mask: &Mask, camera: PinholeCamera) -> Result<Value, Failure> {
    let (depth, mask) = (depth.clone(), mask.clone());
    let start = Instant::now();
    let observation = Observation::new(depth, mask, camera)?;
    Ok(json!({ "ns": nanoseconds(start), "items": observation.region().area() }))
}

/// The hand-written loop with the stop rule of the stages.
fn fused(loaded: &Loaded) -> Result<Value, Failure> {
    let Some(fused) = &loaded.fused else {
        return Ok(Value::Null);
    };
    let start = Instant::now();
    let mut pose = loaded.init;
    let mut iterations = 0;
    loop {
        let center = pose * loaded.model.center();
        let increment = fused
            .step(&pose, &center)
            .ok_or("the pairs determine no step")?;
        iterations += 1;
        let moved = (increment * center - center).norm();
        let small = moved < STOP.0.translation_meters
            && increment.rotation.angle().to_degrees() < STOP.0.rotation_degrees;
        if small || iterations >= STOP.1.0 {
            break;
        }
        pose = increment * pose;
    }
    let elapsed = nanoseconds(start);
    Ok(json!({
        "ns": elapsed,
        "items": loaded.every_pixel.len(),
        "iterations": iterations,
        "pose": pose.to_homogeneous().transpose().as_slice(),
    }))
}

fn answer(nanoseconds: f64, items: usize, outcome: &Outcome) -> Value {
    let pose = outcome.camera_from_object;
    debug_assert!(se3::is_finite(&pose));
    json!({
        "ns": nanoseconds,
        "items": items,
        "iterations": outcome.iterations,
        "ended": outcome.termination.name(),
        "pose": pose.to_homogeneous().transpose().as_slice(),
    })
}

fn nanoseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e9
}

fn serve(folder: &Path) -> Result<(), Failure> {
    let mut bench = Bench {
        workspace: Workspace::new(Rasterizer::default()),
        rasterizer: Rasterizer::default(),
        view: RenderedView::default(),
    };
    let mut loaded: Option<Loaded> = None;
    let mut output = std::io::stdout();
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let answer = match line.split_once(' ') {
            Some(("load", number)) => {
                let folder: PathBuf = folder.join(number);
                loaded = Some(load(&folder)?);
                json!({ "loaded": number })
            }
            Some(("run", row)) => {
                let loaded = loaded.as_ref().ok_or("nothing is loaded")?;
                bench.run(row, loaded)?
            }
            _ => return Err(format!("unknown command {line:?}").into()),
        };
        writeln!(output, "{answer}")?;
        output.flush()?;
    }
    Ok(())
}
