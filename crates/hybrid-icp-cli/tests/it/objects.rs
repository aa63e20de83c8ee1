//! `hybrid-icp objects`.

use crate::common::*;
use hicp_io::{LengthUnit, read_mesh};
use hicp_sim::Household;

#[test]
fn it_writes_every_object_a_sheet_and_a_table() {
    let folder = Folder::new();
    let shown = folder.command("objects --out a/b").exits(0);
    shown.prints(&["20 meshes"]);
    let written = folder.path("a/b");
    assert_eq!(folder.names("a/b").len(), 22);
    let table = folder.read("a/b/objects.csv");
    assert_eq!(table.lines().count(), 21);
    for object in Household::ALL {
        let name = object.name();
        let mesh = read_mesh(written.join(format!("{name}.ply")), LengthUnit::Meters).unwrap();
        let made = object.model().unwrap();
        assert_eq!(
            (mesh.vertices(), mesh.triangles()),
            (made.mesh().vertices(), made.mesh().triangles())
        );
        let set = if Household::TEST.contains(&object) {
            "test"
        } else {
            "tuning"
        };
        assert_contains(&table, &[&format!(",{name},{set},{name}.ply,")]);
    }
    // Every cell has a drawing.
    let sheet = hicp_io::read_color(written.join("contact_sheet.png")).unwrap();
    assert_eq!((sheet.width(), sheet.height()), (1200, 960));
    for (row, column) in (0..4).flat_map(|row| (0..5).map(move |column| (row, column))) {
        let drawn = (0..240 * 240).filter(|i| {
            let (u, v) = (column * 240 + i % 240, row * 240 + i / 240);
            sheet.get(u, v) != Some([255, 255, 255])
        });
        let count = drawn.count();
        assert!(
            (1500..40_000).contains(&count),
            "{count} pixels in row {row}, column {column}"
        );
    }
}

#[test]
fn a_folder_that_cannot_be_created_is_reported() {
    let folder = Folder::new();
    folder.write("file", "");
    let told = folder.command("objects --out file/below").exits(1);
    told.complains(&["cannot create the folder file/below"]);
}
