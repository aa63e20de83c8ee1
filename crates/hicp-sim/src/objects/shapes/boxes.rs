//! Objects with flat faces: boxes, plates at an angle, and combinations of them.

use hicp_core::{Isometry3, Point3, Vector3};

use crate::objects::profile::{curve, refine, subdivide};
use crate::objects::solid::Solid;

/// A flat carton.
pub(crate) fn carton() -> Solid {
    Solid::cuboid(Vector3::new(0.06, 0.16, 0.21), 14)
}

/// A toy car: a body, a cabin and four wheels.
pub(crate) fn car() -> Solid {
    #[rustfmt::skip]
    let body = [
        (-0.09, 0.0), (0.09, 0.0), (0.09, 0.022), (0.045, 0.03), (0.02, 0.055), (-0.055, 0.055),
        (-0.075, 0.034), (-0.09, 0.03),
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

/// A closed book: pages between two covers, and a spine.
pub(crate) fn book() -> Solid {
    let cover = Solid::cuboid(Vector3::new(0.15, 0.21, 0.003), 10);
    let pages = Solid::cuboid(Vector3::new(0.144, 0.2, 0.025), 10);
    let spine = Solid::cuboid(Vector3::new(0.004, 0.21, 0.03), 6);
    let at = Isometry3::translation;
    cover
        .clone()
        .moved(&at(0.0, 0.0, 0.0135))
        .with(&cover, &at(0.0, 0.0, -0.0135))
        .with(&pages, &at(-0.001, 0.0, 0.0))
        .with(&spine, &at(-0.076, 0.0, 0.0))
}

/// An open laptop: two thin plates, the screen leaning back by 20 degrees.
pub(crate) fn laptop() -> Solid {
    let (width, depth) = (0.2, 0.13);
    let lean = Isometry3::rotation(Vector3::x() * -20.0_f64.to_radians());
    let hinge = Isometry3::translation(0.0, depth / 2.0, 0.004);
    let screen = hinge * lean * Isometry3::translation(0.0, 0.0, depth / 2.0);
    Solid::cuboid(Vector3::new(width, depth, 0.011), 10).with(
        &Solid::cuboid(Vector3::new(width, 0.005, depth), 10),
        &screen,
    )
}

/// A camera: a body, an off-center lens, and a viewfinder.
pub(crate) fn camera() -> Solid {
    #[rustfmt::skip]
    let lens = [
        (0.0, -0.02), (0.03, -0.02), (0.03, 0.02), (0.027, 0.035), (0.023, 0.035), (0.018, 0.025),
        (0.0, 0.025),
    ];
    let forward = Isometry3::rotation(Vector3::x() * std::f64::consts::FRAC_PI_2);
    Solid::cuboid(Vector3::new(0.12, 0.042, 0.074), 10)
        .with(
            &Solid::lathe(&refine(&lens, 0.008), 40),
            &(Isometry3::translation(0.012, -0.03, -0.003) * forward),
        )
        .with(
            &Solid::cuboid(Vector3::new(0.036, 0.03, 0.03), 6),
            &Isometry3::translation(0.012, 0.0, 0.038),
        )
}

/// Headphones: two cups and a band, symmetric under a half rotation.
pub(crate) fn headphones() -> Solid {
    #[rustfmt::skip]
    let cup = [
        (0.0, -0.014), (0.028, -0.014), (0.034, -0.008), (0.034, 0.008), (0.03, 0.014),
        (0.02, 0.014), (0.016, 0.006), (0.0, 0.006),
    ];
    // The hollow side faces inward, along -x of the right cup.
    let inward = Isometry3::rotation(Vector3::y() * -std::f64::consts::FRAC_PI_2);
    let right = Solid::lathe(&refine(&cup, 0.008), 36)
        .moved(&(Isometry3::translation(0.078, 0.0, 0.0) * inward));
    let half_turn = Isometry3::rotation(Vector3::z() * std::f64::consts::PI);
    let band = curve(24, |i| {
        let t = std::f64::consts::PI * i / 24.0;
        Point3::new(0.084 * t.cos(), 0.0, 0.012 + 0.092 * t.sin())
    });
    right
        .clone()
        .with(&right, &half_turn)
        .with(&Solid::sweep(&band, 0.0065, 12), &Isometry3::identity())
}
