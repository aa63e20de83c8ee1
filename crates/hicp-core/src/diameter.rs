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

#[cfg(test)]
mod tests {
    use super::*;

    /// Boxes hold their points tightly; halves share a node's points evenly; leaves are small, or one point many times.
    fn check(points: &[Point3<f64>], node: &Node) {
        let own = &points[node.start..node.end];
        for axis in 0..3 {
            let coordinates = || own.iter().map(|p| p[axis]);
            assert_eq!(coordinates().fold(f64::INFINITY, f64::min), node.min[axis]);
            assert_eq!(
                coordinates().fold(f64::NEG_INFINITY, f64::max),
                node.max[axis]
            );
        }
        let coincide = own.iter().all(|p| *p == own[0]);
        assert_eq!(
            node.children.is_none(),
            own.len() <= LEAF_SIZE || coincide,
            "{} points",
            own.len()
        );
        if let Some(children) = &node.children {
            let (low, high) = (&children.0, &children.1);
            assert_eq!((low.start, high.end), (node.start, node.end));
            assert_eq!((low.end, low.end - low.start), (high.start, own.len() / 2));
            check(points, low);
            check(points, high);
        }
    }

    #[test]
    fn a_tree_halves_its_points_down_to_small_leaves() {
        for count in [1, 2, LEAF_SIZE, LEAF_SIZE + 1, 2 * LEAF_SIZE, 1000] {
            // A spiral, and a heap of one of its points as large as it.
            let spiral = (0..count).map(|i| {
                let x = i as f64;
                Point3::new(x.sin(), x.cos(), 0.01 * x)
            });
            let heap = std::iter::repeat_n(Point3::new(0.0, 1.0, 0.0), count);
            for mut points in [
                spiral.clone().collect::<Vec<_>>(),
                heap.clone().collect(),
                spiral.chain(heap).collect(),
            ] {
                let root = Node::build(&mut points, 0);
                assert_eq!((root.start, root.end), (0, points.len()));
                check(&points, &root);
            }
        }
    }
}
