//! `hybrid-icp experiment`.

use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::common::{names, program, run};
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
fn meshes(objects: &[Household]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("meshes")).unwrap();
    for object in objects {
        let file = folder.path().join(format!("meshes/{}.ply", object.name()));
        write_ply(file, &object.solid().to_mesh().unwrap(), LengthUnit::Meters).unwrap();
    }
    folder
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap()
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
        let arguments = [
            "experiment",
            study,
            "--objects",
            "meshes",
            "--poses",
            "1",
            "--threads",
            "2",
        ];
        let told = run(folder.path(), arguments).exits(0);
        assert!(told.out.contains(claim), "{}", told.out);
        let out = folder.path().join("study").join(study);
        let cases = read(&out, "cases.csv");
        assert_eq!(cases.lines().count(), 1 + rows, "{study}");
        assert!(cases.starts_with("object,case,variant,level,bin,vsd_initial,vsd_final,add_final_mm,iterations,termination,cpu_ms"));
        let config: serde_json::Value = serde_json::from_str(&read(&out, "config.json")).unwrap();
        assert_eq!(config["experiment"], study);
        assert_eq!(config["objects"][0]["source"], "mug.ply");
        let page = read(&out, "report.html");
        assert!(
            page.contains("<td>mug</td>") && page.contains(study),
            "{study}"
        );
        let written = names(&out);
        match study {
            "timing" => assert_eq!(written.len(), 7, "{written:?}"),
            "alpha" => assert!(written.contains(&"alpha.svg".to_owned()), "{written:?}"),
            _ => assert_eq!(written, OUTPUTS),
        }
    }
    let studies = ["study/init-noise", "study/depth-noise", "study/alpha"];
    let told = run(
        folder.path(),
        [&["experiment", "report", "--out", "all"][..], &studies].concat(),
    )
    .exits(0);
    assert!(told.out.contains("all/report.html"), "{}", told.out);
    let page = read(&folder.path().join("all"), "report.html");
    assert_eq!(page.matches("<figure>").count(), 2);
}

#[test]
fn a_killed_study_resumes_to_the_same_bytes() {
    let folder = meshes(&[Household::Mug, Household::Book]);
    let arguments = |out: &'static str, threads: &'static str| {
        let fixed = [
            "experiment",
            "init-noise",
            "--objects",
            "meshes",
            "--poses",
            "30",
            "--no-times",
        ];
        [&fixed[..], &["--out", out, "--threads", threads]].concat()
    };
    run(folder.path(), arguments("whole", "2")).exits(0);

    let killed = folder.path().join("killed/cases.csv");
    let mut child = program(folder.path())
        .args(arguments("killed", "1"))
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
    let whole = read(folder.path(), "whole/cases.csv");
    let part = read(folder.path(), "killed/cases.csv");
    assert!(
        part.len() < whole.len() && whole.starts_with(&part),
        "{} of {}",
        part.len(),
        whole.len()
    );

    run(folder.path(), arguments("killed", "1"))
        .exits(1)
        .complains(&["killed/cases.csv", "--resume"]);
    run(
        folder.path(),
        [&arguments("killed", "1")[..], &["--resume"]].concat(),
    )
    .exits(0);
    for file in OUTPUTS {
        let bytes = |out: &str| std::fs::read(folder.path().join(out).join(file)).unwrap();
        // The report names the folder.
        if !matches!(
            file,
            "report.html" | "claims.csv" | "summary.csv" | "differences.csv" | "switches.csv"
        ) {
            assert!(bytes("whole") == bytes("killed"), "{file}");
        }
    }
    let anonymous =
        |out: &str| read(folder.path(), &format!("{out}/report.html")).replace(out, "it");
    assert_eq!(anonymous("whole"), anonymous("killed"));
}

#[test]
fn variants_are_names_and_files() {
    let folder = meshes(&[Household::Book]);
    let shown = run(folder.path(), ["pipelines", "--show", "hybrid"])
        .exits(0)
        .out;
    std::fs::write(
        folder.path().join("eager.toml"),
        shown.replace("alpha = 0.4", "alpha = 0.7"),
    )
    .unwrap();
    let arguments = |variants| {
        let fixed = [
            "experiment",
            "init-noise",
            "--objects",
            "meshes",
            "--poses",
            "1",
            "--resume",
            "--variants",
        ];
        [&fixed[..], &[variants]].concat()
    };
    run(folder.path(), arguments("hybrid,eager.toml")).exits(0);
    let cases = read(folder.path(), "study/init-noise/cases.csv");
    assert!(
        cases.contains("\nbook,0,hybrid,0,0,") && cases.contains("\nbook,0,eager,0,0,"),
        "{cases}"
    );
    // The existing study has other variants.
    run(folder.path(), arguments("hybrid"))
        .exits(1)
        .complains(&["config.json", "as in the command that started the study"]);
    run(folder.path(), arguments("hybird"))
        .exits(2)
        .complains(&["did you mean \"hybrid\"?"]);
    let fixed = [
        "experiment",
        "alpha",
        "--objects",
        "meshes",
        "--variants",
        "nn-point-to-point",
    ];
    run(folder.path(), fixed).exits(1).complains(&["stage"]);
    run(
        folder.path(),
        ["experiment", "timing", "--objects", "nowhere"],
    )
    .exits(1)
    .complains(&["nowhere"]);
}

#[test]
fn fields_of_a_configuration_can_be_changed() {
    let folder = meshes(&[Household::Mug]);
    let study = "experiment depth-noise --objects meshes --poses 1 --variants hybrid --no-times";
    let with = |more: &str| {
        let words = format!("{study} {more}");
        run(folder.path(), words.split(' '))
    };
    with("--out a").exits(0);
    with("--out b --set normal_window=1").exits(0);
    let config: serde_json::Value =
        serde_json::from_str(&read(&folder.path().join("b"), "config.json")).unwrap();
    assert_eq!(config["normal_window"], 1);
    // Normals of 3 × 3 pixels are others.
    assert_ne!(
        read(folder.path(), "a/cases.csv"),
        read(folder.path(), "b/cases.csv")
    );
    with("--set normal=1")
        .exits(1)
        .complains(&["normal", "no such field"]);
    with("--set normal_window=50")
        .exits(1)
        .complains(&["normal_window", "1 to 10"]);
    with("--set normal_window=big")
        .exits(1)
        .complains(&["normal_window"]);
}

#[test]
fn the_protocol_of_trajectories_is_chosen() {
    let folder = meshes(&[Household::Mug]);
    let short = "experiment sequential --objects meshes --underlying hybrid --methods average \
        --set path_m=0.06 --set bins=1 --set reconstruction_images=10 --threads 1";
    for (protocol, covariance) in [("paper", "identity"), ("improved", "about-object")] {
        let words = format!("{short} --protocol {protocol} --out {protocol}");
        run(folder.path(), words.split_whitespace()).exits(0);
        let config = read(&folder.path().join(protocol), "config.json");
        let config: serde_json::Value = serde_json::from_str(&config).unwrap();
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
    let begun: Vec<&str> = begun.split(' ').collect();
    let resumed = [&begun[..], &["--resume"]].concat();
    let report = ["experiment", "report", "--out", "r", "a"];
    run(folder.path(), &begun).exits(0);
    run(folder.path(), report).exits(0);
    let out = folder.path().join("a");
    let (config, cases) = (read(&out, "config.json"), read(&out, "cases.csv"));
    let refused = |file: &str, text: String, parts: &[&str]| {
        std::fs::write(out.join(file), text).unwrap();
        for words in [&report[..], &resumed] {
            let told = run(folder.path(), words).exits(1);
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
    std::fs::write(out.join("config.json"), &config).unwrap();
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
    std::fs::write(out.join("cases.csv"), &cases).unwrap();
    for words in [&report[..], &resumed] {
        run(folder.path(), [words, &["--max-file-bytes", "20"]].concat())
            .exits(1)
            .complains(&["cases.csv", "--max-file-bytes"]);
        run(
            folder.path(),
            [words, &["--max-small-json-bytes", "20"]].concat(),
        )
        .exits(1)
        .complains(&["config.json", "--max-small-json-bytes"]);
    }
    // An incomplete last line is accepted.
    std::fs::write(out.join("cases.csv"), &cases[..cases.len() - 9]).unwrap();
    run(folder.path(), &resumed).exits(0);
    assert_eq!(read(&out, "cases.csv"), cases);
}
