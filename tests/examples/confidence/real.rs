//! The estimates of four detectors on real YCB-Video frames.

use hicp_io::bop::{Dataset, read_results};
use hicp_tests::ycbv::{instances, root};
use hybrid_icp::{Preset, Refiner};

use crate::cases::{Case, Kind};

const FILES: [&str; 4] = [
    "cosypose_ycbv-test.csv",
    "posecnn-rss2018_ycbv-test.csv",
    "sundermeyer_ycbv-test.csv",
    "posecnn-icp-rss2018_ycbv-test.csv",
];

/// Refines every estimate with `auto`, or returns `None` without the dataset.
pub fn cases() -> Option<Vec<Case>> {
    let root = root()?;
    let dataset = Dataset::open(&root).expect("the dataset opens");
    let instances = instances(&dataset);
    let mut refiner = Refiner::preset(Preset::Auto);
    let mut cases = Vec::new();
    for file in FILES {
        for row in read_results(root.join("results").join(file)).expect("the results read") {
            let key = (row.scene_id, row.im_id, row.obj_id);
            let instance = instances
                .iter()
                .find(|i| i.key == key)
                .expect("an instance");
            let sides = (&*instance.model, &instance.observe());
            let init = row.camera_from_object();
            let refined = refiner.refine(sides.0, sides.1, &init);
            let truth = Some(&instance.truth);
            // The visible share is not read, so all of it counts as visible.
            cases.push(Case::new(
                &mut refiner,
                sides,
                (Some(&init), &refined),
                truth,
                (1.0, Kind::Near),
            ));
        }
    }
    Some(cases)
}
