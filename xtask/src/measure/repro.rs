//! `cargo xtask repro`: the paper's figures and tables, by the studies of the program.

use anyhow::{Context as _, Result, ensure};

use crate::process::{cargo, execute};

/// A study of a figure.
struct Study {
    figure: &'static str,
    /// Its name in the report.
    name: &'static str,
    /// Its options, divided by spaces.
    options: &'static str,
    /// Poses per object, or trajectories per object and bin: as many as in the paper, and for
    /// `--quick`.
    poses: [&'static str; 2],
}

const fn study(
    figure: &'static str,
    name: &'static str,
    options: &'static str,
    poses: [&'static str; 2],
) -> Study {
    Study {
        figure,
        name,
        options,
        poses,
    }
}

/// The variants whose normals matter.
const NORMALS: &str = "depth-noise --set normal_window=1 --variants \
    projective-point-to-plane,projective-cascade-point-plane,nn-point-to-plane,hybrid";

const STUDIES: [Study; 11] = [
    study("fig6", "init-noise", "init-noise", ["1000", "30"]),
    study("fig6", "depth-noise", "depth-noise", ["100", "10"]),
    study("fig6", "model-noise", "model-noise", ["100", "10"]),
    study(MESHES, "meshes-init-noise", "init-noise", ["100", "10"]),
    study(MESHES, "meshes-depth-noise", "depth-noise", ["100", "3"]),
    study(MESHES, "meshes-model-noise", "model-noise", ["100", "3"]),
    study("normals", "depth-noise-3x3", NORMALS, ["100", "10"]),
    study("table1", "timing", "timing", ["100", "10"]),
    study("alpha", "alpha", "alpha", ["1000", "30"]),
    study("fig7", "sequential", "sequential", ["5", "1"]),
    study(
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
    for study in STUDIES.iter().filter(|study| study.figure == figure) {
        let out = format!("{folder}/{}", study.name);
        let poses = study.poses[usize::from(quick)];
        let mut arguments: Vec<String> = study.options.split(' ').map(str::to_owned).collect();
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
    let known: Vec<&str> = STUDIES.iter().map(|study| study.figure).collect();
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
