//! The largest distance between two points of a set.

use nalgebra::Point3;

const LEAF_SIZE: usize = 16;

/// Returns the largest distance between two of the points, as BOP defines a model's diameter; 0 for fewer than two points.
///
/// Exact up to a relative 1e-9. A double sweep gives a lower bound, then pairs of nodes of a box tree are discarded by the
/// largest distance between their boxes. Cost: about O(n log n) for surfaces.
#[must_use]
pub fn diameter(points: &[Point3<f32>]) -> f64 {
    let mut points: Vec<Point3<f64>> = points.iter().map(|p| p.cast::<f64>()).collect();
    let Some(first) = points.first().copied() else {
        return 0.0;
    };
    let mut best = 0.0_f64;
    let mut from = first;
    for _ in 0..4 {
        let Some(&farthest) = points.iter().max_by(|a, b| {
            (*a - from)
                .norm_squared()
                .total_cmp(&(*b - from).norm_squared())
        }) else {
            break;
        };
        best = best.max((farthest - from).norm_squared());
        from = farthest;
    }
    let root = Node::build(&mut points, 0);
    visit(&points, &root, &root, &mut best);
    best.sqrt()
}

struct Node {
    min: Point3<f64>,
    max: Point3<f64>,
    start: usize,
    end: usize,
    children: Option<Box<(Node, Node)>>,
}

impl Node {
    /// Builds the tree over `points`, which is reordered; `start` is the index of its first point in the whole.
    fn build(points: &mut [Point3<f64>], start: usize) -> Self {
        let (mut min, mut max) = (points[0], points[0]);
        for p in &*points {
            min = min.inf(p);
            max = max.sup(p);
        }
        let end = start + points.len();
        let axis = (max - min).imax();
        let children = (points.len() > LEAF_SIZE && max[axis] > min[axis]).then(|| {
            let middle = points.len() / 2;
            points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
            let (low, high) = points.split_at_mut(middle);
            Box::new((Self::build(low, start), Self::build(high, start + middle)))
        });
        Self {
            min,
            max,
            start,
            end,
            children,
        }
    }

    fn farthest_squared(&self, other: &Self) -> f64 {
        (self.max - other.min)
            .abs()
            .sup(&(other.max - self.min).abs())
            .norm_squared()
    }
}

fn visit(points: &[Point3<f64>], a: &Node, b: &Node, best: &mut f64) {
    if a.farthest_squared(b) <= *best * (1.0 + 2e-9) {
        return;
    }
    match (&a.children, &b.children) {
        (None, None) => {
            for p in &points[a.start..a.end] {
                for q in &points[b.start..b.end] {
                    *best = best.max((p - q).norm_squared());
                }
            }
        }
        (Some(children), _) if b.children.is_none() || a.end - a.start >= b.end - b.start => {
            visit(points, &children.0, b, best);
            visit(points, &children.1, b, best);
        }
        (_, Some(children)) => {
            visit(points, a, &children.0, best);
            visit(points, a, &children.1, best);
        }
        (Some(_), None) => {}
    }
}
