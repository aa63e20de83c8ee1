//! `cargo xtask repro`: the paper's figures and tables, by the studies of the program.

use anyhow::{Context as _, Result, ensure};

use crate::process::{cargo, execute};

/// A study of a figure: the figure, its name in the report, and its options, divided by spaces.
///
/// Then the poses per object, or the trajectories per object and bin: as many as in the paper, and
/// for `--quick`.
type Study = (&'static str, &'static str, &'static str, [&'static str; 2]);

/// The variants whose normals matter.
const NORMALS: &str = "depth-noise --set normal_window=1 --variants \
    projective-point-to-plane,projective-cascade-point-plane,nn-point-to-plane,hybrid";

const STUDIES: [Study; 11] = [
    ("fig6", "init-noise", "init-noise", ["1000", "30"]),
    ("fig6", "depth-noise", "depth-noise", ["100", "10"]),
    ("fig6", "model-noise", "model-noise", ["100", "10"]),
    (MESHES, "meshes-init-noise", "init-noise", ["100", "10"]),
    (MESHES, "meshes-depth-noise", "depth-noise", ["100", "3"]),
    (MESHES, "meshes-model-noise", "model-noise", ["100", "3"]),
    ("normals", "depth-noise-3x3", NORMALS, ["100", "10"]),
    ("table1", "timing", "timing", ["100", "10"]),
    ("alpha", "alpha", "alpha", ["1000", "30"]),
    ("fig7", "sequential", "sequential", ["5", "1"]),
    (
        "fig7-improved",
        "sequential-improved",
        "sequential --protocol improved",
        ["5", "1"],
    ),
];

/// Figure 6 on public meshes. They are in two folders of the data that `HICP_DATA` names.
const MESHES: &str = "fig6-meshes";
const MESH_FOLDERS: [&str; 2] = ["meshes/public_ycb_ccby4", "meshes/public_small_20"];

/// Reruns a figure or a table. An interrupted run continues where it ended.
pub(crate) fn run(figure: &str, quick: bool) -> Result<()> {
    let folder = format!("target/study/{figure}{}", if quick { "-quick" } else { "" });
    let mut folders = Vec::new();
    for (_, name, options, poses) in STUDIES.iter().filter(|study| study.0 == figure) {
        let (out, poses) = (format!("{folder}/{name}"), poses[usize::from(quick)]);
        let mut arguments: Vec<String> = options.split(' ').map(str::to_owned).collect();
        arguments.extend(["--poses", poses, "--out", &out, "--resume"].map(str::to_owned));
        if figure == MESHES {
            let data = std::env::var("HICP_DATA").context("HICP_DATA: expected a folder")?;
            let folders = MESH_FOLDERS.map(|name| format!("{data}/{name}"));
            arguments.extend(
                folders
                    .into_iter()
                    .flat_map(|f| ["--objects".to_owned(), f]),
            );
        }
        experiment(&arguments)?;
        folders.push(out);
    }
    let known: Vec<&str> = STUDIES.iter().map(|study| study.0).collect();
    ensure!(
        !folders.is_empty(),
        "repro: expected one of {}, found {figure}",
        known.join(", ")
    );
    // A sequential study writes its own report next to its rows.
    if figure.starts_with("fig7") {
        return Ok(());
    }
    let mut arguments = vec!["report".to_owned(), "--out".to_owned(), folder];
    arguments.append(&mut folders);
    experiment(&arguments)
}

fn experiment(arguments: &[String]) -> Result<()> {
    let program = "run --release --quiet --bin hybrid-icp -- experiment";
    execute(cargo(program).args(arguments))
}
