//! Vessels: thin walls, handles and bodies of revolution.

use std::f64::consts::PI;

use hicp_core::{Isometry3, Point3};

use crate::objects::profile::{bowl_profile, curve, refine};
use crate::objects::solid::Solid;

/// A cup with a thin wall and a handle.
pub(crate) fn mug() -> Solid {
    let handle = curve(16, |i| {
        let t = PI * (i / 16.0 - 0.5);
        Point3::new(0.038 + 0.030 * t.cos(), 0.0, 0.032 * t.sin())
    });
    #[rustfmt::skip]
    let wall = [
        (0.0, -0.048), (0.038, -0.048), (0.041, -0.02), (0.042, 0.048), (0.0385, 0.048),
        (0.0375, -0.02), (0.0345, -0.043), (0.0, -0.043),
    ];
    Solid::lathe(&refine(&wall, 0.008), 48)
        .with(&Solid::sweep(&handle, 0.006, 12), &Isometry3::identity())
}

/// A bottle with a neck.
pub(crate) fn bottle() -> Solid {
    #[rustfmt::skip]
    let outline = [
        (0.0, -0.11), (0.034, -0.11), (0.036, -0.105), (0.036, 0.02), (0.030, 0.045),
        (0.015, 0.065), (0.013, 0.1), (0.016, 0.1), (0.016, 0.112), (0.0, 0.112),
    ];
    Solid::lathe(&refine(&outline, 0.012), 48)
}

/// A thin-walled bowl.
pub(crate) fn bowl() -> Solid {
    Solid::lathe(&bowl_profile(0.085, 0.081), 56)
}

/// A dinner plate.
pub(crate) fn plate() -> Solid {
    #[rustfmt::skip]
    let profile = [
        (0.0, -0.012), (0.07, -0.012), (0.085, -0.008), (0.13, 0.008), (0.13, 0.012),
        (0.084, -0.004), (0.069, -0.008), (0.0, -0.008),
    ];
    Solid::lathe(&refine(&profile, 0.01), 64)
}

/// A pan with a long handle.
pub(crate) fn pan() -> Solid {
    #[rustfmt::skip]
    let profile = [
        (0.0, -0.02), (0.085, -0.02), (0.1, 0.022), (0.097, 0.022), (0.0825, -0.0165),
        (0.0, -0.0165),
    ];
    let handle = curve(14, |i| {
        let t = i / 14.0;
        Point3::new(0.09 + 0.105 * t, 0.0, 0.012 + 0.018 * t)
    });
    Solid::lathe(&refine(&profile, 0.01), 56)
        .with(&Solid::sweep(&handle, 0.009, 12), &Isometry3::identity())
}

/// A can with recessed ends, symmetric when turned upside down.
pub(crate) fn can() -> Solid {
    #[rustfmt::skip]
    let outline = [
        (0.0, -0.053), (0.029, -0.053), (0.030, -0.0575), (0.033, -0.0555), (0.033, 0.0555),
        (0.030, 0.0575), (0.029, 0.053), (0.0, 0.053),
    ];
    Solid::lathe(&refine(&outline, 0.007), 48)
}

/// A hexagonal planter with a thin wall.
pub(crate) fn pot() -> Solid {
    #[rustfmt::skip]
    let wall = [
        (0.0, -0.05), (0.045, -0.05), (0.062, 0.05), (0.058, 0.05), (0.042, -0.045), (0.0, -0.045),
    ];
    let sixth = std::f64::consts::FRAC_PI_3;
    // The polar equation of a regular hexagon with a circumradius of 1 and corners at multiples of
    // 60°.
    let hexagon = |angle: f64| {
        let from_middle = (angle / sixth).fract() - 0.5;
        (sixth / 2.0).cos() / (from_middle * sixth).cos()
    };
    Solid::lathe_shaped(&refine(&wall, 0.008), 48, hexagon)
}

/// A teapot: a round body, a spout and a handle.
pub(crate) fn teapot() -> Solid {
    // From the flat bottom to the lid, along an ellipse.
    let mut profile = curve(14, |i| {
        let t = PI * (0.18 + 0.75 * i / 14.0);
        (0.056 * t.sin(), -0.046 * t.cos())
    });
    profile[0] = (0.0, -0.0354); // On the axis.
    profile.extend([(0.007, 0.05), (0.011, 0.056), (0.008, 0.063), (0.0, 0.064)]);
    let spout = curve(12, |i| {
        let t = i / 12.0;
        Point3::new(0.045 + 0.06 * t, 0.0, -0.012 + 0.055 * t * t)
    });
    let handle = curve(16, |i| {
        let t = PI * (i / 16.0 - 0.5);
        Point3::new(-0.046 - 0.038 * t.cos(), 0.0, -0.028 * t.sin())
    });
    Solid::lathe(&refine(&profile, 0.008), 48)
        .with(&Solid::sweep(&spout, 0.009, 14), &Isometry3::identity())
        .with(&Solid::sweep(&handle, 0.006, 12), &Isometry3::identity())
}

/// A ladle: a small thin-walled bowl with a long handle.
pub(crate) fn ladle() -> Solid {
    let handle = curve(20, |i| {
        let t = i / 20.0;
        // A bend at the end, to hang it by.
        let hook = 0.03 * (t - 0.8).max(0.0) / 0.2;
        Point3::new(0.039 + 0.02 * t + hook, 0.0, 0.025 + 0.18 * t)
    });
    Solid::lathe(&bowl_profile(0.042, 0.0395), 40)
        .with(&Solid::sweep(&handle, 0.0045, 12), &Isometry3::identity())
}
