//! The picture of `bop show`: outlines on the image, and a legend below it that hides nothing.

use hicp_bop::{Image, Models};
use hybrid_icp::{
    DepthImage, Mask, Rasterizer, RenderedView, Renderer, VISIBILITY_TOLERANCE_METERS,
};

use super::show_estimates::Estimate;
use super::show_lines::{HEADS, Line, cells};
use crate::contour::pixels;
use crate::overlay::{self, AFTER, BEFORE, Ink, Picture, Rgb};
use crate::text::{Align, Text, fitted};

/// What is drawn of a result file.
pub(crate) struct FileLegend<'a> {
    pub(crate) name: String,
    pub(crate) estimates: &'a [Estimate],
}

/// What the outlines are drawn with.
pub(crate) struct Scenery<'a> {
    pub(crate) image: &'a Image,
    pub(crate) models: &'a Models,
}

/// The first file's lines, and the second's.
const STYLES: [overlay::Line; 2] = [
    overlay::Line {
        color: AFTER,
        dashed: false,
    },
    overlay::Line {
        color: BEFORE,
        dashed: true,
    },
];

/// Draws the outlines of all estimates, and the tag of every object in the middle of it.
pub(crate) fn outlines(
    picture: &mut Picture,
    scenery: &Scenery<'_>,
    files: &[FileLegend<'_>],
    lines: &[Line],
) -> anyhow::Result<()> {
    let mut ink = Ink::of(picture);
    let mut tags = Vec::new();
    // The second file's lines first: the first one's are drawn over them.
    for (place, (file, style)) in files.iter().zip(STYLES).enumerate().rev() {
        let views = scenery.views(file.estimates);
        let nearest = nearest(&scenery.image.depth, &views);
        for (estimate, view) in file.estimates.iter().zip(&views) {
            let hidden = |u: u32, v: u32, z: f32| {
                scenery.hides(u, v, z, estimate.mask.as_ref())
                    || nearest[index(&scenery.image.depth, u, v)] < z - OVERLAP_METERS
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

/// Surfaces of two models that touch may be off by as much without hiding each other, metres.
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

    /// Whether something that was measured hides a model's surface: nothing inside the object's own mask does.
    fn hides(&self, u: u32, v: u32, model: f32, mask: Option<&Mask>) -> bool {
        let measured = self.image.depth.pixels()[index(&self.image.depth, u, v)];
        let own = mask.is_some_and(|mask| mask.get(u, v) == Some(true));
        measured > 0.0 && !own && f64::from(model - measured) > VISIBILITY_TOLERANCE_METERS
    }
}

fn index(depth: &DepthImage, u: u32, v: u32) -> usize {
    v as usize * depth.width() as usize + u as usize
}

/// The depth of the nearest model at every pixel, infinite where there is none.
fn nearest(depth: &DepthImage, views: &[RenderedView]) -> Vec<f32> {
    let mut nearest = vec![f32::INFINITY; depth.pixels().len()];
    for view in views {
        for ((u, v), z) in pixels(&view.region()).zip(view.depth()) {
            let least = &mut nearest[index(depth, u, v)];
            if *z > 0.0 && *z < *least {
                *least = *z;
            }
        }
    }
    nearest
}

/// Half the height of the font in a picture 640 pixels wide. Letters of fonts of odd heights do not stand on one line.
const HALF_FONT: i32 = 7;
const WHITE: Rgb = [255; 3];
const BLACK: Rgb = [20; 3];
const GREY: Rgb = [110; 3];
const RED: Rgb = [200, 30, 30];

/// How much larger everything is than in a picture 640 pixels wide.
fn scale(width: u32) -> f64 {
    (f64::from(width) / 640.0).max(1.0)
}

/// Pixels of a length in a picture 640 pixels wide.
fn scaled(length: i32, width: u32) -> i32 {
    (f64::from(length) * scale(width)).round() as i32
}

/// Height of the font.
fn font(width: u32) -> i32 {
    2 * scaled(HALF_FONT, width)
}

/// The object's tag in the middle of its silhouette, or a little lower where another tag stands; none where nothing is seen.
fn tag(tag: &str, view: &RenderedView, picture: &Picture, others: &[Text]) -> Option<Text> {
    let shown = pixels(&view.region()).zip(view.depth());
    let shown = shown.filter(|(_, z)| **z > 0.0);
    let (mut count, mut columns, mut rows) = (0.0, 0.0, 0.0);
    for ((u, v), _) in shown {
        count += 1.0;
        columns += f64::from(u);
        rows += f64::from(v);
    }
    let size = font(picture.width) + 2;
    let mut at = (
        (columns / count).round() as i32,
        (rows / count).round() as i32,
    );
    while others
        .iter()
        .any(|other| (other.at.0 - at.0).abs() < 2 * size && (other.at.1 - at.1).abs() < size)
    {
        at.1 += size;
    }
    (count > 0.0).then(|| Text {
        text: tag.to_owned(),
        at,
        align: Align::Center,
        size,
        color: WHITE,
    })
}

/// Black copies around a tag, so that it is read on any ground.
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

/// Rows of the legend besides those of the objects: title, files, heads, and what the lines mean.
const OTHER_ROWS: i32 = 4;
/// Height of a row in a picture 640 pixels wide.
const ROW: i32 = 19;
/// Where a file's columns begin, and where those of the second are against those of the first.
const COLUMNS: i32 = 88;
const BESIDE: i32 = 276;
/// Right ends of a file's columns.
const ENDS: [i32; 4] = [52, 116, 190, 252];

/// Returns the picture with the legend below it.
pub(crate) fn with_legend(
    picture: Picture,
    title: &str,
    files: &[FileLegend<'_>],
    lines: &[Line],
) -> anyhow::Result<Picture> {
    let width = picture.width.max(640);
    let s = |length: i32| scaled(length, width);
    let n_rows = i32::try_from(lines.len())? + OTHER_ROWS;
    let legend = u32::try_from(s(ROW * n_rows + 12))?;
    let top = i32::try_from(picture.height)?;
    let middle_of = |row: i32| top + s(6 + ROW * row + ROW / 2);
    let mut canvas = below(&picture, width, legend);

    let text = |text: String, at: (i32, i32), align: Align, color: Rgb| Text {
        text,
        at: (s(at.0), middle_of(at.1)),
        align,
        size: font(width),
        color,
    };
    let mut texts = vec![
        text(
            fitted(title, font(width), width * 9 / 10),
            (12, 0),
            Align::Left,
            BLACK,
        ),
        text("object".to_owned(), (12, 2), Align::Left, GREY),
        text(notes(files, lines), (12, n_rows - 1), Align::Left, GREY),
    ];
    for (place, line) in (3..).zip(lines) {
        texts.push(text(line.tag.clone(), (12, place), Align::Left, BLACK));
    }
    let mut strokes = Vec::new();
    for (file, (found, style)) in (0..).zip(files.iter().zip(STYLES)) {
        let left = COLUMNS + BESIDE * file;
        strokes.push(((s(left), middle_of(1)), style));
        let room = u32::try_from(s(BESIDE - 52))?;
        let name = fitted(&found.name, font(width), room);
        texts.push(text(name, (left + 40, 1), Align::Left, BLACK));
        for (head, end) in HEADS.iter().zip(ENDS) {
            texts.push(text(
                (*head).to_owned(),
                (left + end, 2),
                Align::Right,
                GREY,
            ));
        }
        for (row, line) in (3..).zip(lines) {
            let estimate = line.estimates[usize::try_from(file)?];
            let estimate = estimate.and_then(|place| found.estimates.get(place));
            let far = estimate.and_then(|e| e.error).is_some_and(|e| !e.near);
            for (column, (cell, end)) in cells(estimate).into_iter().zip(ENDS).enumerate() {
                let color = if far && column == 2 { RED } else { BLACK };
                texts.push(text(cell, (left + end, row), Align::Right, color));
            }
        }
    }
    for ((x, y), style) in strokes {
        stroke(&mut canvas, (x, y), s(32), s(2), style);
    }
    canvas.write_texts(&texts)?;
    Ok(canvas)
}

/// What the colours mean.
fn notes(files: &[FileLegend<'_>], lines: &[Line]) -> String {
    let errors = files.iter().flat_map(|file| file.estimates);
    let mut text = "faint: something is in front".to_owned();
    if errors
        .clone()
        .any(|estimate| estimate.error.is_some_and(|e| !e.near))
    {
        text.push_str(" · red: ADI of a tenth of the diameter or more");
    }
    if lines.iter().any(|line| line.estimates == [None; 2]) {
        text.push_str(" · –: no estimate");
    }
    text
}

/// Puts a picture, in the middle of the width, above an empty legend.
fn below(picture: &Picture, width: u32, legend: u32) -> Picture {
    let height = picture.height + legend;
    let row = 3 * width as usize;
    let mut rgb = vec![255; row * height as usize];
    let of_picture = 3 * picture.width as usize;
    let left = 3 * ((width - picture.width) / 2) as usize;
    for (to, from) in rgb
        .chunks_exact_mut(row)
        .zip(picture.rgb.chunks_exact(of_picture.max(1)))
    {
        to[left..left + of_picture].copy_from_slice(from);
    }
    Picture { width, height, rgb }
}

/// Draws a sample of a line to the right of a place.
fn stroke(
    canvas: &mut Picture,
    (x, y): (i32, i32),
    length: i32,
    thickness: i32,
    style: overlay::Line,
) {
    let width = canvas.width as usize;
    for v in y - thickness / 2..y - thickness / 2 + thickness {
        for u in (0..length).filter(|u| style.draws(*u as usize)) {
            let place = 3 * (v as usize * width + (x + u) as usize);
            canvas.rgb[place..place + 3].copy_from_slice(&style.color);
        }
    }
}
