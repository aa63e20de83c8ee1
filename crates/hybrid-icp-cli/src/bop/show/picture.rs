//! The picture of `bop show`: outlines on the image, and a legend below it.

use hicp_bop::{Image, Models, covered_pixels};
use hybrid_icp::core::{Mask, RenderedView, Renderer};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::VISIBILITY_TOLERANCE_METERS;

use super::estimates::{Estimate, Estimates};
use super::lines::{HEADS, Line, cells};
use crate::picture::text::{Align, Text, fitted};
use crate::picture::{self, AFTER, BEFORE, Ink, Picture, Rgb};

/// What the outlines are drawn with.
pub(super) struct Scenery<'a> {
    pub(super) image: &'a Image,
    pub(super) models: &'a Models,
}

/// The first file's lines, and the second's.
const STYLES: [picture::Line; 2] = [
    picture::Line {
        color: AFTER,
        dashed: false,
    },
    picture::Line {
        color: BEFORE,
        dashed: true,
    },
];

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
    picture.write_texts(&texts)
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

    /// Returns whether a measured surface hides a model's surface. Nothing inside the object's own mask does.
    fn hides(&self, u: u32, v: u32, model: f32, mask: Option<&Mask>) -> bool {
        let measured = self.image.depth.get(u, v).unwrap_or(0.0);
        let own = mask.is_some_and(|mask| mask.get(u, v) == Some(true));
        measured > 0.0 && !own && f64::from(model - measured) > VISIBILITY_TOLERANCE_METERS
    }
}

/// Half the height of the font in a picture 640 pixels wide. Letters of fonts of odd heights do not align.
const HALF_FONT: i32 = 7;
const WHITE: Rgb = [255; 3];
const BLACK: Rgb = [20; 3];
const GRAY: Rgb = [110; 3];
const RED: Rgb = [200, 30, 30];

/// Returns the pixels of a length in a picture 640 pixels wide.
fn scaled(length: i32, width: u32) -> i32 {
    let scale = (f64::from(width) / 640.0).max(1.0);
    (f64::from(length) * scale).round() as i32
}

/// Returns the height of the font.
fn font(width: u32) -> i32 {
    2 * scaled(HALF_FONT, width)
}

/// Returns the object's tag in the middle of its silhouette, or below another tag; `None` if nothing is visible.
fn tag(tag: &str, view: &RenderedView, picture: &Picture, others: &[Text]) -> Option<Text> {
    let shown: Vec<(u32, u32)> = covered_pixels(view).collect();
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
        color: WHITE,
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
const OTHER_ROWS: i32 = 4;
/// Height of a row in a picture 640 pixels wide.
const ROW: i32 = 19;
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
    let width = picture.width.max(640);
    let s = |length: i32| scaled(length, width);
    let n_rows = i32::try_from(lines.len())? + OTHER_ROWS;
    let top = i32::try_from(picture.height)?;
    let middle_of = |row: i32| top + s(6 + ROW * row + ROW / 2);
    let mut canvas = picture.above(width, u32::try_from(s(ROW * n_rows + 12))?);

    let size = font(width);
    let text = |text: String, (x, row): (i32, i32), align: Align, color: Rgb| Text {
        text,
        at: (s(x), middle_of(row)),
        align,
        size,
        color,
    };
    let title = fitted(title, size, width * 9 / 10);
    let mut texts = vec![
        text(title, (12, 0), Align::Left, BLACK),
        text(notes(files, lines), (12, n_rows - 1), Align::Left, GRAY),
    ];
    texts.push(text("object".to_owned(), (12, 2), Align::Left, GRAY));
    let tags = (3..)
        .zip(lines)
        .map(|(row, line)| (line.tag.clone(), (12, row)));
    texts.extend(tags.map(|(tag, at)| text(tag, at, Align::Left, BLACK)));
    for ((place, file), style) in files.iter().enumerate().zip(STYLES) {
        let left = COLUMNS + NEXT * i32::try_from(place)?;
        canvas.stroke((s(left), middle_of(1)), s(32), s(2), style);
        let name = fitted(&file.file, size, u32::try_from(s(NEXT - 52))?);
        texts.push(text(name, (left + 40, 1), Align::Left, BLACK));
        let heads = (2, HEADS.map(str::to_owned), GRAY);
        let figures = (3..).zip(lines).map(|(row, line)| {
            let estimate = line.estimates[place].map(|index| &file.shown[index]);
            let color = if estimate.is_some_and(is_far) {
                RED
            } else {
                BLACK
            };
            (row, cells(estimate), color)
        });
        for (row, cells, color) in std::iter::once(heads).chain(figures) {
            let cells = cells.into_iter().zip(ENDS);
            texts.extend(
                cells.map(|(cell, end)| text(cell, (left + end, row), Align::Right, color)),
            );
        }
    }
    canvas.write_texts(&texts)?;
    Ok(canvas)
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
