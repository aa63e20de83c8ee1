//! Procedural household objects.

use hicp_core::{
    Isometry3, MeshError, Model, ModelConfig, Point3, Symmetries, SymmetryAxis, Translation3,
    UnitQuaternion, Vector3,
};

use crate::solid::Solid;

/// A household object made from code: 0.1 to 0.3 m, closed, with its symmetries declared.
///
/// The shapes are those on which ICP variants differ: thin walls, handles, near-symmetric bodies, flat boxes, concave bowls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Household {
    /// A cup with a thin wall and a handle.
    Mug,
    /// A bottle with a neck; any turn about its axis looks the same.
    Bottle,
    /// A thin-walled bowl; any turn about its axis looks the same.
    Bowl,
    /// A flat carton; half turns about its axes look the same.
    Carton,
    /// An angle bracket of two thin plates.
    Bracket,
    /// A hammer: a handle and an asymmetric head.
    Hammer,
    /// A dinner plate; any turn about its axis looks the same.
    Plate,
    /// A clothes iron: a wedge with a handle.
    Iron,
    /// A toy car: a body, a cabin and four wheels.
    Car,
    /// A pan with a long handle.
    Pan,
}

impl Household {
    /// Every object.
    pub const ALL: [Self; 10] = [
        Self::Mug,
        Self::Bottle,
        Self::Bowl,
        Self::Carton,
        Self::Bracket,
        Self::Hammer,
        Self::Plate,
        Self::Iron,
        Self::Car,
        Self::Pan,
    ];

    /// Name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Mug => "mug",
            Self::Bottle => "bottle",
            Self::Bowl => "bowl",
            Self::Carton => "carton",
            Self::Bracket => "bracket",
            Self::Hammer => "hammer",
            Self::Plate => "plate",
            Self::Iron => "iron",
            Self::Car => "car",
            Self::Pan => "pan",
        }
    }

    /// Makes the object's model, with its symmetries.
    ///
    /// # Errors
    ///
    /// None for the objects that ship; the signature is that of the mesh it is made from.
    pub fn model(self) -> Result<Model, MeshError> {
        Ok(Model::with_config(
            self.solid().to_mesh()?,
            ModelConfig {
                symmetries: self.symmetries(),
                ..ModelConfig::default()
            },
        ))
    }

    /// Makes the object's solid, metres, z up.
    #[must_use]
    pub fn solid(self) -> Solid {
        match self {
            Self::Mug => {
                let arc = |i: usize| {
                    let t = std::f64::consts::PI * (f64::from(to_u32(i)) / 16.0 - 0.5);
                    Point3::new(0.038 + 0.030 * t.cos(), 0.0, 0.032 * t.sin())
                };
                let handle: Vec<_> = (0..=16).map(arc).collect();
                let wall = [
                    (0.0, -0.048),
                    (0.038, -0.048),
                    (0.041, -0.02),
                    (0.042, 0.048),
                    (0.0385, 0.048),
                    (0.0375, -0.02),
                    (0.0345, -0.043),
                    (0.0, -0.043),
                ];
                Solid::lathe(&refine(&wall, 0.008), 48)
                    .with(&Solid::sweep(&handle, 0.006, 12), &Isometry3::identity())
            }
            Self::Bottle => {
                let outline = [
                    (0.0, -0.11),
                    (0.034, -0.11),
                    (0.036, -0.105),
                    (0.036, 0.02),
                    (0.030, 0.045),
                    (0.015, 0.065),
                    (0.013, 0.1),
                    (0.016, 0.1),
                    (0.016, 0.112),
                    (0.0, 0.112),
                ];
                Solid::lathe(&refine(&outline, 0.012), 48)
            }
            Self::Bowl => {
                let outside = (0..=14).map(|i| bowl_point(i, 0.085));
                let inside = (0..=14).rev().map(|i| bowl_point(i, 0.081));
                let profile: Vec<_> = outside.chain(inside).collect();
                Solid::lathe(&profile, 56)
            }
            Self::Carton => Solid::cuboid(Vector3::new(0.06, 0.16, 0.21), 14),
            Self::Bracket => {
                let corner = [
                    (0.0, 0.0),
                    (0.09, 0.0),
                    (0.09, 0.004),
                    (0.004, 0.004),
                    (0.004, 0.13),
                    (0.0, 0.13),
                ];
                Solid::prism(&subdivide(&corner, 0.004), (0.002, 0.002), 0.05, 12)
            }
            Self::Hammer => {
                let head = [
                    (-0.055, -0.004),
                    (-0.02, -0.014),
                    (0.03, -0.014),
                    (0.03, -0.018),
                    (0.05, -0.018),
                    (0.05, 0.018),
                    (0.03, 0.018),
                    (0.03, 0.014),
                    (-0.02, 0.014),
                    (-0.055, 0.010),
                ];
                let handle = [
                    (0.0, -0.21),
                    (0.015, -0.21),
                    (0.012, -0.12),
                    (0.010, 0.0),
                    (0.0, 0.0),
                ];
                let lying = Isometry3::rotation(Vector3::x() * std::f64::consts::FRAC_PI_2);
                Solid::lathe(&refine(&handle, 0.01), 32).with(
                    &Solid::prism(&subdivide(&head, 0.006), (0.0, 0.0), 0.028, 5),
                    &lying,
                )
            }
            Self::Plate => {
                let profile = [
                    (0.0, -0.012),
                    (0.07, -0.012),
                    (0.085, -0.008),
                    (0.13, 0.008),
                    (0.13, 0.012),
                    (0.084, -0.004),
                    (0.069, -0.008),
                    (0.0, -0.008),
                ];
                Solid::lathe(&refine(&profile, 0.01), 64)
            }
            Self::Iron => {
                let sole = [
                    (-0.10, -0.055),
                    (0.02, -0.055),
                    (0.08, -0.03),
                    (0.13, 0.0),
                    (0.08, 0.03),
                    (0.02, 0.055),
                    (-0.10, 0.055),
                ];
                let upper = sole.map(|(x, y)| (0.8 * x - 0.012, 0.7 * y));
                let raised = |z: f64| Isometry3::translation(0.0, 0.0, z);
                let grip: Vec<_> = (0..=12)
                    .map(|i| {
                        let t = f64::from(to_u32(i)) / 12.0;
                        let x = 0.06 - 0.15 * t;
                        Point3::new(x, 0.0, 0.055 + 0.05 * (std::f64::consts::PI * t).sin())
                    })
                    .collect();
                Solid::prism(&subdivide(&sole, 0.006), (0.0, 0.0), 0.03, 5)
                    .with(
                        &Solid::prism(&subdivide(&upper, 0.006), (0.0, 0.0), 0.04, 6),
                        &raised(0.035),
                    )
                    .with(&Solid::sweep(&grip, 0.012, 16), &Isometry3::identity())
            }
            Self::Car => {
                let body = [
                    (-0.09, 0.0),
                    (0.09, 0.0),
                    (0.09, 0.022),
                    (0.045, 0.03),
                    (0.02, 0.055),
                    (-0.055, 0.055),
                    (-0.075, 0.034),
                    (-0.09, 0.03),
                ];
                let wheel = Solid::lathe(
                    &refine(
                        &[(0.0, -0.008), (0.019, -0.008), (0.019, 0.008), (0.0, 0.008)],
                        0.006,
                    ),
                    24,
                );
                let mut car = Solid::prism(&subdivide(&body, 0.008), (0.0, 0.02), 0.075, 8);
                for (x, z) in [
                    (-0.055, -0.04),
                    (0.055, -0.04),
                    (-0.055, 0.04),
                    (0.055, 0.04),
                ] {
                    car = car.with(&wheel, &Isometry3::translation(x, 0.0, z));
                }
                car
            }
            Self::Pan => {
                let profile = [
                    (0.0, -0.02),
                    (0.085, -0.02),
                    (0.1, 0.022),
                    (0.097, 0.022),
                    (0.0825, -0.0165),
                    (0.0, -0.0165),
                ];
                let handle: Vec<_> = (0..=14)
                    .map(|i| {
                        let t = f64::from(to_u32(i)) / 14.0;
                        Point3::new(0.09 + 0.15 * t, 0.0, 0.012 + 0.018 * t)
                    })
                    .collect();
                Solid::lathe(&refine(&profile, 0.01), 56)
                    .with(&Solid::sweep(&handle, 0.009, 12), &Isometry3::identity())
            }
        }
    }

    /// Returns the declared symmetries.
    #[must_use]
    pub fn symmetries(self) -> Symmetries {
        let half_turn = |axis: Vector3<f64>| {
            Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::new(axis * std::f64::consts::PI),
            )
        };
        match self {
            Self::Bottle | Self::Bowl | Self::Plate => Symmetries {
                discrete: Vec::new(),
                continuous: SymmetryAxis::new(Vector3::z(), Point3::origin())
                    .into_iter()
                    .collect(),
            },
            Self::Carton => Symmetries {
                discrete: [Vector3::x(), Vector3::y(), Vector3::z()]
                    .map(half_turn)
                    .to_vec(),
                continuous: Vec::new(),
            },
            _ => Symmetries::default(),
        }
    }
}

/// A point of a spherical bowl's profile, from the foot at its axis (0) up to the rim (14).
fn bowl_point(i: usize, radius: f64) -> (f64, f64) {
    let t = 1.35 * f64::from(to_u32(i)) / 14.0;
    (radius * t.sin(), 0.04 - radius * t.cos())
}

/// Inserts points so that no segment of an open profile is longer than `longest`; the closing segment runs along the axis.
fn refine(profile: &[(f64, f64)], longest: f64) -> Vec<(f64, f64)> {
    let mut points = subdivide(profile, longest);
    // The closing segment lies on the axis and makes no surface.
    while points.len() > 1
        && points.last().is_some_and(|p| p.0 == 0.0)
        && points[points.len() - 2].0 == 0.0
    {
        points.pop();
    }
    points
}

/// Inserts points so that no side of a closed polygon is longer than `longest`.
fn subdivide(polygon: &[(f64, f64)], longest: f64) -> Vec<(f64, f64)> {
    let mut points = Vec::new();
    for (i, &(x, y)) in polygon.iter().enumerate() {
        let (next_x, next_y) = polygon[(i + 1) % polygon.len()];
        let length = (next_x - x).hypot(next_y - y);
        let pieces = (length / longest).ceil().max(1.0);
        let mut k = 0.0;
        while k < pieces {
            let t = k / pieces;
            points.push((x + (next_x - x) * t, y + (next_y - y) * t));
            k += 1.0;
        }
    }
    points
}

/// Loop counters of the shapes above.
fn to_u32(i: usize) -> u32 {
    u32::try_from(i).unwrap_or(u32::MAX)
}
