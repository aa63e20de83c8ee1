//! Limits on the work that pipelines request, through the program.

use crate::common::*;

#[test]
fn pipelines_that_would_run_for_years_are_refused_and_the_limits_can_be_raised() {
    let scene = Scene::new()
        .with("--pipeline", "hybrid")
        .with("--set", "times=1000000000");
    scene.run().exits(1).complains(&[
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
        .exits(1)
        .complains(&["hybrid: times: found 3, up to 300 iterations in all, expected at most 299"]);
    limited("300").result();

    let search = Scene::new()
        .with("--pipeline", "search")
        .with("--set", "hypotheses=100001");
    search.run().exits(1).complains(&[
        "search: hypotheses: found 100001, 100001 hypotheses, expected at most 100000",
        "--max-hypotheses N",
    ]);
    search.with("--max-hypotheses", "100001").result();

    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let hybrid = run(folder, ["pipelines", "--show", "hybrid"]).exits(0).out;
    let endless = hybrid.replace("times = 2", "times = 2000000000");
    assert_ne!(endless, hybrid);
    std::fs::write(folder.join("endless.toml"), endless).unwrap();
    let experiment =
        "experiment init-noise --household tuning --poses 1 --out out --variants endless.toml";
    run(folder, experiment.split(' '))
        .exits(1)
        .complains(&["times: found 2000000000", "--max-iterations N"]);
    assert_eq!(names(folder), ["endless.toml"]);
}
