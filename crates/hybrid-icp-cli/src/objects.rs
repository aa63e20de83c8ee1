//! `hybrid-icp objects`.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::Context as _;
use clap::Args;
use hicp_io::{LengthUnit, write_atomically, write_ply};
use hicp_picture::Picture;
use hicp_sim::Household;

use crate::outputs::write_picture;
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

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let folder = &arguments.out;
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot create the folder {}", folder.display()))?;
    let objects = || Household::TUNING.into_iter().chain(Household::TEST);
    let (width, height) = (COLUMNS * CELL, ROWS * CELL);
    let mut sheet = Picture::white(width, height);
    let mut table = String::from(
        "row,column,object,set,file,triangles,diameter_mm,discrete_symmetries,continuous_symmetries\n",
    );
    for (object, cell) in objects().zip(0..) {
        let model = object.model()?;
        let (name, mesh) = (object.name(), model.mesh());
        let file = format!("{name}.ply");
        write_ply(folder.join(&file), mesh, LengthUnit::Meters)?;
        let (row, column) = (cell / COLUMNS, cell % COLUMNS);
        sheet.paste(&Picture::of_model(&model, CELL)?, column * CELL, row * CELL);
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
    write_picture(&folder.join("contact_sheet.png"), &sheet)?;
    write_atomically(folder.join("objects.csv"), |file| {
        file.write_all(table.as_bytes())
    })?;
    say(format_args!(
        "{}: {} meshes, contact_sheet.png and objects.csv",
        folder.display(),
        objects().count()
    ))
}
