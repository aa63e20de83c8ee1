//! Injects faults into the inputs of refinements, and counts how often a diagnosis names them
//! first.
//!
//! Run `cargo run --release -p hicp-tests --example doctor [tuning|test|ycbv] [SCENES]
//! [verbose|clean]`. With `clean`, no faults are injected.
//!
//! The clean inputs are one visible object of each of 20 simulated tabletops (or SCENES), or the
//! instances of the YCB-Video excerpt. Each true pose is disturbed by up to 5 mm and 5°. A case is
//! excluded if its fault changes the MVE of the true pose by no more than a disturbance of 5 mm and
//! 5° does. Distances along the ray change the MVE little; they are excluded if they are at most
//! 10 mm above the depth. Numbers that a diagnosis names must be right, too.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;
use std::time::Instant;

use hicp_io::bop::Dataset;
use hicp_sim::{Household, perturb, stream};
use hicp_tests::tabletop::{MaskKind, Tabletop};
use hybrid_icp::core::{
    DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, PixelRegion, Quaternion,
    Translation3, TriMesh, UnitQuaternion, Vector3,
};
use hybrid_icp::{Diagnosis, Fault, Preset, Refiner};
use rand::RngExt;

type Failure = Box<dyn std::error::Error>;

/// The inputs of a refinement, with the true pose or its faulty form.
#[derive(Clone)]
struct Inputs {
    model: Arc<Model>,
    depth: Arc<DepthImage>,
    mask: Mask,
    camera: PinholeCamera,
    truth: Isometry3<f64>,
    init: Isometry3<f64>,
}

/// The name of a fault, the text that names it, and the injection.
type Injected = (&'static str, &'static str, fn(Inputs) -> Inputs);

#[rustfmt::skip]
const FAULTS: [Injected; 54] = [
    ("mesh: mm read as m", "the mesh is 1000 times too large", |i| i.mesh(1e3, false)),
    ("mesh: m read as mm", "the mesh is 1000 times too small", |i| i.mesh(1e-3, false)),
    ("mesh: cm read as m", "the mesh is 100 times too large", |i| i.mesh(1e2, false)),
    ("mesh: mm read as cm", "the mesh is 10 times too large", |i| i.mesh(10.0, false)),
    ("mesh: cm read as mm", "the mesh is 10 times too small", |i| i.mesh(0.1, false)),
    ("mesh: inches read as mm", "the mesh is 25.4 times too small", |i| i.mesh(1.0 / 25.4, false)),
    ("mesh: size ×0.85", SIZE, |i| i.mesh(0.85, false)),
    ("mesh: size ×0.9", SIZE, |i| i.mesh(0.9, false)),
    ("mesh: size ×1.15", SIZE, |i| i.mesh(1.15, false)),
    ("mesh: inside out", "the mesh is inside out", |i| i.mesh(1.0, true)),
    ("depth: ×10", "the depth is 10 times too large", |i| i.depths(|_, _, z| z * 10.0)),
    ("depth: ×0.1", "the depth is 10 times too small", |i| i.depths(|_, _, z| z * 0.1)),
    ("depth: ×100", "the depth is 100 times too large", |i| i.depths(|_, _, z| z * 100.0)),
    ("depth: ×0.001", "the depth is 1000 times too small", |i| i.depths(|_, _, z| z * 0.001)),
    ("depth: ×4", "the depth is 4 times too large", |i| i.depths(|_, _, z| z * 4.0)),
    ("depth: ×0.2", "the depth is 5 times too small", |i| i.depths(|_, _, z| z * 0.2)),
    (RAY, "the depth image has distances along the ray", |i| {
        let camera = i.camera;
        i.depths(|u, v, z| z * camera.distance_per_depth(u.into(), v.into()))
    }),
    ("depth: inverted", "the depth is inverted", |i| {
        let most = i.depth.pixels().iter().fold(0.0_f32, |a, b| a.max(*b));
        i.depths(|_, _, z| f64::from(most) + 0.1 - z)
    }),
    ("depth: inverted, 16 bits", "the depth is inverted", |i| i.depths(|_, _, z| 6.5535 - z)),
    ("depth: disparity", "the depth image has disparities", |i| {
        let product = 0.05 * i.camera.fx();
        i.depths(|_, _, z| if z > 0.0 { (16.0 * product / z).round() / 16e3 } else { 0.0 })
    }),
    ("depth: 1/z", "the depth image has disparities", |i| i.depths(|_, _, z| 1.0 / z)),
    ("depth: 25 px right", "depth image and mask are not al", |i| i.moved(true, false, 25, 0)),
    ("depth: 30 px up, left", "depth image and mask are not al", |i| i.moved(true, false, -30, -30)),
    ("mask: 25 px right", "depth image and mask are not al", |i| i.moved(false, true, 25, 0)),
    ("mask: 30 px down, left", "depth image and mask are not al", |i| i.moved(false, true, -30, 30)),
    ("image: mirrored, sides", "depth image and mask are mirrored, l", |i| i.mirrored(true, false)),
    ("image: mirrored, top", "depth image and mask are mirrored, t", |i| i.mirrored(false, true)),
    ("camera: twice the resolution", INTRINSICS, |i| i.camera(2.0, 2.0, 0.0)),
    ("camera: half the resolution", INTRINSICS, |i| i.camera(0.5, 0.5, 0.0)),
    ("camera: 1.5 times the resolution", INTRINSICS, |i| i.camera(1.5, 1.5, 0.0)),
    ("camera: 0.75 times the resolution", INTRINSICS, |i| i.camera(0.75, 0.75, 0.0)),
    ("camera: 1280×720, stretched", INTRINSICS, |i| i.camera(2.0, 1.5, 0.0)),
    ("camera: 1280×720, cropped", INTRINSICS, |i| i.camera(1.5, 1.5, 160.0)),
    ("camera: fx, fy and cx, cy exchanged", INTRINSICS, |i| {
        i.intrinsics(|[fx, fy, cx, cy]| [cx, cy, fx, fy])
    }),
    ("camera: cx and cy swapped", INTRINSICS, |i| i.intrinsics(|[fx, fy, cx, cy]| [fx, fy, cy, cx])),
    ("camera: fx, cx, fy, cy", INTRINSICS, |i| i.intrinsics(|[fx, fy, cx, cy]| [fx, cx, fy, cy])),
    ("camera: focal length ×0.8", FOCAL, |i| i.intrinsics(|[fx, fy, cx, cy]| [0.8 * fx, 0.8 * fy, cx, cy])),
    ("camera: focal length ×1.15", FOCAL, |i| i.intrinsics(|[fx, fy, cx, cy]| [1.15 * fx, 1.15 * fy, cx, cy])),
    ("camera: focal length ×1.5", FOCAL, |i| i.intrinsics(|[fx, fy, cx, cy]| [1.5 * fx, 1.5 * fy, cx, cy])),
    ("pose: transposed", "the rotation of the pose is transposed", |i| {
        i.poses(|pose| Isometry3::from_parts(pose.translation, pose.rotation.inverse()))
    }),
    ("pose: inverted", "the pose is inverted", |i| i.poses(Isometry3::inverse)),
    ("pose: OpenGL", "the pose is that of an OpenGL camera", |i| {
        i.poses(|pose| Isometry3::rotation(PI * Vector3::x()) * pose)
    }),
    ("pose: wxyz read as xyzw", "the quaternion of the pose is w, x, y, z", |i| {
        i.quaternions(|[x, y, z, w]| [w, x, y, z])
    }),
    ("pose: xyzw read as wxyz", "the quaternion of the pose is x, y, z, w", |i| {
        i.quaternions(|[x, y, z, w]| [y, z, w, x])
    }),
    ("origin: at a corner", "the pose puts the object elsewhere", |i| i.origin(&[1.0, 1.0, 1.0])),
    ("origin: below the object", "the pose puts the object elsewhere", |i| i.origin(&[0.0, 0.0, 1.0])),
    ("pose: m read as mm", "the translation of the pose is 1000 times too small", |i| {
        i.poses(|pose| Isometry3::from_parts((pose.translation.vector * 1e-3).into(), pose.rotation))
    }),
    ("pose: mm read as m", "the translation of the pose is 1000 times too large", |i| {
        i.poses(|pose| Isometry3::from_parts((pose.translation.vector * 1e3).into(), pose.rotation))
    }),
    ("mask: inverted", "the mask is inverted", |i| i.masks(|i, u, v| i.mask.get(u, v) == Some(false))),
    ("mask: empty", "the mask is empty", |i| i.masks(|_, _, _| false)),
    ("mask: whole image", "the mask covers more than the object", |i| i.masks(|_, _, _| true)),
    ("mask: everything near", "the mask covers more than the object", |i| i.masks(|i, u, v| {
        let b = i.mask.bounding_region();
        let near = |x, low: u32, high| (low.saturating_sub(high - low)..2 * high - low).contains(&x);
        let near = near(u, b.u_min, b.u_max) && near(v, b.v_min, b.v_max);
        near && i.depth.get(u, v) > Some(0.0)
    })),
    // A box may be larger than the bounding sphere.
    ("mask: box with table", "", |i| {
        i.masks(|i, u, v| i.mask.bounding_region().contains(u, v))
    }),
    ("mask: on a wall", "% of the mask show a plane", |i| {
        let (mask, middle) = (i.mask.clone(), i.truth.translation.z);
        i.depths(|u, v, z| match mask.get(u, v) {
            Some(true) => middle + 0.0005 * (f64::from(u) - 320.0) + 0.002 * (z * 1e4).sin(),
            _ => z,
        })
    }),
];
const RAY: &str = "depth: along the ray";
const SIZE: &str = "the mesh is about ";
const FOCAL: &str = "the focal length of the camera is ";
const INTRINSICS: &str = "the intrinsics belong to images of another resolution";

impl Inputs {
    fn observe(&self) -> Observation {
        let depth = Arc::clone(&self.depth);
        Observation::new(depth, self.mask.clone(), self.camera).expect("sizes agree")
    }

    fn poses(mut self, change: impl Fn(&Isometry3<f64>) -> Isometry3<f64>) -> Self {
        (self.truth, self.init) = (change(&self.truth), change(&self.init));
        self
    }

    /// Reorders x, y, z and w of the rotation.
    fn quaternions(self, reorder: impl Fn([f64; 4]) -> [f64; 4]) -> Self {
        self.poses(|pose| {
            let [x, y, z, w] = reorder(pose.rotation.coords.into());
            let rotation = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
            Isometry3::from_parts(pose.translation, rotation)
        })
    }

    /// Makes the pose that of a model whose origin is moved by shares of the radius.
    fn origin(self, radii: &[f64; 3]) -> Self {
        let shift = self.model.radius() / 3_f64.sqrt() * Vector3::from(*radii);
        self.poses(|pose| pose * Translation3::from(shift))
    }

    /// Replaces the depth at every pixel; `new` receives its column, row and depth (0 if missing).
    fn depths(mut self, new: impl Fn(u32, u32, f64) -> f64) -> Self {
        let (width, height) = (self.depth.width(), self.depth.height());
        let places = PixelRegion::of_image(width, height).pixels();
        let depths = places.zip(self.depth.pixels());
        let depths = depths.map(|((u, v), z)| new(u, v, f64::from(*z)) as f32);
        self.depth = Arc::new(DepthImage::collect(width, height, depths).expect("sizes agree"));
        self
    }

    fn masks(mut self, new: impl Fn(&Self, u32, u32) -> bool) -> Self {
        let camera = self.camera;
        let (width, height) = (camera.width(), camera.height());
        self.mask = Mask::in_region(width, height, &camera.region(), |u, v| new(&self, u, v));
        self
    }

    /// Takes depth and mask from other pixels.
    fn from(self, depth: bool, mask: bool, from: impl Fn(u32, u32) -> (u32, u32)) -> Self {
        let before = self.clone();
        let place = |u, v| if depth { from(u, v) } else { (u, v) };
        let after = self.depths(|u, v, _| {
            let (u, v) = place(u, v);
            before.depth.get(u, v).unwrap_or(0.0).into()
        });
        let place = |u, v| if mask { from(u, v) } else { (u, v) };
        after.masks(|_, u, v| {
            let (u, v) = place(u, v);
            before.mask.get(u, v) == Some(true)
        })
    }

    fn moved(self, depth: bool, mask: bool, right: i32, down: i32) -> Self {
        let from = |u: u32, v: u32| (u.wrapping_add_signed(-right), v.wrapping_add_signed(-down));
        self.from(depth, mask, from)
    }

    fn mirrored(self, horizontally: bool, vertically: bool) -> Self {
        let (w, h) = (self.camera.width(), self.camera.height());
        let column = |u| if horizontally { w - 1 - u } else { u };
        let row = |v| if vertically { h - 1 - v } else { v };
        self.from(true, true, |u, v| (column(u), row(v)))
    }

    fn mesh(mut self, factor: f32, flipped: bool) -> Self {
        let mesh = self.model.mesh();
        let vertices = mesh.vertices().iter().map(|p| p * factor).collect();
        let corners = |[a, b, c]: &[u32; 3]| if flipped { [*a, *c, *b] } else { [*a, *b, *c] };
        let triangles = mesh.triangles().iter().map(corners).collect();
        let mesh = TriMesh::new(vertices, triangles).expect("a mesh");
        self.model = Arc::new(Model::new(mesh));
        self
    }

    /// Scales the intrinsics and moves the principal point to the right.
    fn camera(self, x: f64, y: f64, right: f64) -> Self {
        self.intrinsics(|[fx, fy, cx, cy]| [fx * x, fy * y, cx * x + right, cy * y])
    }

    /// Replaces fx, fy, cx and cy.
    fn intrinsics(mut self, new: impl Fn([f64; 4]) -> [f64; 4]) -> Self {
        let c = self.camera;
        let [fx, fy, cx, cy] = new([c.fx(), c.fy(), c.cx(), c.cy()]);
        let camera = PinholeCamera::new(fx, fy, cx, cy, c.width(), c.height());
        self.camera = camera.expect("a camera");
        self
    }

    fn mve(&self, pose: &Isometry3<f64>) -> f64 {
        Refiner::preset(Preset::Hybrid).mve(&self.model, &self.observe(), pose)
    }

    /// Returns the change by a fault and that by noise.
    fn change(&self, faulty: &Self, name: &str, noisy: &Isometry3<f64>) -> (f64, f64) {
        if name == RAY {
            let center = self.truth * self.model.center();
            return (center.coords.norm() - center.z, 0.01);
        }
        let right = self.mve(&self.truth);
        let change = (faulty.mve(&faulty.truth) - right).abs();
        (change, (self.mve(noisy) - right).abs())
    }
}

/// Returns whether a fault is named, with the right numbers.
fn is_named(found: &Fault, expected: &str, inputs: [&Inputs; 2]) -> bool {
    let [clean, faulty] = inputs.map(|inputs| &inputs.camera);
    let [size, faulty_size] = inputs.map(|inputs| inputs.model.radius());
    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 0.01;
    let is_right = match found {
        Fault::Intrinsics { fx, fy, .. } => near(*fx, clean.fx()) && near(*fy, clean.fy()),
        Fault::MeshScale { factor } => (factor * faulty_size / size).ln().abs() < 0.1,
        Fault::FocalLength { factor } => (factor * faulty.fx() / clean.fx()).ln().abs() < 0.1,
        Fault::MaskTooLarge { .. } | Fault::PlaneInMask { .. } => true,
        _ => !expected.is_empty(),
    };
    is_right && found.to_string().contains(expected)
}

#[derive(Default)]
struct Row {
    excluded: usize,
    named: usize,
    missed: usize,
    others: BTreeMap<String, usize>,
}

impl Row {
    fn print(&self, name: &str) {
        let (named, missed) = (self.named, self.missed);
        let percent = 100.0 * named as f64 / (named + missed).max(1) as f64;
        let excluded = self.excluded;
        let others = self.others.iter().map(|(name, n)| format!("{name}: {n}"));
        let others = others.collect::<Vec<_>>().join(", ");
        println!("| {name} | {excluded} | {named} | {missed} | {percent:.1} | {others} |");
    }
}

fn main() -> Result<(), Failure> {
    let mut words = std::env::args().skip(1);
    let set = words.next().unwrap_or_else(|| "tuning".into());
    let scenes = words.next().map_or(Ok(20), |text| text.parse())?;
    let mode = words.next().unwrap_or_default();
    let clean = match set.as_str() {
        "tuning" => simulated(&Household::TUNING, 0, scenes)?,
        "test" => simulated(&Household::TEST, 1_000_000, scenes)?,
        "ycbv" => real()?,
        other => return Err(format!("{other}: expected tuning, test or ycbv").into()),
    };
    let (mut seconds, mut alarms) = (Vec::new(), 0);
    let mut diagnose = |inputs: &Inputs| {
        let observation = inputs.observe();
        let start = Instant::now();
        let diagnosis = Diagnosis::of(&inputs.model, &observation, &inputs.init);
        seconds.push(start.elapsed().as_secs_f64());
        diagnosis
    };
    for (name, inputs) in &clean {
        let diagnosis = diagnose(inputs);
        if let Some(fault) = diagnosis.fault() {
            println!("false alarm: {name}: {fault}: {diagnosis:?}");
            alarms += 1;
        }
    }
    println!("\n| fault | excluded | named first | missed | % | named instead |");
    println!("|---|---:|---:|---:|---:|---|");
    let (mut all, mut excluded) = (Row::default(), Vec::new());
    for (name, expected, inject) in FAULTS.iter().filter(|_| mode != "clean") {
        let mut row = Row::default();
        for ((object, inputs), index) in clean.iter().zip(0..) {
            let faulty = inject(inputs.clone());
            let noisy = disturb(&inputs.truth, index, true);
            let (change, noise) = inputs.change(&faulty, name, &noisy);
            if change <= noise && *name != "mesh: inside out" {
                row.excluded += 1;
                excluded.push(format!("{name}: {object} ({change:.2} of {noise:.2})"));
                continue;
            }
            let diagnosis = diagnose(&faulty);
            match diagnosis.fault() {
                Some(found) if is_named(found, expected, [inputs, &faulty]) => row.named += 1,
                found => {
                    row.missed += 1;
                    let found = found.map_or("nothing".into(), Fault::to_string);
                    *row.others.entry(found).or_default() += 1;
                    if mode == "verbose" {
                        println!("  {name}: {object}: {change:.2} of {noise:.2}: {diagnosis:?}");
                    }
                }
            }
        }
        row.print(name);
        all.excluded += row.excluded;
        all.named += row.named;
        all.missed += row.missed;
    }
    all.print("all");
    seconds.sort_by(f64::total_cmp);
    println!("\nExcluded: {}.", excluded.join("; "));
    println!("\n{alarms} false alarms for {} clean inputs.", clean.len());
    println!(
        "{:.2} s (median), at most {:.2} s.",
        seconds[seconds.len() / 2],
        seconds[seconds.len() - 1]
    );
    Ok(())
}

/// Disturbs a pose by up to 5 mm and 5°, or by exactly as much.
fn disturb(truth: &Isometry3<f64>, index: u64, at_limit: bool) -> Isometry3<f64> {
    let mut random = stream(7, &["doctor"], index);
    let mut share = || match (random.random::<f64>(), at_limit) {
        (_, true) => 1.0,
        (share, false) => share,
    };
    let (meters, degrees) = (0.005 * share(), 5.0 * share());
    perturb(&mut random, truth, meters, degrees.to_radians())
}

fn inputs(
    model: Arc<Model>,
    observation: &Observation,
    truth: Isometry3<f64>,
    index: u64,
) -> Inputs {
    Inputs {
        model,
        depth: Arc::clone(observation.shared_depth()),
        mask: observation.mask().clone(),
        camera: *observation.camera(),
        truth,
        init: disturb(&truth, index, false),
    }
}

/// Returns one visible object of each scene.
fn simulated(
    objects: &[Household],
    first_seed: u64,
    scenes: u64,
) -> Result<Vec<(String, Inputs)>, Failure> {
    let tabletop = Tabletop::new(objects)?;
    let mut clean = Vec::new();
    for index in 0..scenes {
        let visible = tabletop.scene(first_seed + index)?;
        let Some(seen) = visible.get(index as usize % visible.len().max(1)) else {
            continue;
        };
        let (name, model) = &tabletop.objects[seen.model];
        let observation = seen.observe(MaskKind::Exact)?;
        let model = Arc::new(model.clone());
        clean.push((
            format!("{name} {index}"),
            inputs(model, &observation, seen.truth, index),
        ));
    }
    Ok(clean)
}

fn real() -> Result<Vec<(String, Inputs)>, Failure> {
    let root = hicp_tests::ycbv::root().ok_or("no ycbv dataset; set BOP_PATH to its folder")?;
    let instances = (0..).zip(hicp_tests::ycbv::instances(&Dataset::open(&root)?));
    let named = instances.map(|(index, instance)| {
        let model = Arc::clone(&instance.model);
        let inputs = inputs(model, &instance.observe(), instance.truth, index);
        (format!("object {} ({index})", instance.key.2), inputs)
    });
    Ok(named.collect())
}
