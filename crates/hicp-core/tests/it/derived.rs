//! Tests of values that are derived once and shared.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Barrier};

use hicp_core::{DepthImage, Derived, Mask, Model, Observation, PinholeCamera, Point3, TriMesh};

#[test]
fn a_derived_value_is_built_once_for_all_threads() {
    let derived = Derived::default();
    let (built, barrier) = (AtomicUsize::new(0), Barrier::new(8));
    let values: Vec<Arc<usize>> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..8)
            .map(|_| {
                scope.spawn(|| {
                    barrier.wait();
                    derived.get_or_build(7, || {
                        std::thread::sleep(std::time::Duration::from_millis(20));
                        built.fetch_add(1, Ordering::SeqCst)
                    })
                })
            })
            .collect();
        threads.into_iter().map(|t| t.join().unwrap()).collect()
    });
    assert_eq!(built.load(Ordering::SeqCst), 1);
    assert!(
        values
            .iter()
            .all(|v| Arc::ptr_eq(v, &values[0]) && **v == 0)
    );
}

#[test]
fn derived_values_are_keyed_by_type_and_key() {
    let derived = Derived::default();
    assert_eq!(*derived.get_or_build(1, || 10_u32), 10);
    assert_eq!(*derived.get_or_build(2, || 20_u32), 20);
    assert_eq!(*derived.get_or_build(1, || 30_u64), 30);
    assert_eq!(*derived.get_or_build(1, || 99_u32), 10);
    assert_eq!(*derived.get_or_build(1, || 99_u64), 30);
    // A clone starts empty.
    assert_eq!(*derived.clone().get_or_build(1, || 40_u32), 40);
}

#[test]
fn clones_of_models_and_observations_do_not_share_derived_values() {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Point3::from);
    let model = Model::new(TriMesh::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap());
    let camera = PinholeCamera::new(10.0, 10.0, 1.0, 1.0, 3, 3).unwrap();
    let depth = DepthImage::from_meters(3, 3, vec![1.0; 9]).unwrap();
    let observation = Observation::new(depth, Mask::full(3, 3), camera).unwrap();
    let clones = (model.clone(), observation.clone());
    let of_model = |model: &Model, value| *model.derived().get_or_build(1, || value);
    assert_eq!(of_model(&model, 5_u64), 5);
    assert_eq!(of_model(&model, 6_u64), 5);
    assert_eq!(of_model(&clones.0, 7_u64), 7);
    let of_image = |image: &Observation, value| *image.derived().get_or_build(1, || value);
    assert_eq!(of_image(&observation, 5_u64), 5);
    assert_eq!(of_image(&observation, 6_u64), 5);
    assert_eq!(of_image(&clones.1, 7_u64), 7);
}
