//! The list that associations write and metrics read.

use hicp_core::{Correspondences, Isometry3, Pair, Point3, Surfel, UnitVector3, Vector3};

fn pair(x: f32) -> Pair {
    let surfel = Surfel {
        point: Point3::new(x, 0.0, 1.0),
        normal: UnitVector3::new_unchecked(Vector3::new(0.0, 0.0, -1.0)),
    };
    Pair::new(0, surfel, 1, surfel)
}

#[test]
fn beginning_anew_notes_the_pose_and_the_candidates_and_forgets_the_pairs() {
    let mut pairs = Correspondences::new();
    pairs.push(pair(1.0));
    let pose = Isometry3::translation(0.1, 0.2, 0.3);
    pairs.begin(&pose, 7);
    assert!(pairs.is_empty());
    assert_eq!(
        (pairs.camera_from_object(), pairs.n_candidates()),
        (&pose, 7)
    );
    // An association the other way round has as many candidates as there are observed points.
    pairs.set_candidates(9);
    assert_eq!(
        (pairs.camera_from_object(), pairs.n_candidates()),
        (&pose, 9)
    );
}

#[test]
fn room_that_was_made_is_used_and_kept() {
    let mut pairs = Correspondences::new();
    pairs.reserve(100);
    pairs.push(pair(0.0));
    let place = pairs.as_slice().as_ptr();
    for i in 1..100_u8 {
        pairs.push(pair(f32::from(i)));
    }
    assert_eq!((pairs.len(), pairs.as_slice().as_ptr()), (100, place));
    pairs.begin(&Isometry3::identity(), 0);
    pairs.push(pair(0.0));
    assert_eq!(pairs.as_slice().as_ptr(), place);
}
