//! `hybrid-icp demo`.

use crate::common::*;

/// Returns the numbers of a line of the table of errors: degrees, millimeters, MVE, VSD.
fn errors(out: &str, when: &str) -> Vec<f64> {
    let line = out.lines().find(|line| line.starts_with(when)).unwrap();
    line.split_whitespace()
        .filter_map(|word| word.parse().ok())
        .collect()
}

fn without_time(out: &str) -> String {
    let lines = out.lines().filter(|line| !line.contains(" ms from depth"));
    lines.collect::<Vec<_>>().join("\n")
}

#[test]
fn it_needs_nothing_and_shows_everything() {
    let folder = Folder::new();
    let shown = folder.command("demo").exits(0);
    let (before, after) = (errors(&shown.out, "before"), errors(&shown.out, "after"));
    assert_eq!(&before[..2], &[9.5, 6.2]);
    assert_eq!(before.len(), 4);
    for (before, after) in before.iter().zip(&after) {
        assert!(after < before, "{}", shown.out);
    }
    shown.prints(&[
        "stage",
        "association",
        "metric",
        "iterations",
        "pairs",
        "mean loss",
        "ended",
        " ms ",
        "joined",
        "conditioned",
        "demo.png",
        "\n1 ",
    ]);
    assert_eq!(shown.err, "");
    assert_eq!(folder.names(""), ["demo.png"]);

    let image = hicp_io::read_color(folder.path("demo.png")).unwrap();
    let (width, height) = (image.width(), image.height());
    // The picture shows the object, twice as large, and two rows of a legend.
    assert!(width == 640 && (400..700).contains(&height), "{height}");
    let legend = image.pixels().rchunks(640 * 50).next().unwrap();
    assert_eq!(legend[0], [255; 3]);
    assert!(legend.contains(&[230, 159, 0]));
    assert!(legend.contains(&[86, 180, 233]));
    // The picture has both outlines and the measured depth.
    let pixels = || image.pixels().iter();
    let count = |wanted: &dyn Fn(&[u8; 3]) -> bool| pixels().filter(|p| wanted(p)).count();
    assert!(count(&|p| *p == [230, 159, 0]) > 100);
    assert!(count(&|p| *p == [86, 180, 233]) > 100);
    assert!(count(&|p| p[0] == p[1] && p[1] == p[2] && p[0] > 0) > 1000);
}

#[test]
fn everything_but_the_time_follows_from_the_seed() {
    let folder = Folder::new();
    let once = folder.command("demo --seed 3 --picture a.png").exits(0);
    let again = folder.command("demo --seed 3 --picture b.png").exits(0);
    let other = folder.command("demo --seed 4 --picture c.png").exits(0);
    let out = without_time(&once.out);
    assert_eq!(out, without_time(&again.out).replace("b.png", "a.png"));
    assert_ne!(out, without_time(&other.out).replace("c.png", "a.png"));
    let bytes = |name: &str| folder.bytes(name);
    assert_eq!(bytes("a.png"), bytes("b.png"));
    assert_ne!(bytes("a.png"), bytes("c.png"));
}

#[test]
fn every_object_and_pipeline_runs() {
    let folder = Folder::new();
    for object in hicp_sim::Household::ALL {
        let arguments = ["demo", "--object", object.name(), "--noise", "0"];
        run(folder.root(), arguments).exits(0);
    }
    for pipeline in hybrid_icp::Preset::ALL {
        let shown = run(folder.root(), ["demo", "--pipeline", pipeline.name()]).exits(0);
        assert!(shown.out.contains(&format!("pipeline {pipeline},")));
    }
}

#[test]
fn a_picture_that_cannot_be_written_is_reported_first() {
    let folder = Folder::new();
    let told = folder.command("demo --picture no/demo.png").exits(1);
    let told = told.complains(&["cannot write no/demo.png", "folder no does not exist"]);
    assert_eq!(told.out, "");
}
