//! The picture of `bop show`: outlines on the image, and a legend below it.

use hicp_bop::{Image, Models};
use hicp_picture::{
    AGAINST, Align, BLACK, GRAY, Ink, LEFT, Legend, Picture, RED, RESULT, Text, font,
};
use hybrid_icp::core::{Mask, RenderedView, Renderer};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::VISIBILITY_TOLERANCE_METERS;

use super::estimates::{Estimate, Estimates};
use super::lines::{HEADS, Line, cells};

/// The image and the models of a picture.
pub(super) struct Scenery<'a> {
    pub(super) image: &'a Image,
    pub(super) models: &'a Models,
}

/// The first file's lines, and the second's.
const STYLES: [hicp_picture::Line; 2] = [RESULT, AGAINST];

/// Draws the outlines of all estimates, and the tag of every object in its middle.
pub(super) fn outlines(
    picture: &mut Picture,
    scenery: &Scenery<'_>,
    files: &[Estimates],
    lines: &[Line],
) -> anyhow::Result<()> {
    let mut ink = Ink::of(picture);
    let mut tags = Vec::new();
    // The second file's lines first: the first one's are drawn over them.
    for (place, (file, style)) in files.iter().zip(STYLES).enumerate().rev() {
        let views = scenery.views(&file.shown);
        for (estimate, view) in file.shown.iter().zip(&views) {
            let hidden = |u: u32, v: u32, z: f32| {
                let others = views.iter().map(|other| other.depth_at(u, v));
                let mut in_front =
                    others.filter(|other| *other > 0.0 && *other < z - OVERLAP_METERS);
                scenery.hides(u, v, z, estimate.mask.as_ref()) || in_front.next().is_some()
            };
            ink.outline(view, style, hidden);
        }
        for line in lines {
            let first_or_alone = place == 0 || line.estimates[0].is_none();
            let view = line.estimates[place].and_then(|estimate| views.get(estimate));
            if let (true, Some(view)) = (first_or_alone, view) {
                tags.extend(tag(&line.tag, view, picture, &tags));
            }
        }
    }
    picture.draw(&ink);
    let shades = tags.iter().flat_map(shade);
    let texts: Vec<Text> = shades.chain(tags.iter().cloned()).collect();
    Ok(picture.write_texts(&texts)?)
}

/// Surfaces of two models that touch may be off by as much without hiding each other, in meters.
const OVERLAP_METERS: f32 = 0.003;

impl Scenery<'_> {
    /// Renders estimates.
    fn views(&self, estimates: &[Estimate]) -> Vec<RenderedView> {
        let mut rasterizer = Rasterizer::default();
        let camera = &self.image.camera;
        let view = |estimate: &Estimate| {
            let mut view = RenderedView::default();
            if let Some(model) = self.models.by_id.get(&estimate.obj_id) {
                let pose = &estimate.camera_from_object;
                rasterizer.render(model.mesh(), camera, pose, &camera.region(), &mut view);
            }
            view
        };
        estimates.iter().map(view).collect()
    }

    /// Returns whether a measured surface hides a model's surface. No pixel of its mask does.
    fn hides(&self, u: u32, v: u32, model: f32, mask: Option<&Mask>) -> bool {
        let measured = self.image.depth.get(u, v).unwrap_or(0.0);
        let own = mask.is_some_and(|mask| mask.get(u, v) == Some(true));
        measured > 0.0 && !own && f64::from(model - measured) > VISIBILITY_TOLERANCE_METERS
    }
}

/// Returns the object's tag in the middle of its silhouette, or below another tag.
///
/// If nothing of the silhouette is visible, returns `None`.
fn tag(tag: &str, view: &RenderedView, picture: &Picture, others: &[Text]) -> Option<Text> {
    let shown: Vec<(u32, u32)> = view.covered().collect();
    let mean = |axis: fn(&(u32, u32)) -> u32| {
        let sum: f64 = shown.iter().map(|place| f64::from(axis(place))).sum();
        (sum / shown.len() as f64).round() as i32
    };
    let mut at = (mean(|place| place.0), mean(|place| place.1));
    let size = font(picture.width) + 2;
    let is_near =
        |(x, y): (i32, i32), at: (i32, i32)| (x - at.0).abs() < 2 * size && (y - at.1).abs() < size;
    while others.iter().any(|other| is_near(other.at, at)) {
        at.1 += size;
    }
    (!shown.is_empty()).then(|| Text {
        text: tag.to_owned(),
        at,
        align: Align::Center,
        size,
        color: [255; 3],
    })
}

/// Black copies around a tag, so that it is readable on any background.
fn shade(tag: &Text) -> impl Iterator<Item = Text> {
    let around = (-1..=1).flat_map(|dv| (-1..=1).map(move |du| (du, dv)));
    around
        .filter(|shift| *shift != (0, 0))
        .map(|(du, dv)| Text {
            at: (tag.at.0 + du, tag.at.1 + dv),
            color: [0; 3],
            ..tag.clone()
        })
}

/// Rows of the legend except those of the objects: title, files, heads, and notes.
const OTHER_ROWS: usize = 4;
/// Left end of the columns of the first file, and the distance to those of the second.
const COLUMNS: i32 = 88;
const NEXT: i32 = 276;
/// Right ends of a file's columns.
const ENDS: [i32; 4] = [52, 116, 190, 252];

/// Returns the picture with the legend below it.
pub(super) fn with_legend(
    picture: &Picture,
    title: &str,
    files: &[Estimates],
    lines: &[Line],
) -> anyhow::Result<Picture> {
    let n_rows = lines.len() + OTHER_ROWS;
    let mut legend = Legend::below(picture, n_rows)?;
    let last = i32::try_from(n_rows - 1)?;
    legend.text(title, (LEFT, 0), Align::Left, BLACK);
    legend.text("object", (LEFT, 2), Align::Left, GRAY);
    for (row, line) in (3..).zip(lines) {
        legend.text(&line.tag, (LEFT, row), Align::Left, BLACK);
    }
    for ((place, file), style) in files.iter().enumerate().zip(STYLES) {
        let left = COLUMNS + NEXT * i32::try_from(place)?;
        legend.line(&file.file, (left, 1), NEXT - 12, style);
        let heads = (2, HEADS.map(str::to_owned), GRAY);
        let figures = (3..).zip(lines).map(|(row, line)| {
            let estimate = line.estimates[place].map(|index| &file.shown[index]);
            let far = estimate.is_some_and(is_far);
            (row, cells(estimate), if far { RED } else { BLACK })
        });
        for (row, cells, color) in std::iter::once(heads).chain(figures) {
            for (cell, end) in cells.iter().zip(ENDS) {
                legend.text(cell, (left + end, row), Align::Right, color);
            }
        }
    }
    legend.text(&notes(files, lines), (LEFT, last), Align::Left, GRAY);
    Ok(legend.finish()?)
}

fn is_far(estimate: &Estimate) -> bool {
    estimate.error.is_some_and(|error| !error.near)
}

/// Explains the colors.
fn notes(files: &[Estimates], lines: &[Line]) -> String {
    let mut text = "faint: something is in front".to_owned();
    if files.iter().flat_map(|file| &file.shown).any(is_far) {
        text.push_str(" · red: ADI of a tenth of the diameter or more");
    }
    if lines.iter().any(|line| line.estimates == [None; 2]) {
        text.push_str(" · –: no estimate");
    }
    text
}
