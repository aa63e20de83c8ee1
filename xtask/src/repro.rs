//! `cargo xtask repro`: the paper's figures and tables, by the program's studies.

use std::path::Path;
use std::process::Command;

use crate::Findings;

/// A study of a figure: its name, cases per object in full and quickly, and what a case takes on one 2.5 GHz core, seconds.
struct Study {
    name: &'static str,
    full: u32,
    quick: u32,
    seconds_per_case: f64,
}

/// Robustness to the initial pose; the paper has 1000 poses per object.
const INIT_NOISE: Study = Study {
    name: "init-noise",
    full: 1000,
    quick: 30,
    seconds_per_case: 0.1,
};
/// Robustness to depth noise; the paper has 100 poses per object.
const DEPTH_NOISE: Study = Study {
    name: "depth-noise",
    full: 100,
    quick: 10,
    seconds_per_case: 0.4,
};
/// Robustness to model noise; the paper has 100 poses per object. The reconstructions are part of it.
const MODEL_NOISE: Study = Study {
    name: "model-noise",
    full: 100,
    quick: 10,
    seconds_per_case: 0.3,
};
/// Table I.
const TIMING: Study = Study {
    name: "timing",
    full: 100,
    quick: 10,
    seconds_per_case: 0.2,
};
/// The threshold, on the tuning objects.
const ALPHA: Study = Study {
    name: "alpha",
    full: 1000,
    quick: 30,
    seconds_per_case: 0.35,
};
/// Sequential ICP; the paper has 5 trajectories per object and bin. A case is a trajectory per bin, with both pipelines.
const SEQUENTIAL: Study = Study {
    name: "sequential",
    full: 5,
    quick: 1,
    seconds_per_case: 30.0,
};
/// Objects of each study.
const OBJECTS: u32 = 10;
/// Reconstructing ten objects four times, seconds on one core.
const RECONSTRUCTION_SECONDS: f64 = 60.0;

/// Reruns a figure or a table; `quick` with fewer cases.
pub(crate) fn run(root: &Path, what: &str, quick: bool) -> Findings {
    let studies: &[Study] = match what {
        "fig6" => &[INIT_NOISE, DEPTH_NOISE, MODEL_NOISE],
        "table1" => &[TIMING],
        "alpha" => &[ALPHA],
        "fig7" => &[SEQUENTIAL],
        _ => {
            return Err(vec![format!(
                "no figure {what:?}, expected fig6, fig7, table1 or alpha"
            )]);
        }
    };
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    println!(
        "xtask repro {what}: about {:.0} min on the {processors} processors here, after building; an interrupted run goes on where it was",
        minutes(studies, quick, processors).ceil()
    );
    let folder = format!("target/study/{what}{}", if quick { "-quick" } else { "" });
    program(root, &["--version"])?;
    let mut folders = Vec::new();
    for study in studies {
        let out = format!("{folder}/{}", study.name);
        let poses = poses(study, quick).to_string();
        program(
            root,
            &[
                "experiment",
                study.name,
                "--poses",
                &poses,
                "--out",
                &out,
                "--resume",
            ],
        )?;
        folders.push(out);
    }
    // The sequential study writes its own report, beside its rows.
    if what == "fig7" {
        return Ok(());
    }
    let mut arguments = vec!["experiment", "report", "--out", &folder];
    arguments.extend(folders.iter().map(String::as_str));
    program(root, &arguments)
}

fn poses(study: &Study, quick: bool) -> u32 {
    if quick { study.quick } else { study.full }
}

/// What studies take, minutes. Times are measured on one thread.
fn minutes(studies: &[Study], quick: bool, processors: usize) -> f64 {
    let seconds = |study: &Study| {
        let cases = f64::from(OBJECTS * poses(study, quick)) * study.seconds_per_case;
        match study.name {
            "timing" => cases + RECONSTRUCTION_SECONDS,
            "model-noise" | "sequential" => (cases + RECONSTRUCTION_SECONDS) / processors as f64,
            _ => cases / processors as f64,
        }
    };
    studies.iter().map(seconds).sum::<f64>() / 60.0
}

/// Runs the program, built for speed.
fn program(root: &Path, arguments: &[&str]) -> Findings {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let build = [
        "run",
        "--release",
        "--quiet",
        "--package",
        "hybrid-icp-cli",
        "--",
    ];
    let status = Command::new(cargo)
        .args(build)
        .args(arguments)
        .current_dir(root)
        .status();
    match status {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(vec![format!(
            "`hybrid-icp {}`: {status}",
            arguments.join(" ")
        )]),
        Err(error) => Err(vec![format!(
            "`hybrid-icp {}`: {error}",
            arguments.join(" ")
        )]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quick_runs_are_announced_below_five_minutes_on_two_processors() {
        assert!(minutes(&[INIT_NOISE, DEPTH_NOISE, MODEL_NOISE], true, 2) < 5.0);
        assert!(minutes(&[TIMING], true, 2) < 5.0);
        assert!(minutes(&[ALPHA], true, 2) < 5.0);
        assert!(minutes(&[SEQUENTIAL], true, 2) < 5.0);
    }
}
