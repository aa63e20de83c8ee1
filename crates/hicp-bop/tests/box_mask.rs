//! The mask of an estimate where there is no segmentation.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use hicp_bop::BoxMask;
use hybrid_icp::{DepthImage, Isometry3, Mask, Model, PixelRegion, Point3, RenderedView, TriMesh};

/// A plate of 0.3 m × 0.4 m, 0.5 m in diameter, about the origin.
fn plate() -> Model {
    let corner = |x: f32, y: f32| Point3::new(x, y, 0.0);
    let corners = vec![
        corner(-0.15, -0.2),
        corner(0.15, -0.2),
        corner(0.15, 0.2),
        corner(-0.15, 0.2),
    ];
    Model::new(TriMesh::new(corners, vec![[0, 1, 2], [0, 2, 3]]).unwrap())
}

/// A render whose region is larger than its silhouette: columns 8 to 11, rows 5 to 14.
fn view() -> RenderedView {
    let region = PixelRegion {
        u_min: 4,
        v_min: 2,
        u_max: 20,
        v_max: 18,
    };
    let mut view = RenderedView::default();
    view.reset(region);
    let (depth, _) = view.buffers_mut();
    for (v, row) in (2..18).zip(depth.chunks_exact_mut(16)) {
        for (u, z) in (4..20).zip(row) {
            *z = f32::from(u8::from((8..12).contains(&u) && (5..15).contains(&v)));
        }
    }
    view
}

fn mask(by: BoxMask, depth: &DepthImage) -> Option<Mask> {
    let pose = Isometry3::translation(0.0, 0.0, 1.0);
    by.mask(&view(), depth, &plate(), &pose)
}

fn wall(z: f32) -> DepthImage {
    DepthImage::from_meters(24, 16, vec![z; 24 * 16]).unwrap()
}

#[test]
fn the_box_is_that_of_the_silhouette_and_grows_within_the_image() {
    let of = |margin: f64| {
        let by = BoxMask {
            margin,
            ..BoxMask::default()
        };
        let mask = mask(by, &wall(1.0)).unwrap();
        let region = mask.bounding_region();
        let set = mask.pixels().iter().filter(|set| **set).count();
        assert_eq!(set, region.area(), "the whole box is measured");
        (region.u_min, region.v_min, region.u_max, region.v_max)
    };
    assert_eq!(of(0.0), (8, 5, 12, 15));
    // A tenth of ten rows is one pixel, on every side.
    assert_eq!(of(0.1), (7, 4, 13, 16));
    assert_eq!(of(0.11), (6, 3, 14, 16));
    assert_eq!(of(1e30), (0, 0, 24, 16));
    assert_eq!(of(-1.0), of(0.0));
    assert_eq!(of(f64::NAN), of(0.0));
}

#[test]
fn only_what_is_measured_within_the_gate_is_set() {
    // The gate is half a diameter, 0.25 m, about the centre at 1 m.
    let by = BoxMask::default();
    for (z, within) in [(0.76, true), (1.24, true), (0.74, false), (1.26, false)] {
        assert_eq!(mask(by, &wall(z)).is_some(), within, "{z}");
    }
    assert_eq!(mask(by, &wall(0.0)), None);

    let mut depths = vec![1.0; 24 * 16];
    depths[6 * 24 + 9] = 0.0;
    depths[7 * 24 + 9] = 2.0;
    let depth = DepthImage::from_meters(24, 16, depths).unwrap();
    let mask = mask(by, &depth).unwrap();
    let set = |u, v| mask.get(u, v) == Some(true);
    assert!(!set(9, 6) && !set(9, 7) && set(9, 8) && !set(3, 8));
}

#[test]
fn a_model_out_of_sight_has_no_mask() {
    let nothing = RenderedView::default();
    let pose = Isometry3::translation(0.0, 0.0, -1.0);
    let mask = BoxMask::default().mask(&nothing, &wall(1.0), &plate(), &pose);
    assert_eq!(mask, None);
}
