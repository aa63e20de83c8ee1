//! A custom data association: soft correspondences with all pixels of a window.

use super::icp;
use hicp_testkit::{AssociationLaws, check_association};
use hicp_tests::starts::{measure_stage, starts};
use hybrid_icp::association::{DataAssociation, Projective, VisibleSurface};
use hybrid_icp::core::{Context, Correspondences, Isometry3, Pair, RigidTransform, Surfel};
use hybrid_icp::metric::PointToPoint;

// --- The component ---

/// Pairs a model point with every observed point in a window around its projection.
///
/// The weights of a point's pairs sum to one and fall with distance as a Gaussian. This is the
/// E-step of EM-ICP (Granger & Pennec 2002), with the image instead of a tree.
#[derive(Clone, Copy, Debug)]
pub struct SoftProjective {
    /// Half the width of the window, pixels.
    pub radius_pixels: u8,
    /// Standard deviation of the distances, meters.
    pub sigma_meters: f32,
}

impl DataAssociation for SoftProjective {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        let Some(observation) = context.problem.observation() else {
            return;
        };
        let mover = RigidTransform::new(camera_from_object);
        let radius = i16::from(self.radius_pixels);
        for (source_index, surfel) in (0..).zip(source) {
            let source = mover.surfel(surfel);
            let pixel = observation.camera().project(&source.point.cast());
            let Some(pixel) = pixel.filter(|_| source.point.z.is_finite()) else {
                continue;
            };
            let (u, v) = (pixel.x as f32, pixel.y as f32);
            let first = pairs.len();
            let offsets = (-radius..=radius).map(f32::from);
            let window = (offsets.clone()).flat_map(|dv| offsets.clone().map(move |du| (du, dv)));
            pairs.extend(window.filter_map(|(du, dv)| {
                let index = observation.index_near(u + du, v + dv)?;
                let mut pair = Pair::new(source_index, source, index, *observation.surfel(index)?);
                pair.weight = (-0.5 * (pair.distance() / self.sigma_meters).powi(2)).exp();
                Some(pair)
            }));
            let own = &mut pairs.as_mut_slice()[first..];
            let sum: f32 = own.iter().map(|pair| pair.weight).sum();
            own.iter_mut().for_each(|pair| pair.weight /= sum.max(1e-6));
        }
    }
}

// --- Its tests ---

const SOFT: SoftProjective = SoftProjective {
    radius_pixels: 3,
    sigma_meters: 0.002,
};

#[test]
fn it_keeps_the_laws() {
    check_association(|| SOFT, AssociationLaws::default());
}

#[test]
fn it_slides_where_one_pixel_per_point_stands_still() {
    let starts = starts(2, 0.5);
    let (points, surface) = (PointToPoint, VisibleSurface::default());
    let plain = measure_stage(&mut icp(surface, Projective, points), &starts);
    let mine = measure_stage(&mut icp(surface, SOFT, points), &starts);
    mine.assert_below(0.7, &plain);
}
