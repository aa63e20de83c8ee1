//! Tools: handles, plates and asymmetric heads.

use hicp_core::{Isometry3, Point3, Vector3};

use crate::objects::profile::{curve, refine, subdivide};
use crate::objects::solid::Solid;

/// An angle bracket of two thin plates.
pub(crate) fn bracket() -> Solid {
    #[rustfmt::skip]
    let corner = [
        (0.0, 0.0), (0.09, 0.0), (0.09, 0.004), (0.004, 0.004), (0.004, 0.13), (0.0, 0.13),
    ];
    Solid::prism(&subdivide(&corner, 0.004), (0.002, 0.002), 0.05, 12)
}

/// A hammer with an asymmetric head.
pub(crate) fn hammer() -> Solid {
    #[rustfmt::skip]
    let head = [
        (-0.055, -0.004), (-0.02, -0.014), (0.03, -0.014), (0.03, -0.018), (0.05, -0.018),
        (0.05, 0.018), (0.03, 0.018), (0.03, 0.014), (-0.02, 0.014), (-0.055, 0.010),
    ];
    #[rustfmt::skip]
    let handle = [
        (0.0, -0.21), (0.015, -0.21), (0.012, -0.12), (0.010, 0.0), (0.0, 0.0),
    ];
    let lying = Isometry3::rotation(Vector3::x() * std::f64::consts::FRAC_PI_2);
    Solid::lathe(&refine(&handle, 0.01), 32).with(
        &Solid::prism(&subdivide(&head, 0.006), (0.0, 0.0), 0.028, 5),
        &lying,
    )
}

/// A clothes iron: a wedge with a handle.
pub(crate) fn iron() -> Solid {
    #[rustfmt::skip]
    let sole = [
        (-0.10, -0.055), (0.02, -0.055), (0.08, -0.03), (0.13, 0.0), (0.08, 0.03), (0.02, 0.055),
        (-0.10, 0.055),
    ];
    let upper = sole.map(|(x, y)| (0.8 * x - 0.012, 0.7 * y));
    let raised = |z: f64| Isometry3::translation(0.0, 0.0, z);
    let grip = curve(12, |i| {
        let t = i / 12.0;
        let x = 0.06 - 0.15 * t;
        Point3::new(x, 0.0, 0.055 + 0.05 * (std::f64::consts::PI * t).sin())
    });
    Solid::prism(&subdivide(&sole, 0.006), (0.0, 0.0), 0.03, 5)
        .with(
            &Solid::prism(&subdivide(&upper, 0.006), (0.0, 0.0), 0.04, 6),
            &raised(0.035),
        )
        .with(&Solid::sweep(&grip, 0.012, 16), &Isometry3::identity())
}

/// A kitchen knife: a thin blade and a thicker handle.
pub(crate) fn knife() -> Solid {
    #[rustfmt::skip]
    let blade = [
        (0.0, -0.014), (0.105, -0.014), (0.135, -0.006), (0.15, 0.008), (0.12, 0.012), (0.0, 0.012),
    ];
    Solid::prism(&subdivide(&blade, 0.003), (0.06, 0.0), 0.002, 2).with(
        &Solid::cuboid(Vector3::new(0.12, 0.022, 0.016), 11),
        &Isometry3::translation(-0.055, -0.002, 0.0),
    )
}

/// A roll of tape: a ring, symmetric when turned upside down.
pub(crate) fn tape() -> Solid {
    #[rustfmt::skip]
    let section = [
        (0.036, -0.012), (0.055, -0.012), (0.055, 0.012), (0.036, 0.012),
    ];
    Solid::lathe(&refine(&section, 0.004), 64)
}
