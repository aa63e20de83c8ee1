//! `cargo xtask repro`: the paper's figures and tables, by the studies of the program.

use anyhow::{Result, ensure};

use crate::process::{cargo, execute};

/// A figure, a study of it, and the poses per object (trajectories per object and bin for
/// `sequential`): as many as in the paper, and for `--quick`.
const STUDIES: [(&str, &str, &str, &str); 6] = [
    ("fig6", "init-noise", "1000", "30"),
    ("fig6", "depth-noise", "100", "10"),
    ("fig6", "model-noise", "100", "10"),
    ("table1", "timing", "100", "10"),
    ("alpha", "alpha", "1000", "30"),
    ("fig7", "sequential", "5", "1"),
];

/// Reruns a figure or a table. An interrupted run continues where it ended.
pub(crate) fn run(figure: &str, quick: bool) -> Result<()> {
    let folder = format!("target/study/{figure}{}", if quick { "-quick" } else { "" });
    let mut folders = Vec::new();
    for (_, study, full, few) in STUDIES.iter().filter(|(of, ..)| *of == figure) {
        let out = format!("{folder}/{study}");
        let poses = if quick { few } else { full };
        experiment(&[study, "--poses", poses, "--out", &out, "--resume"])?;
        folders.push(out);
    }
    ensure!(
        !folders.is_empty(),
        "repro: expected fig6, fig7, table1 or alpha, found {figure}"
    );
    // The sequential study writes its own report next to its rows.
    if figure == "fig7" {
        return Ok(());
    }
    let folders = folders.iter().map(String::as_str);
    experiment(
        &["report", "--out", &folder]
            .into_iter()
            .chain(folders)
            .collect::<Vec<_>>(),
    )
}

fn experiment(arguments: &[&str]) -> Result<()> {
    let program = "run --release --quiet --bin hybrid-icp -- experiment";
    execute(cargo(program).args(arguments))
}
