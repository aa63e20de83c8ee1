//! ICP with the colors of the image, on surfaces that slide along themselves.

use hicp_sim::{Household, Texture};
use hicp_tests::allocations::allocations;
use hicp_tests::tabletop::MaskKind;
use hybrid_icp::Refiner;
use hybrid_icp::association::{MaxDistance, Projective, Stride, VisibleSurface};
use hybrid_icp::core::{Isometry3, Model, Observation, UnitQuaternion, Vector3};
use hybrid_icp::icp::{Convergence, Icp, IterationLimit};
use hybrid_icp::metric::{Conditioned, Minimize, Photometric, PointToPlane};
use hybrid_icp::pipeline::PipelineFile;

use crate::color::{board, colorful, lighting, photograph, pose, scene};

fn projective(metric: impl Minimize + Send + 'static) -> Refiner {
    Refiner::boxed(Box::new(Icp {
        selection: VisibleSurface::with_stride(Stride::AboutPoints(1000)),
        association: Projective,
        filter: MaxDistance::diameters(0.25),
        metric,
        stop: (Convergence::default(), IterationLimit(40)),
    }))
}

fn plain() -> Refiner {
    projective(Conditioned::<PointToPlane>::default())
}

fn colored() -> Refiner {
    projective(Conditioned {
        metric: Photometric::new(PointToPlane),
        ..Conditioned::default()
    })
}

/// Returns the angle and the distance between a refined pose and the truth: degrees, millimeters.
fn error(
    refiner: &mut Refiner,
    (model, observation): (&Model, &Observation),
    (init, truth): (&Isometry3<f64>, &Isometry3<f64>),
) -> (f64, f64) {
    let refined = refiner.refine(model, observation, init);
    let back = refined.outcome.camera_from_object.inverse() * truth;
    let center = model.center();
    let shift = (back * center - center).norm();
    (back.rotation.angle().to_degrees(), 1e3 * shift)
}

#[test]
fn a_board_slides_back_along_its_plane_only_with_colors() {
    let model = board(colorful);
    let observation = photograph(&model, |color| color);
    for (x, y, degrees) in [
        (0.008, 0.0, 0.0_f64),
        (-0.004, 0.006, 2.0),
        (0.0, 0.0, -4.0),
    ] {
        let turn = Vector3::z() * degrees.to_radians();
        let init = pose() * Isometry3::new(Vector3::new(x, y, 0.0), turn);
        let of = |mut refiner| error(&mut refiner, (&model, &observation), (&init, &pose()));
        let (by_depth, by_color) = (of(plain()), of(colored()));
        assert!(by_depth.0.max(by_depth.1) > 3.5, "{by_depth:?}");
        assert!(by_color.0 < 0.1 && by_color.1 < 0.2, "{by_color:?}");
    }
}

#[test]
fn a_can_turns_back_around_its_axis_only_with_colors() {
    let (painted, seen) = scene(Household::Can, Texture::Logos);
    let model = &painted.scenes.objects[seen.model].1;
    let observation = painted.observe(&seen, MaskKind::Exact, &lighting(), 5);
    let observation = observation.unwrap();
    for degrees in [-5.0_f64, 3.0, 5.0] {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), degrees.to_radians());
        let init = seen.truth * Isometry3::rotation_wrt_point(turn, model.center());
        let of = |mut refiner| error(&mut refiner, (model, &observation), (&init, &seen.truth));
        let (by_depth, by_color) = (of(plain()), of(colored()));
        assert!(by_depth.0 > 2.0, "{by_depth:?}");
        assert!(by_color.0 < 1.0, "{by_color:?}");
    }
}

#[test]
fn without_a_color_image_the_refinement_has_the_bits_of_the_inner_metric() {
    let model = board(colorful);
    let colors = photograph(&model, |color| color);
    let depth = colors.shared_depth().clone();
    let observation = Observation::new(depth, colors.mask().clone(), *colors.camera()).unwrap();
    let init = pose() * Isometry3::translation(0.004, 0.002, 0.003);
    let [with, without] = [
        projective(Photometric::new(PointToPlane)),
        projective(PointToPlane),
    ]
    .map(|mut refiner| refiner.refine(&model, &observation, &init));
    assert_eq!(with, without);
}

#[test]
fn a_warm_run_allocates_nothing_and_a_file_builds_the_same() {
    let model = board(colorful);
    let observation = photograph(&model, |color| color);
    let init = pose() * Isometry3::translation(0.004, 0.002, 0.0);
    let mut refiner = colored();
    let refined = refiner.refine(&model, &observation, &init);
    let before = allocations();
    assert_eq!(refiner.refine(&model, &observation, &init), refined);
    assert_eq!(allocations() - before, 0);
    let text = "type = 'icp'\nselection = { type = 'visible-surface', points = 1000 }\n\
        association = 'projective'\nfilter = [{ type = 'max-distance', limit = 0.25, unit = 'diameters' }]\n\
        metric = { type = 'conditioned', metric = 'photometric' }\n\
        stop = ['convergence', { type = 'iteration-limit', iterations = 40 }]";
    let file = PipelineFile::parse(text, "colored").unwrap();
    let mut built = Refiner::boxed(file.build().unwrap());
    assert_eq!(built.refine(&model, &observation, &init), refined);
}
