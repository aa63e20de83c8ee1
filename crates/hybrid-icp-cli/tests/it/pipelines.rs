//! Pipelines from files and overrides, and limits on their work, through the program.

use crate::common::*;

/// Runs a demo, and returns it with its lines but the time and the names of pipeline and picture.
fn demo(folder: &Folder, options: &str) -> (Run, Vec<String>) {
    let run = folder.command(format!("demo {options}"));
    let names = [" ms ", "pipeline", "demo.png"];
    let lines = run
        .out
        .lines()
        .filter(|line| !names.iter().any(|name| line.contains(name)));
    let lines = lines.map(str::to_owned).collect();
    (run, lines)
}

#[test]
fn a_printed_pipeline_gives_the_same_result_from_its_file() {
    let folder = Folder::new();
    let lines = |options: &str| {
        let (run, lines) = demo(&folder, options);
        run.exits(0);
        lines
    };
    // An override with the default value keeps the result; another value changes it.
    for (name, default, other) in [
        ("hybrid", "times=2", "times=0"),
        (
            "projective-cascade-point-plane",
            "stages.1.metric=point-to-plane",
            "stages.1.metric=point-to-point",
        ),
    ] {
        let shown = folder.command(format!("pipelines --show {name}")).exits(0);
        folder.write("mine.toml", shown.out);
        let by_name = lines(&format!("--pipeline {name}"));
        assert!(by_name.len() > 5);
        assert_eq!(lines("--pipeline mine.toml"), by_name);
        assert_eq!(
            lines(&format!("--pipeline {name} --set {default}")),
            by_name
        );
        assert_ne!(lines(&format!("--pipeline {name} --set {other}")), by_name);
    }
}

#[test]
fn wrong_pipelines_are_refused_with_their_place() {
    let folder = Folder::new();
    let wrong = "type = \"icp\"\nselection = \"all-samples\"\nassociation = \"projectiv\"\n";
    folder.write("wrong.toml", wrong);
    let parameter = "stage.stages.1.misaligned.stages.1.switcher.alpah";
    for (options, code, parts) in [
        (
            "--pipeline wrong.toml",
            1,
            &["wrong.toml:3: association", "\"projective\"?"][..],
        ),
        (
            "--pipeline /nowhere/there.toml",
            1,
            &["/nowhere/there.toml"],
        ),
        (
            &format!("--set {parameter}=0.5"),
            1,
            &[parameter, "\"alpha\"?"],
        ),
        ("--pipeline hybird", 2, &["did you mean \"hybrid\"?"]),
    ] {
        demo(&folder, options).0.exits(code).complains(parts);
    }
    assert!(!folder.path("demo.png").exists());
}

#[test]
fn the_catalog_is_printed() {
    let page = Folder::new().command("pipelines --parts").exits(0).out;
    assert_contains(
        &page,
        &["### projective (", "### generalized (", "### trimmed ("],
    );
    assert!(!page.contains("### hybrid"));
}

#[test]
fn pipelines_that_would_run_for_years_are_refused_and_the_limits_can_be_raised() {
    let scene = Scene::new()
        .with("--pipeline", "hybrid")
        .with("--set", "times=1000000000");
    scene.run().fails(&[
        "error: hybrid: times: found 1000000000, up to ",
        "expected at most 1000000",
        "--max-iterations N",
    ]);
    assert!(!scene.path("out.json").exists());
    // In the worst case, the pipeline runs three times two stages of 50 iterations.
    let limited = |limit: &str| {
        Scene::new()
            .with("--pipeline", "hybrid")
            .with("--set", "times=3")
            .with("--max-iterations", limit)
    };
    limited("299")
        .run()
        .fails(&["hybrid: times: found 3, up to 300 iterations in all, expected at most 299"]);
    limited("300").result();

    let search = Scene::new()
        .with("--pipeline", "search")
        .with("--set", "hypotheses=100001");
    search.run().fails(&[
        "search: hypotheses: found 100001, 100001 hypotheses, expected at most 100000",
        "--max-hypotheses N",
    ]);
    search.with("--max-hypotheses", "100001").result();

    let folder = Folder::new();
    let hybrid = folder.command("pipelines --show hybrid").exits(0).out;
    let endless = hybrid.replace("times = 2", "times = 2000000000");
    assert_ne!(endless, hybrid);
    folder.write("endless.toml", endless);
    let experiment =
        "experiment init-noise --household tuning --poses 1 --out out --variants endless.toml";
    folder
        .command(experiment)
        .fails(&["times: found 2000000000", "--max-iterations N"]);
    assert_eq!(folder.names(""), ["endless.toml"]);
}
