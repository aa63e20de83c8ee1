//! `hybrid-icp objects`.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::Context as _;
use clap::Args;
use hicp_io::{LengthUnit, write_atomically, write_ply};
use hicp_sim::Household;
use hybrid_icp::core::{
    Isometry3, Model, PinholeCamera, RenderedView, Renderer, UnitQuaternion, Vector3,
};
use hybrid_icp::raster::Rasterizer;

use crate::picture::Picture;
use crate::terminal::say;

/// Write the twenty procedural household objects as meshes in meters, with a contact sheet.
///
/// The folder receives one binary PLY mesh per object, `contact_sheet.png` and `objects.csv`. The
/// sheet shows the tuning objects in the upper two rows and the test objects in the lower two. The
/// table lists their names in the order of the sheet, with their sizes and symmetries.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The folder to write to. It is created if it does not exist. Files of the same names are
    /// replaced.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Side of a cell of the contact sheet in pixels.
const CELL: u32 = 240;
const COLUMNS: u32 = 5;
const ROWS: u32 = 4;
/// Yellow, as CAD models are in the paper's pictures.
const SURFACE: [f64; 3] = [240.0, 200.0, 90.0];

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let folder = &arguments.out;
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot create the folder {}", folder.display()))?;
    let objects = || Household::TUNING.into_iter().chain(Household::TEST);
    let (width, height) = (COLUMNS * CELL, ROWS * CELL);
    let mut sheet = Picture {
        width,
        height,
        rgb: vec![255; 3 * width as usize * height as usize],
    };
    let mut table = String::from(
        "row,column,object,set,file,triangles,diameter_mm,discrete_symmetries,continuous_symmetries\n",
    );
    for (object, cell) in objects().zip(0..) {
        let model = object.model()?;
        let (name, mesh) = (object.name(), model.mesh());
        let file = format!("{name}.ply");
        write_ply(folder.join(&file), mesh, LengthUnit::Meters)?;
        let (row, column) = (cell / COLUMNS, cell % COLUMNS);
        shade(&mut sheet, &model, column * CELL, row * CELL)?;
        let set = match Household::TUNING.contains(&object) {
            true => "tuning",
            false => "test",
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            table,
            "{},{},{name},{set},{file},{},{:.1},{},{}",
            row + 1,
            column + 1,
            mesh.triangles().len(),
            model.diameter() * 1e3,
            model.symmetries().discrete.len(),
            model.symmetries().continuous.len(),
        );
    }
    sheet.write(&folder.join("contact_sheet.png"))?;
    write_atomically(folder.join("objects.csv"), |file| {
        file.write_all(table.as_bytes())
    })?;
    say(format_args!(
        "{}: {} meshes, contact_sheet.png and objects.csv",
        folder.display(),
        objects().count()
    ))
}

/// Draws a model into the cell with the given upper left corner.
///
/// The view is oblique from above, and the model fills the cell.
fn shade(sheet: &mut Picture, model: &Model, left: u32, top: u32) -> anyhow::Result<()> {
    let middle = f64::from(CELL - 1) / 2.0;
    let focal = 2.5 * f64::from(CELL);
    let camera = PinholeCamera::new(focal, focal, middle, middle, CELL, CELL)?;
    // Object z points up in the picture. Rotate around it, then tip the model toward the viewer.
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.6);
    let tip =
        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2 + 0.5);
    let rotation = tip * turn;
    let distance = model.radius() * focal / (0.46 * f64::from(CELL));
    let shift = Vector3::new(0.0, 0.0, distance) - rotation * model.center().coords;
    let camera_from_object = Isometry3::from_parts(shift.into(), rotation);
    let mut view = RenderedView::default();
    Rasterizer::default().render(
        model.mesh(),
        &camera,
        &camera_from_object,
        &camera.region(),
        &mut view,
    );
    let light = Vector3::new(-0.4, -0.7, -0.6).normalize();
    for v in 0..CELL {
        for u in 0..CELL {
            let Some(surfel) = view.surfel_at(u, v, model.mesh(), &camera, &camera_from_object)
            else {
                continue;
            };
            let lit = surfel.normal.cast::<f64>().dot(&light).max(0.0);
            let color = SURFACE.map(|full| (full * (0.3 + 0.7 * lit)) as u8);
            sheet.mix(((left + u).into(), (top + v).into()), color, 1.0);
        }
    }
    Ok(())
}
