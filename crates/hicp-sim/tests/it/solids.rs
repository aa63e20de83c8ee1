//! Solids match their definitions.

use hicp_sim::{Household, Proportions, Solid, VsdBins};

#[test]
fn a_solid_without_parts_has_no_mesh_and_adds_nothing() {
    assert!(Solid::new().to_mesh().is_err());
    let mug = Household::Mug.solid();
    let same = mug
        .clone()
        .with(&Solid::new(), &hicp_core::Isometry3::identity());
    assert_eq!(
        same.to_mesh().unwrap().vertices(),
        mug.to_mesh().unwrap().vertices()
    );
}

#[test]
fn proportions_scale_width_and_height() {
    let proportions = Proportions {
        width: 0.5,
        height: 2.0,
    };
    let plain = Household::Bottle.solid().to_mesh().unwrap();
    let scaled = Household::Bottle.solid_with(proportions).to_mesh().unwrap();
    assert_eq!(plain.triangles(), scaled.triangles());
    for (p, q) in plain.vertices().iter().zip(scaled.vertices()) {
        let expected = hicp_core::Point3::new(p.x * 0.5, p.y * 0.5, p.z * 2.0);
        assert!((expected - q).norm() < 1e-6, "{p} {q}");
    }
}

#[test]
fn a_shaped_lathe_multiplies_every_radius_by_its_shape() {
    let profile = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.2), (0.0, 0.2)];
    let round = Solid::lathe(&profile, 12).to_mesh().unwrap();
    let doubled = Solid::lathe_shaped(&profile, 12, |_| 2.0)
        .to_mesh()
        .unwrap();
    assert!((doubled.area() - round.area()).abs() > 0.1 * round.area());
    // An ellipse with semi-axes of 0.1 and 0.05 in polar form.
    let ellipse = |angle: f64| 0.5 / (0.5 * angle.cos()).hypot(angle.sin());
    let oval = Solid::lathe_shaped(&profile, 12, ellipse)
        .to_mesh()
        .unwrap();
    let rim: Vec<_> = oval
        .vertices()
        .iter()
        .filter(|p| p.coords.xy().norm() > 1e-6)
        .collect();
    assert_eq!(rim.len(), 24);
    for p in rim {
        assert!(((p.x / 0.1).hypot(p.y / 0.05) - 1.0).abs() < 1e-5, "{p}");
    }
}

#[test]
fn bins_of_the_vsd_are_half_open_except_the_last() {
    let bins = VsdBins::default();
    let found = [0.0, 0.0999, 0.1, 0.55, 0.9, 1.0].map(|vsd| bins.bin_of(vsd));
    assert_eq!(found, [0, 0, 1, 5, 9, 9]);
}
