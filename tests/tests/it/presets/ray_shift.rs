//! Checks the baseline that moves an object along its viewing ray.

use std::f64::consts::PI;

use hybrid_icp::Refiner;
use hybrid_icp::core::{
    DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Point3, TriMesh, Vector3,
};
use hybrid_icp::icp::{RayShift, Termination, Verdict};

#[test]
fn a_plate_is_moved_along_its_ray_to_the_measured_depth() {
    let camera = PinholeCamera::new(100.0, 100.0, 31.5, 31.5, 64, 64).expect("a camera");
    let corners = [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]];
    let corners = corners.map(|[x, y]| Point3::new(x, y, 0.0)).to_vec();
    let mesh = TriMesh::new(corners, vec![[0, 2, 1], [0, 3, 2]]).expect("a mesh");
    let model = Model::new(mesh);
    let depth = DepthImage::from_meters(64, 64, vec![0.5; 64 * 64]).expect("an image");
    let observation = Observation::new(depth, Mask::full(64, 64), camera).expect("equal sizes");
    let mut refiner = Refiner::new(RayShift::default());
    let aside = Isometry3::translation(0.06, 0.0, 0.6);
    let shifted = refiner.refine(&model, &observation, &aside).outcome;
    let place = shifted.camera_from_object.translation.vector;
    assert!((place.z - 0.5).abs() < 1e-6 && (place.x - 0.05).abs() < 1e-6);
    assert_eq!(shifted.camera_from_object.rotation, aside.rotation);
    let behind = Isometry3::rotation(Vector3::x() * PI) * aside;
    let kept = refiner.refine(&model, &observation, &behind).outcome;
    assert_eq!(kept.verdict, Verdict::KeptInitial(Termination::NoPairs));
    assert_eq!(kept.camera_from_object, behind);
}
