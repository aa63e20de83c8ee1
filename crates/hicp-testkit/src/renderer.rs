//! The laws of renderers.

use hybrid_icp::core::{NO_TRIANGLE, PixelRegion, RenderedView, Renderer};
use hybrid_icp::raster::Rasterizer;

use crate::law::{PURE, Subject, Trial};
use crate::scenes::{Case, cases, sides};

/// The laws that [`check_renderer`] checks beyond the contract of the trait.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RendererLaws {
    /// Largest share of the covered pixels that may differ from [`Rasterizer`]; 2 % by default.
    ///
    /// A pixel is covered if one of the two renders has a depth. It differs if only one has, or if
    /// the depths are more than 1 mm apart. `None` for renderers that do not draw the mesh.
    pub differing_pixels: Option<f64>,
}

impl Default for RendererLaws {
    fn default() -> Self {
        Self {
            differing_pixels: Some(0.02),
        }
    }
}

/// Checks a [`Renderer`]; `make` creates a fresh one.
///
/// # Laws
///
/// - The view lies within the requested region. A render of a part of the image is equal to that
///   part of the whole render.
/// - Depths are finite and not negative. A pixel has a depth if and only if it has a triangle of
///   the mesh.
/// - Nothing is visible behind the camera.
/// - Pure: a fresh, a used and a boxed instance give the same bits, in a fresh and in a used view.
/// - Never panics, also at poses that are not finite.
/// - Agrees with the rasterizer, as declared.
///
/// # Panics
///
/// Panics if a law is broken, with the law, the input and the value found.
pub fn check_renderer<T: Renderer + 'static>(make: impl Fn() -> T, laws: RendererLaws) {
    let subject = Subject::new::<T>(None);
    let (mut used, mut boxed) = (make(), Box::new(make()) as Box<dyn Renderer>);
    let mut used_view = RenderedView::default();
    for case in cases() {
        let trial = subject.on(&case.label);
        let camera = sides(&case.problem).1.camera();
        let part = PixelRegion {
            u_min: 70,
            v_min: 40,
            u_max: 95,
            v_max: 70,
        };
        let mut whole = None;
        for region in [camera.region(), part] {
            let fresh_view = |renderer: &mut (dyn Renderer + 'static)| {
                let mut view = RenderedView::default();
                draw(renderer, &case, &region, &mut view);
                view
            };
            let view = trial.calm(|| fresh_view(&mut make()));
            contract(&trial, &case, &region, &view);
            trial.pure::<dyn Renderer, _>(&view, [&mut used, &mut boxed], fresh_view);
            trial.calm(|| draw(&mut used, &case, &region, &mut used_view));
            trial.same(PURE, &view, &used_view);
            let whole = whole.get_or_insert_with(|| view.clone());
            let law = "a render of a part of the image is equal to that part of the whole render";
            for (u, v) in region.pixels() {
                let (own, there) = (view.depth_at(u, v), whole.depth_at(u, v));
                let found = format_args!("{own} in the part, {there} in the whole at ({u}, {v})");
                trial.holds(law, own.to_bits() == there.to_bits(), found);
            }
        }
        if let (Some(share), Some(whole)) = (laws.differing_pixels, &whole) {
            agrees(&trial, &case, whole, share);
        }
    }
}

fn draw(renderer: &mut dyn Renderer, case: &Case, region: &PixelRegion, view: &mut RenderedView) {
    let (model, observation) = sides(&case.problem);
    renderer.render(model.mesh(), observation.camera(), &case.pose, region, view);
}

fn contract(trial: &Trial<'_>, case: &Case, region: &PixelRegion, view: &RenderedView) {
    let shown = format_args!("{:?} for {region:?}", view.region());
    let inside = view.region().is_empty() || view.region().intersection(region) == view.region();
    trial.holds("the view lies within the region", inside, shown);
    let triangles = sides(&case.problem).0.mesh().triangles().len();
    for (depth, triangle) in view.depth().iter().zip(view.triangles()) {
        let found = format_args!("a depth of {depth} and the triangle {triangle}");
        let law = "depths are finite and not negative";
        trial.holds(law, depth.is_finite() && *depth >= 0.0, found);
        let shows = *triangle != NO_TRIANGLE;
        let law = "a pixel has a depth if and only if it has a triangle of the mesh";
        let in_range = !shows || (*triangle as usize) < triangles;
        trial.holds(law, (*depth > 0.0) == shows && in_range, found);
    }
    if behind(case) {
        let law = "nothing is visible behind the camera";
        trial.holds(law, view.depth().iter().all(|z| *z == 0.0), shown);
    }
}

fn behind(case: &Case) -> bool {
    let model = sides(&case.problem).0;
    (case.pose * model.center()).z < -model.radius()
}

#[allow(clippy::cast_precision_loss)] // Counts of pixels.
fn agrees(trial: &Trial<'_>, case: &Case, view: &RenderedView, share: f64) {
    let region = sides(&case.problem).1.camera().region();
    let mut reference = RenderedView::default();
    draw(&mut Rasterizer::default(), case, &region, &mut reference);
    let (mut shown, mut differing) = (0_usize, 0_usize);
    for (u, v) in region.pixels() {
        let (own, there) = (view.depth_at(u, v), reference.depth_at(u, v));
        shown += usize::from(own > 0.0 || there > 0.0);
        differing += usize::from((own > 0.0) != (there > 0.0) || (own - there).abs() > 1e-3);
    }
    let law = "agrees with the rasterizer, as declared";
    let agrees = differing as f64 <= share * shown as f64;
    let found = format_args!("{differing} of {shown} pixels differ");
    trial.holds(law, agrees, found);
}
