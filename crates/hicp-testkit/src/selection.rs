//! The laws of point selections.

use hybrid_icp::association::PointSelection;
use hybrid_icp::core::Surfel;

use crate::law::Subject;
use crate::scenes::{at_rendered_pose, cases};

/// Checks a [`PointSelection`]; `make` creates a fresh one.
///
/// # Laws
///
/// - Pure: a fresh, a used and a boxed instance select the same points, bit for bit.
/// - Never panics: also if nothing is observed, behind the camera, and at poses that are not
///   finite.
/// - Points are finite and have unit normals.
/// - Shares the render: at most one render per pose, and none if the view is in the context.
///
/// # Panics
///
/// Panics if a law is broken, with the law, the input and the value found.
pub fn check_selection<T: PointSelection + 'static>(make: impl Fn() -> T) {
    let subject = Subject::new::<T>(Some(make().name()));
    let (mut used, mut boxed) = (make(), Box::new(make()) as Box<dyn PointSelection>);
    for case in cases() {
        let trial = subject.on(&case.label);
        let select = |selection: &mut (dyn PointSelection + 'static)| {
            let mut source: Vec<Surfel> = Vec::new();
            let ((), renders) = at_rendered_pose(&case.problem, &case.pose, |context| {
                selection.select(context, &case.pose, &mut source);
            });
            (source, renders)
        };
        let of_fresh = trial.calm(|| select(&mut make()));
        for surfel in &of_fresh.0 {
            let finite = surfel.point.iter().all(|x| x.is_finite());
            trial.holds("points are finite", finite, format_args!("{surfel:?}"));
            let unit = (surfel.normal.norm() - 1.0).abs() < 1e-3;
            let law = "normals are of unit length";
            trial.holds(law, unit, format_args!("{surfel:?}"));
        }
        trial.shares_the_render(of_fresh.1, 0);
        trial.pure::<dyn PointSelection, _>(&of_fresh, [&mut used, &mut boxed], select);
    }
    subject.named([make().name(), used.name(), boxed.name()]);
}
