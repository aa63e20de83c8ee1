//! `hybrid-icp bop compare` on a generated dataset.

use crate::common::*;
use serde_json::Value;

const COMPARE: &str =
    "bop compare --dataset set --init set/initial_synthetic-test.csv --out compared";

/// Returns the cells of the first table without its head.
fn cells(folder: &Folder) -> Vec<Vec<String>> {
    let text = folder.read("compared/compare.md");
    let lines = text
        .lines()
        .skip(2)
        .take_while(|line| line.starts_with('|'));
    let cells = |line: &str| {
        line.trim_matches('|')
            .split('|')
            .map(|c| c.trim().to_owned())
            .collect()
    };
    lines.map(cells).collect()
}

#[test]
fn pipelines_are_compared_by_the_numbers_of_eval() {
    let folder = Folder::new();
    let words = "bop generate --scenes 1 --images 2 --instances 5 --out set";
    folder.command(words).exits(0);
    // The page names files without their folders.
    let (dataset, init) = (
        folder.path("set"),
        folder.path("set/initial_synthetic-test.csv"),
    );
    let words = format!(
        "bop compare --dataset {} --init {} --out compared --pipelines hybrid,nn-point-to-point",
        dataset.display(),
        init.display()
    );
    let told = folder.command(words).exits(0);
    // Warnings about poses name the file of their pipeline.
    let begin = "warning: compared/nn-point-to-point.csv: ";
    assert!(
        told.err.lines().count() == 1 && told.err.starts_with(begin),
        "{}",
        told.err
    );
    assert_eq!(
        folder.names("compared"),
        [
            "compare.html",
            "compare.json",
            "compare.md",
            "hybrid.csv",
            "hybrid.json",
            "initial.json",
            "nn-point-to-point.csv",
            "nn-point-to-point.json",
            "ray-shift.csv",
            "ray-shift.json"
        ]
    );
    let cells = cells(&folder);
    let named: Vec<&str> = cells.iter().map(|line| line[0].as_str()).collect();
    assert_eq!(
        named,
        ["initial", "ray-shift", "hybrid", "nn-point-to-point"]
    );
    for line in &cells {
        let report = folder.json(format!("compared/{}.json", line[0]));
        let keys = ["ar", "ar_vsd", "ar_mssd", "ar_mspd"];
        for (key, cell) in keys.iter().zip(&line[1..]) {
            assert_eq!(&format!("{:.3}", report[key].as_f64().unwrap()), cell);
        }
        let adi = report["median_adi_mm"].as_f64().unwrap();
        assert_eq!(format!("{adi:.2}"), line[5]);
        for (key, cell) in ["mssd_recall", "add_recall"].iter().zip(&line[10..]) {
            assert_eq!(&format!("{:.3}", report[key].as_f64().unwrap()), cell);
        }
        let words = || line.iter().flat_map(|cell| cell.split_whitespace());
        let mut printed = told.out.lines();
        assert!(
            printed.any(|line| line.split_whitespace().eq(words())),
            "{}",
            told.out
        );
        // The interval contains the AR, and the difference is that of two ARs.
        let ends: Vec<f64> = line[12]
            .split(" to ")
            .map(|end| end.parse().unwrap())
            .collect();
        let ar = line[1].parse::<f64>().unwrap();
        assert!(ends[0] <= ar && ar <= ends[1], "{line:?}");
        let gain = line[13].split(' ').next().unwrap().parse::<f64>();
        let expected = ar - cells[2][1].parse::<f64>().unwrap();
        assert!(gain.map_or(line[0] == "hybrid", |gain| (gain - expected).abs() < 0.002));
    }
    assert_eq!(cells[0][6..10], ["-"; 4]);
    let number = |line: usize, cell: usize| cells[line][cell].parse::<f64>().unwrap();
    // Most poses are better after Hybrid ICP than before, and no share is above the whole.
    assert!(number(2, 1) > number(0, 1) && number(2, 6) > 80.0);
    for line in [1, 2, 3] {
        assert!(number(line, 6) + number(line, 7) <= 100.05);
        assert!(number(line, 8) > 0.0);
        let ratio = number(line, 8) / number(2, 8);
        assert!((number(line, 9) - ratio).abs() < 0.01 + 0.01 * ratio);
    }
    let read = |name: &str| folder.read(format!("compared/{name}"));
    let document = folder.json("compared/compare.json");
    for (entry, line) in document["entries"].as_array().unwrap().iter().zip(&cells) {
        let report = folder.json(format!("compared/{}.json", line[0]));
        assert_eq!(entry["name"].as_str().unwrap(), line[0]);
        for key in [
            "ar",
            "mssd_recall",
            "add_recall",
            "mssd_mm_recalls",
            "objects",
        ] {
            assert_eq!(entry[key], report[key], "{key}");
        }
    }
    // The page has the same numbers, loads no other file, and has a row per object.
    let page = read("compare.html");
    let plain = page.replace("<b>", "").replace("</b>", "");
    for line in &cells {
        let row: String = line.iter().map(|cell| format!("<td>{cell}</td>")).collect();
        assert!(plain.contains(&format!("<tr>{row}</tr>")), "{row}");
    }
    for loaded in ["href=", "url(", "<script"] {
        assert!(!page.contains(loaded), "{loaded}");
    }
    assert_eq!(page.matches("src=").count(), 3);
    let picture = "<figure><img src=\"data:image/png;base64,iVBORw0KGgo";
    assert_eq!(page.matches(picture).count(), 3);
    // A dot per line for AR and for the median ADI.
    assert_eq!(page.matches("<circle").count(), 8);
    let best = cells.iter().map(|line| &line[1]).max().unwrap();
    assert!(page.contains(&format!("<td><b>{best}</b></td>")), "{best}");
    let least = cells.iter().map(|line| &line[5]);
    let least = least
        .min_by_key(|cell| (cell.len(), (*cell).clone()))
        .unwrap();
    assert!(
        page.contains(&format!("<td><b>{least}</b></td>")),
        "{least}"
    );
    let path = folder.root().to_str().unwrap();
    for name in ["compare.html", "compare.md"] {
        let text = read(name);
        assert!(text.contains("initial_synthetic-test.csv in set, split test: "));
        assert!(!text.contains(path), "{name}");
    }
    let objects = document["entries"][0]["objects"].as_object().unwrap();
    for id in objects.keys() {
        assert_eq!(plain.matches(&format!("<tr><td>{id}</td>")).count(), 2);
        assert_eq!(
            read("compare.md").matches(&format!("\n| {id} |")).count(),
            2
        );
    }

    // The masks are those of `bop refine`, and only the given targets count.
    let (rows, targets) = (document["entries"][0]["targets"].as_u64(), "targets.json");
    let first = r#"[{"scene_id": 1, "im_id": 0, "obj_id": OBJ, "inst_count": 1},
                    {"scene_id": 1, "im_id": 99, "obj_id": OBJ, "inst_count": 1}]"#;
    let id = objects.keys().next().unwrap();
    folder.write(targets, first.replace("OBJ", id));
    let options = "--mask none --no-color --models models --targets targets.json --set times=1";
    let words = format!(
        "bop compare --dataset set --results set/initial_synthetic-test.csv --pipelines hybrid --out boxes {options}"
    );
    let told = folder.command(words).exits(0);
    let left_out = "\n1 targets could not be evaluated and are left out\n";
    told.prints(&[left_out]);
    let boxes = folder.json("boxes/compare.json");
    assert!(rows > Some(1) && boxes["entries"][0]["targets"] == 1);
    assert_eq!(boxes["entries"][2]["ar_interval"], Value::Null);
    let text = folder.read("boxes/compare.md");
    let subject = "split test, without masks, times=1: 1 targets; 1 targets could not be evaluated";
    assert_contains(&text, &[subject]);

    // `bop refine` alone writes the same poses.
    let words = "bop refine --dataset set --results set/initial_synthetic-test.csv --pipeline hybrid --output alone.csv";
    folder.command(words).exits(0);
    let poses = |name: &str| -> Vec<_> {
        let rows = hicp_io::bop::read_results(folder.path(name)).unwrap();
        rows.iter().map(|row| row.camera_from_object()).collect()
    };
    assert_eq!(poses("alone.csv"), poses("compared/hybrid.csv"));
    let words = format!("{words} --mask none --set times=1");
    folder.command(words).exits(0);
    assert_eq!(poses("alone.csv"), poses("boxes/hybrid.csv"));
}

#[test]
fn wrong_pipelines_are_reported_before_anything_is_computed() {
    let folder = Folder::new();
    folder.write("hybrid.toml", "");
    for (pipelines, code, parts) in [
        (
            "hybird",
            2,
            &["--pipelines", "hybird", "did you mean \"hybrid\""][..],
        ),
        ("hybrid,hybrid", 1, &["--pipelines gives hybrid twice"]),
        ("compare.toml", 1, &["--pipelines gives compare", "differ"]),
        ("hybrid,hybrid.toml", 1, &["--pipelines gives hybrid twice"]),
        ("hybrid.toml", 1, &["hybrid.toml"]),
        ("hybrid,gone.toml", 1, &["gone.toml"]),
    ] {
        let words = format!("{COMPARE} --pipelines {pipelines}");
        folder.command(words).exits(code).complains(parts);
        assert_eq!(folder.names(""), ["hybrid.toml"]);
    }
    let words = format!("{COMPARE} --pipelines hybrid");
    folder.command(words).fails(&["initial_synthetic-test.csv"]);
}

#[test]
fn no_input_is_overwritten() {
    let folder = Folder::new();
    let words = "bop generate --scenes 1 --images 1 --instances 2 --out set";
    folder.command(words).exits(0);
    let init = folder.bytes("set/initial_synthetic-test.csv");
    let pipeline = folder.command("pipelines --show hybrid").out;
    folder.create_dir("out");
    for name in ["hybrid.csv", "hybrid.csv.journal"] {
        folder.write(format!("out/{name}"), &init);
    }
    folder.write("test_targets_bop19.toml", &pipeline);
    for (init, pipelines, out, parts) in [
        (
            "out/hybrid.csv",
            "nn-point-to-point,hybrid",
            "out",
            &["--out and --results both name out/hybrid.csv"][..],
        ),
        (
            "out/hybrid.csv.journal",
            "hybrid",
            "./out",
            &["--out and --results both name ./out/hybrid.csv.journal"],
        ),
        (
            "set/initial_synthetic-test.csv",
            "test_targets_bop19.toml",
            "set",
            &[
                "--out names set/test_targets_bop19.json",
                "belongs to the dataset set",
            ],
        ),
    ] {
        let words =
            format!("bop compare --dataset set --init {init} --pipelines {pipelines} --out {out}");
        let told = folder.command(words).exits(1);
        assert_eq!(told.complains(parts).out, "");
        assert_eq!(folder.names("out"), ["hybrid.csv", "hybrid.csv.journal"]);
    }
    for name in ["hybrid.csv", "hybrid.csv.journal"] {
        assert_eq!(folder.bytes(format!("out/{name}")), init);
    }
}
