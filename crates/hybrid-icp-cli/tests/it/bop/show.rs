//! `hybrid-icp bop show` on a small dataset.

use std::collections::BTreeMap;

use crate::common::*;
use hicp_io::bop::{ResultRow, write_results};
use hybrid_icp::core::Isometry3;
use serde_json::Value;

const AFTER: [u8; 3] = [86, 180, 233];
const BEFORE: [u8; 3] = [230, 159, 0];
/// The image with two cars and a hammer.
const FRAME: (u32, u32) = (3, 40);

/// Creates a dataset with two result files: the truth, and poses off by 3 mm and 5 degrees.
fn dataset() -> World {
    let world = World::new();
    write_results(world.path("off.csv"), &world.rows()).unwrap();
    let mut truth = Vec::new();
    for ((scene, image), truths) in &world.truths {
        for (id, pose) in truths {
            truth.push(ResultRow::new(*scene, *image, *id, *pose));
        }
    }
    write_results(world.path("truth.csv"), &truth).unwrap();
    world
}

#[track_caller]
fn show(world: &World, options: &str) -> Run {
    let fixed = "bop show --dataset . --scene 3 --image 40 --out show.png";
    world.command(format!("{fixed} {options}"))
}

/// Returns the printed cells by the object's tag.
fn cells(told: &Run) -> BTreeMap<String, Vec<String>> {
    let lines = told.out.lines().skip(2);
    let lines = lines.take_while(|line| line.starts_with(' '));
    let words =
        |line: &str| -> Vec<String> { line.split_whitespace().map(str::to_owned).collect() };
    lines
        .map(words)
        .map(|w| (w[0].clone(), w[1..].to_vec()))
        .collect()
}

/// Returns the width, height and colors of the picture.
fn picture(world: &World) -> (u32, u32, Vec<[u8; 3]>) {
    let image = hicp_io::read_color(world.path("show.png")).unwrap();
    (image.width(), image.height(), image.pixels().to_vec())
}

fn count(pixels: &[[u8; 3]], color: [u8; 3]) -> usize {
    pixels.iter().filter(|pixel| **pixel == color).count()
}

#[test]
fn outlines_of_both_files_with_the_errors_of_eval() {
    let world = dataset();
    let told = show(&world, "--results truth.csv --against off.csv").exits(0);
    assert_eq!(told.err, "");
    assert!(told.out.contains("truth.csv") && told.out.ends_with("show.png\n"));
    let found = cells(&told);
    let tags: Vec<&str> = found.keys().map(String::as_str).collect();
    assert_eq!(tags, ["1a", "1b", "2"]);
    for cells in found.values() {
        let [score, mve, adi, vsd] = [0, 1, 2, 3].map(|i| cells[i].as_str());
        assert_eq!((score, adi, vsd), ("1.000", "0.00", "0.000"));
        assert!(mve.parse::<f64>().unwrap() < 0.02, "{mve}");
        // The estimate is paired with the nearby one, not with that of the other car.
        let adi: f64 = cells[6].parse().unwrap();
        assert!(adi > 0.5 && adi < 6.0, "{adi}");
        assert!(cells[5].parse::<f64>().unwrap() > mve.parse().unwrap());
    }

    // The errors are those of bop eval.
    let words = "bop eval --dataset . --results off.csv --errors errors.csv";
    world.command(words).exits(0);
    let errors = world.read("errors.csv");
    let mut expected: Vec<(String, String)> = Vec::new();
    let mut least: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
    for line in errors.lines().skip(1) {
        let numbers: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        if (numbers[0], numbers[1]) == (f64::from(FRAME.0), f64::from(FRAME.1)) {
            let best = least
                .entry(numbers[3] as u64)
                .or_insert_with(|| numbers.clone());
            if numbers[19] < best[19] {
                *best = numbers;
            }
        }
    }
    for numbers in least.values() {
        let vsd = numbers[6..16].iter().sum::<f64>() / 10.0;
        expected.push((format!("{:.2}", numbers[19]), format!("{vsd:.3}")));
    }
    let mut shown: Vec<_> = found
        .values()
        .map(|cells| (cells[6].clone(), cells[7].clone()))
        .collect();
    expected.sort();
    shown.sort();
    assert_eq!(shown, expected);

    let (width, height, pixels) = picture(&world);
    assert_eq!(width, 640);
    assert!(height > 240 + 3 * 19, "{height}");
    let image = &pixels[..640 * 240];
    assert!(count(image, AFTER) > 300 && count(image, BEFORE) > 100);
    // The legend has a solid and a dashed line.
    let legend = &pixels[640 * 240..];
    assert!(count(legend, AFTER) > count(legend, BEFORE) && count(legend, BEFORE) > 20);

    let bytes = world.bytes("show.png");
    show(&world, "--results truth.csv --against off.csv").exits(0);
    assert_eq!(world.bytes("show.png"), bytes);

    // With one file, there is one color.
    show(&world, "--results truth.csv").exits(0);
    let (_, _, pixels) = picture(&world);
    assert!(count(&pixels, AFTER) > 300);
    assert_eq!(count(&pixels, BEFORE), 0);
}

#[test]
fn the_color_image_is_the_background_if_it_can_be_read() {
    let world = dataset();
    let folder = world.scene(3).join("rgb");
    world.create_dir(&folder);
    let path = folder.join("000040.png");
    let green = [20, 120, 40];
    hicp_io::write_rgb_png(&path, 320, 240, &green.repeat(320 * 240)).unwrap();
    show(&world, "--results off.csv").exits(0);
    let (width, height, pixels) = picture(&world);
    // The image is centered, and only outlines cover it, because the legend is below.
    let is_image = |index: usize| (160..480).contains(&(index % 640)) && index / 640 < 240;
    let (mut of_image, mut changed) = (0, 0);
    for (index, pixel) in pixels.iter().enumerate() {
        of_image += usize::from(is_image(index) && *pixel == green);
        changed += usize::from(!is_image(index) && *pixel == green);
    }
    assert!(of_image > 320 * 240 * 9 / 10, "{of_image}");
    assert_eq!((width, changed), (640, 0));
    assert!(height < 240 + 8 * 20, "{height}");

    show(&world, "--results off.csv --depth").exits(0);
    assert_eq!(count(&picture(&world).2, green), 0);

    hicp_io::write_rgb_png(&path, 4, 3, &green.repeat(12)).unwrap();
    show(&world, "--results off.csv")
        .fails(&["rgb/000040.png is 4x3 pixels, expected 320x240 as the depth image"]);
    world.write(&path, "no picture");
    show(&world, "--results off.csv").fails(&["rgb/000040.png"]);
    std::fs::rename(&path, folder.join("000040.jpg")).unwrap();
    show(&world, "--results off.csv").fails(&["rgb/000040.jpg"]);
}

#[test]
fn without_ground_truth_there_is_the_mve_of_detections() {
    let world = dataset();
    let detections = Value::from(world.detections(|_| false));
    world.write("found.json", detections.to_string());
    let known = cells(&show(&world, "--results off.csv --top 2").exits(0));
    world.remove(world.scene(3).join("scene_gt.json"));
    let told = show(&world, "--results off.csv").exits(0);
    // One estimate per object is shown, because the number of cars is unknown.
    let told = told.complains(&["warning: off.csv: 1 estimates", "--top"]);
    for cells in cells(&told).values() {
        assert_eq!(cells[1..], ["–"; 3]);
    }
    let told = show(&world, "--results off.csv --top 2 --detections found.json").exits(0);
    assert_eq!(told.err, "");
    for (tag, cells) in cells(&told) {
        assert_eq!(
            (&cells[1], &cells[2..]),
            (&known[&tag][1], &["–"; 2].map(String::from)[..])
        );
    }
}

#[test]
fn objects_without_an_estimate_are_reported() {
    let world = dataset();
    let rows = world.rows();
    let of_hammer = |row: &ResultRow| row.obj_id == HAMMER && (row.scene_id, row.im_id) == FRAME;
    let mut hammer: Vec<_> = rows.into_iter().filter(of_hammer).collect();
    let pose = hammer[0].camera_from_object();
    hammer.push(ResultRow::new(3, 40, ABSENT, pose));
    // A pose next to its mask has no MVE, and the errors of a distant pose.
    let aside = Isometry3::translation(0.3, 0.0, 0.0) * pose;
    hammer[0].set_camera_from_object(aside);
    write_results(world.path("in.csv"), &hammer).unwrap();
    let told = show(&world, "--results in.csv").exits(0);
    let told = told.complains(&["warning: the dataset has no model for object 9"]);
    let found = cells(&told);
    let dashes = ["–"; 4].map(String::from);
    assert_eq!(
        (&found["1a"][..], &found["1b"][..]),
        (&dashes[..], &dashes[..])
    );
    let adi: f64 = found["2"][2].parse().unwrap();
    assert!(
        adi > 100.0 && found["2"][1] == "–" && found["2"][3] == "1.000",
        "{found:?}"
    );
}

#[test]
fn images_that_cannot_be_shown_are_refused() {
    let world = dataset();
    let fails = |options: &str, parts: &[&str]| {
        let told = show(&world, options).fails(parts);
        assert_eq!(told.out, "");
        assert!(!world.path("show.png").exists());
    };
    let pose = world.rows()[0].camera_from_object();
    let write = |row: ResultRow| write_results(world.path("in.csv"), &[row]).unwrap();
    write(ResultRow::new(3, 0, CAR, pose));
    fails(
        "--results in.csv",
        &[
            "in.csv has no row of image 40 of scene 3",
            "of scene 3 it has image 0",
        ],
    );
    fails(
        "--results off.csv --against in.csv",
        &["in.csv has no row of image 40 of scene 3"],
    );
    write(ResultRow::new(3, 40, ABSENT, pose));
    fails(
        "--results in.csv",
        &[
            "nothing to show",
            "no model for object 9, expected",
            "obj_000009.ply",
        ],
    );
    fails("--results gone.csv", &["cannot read gone.csv"]);
    fails(
        "--results off.csv --split tset",
        &["split is missing", "tset"],
    );
    world.write("found.json", "[7]");
    fails(
        "--results off.csv --detections found.json",
        &["found.json, $[0]"],
    );
    let depth = world.depth_path(3, 40);
    let whole = world.bytes(&depth);
    world.remove(&depth);
    fails(
        "--results off.csv",
        &["000003/depth/000040.png does not exist"],
    );
    world.write(&depth, &whole[..whole.len() / 3]);
    fails("--results off.csv", &["000003/depth/000040.png"]);
    world.write(&depth, whole);

    let named = |words: &str, code: i32, parts: &[&str]| {
        let words = format!("bop show --dataset . --results off.csv {words}");
        world.command(words).exits(code).complains(parts);
    };
    named(
        "--scene 9 --image 40 --out a.png",
        1,
        &["no row of image 40 of scene 9"],
    );
    named(
        "--scene 3 --image 40 --out off.csv",
        1,
        &["--out and --results", "overwritten"],
    );
    named(
        "--scene 3 --image 40 --out no/a.png",
        1,
        &["folder no does not exist"],
    );
    named("--scene 3 --image -1 --out a.png", 2, &["--image"]);
    named(
        "--scene 3 --image 40 --out a.png --top 0",
        2,
        &["--top", "1.."],
    );

    // A damaged mask removes only its MVE.
    let mask = world.mask_path(3, 40, 1);
    let whole = world.bytes(&mask);
    world.write(&mask, &whole[..whole.len() / 3]);
    let told = show(&world, "--results truth.csv").exits(1);
    let told = told.complains(&["mask_visib/000040_000001.png", "1 file could not be used"]);
    let found = cells(&told);
    assert_eq!(found["2"][1..], ["–", "0.00", "0.000"]);
    assert!(found["1a"][1] != "–" && world.path("show.png").exists());
}
