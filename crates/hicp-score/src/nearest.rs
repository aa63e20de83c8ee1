//! Exact distances to the nearest of many points.

use hicp_core::{Isometry3, Point3};

/// Points per leaf: small enough to prune, large enough that a leaf is a short scan.
const LEAF_SIZE: usize = 8;
/// A tree that halves its points at every level is at most this deep; so is the stack of a query.
const MAX_DEPTH: usize = 64;

#[derive(Clone, Copy, Debug)]
struct Node {
    min: Point3<f64>,
    max: Point3<f64>,
    /// A leaf's first point; an inner node's second child (its first child is the next node).
    first: usize,
    /// A leaf's number of points; 0 for an inner node.
    count: usize,
}

impl Node {
    fn distance_squared(&self, point: &Point3<f64>) -> f64 {
        let gap = (self.min - point).sup(&(point - self.max));
        gap.map(|g| g.max(0.0)).norm_squared()
    }
}

/// A balanced tree of tight boxes over points, in `f64` so that nothing is lost against a search by
/// definition.
///
/// An estimate may be far off, and then every query lies far outside the points: tight boxes still
/// prune there, where the half-spaces of a k-d tree hardly do (kiddo's took 10 to 24 times as long
/// for 30,000 points a little over a diameter off).
#[derive(Debug)]
pub(crate) struct NearestPoints {
    nodes: Vec<Node>,
    /// In the order of the leaves.
    points: Vec<Point3<f64>>,
}

impl NearestPoints {
    /// Builds the tree, O(n log n). Points that are not finite are near nothing.
    pub(crate) fn new(points: &[Point3<f32>]) -> Self {
        let finite = points.iter().filter(|p| p.iter().all(|x| x.is_finite()));
        let mut tree = Self {
            nodes: Vec::new(),
            points: finite.map(|p| p.cast::<f64>()).collect(),
        };
        if !tree.points.is_empty() {
            tree.split(0, tree.points.len());
        }
        tree
    }

    fn split(&mut self, from: usize, to: usize) {
        let points = &mut self.points[from..to];
        let corners = (points[0], points[0]);
        let (min, max) = points
            .iter()
            .fold(corners, |(min, max), p| (min.inf(p), max.sup(p)));
        let (node, n) = (self.nodes.len(), points.len());
        self.nodes.push(Node {
            min,
            max,
            first: from,
            count: if n <= LEAF_SIZE { n } else { 0 },
        });
        if n <= LEAF_SIZE {
            return;
        }
        let axis = (max - min).imax();
        points.select_nth_unstable_by(n / 2, |a, b| a[axis].total_cmp(&b[axis]));
        self.split(from, from + n / 2);
        self.nodes[node].first = self.nodes.len();
        self.split(from + n / 2, to);
    }

    /// Returns the squared distance to the nearest point, or `limit` when none is nearer than that.
    fn distance_squared(&self, from: &Point3<f64>, limit: f64) -> f64 {
        let mut best = limit;
        let mut stack = [(0, 0.0); MAX_DEPTH];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let (index, distance) = stack[depth];
            if distance >= best {
                continue;
            }
            let node = &self.nodes[index];
            if node.count > 0 {
                for point in &self.points[node.first..node.first + node.count] {
                    best = best.min((point - from).norm_squared());
                }
                continue;
            }
            let [a, b] = [index + 1, node.first]
                .map(|child| (child, self.nodes[child].distance_squared(from)));
            let (near, far) = if a.1 <= b.1 { (a, b) } else { (b, a) };
            // Every level leaves at most one node behind, so the stack never holds more than the
            // depth plus one.
            stack[depth] = far;
            stack[depth + 1] = near;
            depth += 2;
        }
        best
    }

    /// Returns ADI of `points`, which must be those of the tree; 0 without points, infinite for
    /// what is not finite.
    pub(crate) fn adi(
        &self,
        estimate: &Isometry3<f64>,
        truth: &Isometry3<f64>,
        points: &[Point3<f32>],
    ) -> f64 {
        if points.is_empty() {
            return 0.0;
        }
        // The points at the true pose, seen from the frame of the estimate: the tree stays where it
        // is. The translations are subtracted first, so that nothing is lost far from the camera.
        let back = estimate.rotation.inverse();
        let shift = back * (truth.translation.vector - estimate.translation.vector);
        let rotation = (back * truth.rotation).to_rotation_matrix();
        let sum: f64 = points
            .iter()
            .map(|x| {
                let x = x.cast::<f64>();
                let moved = rotation * x + shift;
                // The same point is one of those looked at, and often not far from the nearest.
                let same = (moved - x).norm_squared();
                if same.is_finite() {
                    self.distance_squared(&moved, same).sqrt()
                } else {
                    f64::INFINITY
                }
            })
            .sum();
        sum / points.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By what a search passes over: the distance to the nearest point of the box.
    #[test]
    fn the_distance_of_a_box_is_that_of_its_nearest_point() {
        let node = Node {
            min: Point3::new(-1.0, 0.0, 2.0),
            max: Point3::new(1.0, 0.5, 5.0),
            first: 0,
            count: 0,
        };
        let places: [f64; 8] = [-3.0, -1.0, -0.25, 0.0, 0.25, 1.0, 2.5, 8.0];
        for x in places {
            for y in places {
                for z in places {
                    let point = Point3::new(x, y, z);
                    let nearest =
                        Point3::new(x.clamp(-1.0, 1.0), y.clamp(0.0, 0.5), z.clamp(2.0, 5.0));
                    let expected = (point - nearest).norm_squared();
                    assert_eq!(node.distance_squared(&point), expected, "{point}");
                }
            }
        }
    }

    /// What makes a query short: the two halves of a node lie side by side along its longest edge.
    #[test]
    fn the_halves_of_a_node_do_not_overlap() {
        // Of no order, and without equal coordinates.
        let points: Vec<Point3<f32>> = (0..500_u32)
            .map(|i| Point3::new(i * 383 % 509, i * 191 % 503, i * 97 % 521))
            .map(|p| p.map(f64::from).cast())
            .collect();
        let tree = NearestPoints::new(&points);
        let inner = (0..tree.nodes.len()).filter(|index| tree.nodes[*index].count == 0);
        let mut halved = 0;
        for index in inner {
            let node = tree.nodes[index];
            let [a, b] = [index + 1, node.first].map(|child| tree.nodes[child]);
            let axis = (node.max - node.min).imax();
            assert!(a.max[axis] < b.min[axis], "node {index}");
            halved += 1;
        }
        // 500 points halve into 64 leaves of 7 or 8.
        assert_eq!((halved, tree.nodes.len()), (63, 127));
    }
}
