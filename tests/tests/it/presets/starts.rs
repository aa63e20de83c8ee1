//! Hybrid ICP from the paper's mean initialization error (§VI-A.5), without noise and with full
//! masks.

use hicp_sim::{perturb_by_mean, rng};
use hicp_tests::{OBJECTS, scene, symmetric_pose_distance};
use hybrid_icp::{Preset, Refiner};

#[test]
fn the_median_start_is_refined_to_a_fraction_of_a_degree_and_a_millimeter() {
    let mut refiner = Refiner::preset(Preset::Hybrid);
    let (mut angles, mut distances) = (Vec::new(), Vec::new());
    for (seed, object) in (0..).zip(OBJECTS) {
        let mut rng = rng(seed);
        for _ in 0..20 {
            let scene = scene(object, 0.0, &mut rng);
            let init = perturb_by_mean(&mut rng, &scene.truth);
            let refined = refiner.refine(&scene.model, &scene.observation, &init);
            let (angle, distance) = symmetric_pose_distance(
                &refined.outcome.camera_from_object,
                &scene.truth,
                scene.model.symmetries(),
            );
            angles.push(angle.to_degrees());
            distances.push(distance * 1e3);
        }
    }
    assert_eq!(angles.len(), 200);
    angles.sort_by(f64::total_cmp);
    distances.sort_by(f64::total_cmp);
    assert!(
        angles[100] < 0.2,
        "median rotation error {} degrees",
        angles[100]
    );
    assert!(
        distances[100] < 0.3,
        "median translation error {} mm",
        distances[100]
    );
}
