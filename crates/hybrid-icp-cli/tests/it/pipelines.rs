//! Pipelines from files and overrides, through the program.

// Helpers of tests may panic like tests.

use std::process::{Command, Output};

fn hybrid_icp(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_hybrid-icp"))
        .args(arguments)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Returns the output of a demo without its time and the names of its pipeline and picture.
fn demo(pipeline: &[&str], picture: &str) -> (Option<i32>, Vec<String>, String) {
    let mut arguments = vec!["demo", "--picture", picture];
    arguments.extend(pipeline);
    let output = hybrid_icp(&arguments);
    let lines = text(&output.stdout)
        .lines()
        .filter(|l| !l.contains(" ms ") && !l.contains("pipeline") && !l.contains(picture))
        .map(str::to_owned)
        .collect();
    (output.status.code(), lines, text(&output.stderr))
}

#[test]
fn a_printed_pipeline_gives_the_same_result_from_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("demo.png");
    let picture = picture.to_str().unwrap();
    let file = folder.path().join("mine.toml");
    let file = file.to_str().unwrap();
    for name in ["hybrid", "projective-cascade-point-plane"] {
        let shown = hybrid_icp(&["pipelines", "--show", name]);
        assert!(shown.status.success());
        std::fs::write(file, &shown.stdout).unwrap();
        let by_name = demo(&["--pipeline", name], picture);
        assert_eq!(by_name.0, Some(0));
        assert!(by_name.1.len() > 5);
        assert_eq!(demo(&["--pipeline", file], picture), by_name);
        // An override with the default value keeps the result; another value changes it.
        let metric = if name == "hybrid" {
            "times=2"
        } else {
            "stages.1.metric=point-to-plane"
        };
        assert_eq!(
            demo(&["--pipeline", name, "--set", metric], picture),
            by_name
        );
        let other = if name == "hybrid" {
            "times=0"
        } else {
            "stages.1.metric=point-to-point"
        };
        assert_ne!(
            demo(&["--pipeline", name, "--set", other], picture).1,
            by_name.1
        );
    }
}

#[test]
fn wrong_pipelines_are_refused_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("demo.png");
    let picture = picture.to_str().unwrap();
    let file = folder.path().join("wrong.toml");
    std::fs::write(
        &file,
        "type = \"icp\"\nselection = \"all-samples\"\nassociation = \"projectiv\"\n",
    )
    .unwrap();
    let (code, _, error) = demo(&["--pipeline", file.to_str().unwrap()], picture);
    assert_eq!(code, Some(1));
    assert!(
        error.contains("wrong.toml:3: association") && error.contains("\"projective\"?"),
        "{error}"
    );

    let (code, _, error) = demo(&["--pipeline", "/nowhere/there.toml"], picture);
    assert_eq!(code, Some(1));
    assert!(error.contains("/nowhere/there.toml"), "{error}");

    let (code, _, error) = demo(
        &[
            "--set",
            "stage.stages.1.misaligned.stages.1.switcher.alpah=0.5",
        ],
        picture,
    );
    assert_eq!(code, Some(1));
    assert!(
        error.contains("stage.stages.1.misaligned.stages.1.switcher.alpah")
            && error.contains("\"alpha\"?"),
        "{error}"
    );

    let (code, _, error) = demo(&["--pipeline", "hybird"], picture);
    assert_eq!(code, Some(2));
    assert!(error.contains("did you mean \"hybrid\"?"), "{error}");
    assert!(!std::path::Path::new(picture).exists());
}

#[test]
fn the_catalog_is_printed() {
    let output = hybrid_icp(&["pipelines", "--parts"]);
    assert!(output.status.success());
    let page = text(&output.stdout);
    for name in [
        "### hybrid",
        "### projective (",
        "### generalized (",
        "### trimmed (",
    ] {
        assert_eq!(page.contains(name), name != "### hybrid", "{name}");
    }
}
