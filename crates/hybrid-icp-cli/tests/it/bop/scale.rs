//! `hybrid-icp bop refine` on large files: shards, limits, killed runs, scores.

use std::process::Stdio;
use std::time::{Duration, SystemTime};

use crate::common::*;
use hicp_io::bop::{ResultRow, read_results, write_results};
use hybrid_icp::core::{Isometry3, Vector3};

const OUTPUT: &str = "out.csv";
const JOURNAL: &str = "out.csv.journal";

/// Kills a run on one thread after one of four images, and returns its journal.
fn killed(world: &World, options: &str) -> Vec<u8> {
    let words = "bop refine --dataset . --results in.csv --output out.csv --threads 1";
    let mut program = program(world.root());
    program
        .args(words.split(' '))
        .args(options.split(' '))
        .stdout(Stdio::null());
    let mut child = program.spawn().unwrap();
    wait_for_lines(&mut child, &world.path(JOURNAL), 2);
    // This sends SIGKILL on systems with signals.
    child.kill().unwrap();
    assert!(!child.wait().unwrap().success(), "finished too early");
    assert!(n_lines(&world.path(JOURNAL)) < 5);
    world.bytes(JOURNAL)
}

#[test]
fn a_killed_run_continues_to_the_same_bytes() {
    let world = World::new();
    let rows = grouped_for_signals(&world);
    world.refined(&rows, "--no-time");
    let expected = world.bytes(OUTPUT);
    assert!(!world.path(JOURNAL).exists());
    world.write("out.csv", "the user's");

    let held = killed(&world, "--no-time");
    // There is no partial output.
    assert_eq!(world.bytes(OUTPUT), b"the user's");
    world
        .run("--no-time")
        .fails(&["out.csv.journal", "unfinished run", "--resume"]);
    for (option, found, expected) in [
        ("--limit 7", "--limit=none", "--limit=7"),
        ("--shard 1/2", "--shard=none", "--shard=1/2"),
        (
            "--pipeline nn-point-to-point",
            "--pipeline=auto,",
            "--pipeline=nn-point-to-point",
        ),
        (
            "--set refined=1",
            "--pipeline=auto,",
            "--pipeline=auto refined=1",
        ),
    ] {
        let parts = [format!("found \"{found}"), format!("expected \"{expected}")];
        let run = world.run(&format!("{option} --resume"));
        run.fails(&parts.each_ref().map(String::as_str));
    }
    let other: Vec<_> = rows.iter().rev().cloned().collect();
    write_results(world.path("in.csv"), &other).unwrap();
    world.run("--resume").fails(&["found \"digest-of-results="]);
    write_results(world.path("in.csv"), &rows).unwrap();
    assert_eq!(world.bytes(JOURNAL), held);

    let run = world.run("--no-time --resume").exits(0);
    run.prints(&["frames from the journal"]);
    assert_eq!(run.err, "");
    assert_eq!(world.bytes(OUTPUT), expected);
    assert!(!world.path(JOURNAL).exists());

    // If the end of a run cut off a line, its image is refined again.
    for length in [3, held.len() / 2, held.len() - 1] {
        world.write(JOURNAL, &held[..length]);
        world.run("--no-time --resume --threads 2").exits(0);
        assert_eq!(world.bytes(OUTPUT), expected);
    }
    // Images in the journal are not refined again: their results are written as stored.
    let text = String::from_utf8(held).unwrap();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    lines[1] = lines[1].replacen("\"refined\"", "\"kept: no mask of the object\"", 1);
    world.write(JOURNAL, lines.join("\n") + "\n");
    let run = world.run("--no-time --resume").exits(0);
    run.prints(&["1  kept: no mask of the object"]);
    // Without a journal, there is nothing to continue.
    let run = world.run("--no-time --resume").exits(0);
    assert!(!run.out.contains("journal"));
    assert_eq!(world.bytes(OUTPUT), expected);
}

#[test]
fn images_of_damaged_journal_lines_are_refined_again() {
    let world = World::new();
    world.refined(&grouped_for_signals(&world), "--no-time");
    let expected = world.bytes(OUTPUT);
    let held = killed(&world, "--no-time");
    let begin = held.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    let length = held[begin..].iter().position(|b| *b == b'\n').unwrap();
    // The lines are one that does not parse, one of another image, and one without its end.
    for (place, bit) in [(begin, 1), (begin + 1, 1), (begin + length, 4)] {
        let mut changed = held.clone();
        changed[place] ^= bit;
        world.write(JOURNAL, changed);
        let run = world.run("--no-time --resume").exits(0);
        assert_eq!(world.bytes(OUTPUT), expected, "byte {place}");
        // A line without its end may be one that was cut off, so it gives no warning.
        if place < begin + length {
            run.complains(&["warning: out.csv.journal: 1 lines are damaged"]);
        }
    }
}

#[test]
fn a_run_continues_only_with_the_files_that_it_started_with() {
    let world = World::new();
    world.remove("models/models_info.json");
    world.refined(&grouped_for_signals(&world), "--no-time");
    let expected = world.bytes(OUTPUT);
    let held = killed(&world, "--no-time");
    let refused = |name: &str, parts: [&str; 2]| {
        let name = format!("out.csv.journal, line 1: found \"{name}=");
        let run = world.run("--no-time --resume").exits(1);
        run.complains(&[&name, parts[0], parts[1]]);
        assert_eq!(world.bytes(JOURNAL), held);
    };
    for name in [
        "models/obj_000001.ply",
        "models/obj_000002.ply",
        "test/000003/scene_camera.json",
        "test/000012/scene_gt.json",
    ] {
        let path = world.path(name);
        let (content, metadata) = (world.bytes(&path), path.metadata().unwrap());
        let changed_at = |time: SystemTime| {
            let file = std::fs::File::options().append(true).open(&path).unwrap();
            file.set_modified(time).unwrap();
        };
        let time = metadata.modified().unwrap();
        // Change only the time, then only the size.
        changed_at(time + Duration::from_secs(10));
        refused(name, ["-bytes@", "expected \""]);
        world.write(&path, [&content[..], b" "].concat());
        changed_at(time);
        let sizes = [content.len(), content.len() + 1].map(|n| format!("{n}-bytes@"));
        refused(
            name,
            [&sizes[0], &format!("expected \"{name}={}", sizes[1])],
        );
        world.write(&path, content);
        changed_at(time);
    }
    for name in ["models/models_info.json", "test/000003/scene_gt_info.json"] {
        world.write(name, "{}");
        refused(name, ["=absent", "=2-bytes@"]);
        world.remove(name);
    }
    // Scenes without rows do not belong to this run.
    world.create_dir("test/000004");
    world.write("test/000004/scene_gt.json", "{}");
    world.run("--no-time --resume").exits(0);
    assert_eq!(world.bytes(OUTPUT), expected);
}

#[test]
fn a_continued_run_repeats_the_warnings() {
    let world = World::new();
    for scene in [3, 12] {
        let path = world.scene(scene).join("scene_camera.json");
        world.replace(path, "\"depth_scale\":0.1", "\"depth_scale\":1.0");
    }
    // A search for a pose at the wrong distance would take long.
    let options = "--no-time --pipeline local";
    let (whole, _) = world.refine(&grouped_for_signals(&world), options);
    let whole = whole.warns(&["check depth_scale"]);
    killed(&world, options);
    let run = world.run(&format!("{options} --resume")).exits(0);
    run.prints(&["frames from the journal"]);
    assert_eq!(run.err, whole.err);
}

#[test]
fn another_file_in_the_place_of_the_journal_is_not_changed() {
    let world = World::new();
    let rows = grouped(&world, 1);
    write_results(world.path("in.csv"), &rows).unwrap();
    world.write("notes", "my notes");
    for (resume, complaint) in [("", "remove the file"), ("--resume", "found \"my notes\"")] {
        world.write(JOURNAL, "my notes");
        let parts = ["out.csv.journal", complaint];
        world.run(resume).fails(&parts);
        assert_eq!(world.bytes(JOURNAL), b"my notes");
        world.remove(JOURNAL);
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("notes", world.path(JOURNAL)).unwrap();
            world.run(resume).fails(&parts);
            assert_eq!(world.bytes("notes"), b"my notes");
            world.remove(JOURNAL);
        }
        world.create_dir(JOURNAL);
        world.run(resume).fails(&["out.csv.journal"]);
        std::fs::remove_dir(world.path(JOURNAL)).unwrap();
    }
    // The journal and the file of `--rows` may not replace an input or the output.
    write_results(world.path("k.csv.journal"), &rows).unwrap();
    let input = world.bytes("k.csv.journal");
    let words = "bop refine --dataset . --results k.csv.journal --output k.csv";
    world
        .command(words)
        .fails(&["the journal of --output and --results both name k.csv.journal"]);
    for (rows, other) in [
        ("k.csv.journal", "--results"),
        ("out.csv", "--output"),
        ("out.csv.journal", "the journal of --output"),
    ] {
        let words = "bop refine --dataset . --results k.csv.journal --output out.csv --rows";
        world
            .command(format!("{words} {rows}"))
            .fails(&[&format!("--rows and {other} both name {rows}")]);
    }
    assert_eq!(world.bytes("k.csv.journal"), input);
    assert!(!world.path("k.csv").exists() && !world.path("out.csv").exists());
}

/// The output may be the input. It is replaced last, so that a run that fails before can continue.
#[cfg(target_os = "linux")]
#[test]
fn a_run_in_place_that_cannot_write_its_rows_can_continue() {
    let world = World::new();
    write_results(world.path("io.csv"), &world.rows()).unwrap();
    let input = world.bytes("io.csv");
    let refine = |options: &str| {
        let words = "bop refine --dataset . --results io.csv --output io.csv --no-time --rows";
        world.command(format!("{words} {options}"))
    };
    refine("/dev/full").fails(&["/dev/full", "No space left"]);
    assert_eq!(world.bytes("io.csv"), input);
    refine("rows.csv --resume").exits(0);
    assert_ne!(world.bytes("io.csv"), input);
    assert!(world.path("rows.csv").exists() && !world.path("io.csv.journal").exists());
}

#[test]
fn the_outputs_of_all_shards_equal_the_output_of_one_run() {
    let world = World::new();
    write_results(world.path("in.csv"), &grouped(&world, 2)).unwrap();
    world.run("--no-time --rescore mve").exits(0);
    let whole = String::from_utf8(world.bytes(OUTPUT)).unwrap();
    for count in [2, 3, 9] {
        let mut joined = String::new();
        for index in 1..=count {
            let options = format!("--no-time --rescore mve --shard {index}/{count}");
            let run = world.run(&options).exits(0);
            assert_eq!(run.err, "");
            let text = String::from_utf8(world.bytes(OUTPUT)).unwrap();
            let (header, rows) = text.split_once('\n').unwrap();
            if index == 1 {
                joined = format!("{header}\n");
            }
            joined.push_str(rows);
        }
        assert_eq!(joined, whole, "{count}");
    }

    // If rows are scattered, the lines have another order, and a warning reports it.
    let rows = world.rows();
    world.refined(&rows, "--no-time");
    let sorted = |texts: &[Vec<u8>]| {
        let texts = texts.iter().map(|text| String::from_utf8_lossy(text));
        let lines = texts.flat_map(|text| {
            let lines = text.lines().skip(1).map(str::to_owned);
            lines.collect::<Vec<_>>()
        });
        let mut lines: Vec<String> = lines.collect();
        lines.sort();
        lines
    };
    let whole = world.bytes(OUTPUT);
    let parts = ["1/2", "2/2"].map(|shard| {
        world
            .run(&format!("--no-time --shard {shard}"))
            .warns(&["warning: in.csv: the rows of an image are not contiguous"]);
        world.bytes(OUTPUT)
    });
    assert!(parts.iter().all(|part| part.len() > 200));
    assert_eq!(sorted(&parts), sorted(&[whole]));
}

#[test]
fn limits_and_scores() {
    let world = World::new();
    let mut rows = grouped(&world, 1);
    let pose = rows[0].camera_from_object();
    rows.insert(1, ResultRow::new(12, 40, ABSENT, pose));
    let aside = Isometry3::translation(0.0, 3.0, 0.0) * pose;
    rows.insert(2, ResultRow::new(12, 40, CAR, aside));
    let upside_down = pose * Isometry3::rotation(Vector3::x() * std::f64::consts::PI);
    rows.insert(3, ResultRow::new(12, 40, CAR, upside_down));
    write_results(world.path("in.csv"), &rows).unwrap();
    // This pipeline does not search, so the upside-down pose stays wrong.
    let run = |options: &str| world.run(&format!("--no-time --pipeline hybrid {options}"));
    run("").exits(0);
    let all = read_results(world.path("out.csv")).unwrap();
    run("--limit 5").exits(0);
    assert_eq!(read_results(world.path("out.csv")).unwrap(), all[..5]);
    run("--limit 99999").exits(0);
    assert_eq!(read_results(world.path("out.csv")).unwrap(), all);

    let run = run("--rescore mve").exits(0);
    let scored = read_results(world.path("out.csv")).unwrap();
    for (index, (before, after)) in all.iter().zip(&scored).enumerate() {
        assert!(same_pose(before, after));
        assert_eq!(before.score, 1.0);
        match index {
            1 | 2 => assert_eq!(after.score, 0.0),
            _ => assert!(after.score > 0.0 && after.score <= 1.0),
        }
    }
    // The result from the upside-down pose explains the image worse than all other poses.
    let others = scored[4..].iter().chain(&scored[..1]);
    let lowest = others.map(|row| row.score).fold(1.0, f64::min);
    let score = scored[3].score;
    assert!(score < lowest && lowest > 0.8, "{score} {lowest}");
    let mut known: Vec<f64> = scored.iter().map(|row| row.score).collect();
    known.retain(|score| *score > 0.0);
    known.sort_by(f64::total_cmp);
    let n = known.len();
    let median = 1.0 - 0.5 * (known[(n - 1) / 2] + known[n / 2]);
    run.prints(&[&format!("-> {median:.3}")]);

    for (option, value, expected) in [
        ("--shard", "0/2", "I/N with 1 <= I <= N"),
        ("--shard", "3/2", "I/N with 1 <= I <= N"),
        ("--shard", "-1/2", "I/N"),
        ("--limit", "0", "1.."),
        ("--limit", "-3", "1.."),
        ("--rescore", "vsd", "mve"),
    ] {
        let run = world.run(&format!("{option} {value}"));
        run.refuses(&[option, &format!("'{value}'"), expected]);
    }
}
