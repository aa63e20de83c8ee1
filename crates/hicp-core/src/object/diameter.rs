//! The largest distance between two points of a set.

use nalgebra::{Point3, Vector3};

use crate::internal::bounds;

const LEAF_SIZE: usize = 16;

/// Returns the largest distance between two of the points: a model's diameter as BOP defines it.
///
/// The result has the unit of the points. It is 0 for fewer than two points. Points that are not
/// finite are ignored.
///
/// The result is exact up to a relative 1e-7, less than the rounding of coordinates to `f32`. A few
/// sweeps to the farthest point give a lower bound. Then pairs of nodes of a box tree are discarded
/// by two upper bounds. The first is the largest distance between the boxes. The second comes from
/// the cones in which the center sees the nodes; it spares round objects their many pairs of nearly
/// maximal length.
///
/// Cost: about O(n log n) for surfaces.
#[must_use]
// Open: the object's diameter: §IV-A.2. The largest distance between two vertices, as in BOP.
pub fn diameter(points: &[Point3<f32>]) -> f64 {
    let finite = |p: &&Point3<f32>| p.iter().all(|x| x.is_finite());
    let mut points: Vec<Point3<f64>> = points.iter().filter(finite).map(|p| p.cast()).collect();
    match points.first().copied() {
        Some(first) => farthest_pair(&mut points, first).best.sqrt(),
        None => 0.0,
    }
}

/// Searches `points`, reordering them. The sweeps start at `first`.
fn farthest_pair(points: &mut [Point3<f64>], first: Point3<f64>) -> Search<'_> {
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
    let [min, max] = bounds(points.iter().copied()).unwrap_or_default();
    let root = Node::build(points, 0, &nalgebra::center(&min, &max));
    let mut search = Search {
        points,
        best,
        compared: 0,
    };
    search.visit(&root, &root);
    search
}

struct Node {
    min: Point3<f64>,
    max: Point3<f64>,
    /// Largest distance of a point from the center of the whole set.
    radius: f64,
    /// The axis of a cone from that center that holds all points, and its half-angle in radians.
    axis: Vector3<f64>,
    angle: f64,
    start: usize,
    end: usize,
    children: Option<Box<(Node, Node)>>,
}

impl Node {
    /// Builds the tree over `points`, reordering them.
    ///
    /// `start` is the index of the first point in the whole set. Coinciding points become a leaf of
    /// one.
    fn build(points: &mut [Point3<f64>], start: usize, middle_of_all: &Point3<f64>) -> Self {
        let [min, max] = bounds(points.iter().copied()).unwrap_or_default();
        let end = start + if min == max { 1 } else { points.len() };
        let axis = (max - min).imax();
        let children = (points.len() > LEAF_SIZE && max[axis] > min[axis]).then(|| {
            let middle = points.len() / 2;
            points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
            let (low, high) = points.split_at_mut(middle);
            Box::new((
                Self::build(low, start, middle_of_all),
                Self::build(high, start + middle, middle_of_all),
            ))
        });
        let axis = (nalgebra::center(&min, &max) - middle_of_all)
            .try_normalize(0.0)
            .unwrap_or_default();
        let (mut radius, mut angle) = (0.0_f64, 0.0_f64);
        for p in &*points {
            let from_middle = p - middle_of_all;
            let distance = from_middle.norm();
            radius = radius.max(distance);
            // A point at the center gives NaN, which `max` ignores: it is in every cone.
            angle = angle.max((axis.dot(&from_middle) / distance).clamp(-1.0, 1.0).acos());
        }
        Self {
            min,
            max,
            radius,
            axis,
            angle,
            start,
            end,
            children,
        }
    }

    /// Returns an upper bound of the squared distance of two points from their boxes.
    fn farthest_squared(&self, other: &Self) -> f64 {
        (self.max - other.min)
            .abs()
            .sup(&(other.max - self.min).abs())
            .norm_squared()
    }

    /// Returns an upper bound of the squared distance of two points from their cones.
    ///
    /// It combines their distances from the center with the angle by which they are at least from
    /// being opposite each other.
    fn farthest_squared_about_middle(&self, other: &Self) -> f64 {
        let from_opposite = (-self.axis.dot(&other.axis)).clamp(-1.0, 1.0).acos();
        let bend = (from_opposite - self.angle - other.angle).max(0.0);
        let (a, b) = (self.radius, other.radius);
        // Beyond a right angle, the farthest pair is not made of the points farthest from the
        // center.
        a * a + b * b + 2.0 * a * b * bend.cos().max(0.0)
    }
}

/// The search for the farthest pair.
struct Search<'a> {
    points: &'a [Point3<f64>],
    /// The largest squared distance found.
    best: f64,
    /// Number of compared pairs of points.
    compared: u64,
}

impl Search<'_> {
    fn visit(&mut self, a: &Node, b: &Node) {
        let longest = self.best * (1.0 + 2e-7);
        if a.farthest_squared(b) <= longest || a.farthest_squared_about_middle(b) <= longest {
            return;
        }
        match (&a.children, &b.children) {
            (None, None) => {
                self.compared += ((a.end - a.start) * (b.end - b.start)) as u64;
                for p in &self.points[a.start..a.end] {
                    for q in &self.points[b.start..b.end] {
                        self.best = self.best.max((p - q).norm_squared());
                    }
                }
            }
            // A leaf never has more points than an inner node.
            (Some(children), _) if a.end - a.start >= b.end - b.start => {
                self.visit(&children.0, b);
                self.visit(&children.1, b);
            }
            (_, Some(children)) => {
                self.visit(a, &children.0);
                self.visit(a, &children.1);
            }
            (Some(_), None) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that boxes are tight, halves have equal size, and leaves are small or hold coinciding
    /// points.
    fn check(points: &[Point3<f64>], node: &Node, count: usize) {
        let own = &points[node.start..node.start + count];
        for axis in 0..3 {
            let coordinates = || own.iter().map(|p| p[axis]);
            assert_eq!(coordinates().fold(f64::INFINITY, f64::min), node.min[axis]);
            assert_eq!(
                coordinates().fold(f64::NEG_INFINITY, f64::max),
                node.max[axis]
            );
        }
        let from_middle = || own.iter().map(|p| p - Point3::new(0.5, 0.5, 0.5));
        assert_eq!(
            node.radius,
            from_middle().map(|d| d.norm()).fold(0.0, f64::max)
        );
        assert!(from_middle().all(|d| d.angle(&node.axis) <= node.angle + 1e-7));
        let coincide = own.iter().all(|p| *p == own[0]);
        assert_eq!(node.end, node.start + if coincide { 1 } else { count });
        assert_eq!(
            node.children.is_none(),
            own.len() <= LEAF_SIZE || coincide,
            "{} points",
            own.len()
        );
        if let Some(children) = &node.children {
            let (low, high) = (&children.0, &children.1);
            assert_eq!(low.start, node.start);
            assert_eq!(high.start - low.start, count / 2);
            check(points, low, count / 2);
            check(points, high, count - count / 2);
        }
    }

    #[test]
    fn a_tree_halves_its_points_down_to_small_leaves() {
        for count in [1, 2, LEAF_SIZE, LEAF_SIZE + 1, 2 * LEAF_SIZE, 1000] {
            // A spiral, and as many copies of one of its points.
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
                let root = Node::build(&mut points, 0, &Point3::new(0.5, 0.5, 0.5));
                check(&points, &root, points.len());
            }
        }
    }

    #[test]
    fn every_pair_within_a_leaf_is_compared() {
        let mut points: Vec<_> = (0..10)
            .map(|i| Point3::new(f64::from(i).sin(), f64::from(i).cos(), 0.0))
            .collect();
        let first = points[0];
        assert_eq!(farthest_pair(&mut points, first).compared, 100);
    }

    #[test]
    #[allow(clippy::cast_possible_truncation)]
    fn not_all_pairs_of_nearly_maximal_distance_are_compared() {
        let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        let count = 20_000;
        let sphere = (0..count).map(|i| {
            let along = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
            let across = (1.0 - along * along).sqrt();
            let (sin, cos) = (f64::from(i) * golden).sin_cos();
            Point3::new(across * cos, across * sin, along).map(|x| f64::from(x as f32))
        });
        let ring = (0..count).map(|i| {
            let (sin, cos) = (f64::from(i) * golden).sin_cos();
            Point3::new(cos, sin, f64::from(i % 2)).map(|x| f64::from(x as f32))
        });
        let heaps = (0..count).map(|i| Point3::new(f64::from(i % 2), f64::from(i / 2 % 2), 0.0));
        for (mut points, longest) in [
            (sphere.collect::<Vec<_>>(), 2.0),
            (ring.collect(), 5.0_f64.sqrt()),
            (heaps.collect(), 2.0_f64.sqrt()),
        ] {
            let first = points[0];
            let found = farthest_pair(&mut points, first);
            assert!((found.best.sqrt() / longest - 1.0).abs() < 1e-6);
            assert!(found.compared < 1_000_000, "{}", found.compared);
        }
    }
}
