//! What every preset does on a fixed set of scenes, in counts that no clock changes, and no x86-64 processor: `cargo xtask counts`.
//!
//! Scenes: three objects, without noise and with 0.5 % of it, from a start that is nearly right, one that is far off, and one that is
//! the wrong way round, so that what can search does.
//! A line per preset. Columns:
//!
//! - `regimes`: switches that took the aligned branch / the other;
//! - `stages`, `iterations` (evaluations of a pose, the rejected included), `selected` points, `pairs` that the metrics saw;
//! - `queries`: points that asked for their nearest neighbour, and the `nodes` of trees that were looked at for them;
//! - `renders` made, `pixels` of their views, those `filled` in the end and those `tested` against triangles, `triangles` given to the renderer;
//! - `cold`, `warm`: heap allocations of the first run (model and observation new, scratch memory empty) and of the next.

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
/// Name, translation (metres) and rotation (degrees) error.
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
    // All of it anew for every line: what a cold run builds must not be there already.
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

/// The columns padded to one width each: words to the left, numbers to the right.
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
