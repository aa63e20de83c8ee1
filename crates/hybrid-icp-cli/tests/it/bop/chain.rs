//! All steps over a generated dataset: generate, refine, eval, compare, show.
//!
//! The printed text must equal `golden/bop_chain.txt`. This is possible because the dataset follows
//! from its seed, no pose depends on the number of threads, and numbers are rounded to three
//! digits. `HICP_BLESS=1 cargo test -p hybrid-icp-cli --test it bop::chain` writes the file again;
//! the commit message must explain the change.

use std::fmt::Write as _;
use std::path::Path;

use crate::common::*;

/// Runs a command of `hybrid-icp bop`, asserts success without warnings, and returns its output.
#[track_caller]
fn bop(folder: &Folder, words: &str) -> String {
    let told = folder.command(format!("bop {words}")).exits(0);
    assert_eq!(told.err, "", "bop {words}");
    told.out
}

/// Removes the columns of times, which differ between runs, from Markdown.
fn without_times(markdown: &str) -> String {
    let mut text = String::new();
    let (table, rest) = markdown.split_once("\n\n").unwrap();
    for line in table.lines() {
        let cells: Vec<&str> = line.split('|').collect();
        let (figures, times) = cells.split_at(cells.len() - 7);
        let _ = writeln!(text, "{}|{}", figures.join("|"), times[2..].join("|"));
    }
    text + "\n" + rest
}

#[test]
fn generate_refine_eval_compare_show() {
    let folder = Folder::new();
    let initial = "set/initial_synthetic-test.csv";
    let generate = "generate --scenes 1 --images 2 --instances 6 --seed 5 --out set";
    let mut found = format!("$ bop {generate}\n{}", bop(&folder, generate));

    let refine = format!("refine --dataset set --no-time --results {initial} --output refined.csv");
    let told = bop(&folder, &refine);
    let (_, summary) = told.split_once('\n').unwrap();
    let _ = write!(found, "\n$ bop {refine}\n{summary}");

    for results in ["set/truth_synthetic-test.csv", initial, "refined.csv"] {
        let eval = format!("eval --dataset set --results {results}");
        let _ = write!(found, "\n$ bop {eval}\n{}", bop(&folder, &eval));
    }

    let pipelines = "hybrid,projective-cascade-point-plane";
    let compare =
        format!("compare --dataset set --results {initial} --pipelines {pipelines} --out compared");
    // One of the pipelines fails for some rows, so there are warnings.
    let told = folder.command(format!("bop {compare}")).exits(0);
    let table = without_times(&folder.read("compared/compare.md"));
    let _ = write!(found, "\n$ bop {compare}\n{}\n{table}", told.err);
    assert!(folder.path("compared/compare.html").is_file());

    let show = format!(
        "show --dataset set --scene 1 --image 1 --results refined.csv --against {initial} --out show.png"
    );
    let _ = write!(found, "\n$ bop {show}\n{}", bop(&folder, &show));
    let (width, height) = hicp_io::read_png_size(folder.path("show.png")).unwrap();
    let _ = writeln!(found, "{width}x{height}");

    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/bop_chain.txt");
    if std::env::var_os("HICP_BLESS").is_some() {
        std::fs::create_dir_all(golden.parent().unwrap()).unwrap();
        std::fs::write(&golden, &found).unwrap();
    }
    let expected = std::fs::read_to_string(&golden).unwrap();
    assert!(found == expected, "expected\n{expected}\nfound\n{found}");
}
