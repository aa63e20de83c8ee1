//! Objects of random parts.

use std::f64::consts::{PI, TAU};

use hicp_core::{
    Isometry3, MeshError, Model, ModelConfig, Point3, Symmetries, SymmetryAxis, Vector3,
};
use rand::RngExt;

use crate::objects::household::Proportions;
use crate::objects::profile::{curve, refine, subdivide};
use crate::objects::solid::Solid;
use crate::stream::stream;
use crate::{SimRng, rotation};

/// Builds an object that exists nowhere, in some proportions, with its symmetries. Meters, z up.
///
/// It has a body and up to three smaller parts. The body is solid or hollow and round, a box, or a
/// plate or column with any outline. The parts are handles, rods, boxes and knobs at its side. The
/// diameter is 0.08 to 0.3 m in the nominal proportions. Use these objects to fit parameters that
/// must suit every object: the ten tuning objects of [`crate::Household`] have too little variety.
///
/// # Errors
///
/// [`MeshError`] if the proportions leave no mesh.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use hicp_sim::{Proportions, invented};
/// let model = invented(7, Proportions::default())?;
/// assert!((0.08..=0.3).contains(&model.diameter()) && model.mesh().is_closed());
/// # Ok(()) }
/// ```
pub fn invented(seed: u64, proportions: Proportions) -> Result<Model, MeshError> {
    let mut random = stream(seed, &["invented"], 0);
    let between =
        |random: &mut SimRng, low: f64, high: f64| low + (high - low) * random.random::<f64>();
    let height = between(&mut random, 0.15, 1.5);
    let (mut solid, mut symmetries) = body(&mut random, height);
    for _ in 0..random.random_range(0..4_u32) {
        solid = solid.with(&part(&mut random, height), &Isometry3::identity());
        symmetries = Symmetries::default();
    }
    let size = between(&mut random, 0.08, 0.3);
    let Proportions { width, height } = proportions;
    let nominal = Model::new(solid.to_mesh()?).diameter();
    let scale = size / nominal;
    let mesh = solid
        .scaled(&(Vector3::new(width, width, height) * scale))
        .to_mesh()?;
    let config = ModelConfig {
        symmetries,
        ..ModelConfig::default()
    };
    Ok(Model::with_config(mesh, config))
}

/// Returns a body about 1 wide around the z axis, and its symmetries.
fn body(random: &mut SimRng, height: f64) -> (Solid, Symmetries) {
    let half = height / 2.0;
    let half_turn = |axis: Vector3<f64>| Isometry3::rotation(axis * PI);
    match random.random_range(0..4_u32) {
        kind @ (0 | 1) => {
            let corners = random.random_range(2..6_u32);
            let outline: Vec<(f64, f64)> = (0..=corners)
                .map(|k| {
                    let radius = 0.2 + 0.3 * random.random::<f64>();
                    (radius, height * (f64::from(k) / f64::from(corners) - 0.5))
                })
                .collect();
            let mut profile = vec![(0.0, -half)];
            profile.extend(&outline);
            if kind == 1 {
                // The wall continues inside, down to the bottom.
                let wall = 0.02 + 0.05 * random.random::<f64>();
                let bottom = wall.min(0.3 * height) - half;
                let inside = outline.iter().rev().map(|(r, z)| (r - wall, z.max(bottom)));
                profile.extend(inside);
                profile.push((0.0, bottom));
            } else {
                profile.push((0.0, half));
            }
            let axis = SymmetryAxis::new(Vector3::z(), Point3::origin());
            let symmetries = Symmetries {
                discrete: Vec::new(),
                continuous: axis.into_iter().collect(),
            };
            (Solid::lathe(&refine(&profile, 0.08), 40), symmetries)
        }
        2 => {
            let depth = 0.15 + 0.75 * random.random::<f64>();
            let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
            let symmetries = Symmetries {
                discrete: axes.map(half_turn).to_vec(),
                continuous: Vec::new(),
            };
            (
                Solid::cuboid(Vector3::new(1.0, depth, height), 12),
                symmetries,
            )
        }
        _ => {
            let corners = random.random_range(3..9_u32);
            let polygon: Vec<(f64, f64)> = (0..corners)
                .map(|k| {
                    let radius = 0.2 + 0.4 * random.random::<f64>();
                    let (sin, cos) = (TAU * f64::from(k) / f64::from(corners)).sin_cos();
                    (radius * cos, radius * sin)
                })
                .collect();
            let thin = if random.random() { 1.0 } else { 0.2 };
            let outline = subdivide(&polygon, 0.05);
            let prism = Solid::prism(&outline, (0.0, 0.0), thin * height, 6);
            (prism, Symmetries::default())
        }
    }
}

/// Returns a handle, a rod, a box or a knob at the side of a body.
fn part(random: &mut SimRng, height: f64) -> Solid {
    let turn = Isometry3::rotation(Vector3::z() * (TAU * random.random::<f64>()));
    let level = height * (0.8 * random.random::<f64>() - 0.4);
    let size = 0.1 + 0.4 * random.random::<f64>();
    let thickness = size * (0.06 + 0.14 * random.random::<f64>());
    let at = Isometry3::translation;
    let part = match random.random_range(0..4_u32) {
        0 => Solid::sweep(
            &curve(14, |i| {
                let t = PI * (i / 14.0 - 0.5);
                Point3::new(0.2 + size * t.cos(), 0.0, 0.5 * height.min(size) * t.sin())
            }),
            thickness,
            12,
        ),
        1 => {
            let (length, rise) = (3.0 * size, size * (2.0 * random.random::<f64>() - 1.0));
            Solid::sweep(
                &curve(12, |i| {
                    Point3::new(0.1 + length * i / 12.0, 0.0, rise * i / 12.0)
                }),
                thickness,
                12,
            )
        }
        2 => {
            let sides = Vector3::new(
                1.0,
                random.random::<f64>() + 0.2,
                random.random::<f64>() + 0.2,
            );
            Solid::cuboid(sides * size, 6).moved(&at(0.2 + 0.5 * size, 0.0, 0.0))
        }
        _ => {
            let knob = [
                (0.0, 0.0),
                (0.5, 0.0),
                (0.3 + 0.3 * random.random::<f64>(), 0.7),
                (0.0, 0.9),
            ];
            let knob = knob.map(|(r, z)| (size * r, size * z));
            let tilt = rotation(random);
            Solid::lathe(&refine(&knob, 0.08), 24).moved(&(at(0.3, 0.0, 0.0) * tilt))
        }
    };
    part.moved(&(at(0.0, 0.0, level) * turn))
}
