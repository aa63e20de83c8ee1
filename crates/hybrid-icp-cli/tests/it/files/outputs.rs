//! Outputs never replace other data of the user.
//!
//! Such data are redirected files, files of the dataset, rows of the input, and other outputs.

use std::os::unix::fs::symlink;

use crate::common::*;
use hicp_io::bop::write_results;
#[cfg(target_os = "linux")]
use {serde_json::Value, std::fs::File, std::os::unix::fs::MetadataExt};

/// Runs the program with its standard output in a file.
#[cfg(target_os = "linux")]
#[track_caller]
fn redirected(folder: &Folder, words: &str, file: File) -> Run {
    let mut command = program(folder.root());
    command.args(words.split(' ')).stdout(file);
    Run::from(command.output().unwrap())
}

#[cfg(target_os = "linux")]
const REFINE: &str = "refine --model mesh.ply --model-unit m --depth depth.png --depth-scale 0.1 --mask mask.png \
                      --camera camera.json --init init.json --output";

/// `--output - >> log` adds to the log.
#[cfg(target_os = "linux")]
#[test]
fn the_standard_output_is_added_to() {
    let scene = Scene::new();
    let folder = &scene.folder;
    scene.write("log", "precious\n");
    let inode = std::fs::metadata(scene.path("log")).unwrap().ino();
    let log = File::options().append(true).open(scene.path("log"));
    // The summary is not mixed with the result.
    let told = redirected(folder, &format!("{REFINE} -"), log.unwrap()).exits(0);
    told.complains(&["MVE"]);
    let text = scene.read("log");
    let added = text.strip_prefix("precious\n").unwrap();
    serde_json::from_str::<Value>(added).unwrap();
    let after = std::fs::metadata(scene.path("log")).unwrap().ino();
    assert_eq!(after, inode, "replaced");
    // As with `> log`, this file is not opened for appending, so the stream has its own position.
    let log = File::create(scene.path("log")).unwrap();
    redirected(folder, &format!("{REFINE} -"), log).exits(0);
    serde_json::from_str::<Value>(&scene.read("log")).unwrap();
    assert!(!folder.names("").iter().any(|name| name.ends_with(".tmp")));
}

/// Other names of a redirected stream are refused.
///
/// Replacing its file would lose the text that a shell writes to it.
#[cfg(target_os = "linux")]
#[test]
fn files_behind_streams_are_not_replaced() {
    let scene = Scene::new();
    for name in ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"] {
        scene.write("log", "precious\n");
        let log = File::options().append(true).open(scene.path("log"));
        redirected(&scene, &format!("{REFINE} {name}"), log.unwrap())
            .fails(&[&format!("cannot write {name}"), "- for the standard output"]);
        assert_eq!(scene.read("log"), "precious\n");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn the_standard_output_of_the_commands_over_datasets() {
    let world = World::new();
    let folder = &world.folder;
    write_results(world.path("in.csv"), &world.rows()).unwrap();
    let add_to = |name: &str, words: &str| {
        let file = File::options().append(true).open(world.path(name));
        redirected(folder, words, file.unwrap())
    };
    world.write("log", "precious\n");
    let words = "bop eval --dataset . --results in.csv --json -";
    add_to("log", words).exits(0);
    let text = world.read("log");
    assert!(text.starts_with("precious\n{"), "{text}");

    // There is no journal next to a stream.
    world.write("-.journal", "my notes");
    world.write("log", "");
    let refine = "bop refine --dataset . --results in.csv --no-time --output";
    add_to("log", &format!("{refine} -")).exits(0);
    folder.command(format!("{refine} out.csv")).exits(0);
    let rows = world.read("out.csv");
    let text = world.read("log");
    assert!(text.starts_with(&rows), "{text}");
    let notes = world.bytes("-.journal");
    assert_eq!(notes, b"my notes");
}

/// Creates a dataset with the usual other files, and with results next to it.
fn dataset() -> World {
    let world = World::new();
    for name in ["train_pbr/000007", "models_eval", "models_fine", "results"] {
        world.create_dir(name);
    }
    let targets = r#"[{"scene_id": 3, "im_id": 40, "obj_id": 1, "inst_count": 2}]"#;
    world.write("test_targets_bop19.json", targets);
    for name in [
        "camera_uw.json",
        "dataset_info.md",
        "train_pbr/notes",
        "train_pbr/000007/scene_gt.json",
        "models_eval/models_info.json",
        "models_fine/obj_000001.ply",
        "results/old.json",
        "old.json",
    ] {
        world.write(name, "{}");
    }
    write_results(world.path("in.csv"), &world.rows()).unwrap();
    world
}

/// Every command over datasets, without the path of one of its outputs.
const COMMANDS: [(&str, &str); 7] = [
    ("bop refine --dataset . --results in.csv", "--output"),
    (
        "bop refine --dataset . --results in.csv --output new.csv",
        "--rows",
    ),
    ("bop eval --dataset . --results in.csv", "--json"),
    ("bop eval --dataset . --results in.csv", "--errors"),
    (
        "bop show --dataset . --scene 3 --image 40 --results in.csv",
        "--out",
    ),
    (
        "bop sequence --dataset . --scene 3 --object 1 --init in.csv",
        "--output",
    ),
    (
        "bop sequence --dataset . --scene 3 --object 1 --init in.csv --output new.jsonl",
        "--results",
    ),
];

#[test]
fn files_of_the_dataset_are_spared_by_every_command() {
    let world = dataset();
    let folder = &world.folder;
    symlink("test/000003/scene_gt.json", world.path("link.json")).unwrap();
    let before = folder.files("");
    for (command, option) in COMMANDS {
        for path in [
            "models/obj_000002.ply",
            "models_eval/models_info.json",
            "test/000003/depth/000000.png",
            "results/../test/000003/scene_camera.json",
            "test_targets_bop19.json",
            "link.json",
        ] {
            let words = format!("{command} {option} {path}");
            let told = folder.command(words).exits(1);
            let names = format!("error: {option} names {path}, which belongs to");
            assert_eq!(told.complains(&[&names, "overwritten"]).out, "");
        }
        assert_eq!(folder.files(""), before, "{command} {option}");
    }
    let words = "bop compare --dataset . --init in.csv --pipelines scene_gt.toml --out test/000003";
    let pipeline = folder.command("pipelines --show hybrid").out;
    world.write("scene_gt.toml", pipeline);
    folder
        .command(words)
        .fails(&["--out names test/000003/scene_gt.json", "its scenes"]);
}

#[test]
fn files_are_divided_into_those_of_the_dataset_and_others() {
    let world = dataset();
    let folder = &world.folder;
    let before = folder.files("");
    let eval = |json: &str| {
        let words = "bop eval --dataset . --results in.csv --json";
        folder.command(format!("{words} {json}"))
    };
    // Files in the folders of any split belong to the dataset, and so do the usual files next to
    // them.
    for path in [
        "camera_uw.json",
        "dataset_info.md",
        "train_pbr/notes",
        "train_pbr/000007/scene_gt.json",
        "models_fine/obj_000001.ply",
    ] {
        eval(path).fails(&[path, "belongs to the dataset"]);
    }
    assert_eq!(folder.files(""), before);
    std::fs::remove_dir_all(world.path("models_eval")).unwrap();
    // Outputs of an earlier run inside the dataset's folder may be replaced, and new files may be
    // created anywhere.
    for path in [
        "old.json",
        "results/old.json",
        "test/../results/old.json",
        "new.json",
        "models/new.json",
        "test/000003/new.json",
    ] {
        eval(path).exits(0);
        let text = world.read(path);
        assert!(text.contains("\"ar\""), "{path}");
    }
    // With the split `.`, the dataset's folder contains scenes, but also other files.
    for path in ["7/scene_gt.json", "obj_000001.ply"] {
        std::fs::create_dir_all(world.path(path).parent().unwrap()).unwrap();
        world.write(path, "{}");
        let words = format!("bop eval --dataset . --split . --results in.csv --json {path}");
        folder.command(words).fails(&["belongs to the dataset"]);
    }
    let words = "bop eval --dataset . --split . --results in.csv --json old.json";
    let told = folder.command(words).exits(1);
    assert!(!told.err.contains("belongs"), "{}", told.err);
}

/// Splits, scenes and meshes are often links to another disk; neither name may be written to.
#[test]
fn links_do_not_hide_a_dataset() {
    let world = dataset();
    let folder = &world.folder;
    world.create_dir("disk");
    for (name, aside) in [
        ("test/000012", "disk/twelve"),
        ("models/obj_000001.ply", "disk/mesh"),
        ("train_pbr", "disk/train"),
        ("test_targets_bop19.json", "disk/targets"),
    ] {
        std::fs::rename(world.path(name), world.path(aside)).unwrap();
        symlink(world.path(aside), world.path(name)).unwrap();
    }
    symlink(".", world.path("again")).unwrap();
    let before = world.files("disk");
    for path in [
        "test/000012/scene_gt.json",
        "disk/twelve/scene_gt.json",
        "again/test/000012/depth/000000.png",
        "models/obj_000001.ply",
        "disk/mesh",
        "train_pbr/notes",
        "disk/train/000007/scene_gt.json",
        "test_targets_bop19.json",
        "disk/targets",
    ] {
        let words = "bop show --dataset again --scene 3 --image 40 --results in.csv --out";
        folder
            .command(format!("{words} {path}"))
            .fails(&[path, "belongs to the dataset again"]);
    }
    assert_eq!(world.files("disk"), before);
}

#[test]
fn a_result_file_in_a_split_is_refined_in_place() {
    let world = dataset();
    write_results(world.path("test/in.csv"), &world.rows()[..2]).unwrap();
    let before = world.bytes("test/in.csv");
    let words = "bop refine --dataset . --results test/in.csv --output ./test/in.csv";
    world.command(words).exits(0);
    assert_ne!(world.bytes("test/in.csv"), before);
}

/// A run in place writes every row or none.
#[test]
fn rows_that_are_left_out_are_not_lost_in_place() {
    let world = dataset();
    let folder = &world.folder;
    symlink("in.csv", world.path("link.csv")).unwrap();
    let before = world.bytes("in.csv");
    // There are ten rows, three for each image with a hammer, and two targets.
    for (option, left_out) in [
        ("--limit 4", "--limit leaves out 6 of its 10 rows"),
        ("--top-k 1", "--top-k leaves out 4 of its 10 rows"),
        (
            "--targets test_targets_bop19.json",
            "--targets leaves out 8 of its 10 rows",
        ),
        ("--shard 1/2", "--shard leaves out 4 of its 10 rows"),
        (
            "--limit 9 --shard 1/1",
            "--limit with --shard leaves out 1 of its 10 rows",
        ),
    ] {
        for output in ["in.csv", "./in.csv", "link.csv"] {
            let words =
                format!("bop refine --dataset . --results in.csv --output {output} {option}");
            let told = folder.command(words).exits(1);
            let both = format!("--output and --results both name {output}, and {left_out}");
            told.complains(&[&both, "would be lost"]);
            assert_eq!(world.bytes("in.csv"), before);
            assert!(!world.path("in.csv.journal").exists());
        }
    }
    // Options that leave no row out are accepted.
    let words =
        "bop refine --dataset . --results in.csv --output in.csv --limit 10 --shard 1/1 --top-k 2";
    folder.command(words).exits(0);
    let rows = hicp_io::bop::read_results(world.path("in.csv")).unwrap();
    assert_eq!(rows.len(), 10);
    assert_ne!(world.bytes("in.csv"), before);
}
