//! Tests on real YCB-Video frames.
//!
//! A refinement from the ground truth stays there, and the estimates of real detectors improve.
//! Without the data, the tests are skipped with a message.

use hicp_io::bop::{Dataset, read_results};
use hicp_tests::median;
use hicp_tests::ycbv::{instances, root};
use hybrid_icp::core::se3;
use hybrid_icp::score::adi;
use hybrid_icp::{Preset, Refiner};

#[test]
fn hybrid_stays_within_five_millimeters_of_the_true_pose() {
    let Some(root) = root() else {
        eprintln!("SKIPPED: no ycbv dataset; set BOP_PATH to the folder that holds it");
        return;
    };
    let mut refiner = Refiner::preset(Preset::Hybrid);
    let instances = instances(&Dataset::open(&root).unwrap());
    assert_eq!(instances.len(), 19);
    for instance in instances {
        let refined = refiner.refine(&instance.model, &instance.observe(), &instance.truth);
        let pose = refined.outcome.camera_from_object;
        let error = adi(&pose, &instance.truth, instance.model.mesh().vertices());
        assert!(error < 0.005, "{:?}: {error} m, {refined:?}", instance.key);
    }
}

#[test]
fn hybrid_improves_the_poses_of_real_detectors() {
    let Some(root) = root() else {
        eprintln!("SKIPPED: no ycbv dataset; set BOP_PATH to the folder that holds it");
        return;
    };
    let instances = instances(&Dataset::open(&root).unwrap());
    let mut refiner = Refiner::preset(Preset::Hybrid);
    // The largest median after refinement as a share of the median before, and the slack in mm.
    for (file, share, slack) in [
        ("cosypose_ycbv-test.csv", 0.7, 0.0),
        ("posecnn-rss2018_ycbv-test.csv", 0.5, 0.0),
        ("sundermeyer_ycbv-test.csv", 0.5, 0.0),
        ("posecnn-icp-rss2018_ycbv-test.csv", 1.0, 0.5),
    ] {
        let (mut before, mut after) = (Vec::new(), Vec::new());
        for row in read_results(root.join("results").join(file)).unwrap() {
            let key = (row.scene_id, row.im_id, row.obj_id);
            let instance = instances.iter().find(|i| i.key == key).unwrap();
            let vertices = instance.model.mesh().vertices();
            let init = row.camera_from_object();
            let refined = refiner.refine(&instance.model, &instance.observe(), &init);
            let pose = refined.outcome.camera_from_object;
            assert!(se3::is_finite(&pose), "{key:?}");
            before.push(1e3 * adi(&init, &instance.truth, vertices));
            after.push(1e3 * adi(&pose, &instance.truth, vertices));
        }
        let (before, after) = (median(&mut before), median(&mut after));
        assert!(
            after <= share * before + slack,
            "{file}: {before} mm -> {after} mm"
        );
    }
}
