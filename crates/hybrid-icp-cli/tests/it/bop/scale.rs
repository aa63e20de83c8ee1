//! `hybrid-icp bop refine` on large files: shards, limits, killed runs, scores.

use std::time::{Duration, Instant, SystemTime};

use crate::common::*;
use crate::world::*;
use hicp_io::bop::{ResultRow, read_results, write_results};
use hybrid_icp::core::{Isometry3, Vector3};

fn output(world: &World) -> Vec<u8> {
    std::fs::read(world.path("out.csv")).unwrap()
}

fn journal(world: &World) -> std::path::PathBuf {
    world.path("out.csv.journal")
}

/// Kills a run on one thread after one of four images, and returns its journal.
fn killed(world: &World) -> Vec<u8> {
    let words = "bop refine --dataset . --results in.csv --output out.csv --no-time --threads 1";
    let mut child = program(world.folder.path())
        .args(words.split(' '))
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    let lines = || {
        let text = std::fs::read(journal(world)).unwrap_or_default();
        text.iter().filter(|byte| **byte == b'\n').count()
    };
    while lines() < 2 {
        assert!(child.try_wait().unwrap().is_none(), "finished too early");
        assert!(start.elapsed() < Duration::from_secs(300));
        std::thread::sleep(Duration::from_millis(1));
    }
    // This sends SIGKILL on systems with signals.
    child.kill().unwrap();
    assert!(!child.wait().unwrap().success(), "finished too early");
    assert!(lines() < 5);
    std::fs::read(journal(world)).unwrap()
}

#[test]
fn a_killed_run_continues_to_the_same_bytes() {
    let world = World::new();
    let rows = grouped_for_signals(&world);
    let (whole, _) = world.refine(&rows, &["--no-time"]);
    whole.exits(0);
    let expected = output(&world);
    assert!(!journal(&world).exists());
    std::fs::write(world.path("out.csv"), "the user's").unwrap();

    let held = killed(&world);
    // There is no partial output.
    assert_eq!(output(&world), b"the user's");
    world.run(&["--no-time"]).exits(1).complains(&[
        "out.csv.journal",
        "unfinished run",
        "--resume",
    ]);
    for (options, parts) in [
        (
            &["--limit", "7"][..],
            &["found \"--limit=none", "expected \"--limit=7"],
        ),
        (
            &["--shard", "1/2"],
            &["found \"--shard=none", "expected \"--shard=1/2"],
        ),
        (
            &["--pipeline", "nn-point-to-point"],
            &[
                "found \"--pipeline=auto,",
                "expected \"--pipeline=nn-point-to-point",
            ],
        ),
        (
            &["--set", "refined=1"],
            &[
                "found \"--pipeline=auto,",
                "expected \"--pipeline=auto refined=1",
            ],
        ),
    ] {
        let options = [options, &["--resume"]].concat();
        world.run(&options).exits(1).complains(parts);
    }
    let other: Vec<_> = rows.iter().rev().cloned().collect();
    write_results(world.path("in.csv"), &other).unwrap();
    world
        .run(&["--resume"])
        .exits(1)
        .complains(&["found \"digest-of-results="]);
    write_results(world.path("in.csv"), &rows).unwrap();
    assert_eq!(std::fs::read(journal(&world)).unwrap(), held);

    let run = world.run(&["--no-time", "--resume"]).exits(0);
    assert!(run.out.contains("frames from the journal"), "{}", run.out);
    assert_eq!(run.err, "");
    assert_eq!(output(&world), expected);
    assert!(!journal(&world).exists());

    // If the end of a run cut off a line, its image is refined again.
    for length in [3, held.len() / 2, held.len() - 1] {
        std::fs::write(journal(&world), &held[..length]).unwrap();
        world
            .run(&["--no-time", "--resume", "--threads", "2"])
            .exits(0);
        assert_eq!(output(&world), expected);
    }
    // Images in the journal are not refined again: their results are written as stored.
    let text = String::from_utf8(held).unwrap();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    lines[1] = lines[1].replacen("\"refined\"", "\"kept: no mask of the object\"", 1);
    std::fs::write(journal(&world), lines.join("\n") + "\n").unwrap();
    let run = world.run(&["--no-time", "--resume"]).exits(0);
    assert!(
        run.out.contains("1  kept: no mask of the object"),
        "{}",
        run.out
    );
    // Without a journal, there is nothing to continue.
    let run = world.run(&["--no-time", "--resume"]).exits(0);
    assert!(!run.out.contains("journal"));
    assert_eq!(output(&world), expected);
}

#[test]
fn images_of_damaged_journal_lines_are_refined_again() {
    let world = World::new();
    let (whole, _) = world.refine(&grouped_for_signals(&world), &["--no-time"]);
    whole.exits(0);
    let expected = output(&world);
    let held = killed(&world);
    let begin = held.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    let length = held[begin..].iter().position(|b| *b == b'\n').unwrap();
    // The lines are one that does not parse, one of another image, and one without its end.
    for (place, bit) in [(begin, 1), (begin + 1, 1), (begin + length, 4)] {
        let mut changed = held.clone();
        changed[place] ^= bit;
        std::fs::write(journal(&world), changed).unwrap();
        let run = world.run(&["--no-time", "--resume"]).exits(0);
        assert_eq!(output(&world), expected, "byte {place}");
        // A line without its end may be one that was cut off, so it gives no warning.
        if place < begin + length {
            run.complains(&["warning: out.csv.journal: 1 lines are damaged"]);
        }
    }
}

#[test]
fn a_run_continues_only_with_the_files_that_it_started_with() {
    let world = World::new();
    let (whole, _) = world.refine(&grouped_for_signals(&world), &["--no-time"]);
    whole.exits(0);
    let expected = output(&world);
    let held = killed(&world);
    let refused = |name: &str, parts: [&str; 2]| {
        let name = format!("out.csv.journal, line 1: found \"{name}=");
        let run = world.run(&["--no-time", "--resume"]).exits(1);
        run.complains(&[&name, parts[0], parts[1]]);
        assert_eq!(std::fs::read(journal(&world)).unwrap(), held);
    };
    for name in [
        "models/obj_000001.ply",
        "models/obj_000002.ply",
        "test/000003/scene_camera.json",
        "test/000012/scene_gt.json",
    ] {
        let path = world.path(name);
        let (content, metadata) = (std::fs::read(&path).unwrap(), path.metadata().unwrap());
        let changed_at = |time: SystemTime| {
            let file = std::fs::File::options().append(true).open(&path).unwrap();
            file.set_modified(time).unwrap();
        };
        let time = metadata.modified().unwrap();
        // Change only the time, then only the size.
        changed_at(time + Duration::from_secs(10));
        refused(name, ["-bytes@", "expected \""]);
        std::fs::write(&path, [&content[..], b" "].concat()).unwrap();
        changed_at(time);
        let sizes = [content.len(), content.len() + 1].map(|n| format!("{n}-bytes@"));
        refused(
            name,
            [&sizes[0], &format!("expected \"{name}={}", sizes[1])],
        );
        std::fs::write(&path, content).unwrap();
        changed_at(time);
    }
    for name in ["models/models_info.json", "test/000003/scene_gt_info.json"] {
        std::fs::write(world.path(name), "{}").unwrap();
        refused(name, ["=absent", "=2-bytes@"]);
        std::fs::remove_file(world.path(name)).unwrap();
    }
    // Scenes without rows do not belong to this run.
    std::fs::create_dir(world.path("test/000004")).unwrap();
    std::fs::write(world.path("test/000004/scene_gt.json"), "{}").unwrap();
    world.run(&["--no-time", "--resume"]).exits(0);
    assert_eq!(output(&world), expected);
}

#[test]
fn a_continued_run_repeats_the_warnings() {
    let world = World::new();
    for scene in [3, 12] {
        let path = world.scene(scene).join("scene_camera.json");
        let text = std::fs::read_to_string(&path).unwrap();
        let other = text.replace("\"depth_scale\":0.1", "\"depth_scale\":1.0");
        assert_ne!(text, other);
        std::fs::write(&path, other).unwrap();
    }
    let (whole, _) = world.refine(&grouped_for_signals(&world), &["--no-time"]);
    let whole = whole.exits(0).complains(&["check depth_scale"]);
    killed(&world);
    let run = world.run(&["--no-time", "--resume"]).exits(0);
    assert!(run.out.contains("frames from the journal"), "{}", run.out);
    assert_eq!(run.err, whole.err);
}

#[test]
fn another_file_in_the_place_of_the_journal_is_not_changed() {
    let world = World::new();
    let rows = grouped(&world, 1);
    write_results(world.path("in.csv"), &rows).unwrap();
    std::fs::write(world.path("notes"), "my notes").unwrap();
    for (resume, complaint) in [
        (&[][..], "remove the file"),
        (&["--resume"], "found \"my notes\""),
    ] {
        std::fs::write(journal(&world), "my notes").unwrap();
        let parts = ["out.csv.journal", complaint];
        world.run(resume).exits(1).complains(&parts);
        assert_eq!(std::fs::read(journal(&world)).unwrap(), b"my notes");
        std::fs::remove_file(journal(&world)).unwrap();
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("notes", journal(&world)).unwrap();
            world.run(resume).exits(1).complains(&parts);
            assert_eq!(std::fs::read(world.path("notes")).unwrap(), b"my notes");
            std::fs::remove_file(journal(&world)).unwrap();
        }
        std::fs::create_dir(journal(&world)).unwrap();
        world.run(resume).exits(1).complains(&["out.csv.journal"]);
        std::fs::remove_dir(journal(&world)).unwrap();
    }
    // The journal and the file of `--rows` may not replace an input or the output.
    write_results(world.path("k.csv.journal"), &rows).unwrap();
    let input = std::fs::read(world.path("k.csv.journal")).unwrap();
    let words = "bop refine --dataset . --results k.csv.journal --output k.csv";
    run(world.folder.path(), words.split(' '))
        .exits(1)
        .complains(&["the journal of --output and --results both name k.csv.journal"]);
    for (rows, other) in [
        ("k.csv.journal", "--results"),
        ("out.csv", "--output"),
        ("out.csv.journal", "the journal of --output"),
    ] {
        let words = "bop refine --dataset . --results k.csv.journal --output out.csv --rows";
        run(world.folder.path(), words.split(' ').chain([rows]))
            .exits(1)
            .complains(&[&format!("--rows and {other} both name {rows}")]);
    }
    assert_eq!(std::fs::read(world.path("k.csv.journal")).unwrap(), input);
    assert!(!world.path("k.csv").exists() && !world.path("out.csv").exists());
}

/// The output may be the input. It is replaced last, so that a run that fails before can continue.
#[cfg(target_os = "linux")]
#[test]
fn a_run_in_place_that_cannot_write_its_rows_can_continue() {
    let world = World::new();
    write_results(world.path("io.csv"), &world.rows()).unwrap();
    let input = std::fs::read(world.path("io.csv")).unwrap();
    let refine = |options: &str| {
        let words = "bop refine --dataset . --results io.csv --output io.csv --no-time --rows";
        run(
            world.folder.path(),
            words.split(' ').chain(options.split(' ')),
        )
    };
    refine("/dev/full")
        .exits(1)
        .complains(&["/dev/full", "No space left"]);
    assert_eq!(std::fs::read(world.path("io.csv")).unwrap(), input);
    refine("rows.csv --resume").exits(0);
    assert_ne!(std::fs::read(world.path("io.csv")).unwrap(), input);
    assert!(world.path("rows.csv").exists() && !world.path("io.csv.journal").exists());
}

#[test]
fn the_outputs_of_all_shards_equal_the_output_of_one_run() {
    let world = World::new();
    write_results(world.path("in.csv"), &grouped(&world, 2)).unwrap();
    world.run(&["--no-time", "--rescore", "mve"]).exits(0);
    let whole = String::from_utf8(output(&world)).unwrap();
    for count in [2, 3, 9] {
        let mut joined = String::new();
        for index in 1..=count {
            let shard = format!("{index}/{count}");
            let options = ["--no-time", "--rescore", "mve", "--shard", &shard];
            let run = world.run(&options).exits(0);
            assert_eq!(run.err, "");
            let text = String::from_utf8(output(&world)).unwrap();
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
    let (run, _) = world.refine(&rows, &["--no-time"]);
    run.exits(0);
    let sorted = |texts: &[Vec<u8>]| {
        let mut lines: Vec<String> = texts
            .iter()
            .flat_map(|text| {
                String::from_utf8_lossy(text)
                    .lines()
                    .skip(1)
                    .map(str::to_owned)
                    .collect::<Vec<_>>()
            })
            .collect();
        lines.sort();
        lines
    };
    let whole = output(&world);
    let parts = ["1/2", "2/2"].map(|shard| {
        world
            .run(&["--no-time", "--shard", shard])
            .exits(0)
            .complains(&["warning: in.csv: the rows of an image are not contiguous"]);
        output(&world)
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
    rows.insert(
        2,
        ResultRow::new(12, 40, CAR, Isometry3::translation(0.0, 3.0, 0.0) * pose),
    );
    let upside_down = pose * Isometry3::rotation(Vector3::x() * std::f64::consts::PI);
    rows.insert(3, ResultRow::new(12, 40, CAR, upside_down));
    write_results(world.path("in.csv"), &rows).unwrap();
    // This pipeline does not search, so the upside-down pose stays wrong.
    let run =
        |options: &[&str]| world.run(&[&["--no-time", "--pipeline", "hybrid"], options].concat());
    run(&[]).exits(0);
    let all = read_results(world.path("out.csv")).unwrap();
    run(&["--limit", "5"]).exits(0);
    assert_eq!(read_results(world.path("out.csv")).unwrap(), all[..5]);
    run(&["--limit", "99999"]).exits(0);
    assert_eq!(read_results(world.path("out.csv")).unwrap(), all);

    let run = run(&["--rescore", "mve"]).exits(0);
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
    assert!(run.out.contains(&format!("-> {median:.3}")), "{}", run.out);

    for (options, parts) in [
        (
            ["--shard", "0/2"],
            ["--shard", "'0/2'", "I/N with 1 <= I <= N"],
        ),
        (
            ["--shard", "3/2"],
            ["--shard", "'3/2'", "I/N with 1 <= I <= N"],
        ),
        (["--shard", "-1/2"], ["--shard", "'-1/2'", "I/N"]),
        (["--limit", "0"], ["--limit", "'0'", "1.."]),
        (["--limit", "-3"], ["--limit", "'-3'", "1.."]),
        (["--rescore", "vsd"], ["--rescore", "'vsd'", "mve"]),
    ] {
        world.run(&options).exits(2).complains(&parts);
    }
}
