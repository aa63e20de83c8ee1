//! Point selections.

use hicp_association::{
    AllSamples, NormalSpace, ObservedSurface, RandomSample, SelectAt, StableSampling, UniformCount,
    VisibleSide, VisibleSurface, VoxelGrid, WithoutBoundary,
};

use super::common::{EDGE, TILT, length, stride};
use crate::build::Parameters;
use crate::catalog::{BoxedSelection, Catalog};
use crate::error::PipelineError;
use crate::work::Limited::Samples;

pub(super) fn add(catalog: &mut Catalog) {
    catalog.add_selection("all-samples", |p| {
        p.about = "Selects the model's area-uniform samples, visible or not. Source: §III-A. \
            Cost: O(n).";
        Ok(AllSamples)
    });
    catalog.add_selection("none", |p| {
        p.about = "Selects nothing, for associations that start from the observed points, such as \
            `observation-to-model`.";
        Ok(())
    });
    catalog.add_selection("visible-surface", |p| {
        p.about = "Selects the points visible at the initial pose of the stage or of its \
            cascade: V_O. Source: §III-A.1. Cost: a render, shared with the score, and O(pixels).";
        let stride = stride(p, 2000, KEPT)?;
        let poses = [("stage", SelectAt::Stage), ("cascade", SelectAt::Cascade)];
        let at = p.word("at", &poses, "owner of the initial pose")?;
        Ok(VisibleSurface { stride, at })
    });
    catalog.add_selection("visible-side", |p| {
        p.about = "Selects what is seen of the model from the nearest of 48 sides, spread evenly \
            over the image. For many poses at low cost. Cost: O(samples), no render.";
        let count = p.limited(Samples, "samples", 0, 100, "points of a side, about")?;
        Ok(VisibleSide { count })
    });
    catalog.add_selection("observed-surface", |p| {
        p.about = "Selects the observed surface, moved into the object frame at the stage's \
            initial pose. Cost: O(m).";
        Ok(ObservedSurface {
            stride: stride(p, 2000, KEPT)?,
        })
    });
    catalog.add_selection("without-boundary", |p| {
        p.about = "Keeps the points of another selection that are not rendered at a silhouette or \
            a depth step. Source: Turk & Levoy 1994. Cost: a render, shared with the score.";
        Ok(WithoutBoundary {
            selection: selection(p, "visible-surface")?,
            width: p.count("width", 0, 1, "pixels from the boundary")?,
            max_tilt_degrees: p.number("max_tilt_degrees", TILT, 85.0, EDGE)?,
        })
    });
    catalog.add_selection("uniform-count", |p| {
        p.about = "Keeps evenly spaced points of another selection. Cost: O(n).";
        Ok(UniformCount {
            selection: selection(p, "all-samples")?,
            count: count(p)?,
        })
    });
    catalog.add_selection("random-sample", |p| {
        p.about = "Keeps random points of another selection, the same for a seed. Source: Masuda \
            1996. Cost: O(n).";
        Ok(RandomSample {
            selection: selection(p, "all-samples")?,
            count: count(p)?,
            seed: p.count("seed", 0, 0, "seed of the draw")?,
        })
    });
    catalog.add_selection("voxel-grid", |p| {
        p.about = "Keeps one point of another selection per cell of a grid. Cost: O(n log n).";
        let selection = selection(p, "all-samples")?;
        Ok(VoxelGrid::new(
            selection,
            length(p, "cell", 0.05, "edge of a cell")?,
        ))
    });
    catalog.add_selection("normal-space", |p| {
        p.about = "Keeps points of another selection whose normals are spread evenly. \
            Source: Rusinkiewicz & Levoy 2001. Cost: O(n).";
        let (selection, count) = (selection(p, "all-samples")?, count(p)?);
        let resolution = p.count("resolution", 1, 4, "cells per edge of a cube")?;
        Ok(NormalSpace::new(selection, count, resolution))
    });
    catalog.add_selection("stable-sampling", |p| {
        p.about = "Keeps points of another selection that constrain all six directions alike. \
            Source: Gelfand et al. 2003. Cost: O(n log n).";
        Ok(StableSampling::new(selection(p, "all-samples")?, count(p)?))
    });
}

const KEPT: &str = "points to keep, about";

fn selection(
    p: &mut Parameters<'_>,
    default: &'static str,
) -> Result<BoxedSelection, PipelineError> {
    p.part("selection", default, "the selection to choose from")
}

fn count(p: &mut Parameters<'_>) -> Result<usize, PipelineError> {
    p.count("count", 0, 500, "number of points that are kept")
}
