//! Masks of estimates without a segmentation.

use hicp_bop::BoxMask;
use hybrid_icp::core::{
    DepthImage, Isometry3, Mask, Model, PinholeCamera, PixelRegion, Point3, RenderedView, TriMesh,
    Vector3,
};

/// Returns a plate of 0.3 m × 0.4 m around the origin, with a diameter of 0.5 m.
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

/// Returns a render whose region is larger than its silhouette: columns 8 to 11, rows 5 to 14.
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

/// Returns a camera with pixels of 5 cm at a distance of 1 m.
///
/// It sees the plate at the place of the silhouette, which is a little smaller.
fn camera() -> PinholeCamera {
    PinholeCamera::new(20.0, 20.0, 9.5, 9.5, 24, 16).unwrap()
}

fn mask(margin: f64, depth: &DepthImage) -> Option<Mask> {
    let pose = Isometry3::translation(0.0, 0.0, 1.0);
    BoxMask { margin }.mask(&view(), (depth, &camera()), &plate(), &pose)
}

fn wall(z: f32) -> DepthImage {
    DepthImage::from_meters(24, 16, vec![z; 24 * 16]).unwrap()
}

/// Returns the box of the set pixels: the first column and row, and one past the last ones.
fn set(mask: &Mask) -> (u32, u32, u32, u32) {
    let region = mask.bounding_region();
    let count = mask.n_set();
    assert_eq!(count, region.area(), "the whole box is measured");
    (region.u_min, region.v_min, region.u_max, region.v_max)
}

#[test]
fn the_boxes_grow_by_the_margin_within_the_image() {
    // The plate covers columns 6.5 to 12.5 and rows 5.5 to 13.5. The silhouette covers columns 8 to
    // 11 and rows 5 to 14.
    assert_eq!(set(&mask(0.0, &wall(1.0)).unwrap()), (8, 6, 12, 14));
    // The image box grows by one pixel. The box in space grows by 5 cm, which is also one pixel:
    // columns 5.5 to 13.5, rows 4.5 to 14.5.
    assert_eq!(set(&mask(0.1, &wall(1.0)).unwrap()), (7, 5, 13, 15));
    assert_eq!(set(&mask(1e30, &wall(1.0)).unwrap()), (0, 0, 24, 16));
    for without in [-1.0, f64::NAN] {
        assert_eq!(mask(without, &wall(1.0)), mask(0.0, &wall(1.0)));
    }
}

#[test]
fn only_points_measured_inside_the_grown_box_are_set() {
    // The plate is flat, but its grown box extends 5 cm to both sides.
    for (z, within) in [(0.96, true), (1.04, true), (0.94, false), (1.06, false)] {
        assert_eq!(mask(0.1, &wall(z)).is_some(), within, "{z}");
    }
    assert_eq!(mask(0.1, &wall(0.0)), None);

    let mut depths = vec![1.0; 24 * 16];
    depths[6 * 24 + 9] = 0.0;
    depths[7 * 24 + 9] = 2.0;
    let depth = DepthImage::from_meters(24, 16, depths).unwrap();
    let mask = mask(0.1, &depth).unwrap();
    let set = |u, v| mask.get(u, v) == Some(true);
    assert!(!set(9, 6) && !set(9, 7) && set(9, 8) && !set(3, 8));
}

#[test]
fn the_box_rotates_with_the_estimate() {
    // Rotated by 90° around the optical axis, the plate is wider than high. The silhouette is that
    // of the view.
    let pose = Isometry3::new(
        Vector3::new(0.0, 0.0, 1.0),
        Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2),
    );
    let by = BoxMask { margin: 0.0 };
    let mask = by.mask(&view(), (&wall(1.0), &camera()), &plate(), &pose);
    assert_eq!(set(&mask.unwrap()), (8, 7, 12, 13));
}

#[test]
fn a_model_outside_the_view_has_no_mask() {
    let nothing = RenderedView::default();
    let pose = Isometry3::translation(0.0, 0.0, -1.0);
    let mask = BoxMask::default().mask(&nothing, (&wall(1.0), &camera()), &plate(), &pose);
    assert_eq!(mask, None);
}
