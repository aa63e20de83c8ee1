//! The laws of point selections.

use hybrid_icp::association::PointSelection;
use hybrid_icp::core::{Isometry3, Problem, Surfel};

use crate::law::{BOXED, NAMED, PURE, SHARED_RENDER, Subject};
use crate::scenes::{cases, workspace};

/// Checks a [`PointSelection`]; `make` makes a fresh one.
///
/// # Laws
///
/// - Pure: a fresh and a used instance select the same bits, and so does a boxed one.
/// - Never panics: also with nothing observed, behind the camera, and at poses that are not finite.
/// - Finite points with unit normals.
/// - Shares the render: at most one per pose, and none where the context has it already.
///
/// # Panics
///
/// Panics with the law, the input and what was found when a law is broken.
pub fn check_selection<T: PointSelection + 'static>(make: impl Fn() -> T) {
    let subject = Subject::new::<T>(Some(make().name()));
    let mut used = make();
    for case in cases() {
        let input = case.label.as_str();
        let select = |selection: &mut dyn PointSelection| {
            subject.calm(input, || run(selection, &case.problem, &case.pose))
        };
        let expected = select(&mut make());
        for surfel in &expected.0 {
            let finite = surfel.point.iter().all(|x| x.is_finite());
            subject.holds("points are finite", input, finite, || format!("{surfel:?}"));
            let length = surfel.normal.norm();
            subject.holds(
                "normals are of unit length",
                input,
                (length - 1.0).abs() < 1e-3,
                || format!("{surfel:?}"),
            );
        }
        subject.holds(SHARED_RENDER, input, expected.1 == 0, || {
            format!("{} more renders of a pose already rendered", expected.1)
        });
        subject.same(PURE, input, &expected, &select(&mut used));
        subject.same(PURE, input, &expected, &select(&mut used));
        let mut boxed: Box<dyn PointSelection> = Box::new(make());
        // The box itself is the selection here, not what it holds.
        let through_box = subject.calm(input, || run(&mut boxed, &case.problem, &case.pose));
        subject.same(BOXED, input, &expected, &through_box);
        subject.same(NAMED, input, &make().name(), &used.name());
        subject.same(BOXED, input, &make().name(), &boxed.name());
    }
    subject.holds(NAMED, "any", !used.name().is_empty(), String::new);
}

/// What is selected, and how many renders it took once the pose had been rendered.
fn run<P: PointSelection + ?Sized>(
    selection: &mut P,
    problem: &Problem<'_>,
    pose: &Isometry3<f64>,
) -> (Vec<Surfel>, u64) {
    let mut workspace = workspace();
    let mut source = Vec::new();
    workspace.context(problem).view(pose);
    let before = workspace.renders();
    selection.select(&mut workspace.context(problem), pose, &mut source);
    (source, workspace.renders() - before)
}
