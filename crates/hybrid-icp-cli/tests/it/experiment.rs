//! `hybrid-icp experiment`.

use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::common::*;
use hicp_io::{LengthUnit, write_ply};
use hicp_sim::Household;

const OUTPUTS: [&str; 9] = [
    "cases.csv",
    "claims.csv",
    "config.json",
    "differences.csv",
    "figure.png",
    "figure.svg",
    "report.html",
    "summary.csv",
    "switches.csv",
];

/// Creates a folder with a folder of one or two meshes.
fn meshes(objects: &[Household]) -> Folder {
    let folder = Folder::new();
    folder.create_dir("meshes");
    for object in objects {
        let file = folder.path(format!("meshes/{}.ply", object.name()));
        write_ply(file, &object.solid().to_mesh().unwrap(), LengthUnit::Meters).unwrap();
    }
    folder
}

#[test]
fn every_study_runs_end_to_end() {
    let folder = meshes(&[Household::Mug]);
    for (study, rows, claim) in [
        (
            "init-noise",
            9,
            "lower mean VSD than each other variant over all bins",
        ),
        (
            "depth-noise",
            6 * 9,
            "nn-point-to-plane improves from 0 % to 1 %",
        ),
        ("model-noise", 5 * 9, "over reconstructions 1 to 4"),
        ("timing", 3 * 9, "order of Table I"),
        ("alpha", 21, "α = 0.4 is as good as the best"),
    ] {
        let words = format!("experiment {study} --objects meshes --poses 1 --threads 2");
        let told = folder.command(words).exits(0);
        told.prints(&[claim]);
        let out = format!("study/{study}");
        let cases = folder.read(format!("{out}/cases.csv"));
        assert_eq!(cases.lines().count(), 1 + rows, "{study}");
        assert!(cases.starts_with("object,case,variant,level,bin,vsd_initial,vsd_final,add_final_mm,iterations,termination,cpu_ms"));
        let config = folder.json(format!("{out}/config.json"));
        assert_eq!(config["experiment"], study);
        assert_eq!(config["objects"][0]["source"], "mug.ply");
        let page = folder.read(format!("{out}/report.html"));
        assert!(
            page.contains("<td>mug</td>") && page.contains(study),
            "{study}"
        );
        let written = folder.names(&out);
        match study {
            "timing" => assert_eq!(written.len(), 7, "{written:?}"),
            "alpha" => assert!(written.contains(&"alpha.svg".to_owned()), "{written:?}"),
            _ => assert_eq!(written, OUTPUTS),
        }
    }
    let words = "experiment report --out all study/init-noise study/depth-noise study/alpha";
    let told = folder.command(words).exits(0);
    told.prints(&["all/report.html"]);
    let page = folder.read("all/report.html");
    assert_eq!(page.matches("<figure>").count(), 2);
}

#[test]
fn a_killed_study_resumes_to_the_same_bytes() {
    let folder = meshes(&[Household::Mug, Household::Book]);
    let command = |out: &str, threads: u32| {
        format!(
            "experiment init-noise --objects meshes --poses 10 --no-times --out {out} --threads {threads}"
        )
    };
    folder.command(command("whole", 2)).exits(0);

    let killed = folder.path("killed/cases.csv");
    let mut child = program(folder.root())
        .args(command("killed", 1).split(' '))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while std::fs::metadata(&killed).map_or(0, |m| m.len()) < 5000 {
        assert!(child.try_wait().unwrap().is_none(), "done too early");
        assert!(start.elapsed() < Duration::from_secs(300));
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let whole = folder.read("whole/cases.csv");
    let part = folder.read("killed/cases.csv");
    assert!(
        part.len() < whole.len() && whole.starts_with(&part),
        "{} of {}",
        part.len(),
        whole.len()
    );

    let killed = command("killed", 1);
    folder
        .command(&killed)
        .fails(&["killed/cases.csv", "--resume"]);
    folder.command(format!("{killed} --resume")).exits(0);
    for file in OUTPUTS {
        let bytes = |out: &str| folder.bytes(format!("{out}/{file}"));
        // The report names the folder.
        if !matches!(
            file,
            "report.html" | "claims.csv" | "summary.csv" | "differences.csv" | "switches.csv"
        ) {
            assert!(bytes("whole") == bytes("killed"), "{file}");
        }
    }
    let anonymous = |out: &str| {
        let page = folder.read(format!("{out}/report.html"));
        page.replace(out, "it")
    };
    assert_eq!(anonymous("whole"), anonymous("killed"));
}

#[test]
fn variants_are_names_and_files() {
    let folder = meshes(&[Household::Book]);
    let shown = folder.command("pipelines --show hybrid").exits(0).out;
    folder.write("eager.toml", shown.replace("alpha = 0.4", "alpha = 0.7"));
    let of = |variants: &str| {
        let fixed = "experiment init-noise --objects meshes --poses 1 --resume";
        folder.command(format!("{fixed} --variants {variants}"))
    };
    of("hybrid,eager.toml").exits(0);
    let cases = folder.read("study/init-noise/cases.csv");
    assert_contains(&cases, &["\nbook,0,hybrid,0,0,", "\nbook,0,eager,0,0,"]);
    // The existing study has other variants.
    of("hybrid").fails(&["config.json", "as in the command that started the study"]);
    of("hybird").refuses(&["did you mean \"hybrid\"?"]);
    folder
        .command("experiment alpha --objects meshes --variants nn-point-to-point")
        .fails(&["switcher.alpha=0.0", "the pipeline has no \"switcher\""]);
    folder
        .command("experiment timing --objects nowhere")
        .fails(&["nowhere"]);
}

#[test]
fn fields_of_a_configuration_can_be_changed() {
    let folder = meshes(&[Household::Mug]);
    let study = "experiment depth-noise --objects meshes --poses 1 --variants hybrid --no-times";
    let with = |more: &str| {
        let words = format!("{study} {more}");
        folder.command(words)
    };
    with("--out a").exits(0);
    with("--out b --set normal_window=1").exits(0);
    let config = folder.json("b/config.json");
    assert_eq!(config["normal_window"], 1);
    // Normals of 3 × 3 pixels are others.
    assert_ne!(folder.read("a/cases.csv"), folder.read("b/cases.csv"));
    with("--set normal=1").fails(&["normal", "no such field"]);
    with("--set normal_window=50").fails(&["normal_window", "1 to 10"]);
    with("--set normal_window=big").fails(&["normal_window"]);
}

#[test]
fn the_protocol_of_trajectories_is_chosen() {
    let folder = meshes(&[Household::Mug]);
    let short = "experiment sequential --objects meshes --underlying hybrid --methods average \
        --set path_m=0.06 --set bins=1 --set reconstruction_images=10 --threads 1";
    for (protocol, covariance) in [("paper", "identity"), ("improved", "about-object")] {
        let words = format!("{short} --protocol {protocol} --out {protocol}");
        folder.command(words).exits(0);
        let config = folder.json(format!("{protocol}/config.json"));
        assert_eq!(
            (&config["covariance"], &config["path_m"]),
            (&covariance.into(), &0.06.into())
        );
    }
}

#[test]
fn files_that_are_not_those_of_a_study_are_refused() {
    let folder = meshes(&[Household::Book]);
    let begun =
        "experiment init-noise --objects meshes --poses 1 --variants hybrid --no-times --out a";
    let resumed = format!("{begun} --resume");
    let report = "experiment report --out r a";
    folder.command(begun).exits(0);
    folder.command(report).exits(0);
    let (config, cases) = (folder.read("a/config.json"), folder.read("a/cases.csv"));
    let refused = |file: &str, text: String, parts: &[&str]| {
        folder.write(format!("a/{file}"), text);
        for words in [report, &resumed] {
            let told = folder.command(words).exits(1);
            assert!(told.err.starts_with("error: "), "{}", told.err);
            told.complains(&[&[file], parts].concat());
        }
    };
    for (found, bins) in [("0", "0"), ("4000000000", "4000000000")] {
        refused(
            "config.json",
            config.replace("\"bins\": 10", &format!("\"bins\": {bins}")),
            &[&format!("bins: found {found}, expected 1 to 1000")],
        );
    }
    let mut other: serde_json::Value = serde_json::from_str(&config).unwrap();
    other["objects"] = serde_json::json!([]);
    refused(
        "config.json",
        other.to_string(),
        &["objects: found none, expected 1 to 10000"],
    );
    other["objects"] = serde_json::json!(1);
    refused(
        "config.json",
        other.to_string(),
        &["expected the configuration of a study", "line 1"],
    );
    folder.write("a/config.json", &config);
    refused(
        "cases.csv",
        cases.replace("book", "mug"),
        &["line 2: found object \"mug\", expected \"book\", by config.json"],
    );
    refused(
        "cases.csv",
        cases.replace(",hybrid,", ",local,"),
        &["line 2: found variant \"local\""],
    );
    // The limits of the command line apply.
    folder.write("a/cases.csv", &cases);
    for words in [report, &resumed] {
        for (option, file) in [
            ("--max-file-bytes", "cases.csv"),
            ("--max-small-json-bytes", "config.json"),
        ] {
            let told = folder.command(format!("{words} {option} 20"));
            told.fails(&[file, option]);
        }
    }
    // An incomplete last line is accepted.
    folder.write("a/cases.csv", &cases[..cases.len() - 9]);
    folder.command(resumed).exits(0);
    assert_eq!(folder.read("a/cases.csv"), cases);
}
