//! Counts the work of every preset on a fixed set of scenes: `cargo xtask counts`.
//!
//! The counts are the same on every run and on every x86-64 processor.
//!
//! The scenes show three objects, without noise and with 0.5 % noise. The starts are nearly right,
//! far off, and rotated by 180°, so that the presets that can search do so. There is a line per
//! preset, with these columns:
//!
//! - `regimes`: switches that selected the aligned branch / another branch.
//! - `stages`, `iterations`: ICP stages, and evaluations of a pose, including rejected poses.
//! - `selected`, `pairs`: selected points, and pairs passed to the metrics.
//! - `queries`, `nodes`: nearest-neighbor queries, and tree nodes visited for them.
//! - `renders`, `pixels`, `triangles`: renders, pixels of their views, and triangles passed to the
//!   renderer.
//! - `filled`, `tested`: pixels that show the object, and pixels tested against triangles.
//! - `cold`, `warm`: heap allocations of the first run (new model and observation, empty scratch
//!   memory) and of the next run.

use std::fmt::Write as _;

use hicp_benches::work::{CountingRenderer, StageWork};
use hicp_sim::{Household, perturb, rng};
use hicp_tests::allocations::{Counting, allocations};
use hybrid_icp::Preset;
use hybrid_icp::core::internal::Work;
use hybrid_icp::core::{Isometry3, Problem};
use hybrid_icp::icp::{Session, Workspace};

#[global_allocator]
static COUNTING: Counting = Counting;

const OBJECTS: [Household; 3] = [Household::Mug, Household::Hammer, Household::Carton];
const NOISE_PERCENT: [f64; 2] = [0.0, 0.5];
/// Name, translation error (meters) and rotation error (degrees).
const STARTS: [(&str, f64, f64); 3] = [
    ("aligned", 0.003, 3.0),
    ("misaligned", 0.04, 30.0),
    ("turned", 0.02, 180.0),
];

fn main() {
    let mut table = vec![
        "object noise start preset regimes stages iterations selected pairs queries nodes renders pixels filled tested triangles cold warm"
            .split(' ')
            .map(str::to_owned)
            .collect(),
    ];
    for object in OBJECTS {
        for percent in NOISE_PERCENT {
            for (start, meters, degrees) in STARTS {
                for preset in Preset::ALL {
                    table.push(line(object, percent, (start, meters, degrees), preset));
                }
            }
        }
    }
    print!("{}", aligned(&table));
}

fn line(
    object: Household,
    percent: f64,
    (start, meters, degrees): (&str, f64, f64),
    preset: Preset,
) -> Vec<String> {
    // Creates everything again for every line, because a cold run must not find existing results.
    let mut rng = rng(7);
    let scene = hicp_tests::scene(object, percent, &mut rng);
    let model = object.model().expect("the objects that ship are valid");
    let init = perturb(&mut rng, &scene.truth, meters, degrees.to_radians());
    let problem = Problem::new(&model, &scene.observation);

    let renderer = CountingRenderer::default();
    let mut workspace = Workspace::new(renderer.clone());
    let mut stage = preset.build();
    let mut run = |init: &Isometry3<f64>| {
        let mut work = StageWork::default();
        let before = allocations();
        stage.run(&problem, init, &mut Session::new(&mut workspace, &mut work));
        (work, allocations() - before)
    };
    let _ = (Work::NodesVisited.take(), Work::PixelsTested.take());
    let (work, cold) = run(&init);
    let (nodes, tested) = (Work::NodesVisited.take(), Work::PixelsTested.take());
    let rendered = renderer.take();
    let (_, warm) = run(&init);

    let mut line = vec![
        object.name().to_owned(),
        format!("{percent}%"),
        start.to_owned(),
        preset.name().to_owned(),
        format!("{}/{}", work.aligned, work.misaligned),
    ];
    let counts = [
        work.stages,
        work.iterations,
        work.selected,
        work.pairs,
        work.queries,
        nodes,
        rendered.renders,
        rendered.pixels,
        rendered.filled,
        tested,
        rendered.triangles,
        cold,
        warm,
    ];
    line.extend(counts.map(|count| count.to_string()));
    line
}

/// Pads each column to one width: words to the left, numbers to the right.
fn aligned(table: &[Vec<String>]) -> String {
    let mut widths = vec![0; table[0].len()];
    for line in table {
        for (width, cell) in widths.iter_mut().zip(line) {
            *width = cell.len().max(*width);
        }
    }
    let mut text = String::new();
    for line in table {
        for (column, (width, cell)) in widths.iter().zip(line).enumerate() {
            let gap = if column == 0 { "" } else { " " };
            let _ = if column < 4 {
                write!(text, "{gap}{cell:<width$}")
            } else {
                write!(text, "{gap}{cell:>width$}")
            };
        }
        text.push('\n');
    }
    text
}
