//! Data associations.

use hicp_association::{
    ClosestPointOnMesh, Contour, KNearest, Length, NearestNeighbor, NormalCompatible,
    NormalShooting, ObservationToModel, Projective, ProjectiveInterpolated, ProjectiveSearch,
    Reciprocal, RenderedSurface, SearchIndex, Stride,
};

use super::common::{length, stride};
use crate::build::Parameters;
use crate::catalog::{BoxedAssociation, Catalog};
use crate::error::PipelineError;
use crate::range::{FACTOR, Range};
use crate::work::Limited::{Neighbors, Samples};

pub(super) fn add(catalog: &mut Catalog) {
    catalog.add_association("nearest-neighbor", |p| {
        p.about = "Pairs a point with the closest observed point. Source: §III-A.1; Besl & McKay \
            1992. Cost: O(n log m), and O(m log m) once per observation.";
        let indexes = [
            ("box-tree", SearchIndex::BoxTree),
            #[cfg(feature = "kiddo")]
            ("kd-tree", SearchIndex::KdTree),
        ];
        let targets = searched(p)?;
        let meaning = "index to search: bounding boxes, or kiddo's k-d tree";
        Ok(NearestNeighbor::new(
            targets,
            p.word("index", &indexes, meaning)?,
        ))
    });
    catalog.add_association("projective", |p| {
        p.about = "Pairs a point with the observed point at the pixel that it projects to. \
            Source: §III-A.1; Blais & Levine 1995. Cost: O(n).";
        Ok(Projective)
    });
    catalog.add_association("k-nearest", |p| {
        p.about = "Pairs a point with the k closest observed points, each with weight 1/k. \
            Cost: O(k n log m).";
        let k = p.limited(Neighbors, "k", 1, 3, "number of neighbors")?;
        Ok(KNearest::new(k, searched(p)?))
    });
    catalog.add_association("normal-compatible", |p| {
        p.about = "Pairs a point with the closest of its k nearest whose normal agrees. \
            Source: Pulli 1999. Cost: O(k n log m).";
        let half_turn = Range::new(0.0, 180.0, "degrees");
        let angle = p.number(
            "max_angle_degrees",
            half_turn,
            45.0,
            "largest angle between the normals",
        )?;
        Ok(NormalCompatible::new(angle, considered(p)?, searched(p)?))
    });
    catalog.add_association("normal-shooting", |p| {
        p.about = "Pairs a point with the one of its k nearest that is closest to the line along \
            its normal. Source: Chen & Medioni 1991. Cost: O(k n log m).";
        let k = considered(p)?;
        let offset = length(p, "max_offset", f64::INFINITY, "distance from the line")?;
        let (Length::Meters(value) | Length::Diameters(value)) = offset;
        let offset = value.is_finite().then_some(offset);
        Ok(NormalShooting::new(k, offset, searched(p)?))
    });
    catalog.add_association("reciprocal", |p| {
        p.about = "Keeps the pairs of another association in which each is the other's closest. \
            Source: Pajdla & Van Gool 1995. Cost: that association, and O(n log n).";
        let association = p.part::<BoxedAssociation>(
            "association",
            "nearest-neighbor",
            "the association to filter",
        )?;
        Ok(Reciprocal::new(association))
    });
    catalog.add_association("projective-search", |p| {
        p.about = "Pairs a point with the closest observed point in a window around its \
            projection. Source: Benjemaa & Schmitt 1997. Cost: O(n radius²).";
        Ok(ProjectiveSearch {
            radius: p.count("radius", 0, 2, "half side of the window, pixels")?,
        })
    });
    catalog.add_association("projective-interpolated", |p| {
        p.about = "Pairs a point with the observed surface interpolated at its projection. \
            Cost: O(n).";
        let step = Range::positive("share of the depth");
        Ok(ProjectiveInterpolated {
            max_step: p.number("max_step", step, 0.02, "a larger step is not interpolated")?,
        })
    });
    catalog.add_association("observation-to-model", |p| {
        p.about = "Pairs every observed point with the closest model sample. Cost: O(m log s), \
            and O(s log s) once per model.";
        Ok(ObservationToModel {
            stride: asking(p)?,
            samples: p.limited(Samples, "samples", 1, 20_000, "model samples in the index")?,
            visible_only: visible_only(p)?,
        })
    });
    catalog.add_association("closest-point-on-mesh", |p| {
        p.about = "Pairs every observed point with the closest point of the model's triangles, \
            exactly. Cost: O(m log t), and O(t log t) once per model.";
        Ok(ClosestPointOnMesh {
            stride: asking(p)?,
            visible_only: visible_only(p)?,
        })
    });
    catalog.add_association("rendered-surface", |p| {
        p.about = "Pairs every rendered point with the depth measured along its ray, with the \
            model's normal. For point-to-plane. Cost: a render, and O(pixels).";
        Ok(RenderedSurface {
            stride: stride(p, 2000, "rendered points to pair, about")?,
            limit: length(
                p,
                "limit",
                0.12,
                "largest difference of depth, without noise",
            )?,
        })
    });
    catalog.add_association("contour", |p| {
        p.about = "Pairs the rendered silhouette with the object's border in depth and mask, \
            also if the mask is dilated or a box. For point-to-plane. Source: Harris & Stennett \
            1990; Stoiber et al. 2022. Cost: a render, and O(pixels).";
        let default = Contour::default();
        let reach = Range::positive("diameters");
        Ok(Contour::new(
            p.count("lines", 1, 150, "lines across the silhouette, about")?,
            p.number(
                "reach",
                reach,
                default.reach_diameters,
                "length of a line to each side",
            )?,
            p.number(
                "weight",
                FACTOR,
                default.weight,
                "of borders relative to depths",
            )?,
        ))
    });
    catalog.add_association("joined", |p| {
        p.about = "Joins the pairs of several associations. Cost: the sum of theirs.";
        p.parts::<BoxedAssociation>("associations", None, "the associations, in order")
    });
}

const SEARCHED: &str = "pixels to search, about; all points of a cloud";

fn searched(p: &mut Parameters<'_>) -> Result<Stride, PipelineError> {
    stride(p, 4000, SEARCHED)
}

fn asking(p: &mut Parameters<'_>) -> Result<Stride, PipelineError> {
    stride(p, 2000, "observed points to pair, about")
}

fn considered(p: &mut Parameters<'_>) -> Result<usize, PipelineError> {
    p.limited(Neighbors, "k", 1, 10, "neighbors to consider")
}

fn visible_only(p: &mut Parameters<'_>) -> Result<bool, PipelineError> {
    p.flag("visible_only", true, "skips surface that faces away")
}
