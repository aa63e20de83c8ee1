//! Exact nearest points, eight at a time.

use hicp_core::Point3;
use hicp_core::internal::Work;

/// Children of a node.
const WIDTH: usize = 8;
/// Points of a leaf: few levels, and two vectors of points cost less than a node.
const LEAF_WIDTH: usize = 16;
/// Levels of a tree of 2³² points whose nodes are at least half full, and more.
const MAX_DEPTH: usize = 16;
/// Marks a child that is a leaf.
const LEAF: u32 = 1 << 31;
/// Rounding may put the computed distance of a box a few units in the last place beyond that of a point inside it.
const PRUNING_SLACK: f32 = 1.0 - 1.0e-6;

/// Eight boxes: `min[axis][child]`.
#[derive(Clone, Copy, Debug)]
struct Node {
    min: [[f32; WIDTH]; 3],
    max: [[f32; WIDTH]; 3],
    /// Index of a node, or of a leaf with [`LEAF`] set. Missing children are boxes at infinity.
    child: [u32; WIDTH],
}

/// Sixteen points: `point[axis][slot]`; missing ones lie at infinity.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    point: [[f32; LEAF_WIDTH]; 3],
    element: [u32; LEAF_WIDTH],
}

/// A point that a query found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Nearest {
    /// Squared distance, m².
    pub(crate) distance_squared: f32,
    /// Which point, by the order in which they were given.
    pub(crate) element: u32,
}

impl Nearest {
    const NONE: Self = Self {
        distance_squared: f32::INFINITY,
        element: u32::MAX,
    };
}

/// A tree of boxes with eight children each, so that a node or a leaf is a few vector operations.
///
/// Answers are exact and depend on the points alone: ties go to the point given first. A query that is told a point near by
/// looks into few boxes, and answers the same.
#[derive(Clone, Debug, Default)]
pub(crate) struct WideTree {
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    /// The points in the order in which they were given.
    points: Vec<Point3<f32>>,
}

impl WideTree {
    /// Builds the tree; the points must be finite. O(n log n).
    pub(crate) fn new(points: Vec<Point3<f32>>) -> Self {
        let mut tree = Self {
            points,
            ..Self::default()
        };
        let mut order: Vec<u32> = (0_u32..).take(tree.points.len()).collect();
        if !order.is_empty() {
            tree.build(&mut order);
        }
        tree
    }

    /// Builds the node over some points, with leaves as children where eight of them suffice; returns its index.
    fn build(&mut self, order: &mut [u32]) -> u32 {
        // Nodes and leaves are fewer than points, which are counted in u32.
        #[allow(clippy::cast_possible_truncation)]
        let index = self.nodes.len() as u32;
        self.nodes.push(Node {
            min: [[f32::INFINITY; WIDTH]; 3],
            max: [[f32::INFINITY; WIDTH]; 3],
            child: [LEAF; WIDTH],
        });
        let mut parts: [&mut [u32]; WIDTH] = Default::default();
        let (a, b) = self.halve(order);
        let (c, d) = self.halve(a);
        let (e, f) = self.halve(b);
        for (two, half) in parts.chunks_exact_mut(2).zip([c, d, e, f]) {
            let (first, second) = self.halve(half);
            two[0] = first;
            two[1] = second;
        }
        for (slot, part) in parts.into_iter().enumerate() {
            if part.is_empty() {
                continue;
            }
            let (min, max) = self.bounds(part);
            let child = if part.len() <= LEAF_WIDTH {
                self.leaf(part) | LEAF
            } else {
                self.build(part)
            };
            let node = &mut self.nodes[index as usize];
            node.child[slot] = child;
            for axis in 0..3 {
                node.min[axis][slot] = min[axis];
                node.max[axis][slot] = max[axis];
            }
        }
        index
    }

    fn bounds(&self, order: &[u32]) -> (Point3<f32>, Point3<f32>) {
        let mut points = order.iter().map(|element| self.points[*element as usize]);
        let first = points.next().unwrap_or_else(Point3::origin);
        points.fold((first, first), |(min, max), point| {
            (min.inf(&point), max.sup(&point))
        })
    }

    /// Splits at the median of the longest extent, so that the first half has whole leaves; points that fit one stay together.
    fn halve<'a>(&self, order: &'a mut [u32]) -> (&'a mut [u32], &'a mut [u32]) {
        if order.len() <= LEAF_WIDTH {
            return (order, &mut []);
        }
        let (min, max) = self.bounds(order);
        let axis = (max - min).imax();
        let middle = (order.len() / 2)
            .next_multiple_of(LEAF_WIDTH)
            .min(order.len() - 1);
        let key = |element: u32| self.points[element as usize][axis];
        // The index makes the order total, so the tree does not depend on how the selection works.
        order.select_nth_unstable_by(middle, |a, b| {
            key(*a).total_cmp(&key(*b)).then_with(|| a.cmp(b))
        });
        order.split_at_mut(middle)
    }

    fn leaf(&mut self, order: &[u32]) -> u32 {
        let mut leaf = Leaf {
            point: [[f32::INFINITY; LEAF_WIDTH]; 3],
            element: [u32::MAX; LEAF_WIDTH],
        };
        for (slot, element) in order.iter().enumerate() {
            leaf.element[slot] = *element;
            for axis in 0..3 {
                leaf.point[axis][slot] = self.points[*element as usize][axis];
            }
        }
        self.leaves.push(leaf);
        #[allow(clippy::cast_possible_truncation)] // See `build`.
        let index = (self.leaves.len() - 1) as u32;
        index
    }

    /// Returns the nearest point, `hint` being one of them, the nearer the better, or out of range; `None` without points and for a query that is
    /// not finite.
    #[inline(always)]
    pub(crate) fn nearest(&self, query: &Point3<f32>, hint: u32) -> Option<Nearest> {
        if self.nodes.is_empty() || !query.iter().all(|x| x.is_finite()) {
            return None;
        }
        let query = [query.x, query.y, query.z];
        let mut best = Nearest::NONE;
        if let Some(point) = self.points.get(hint as usize) {
            best = Nearest {
                distance_squared: distance_squared(&query, [point.x, point.y, point.z]),
                element: hint,
            };
        }
        let mut stack = [(0_u32, 0.0_f32); MAX_DEPTH * WIDTH];
        let mut depth = 1;
        let mut visited = 0;
        while depth > 0 {
            depth -= 1;
            let (index, distance) = stack[depth];
            if distance * PRUNING_SLACK > best.distance_squared {
                continue;
            }
            visited += 1;
            if index & LEAF != 0 {
                self.leaves[(index & !LEAF) as usize].nearest(&query, &mut best);
                continue;
            }
            let node = &self.nodes[index as usize];
            let distances = node.distances(&query);
            let limit = best.distance_squared / PRUNING_SLACK;
            let mut near = 0;
            for (slot, distance) in distances.iter().enumerate() {
                near |= u32::from((*distance <= limit) & (*distance < f32::INFINITY)) << slot;
            }
            // In any order, but for the nearest one, which is on top.
            let mut nearest = (0, f32::INFINITY);
            while near != 0 {
                let slot = near.trailing_zeros() as usize;
                near &= near - 1;
                let found = (node.child[slot], distances[slot]);
                if found.1 < nearest.1 {
                    if nearest.1 < f32::INFINITY {
                        stack[depth] = nearest;
                        depth += 1;
                    }
                    nearest = found;
                } else {
                    stack[depth] = found;
                    depth += 1;
                }
            }
            if nearest.1 < f32::INFINITY {
                stack[depth] = nearest;
                depth += 1;
            }
        }
        Work::NodesVisited.count(visited);
        (best.element != u32::MAX && best.distance_squared < f32::INFINITY).then_some(best)
    }
}

#[inline(always)]
fn distance_squared(a: &[f32; 3], b: [f32; 3]) -> f32 {
    let (x, y, z) = (a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    x * x + y * y + z * z
}

impl Node {
    /// Squared distances of the children's boxes.
    #[inline(always)]
    fn distances(&self, query: &[f32; 3]) -> [f32; WIDTH] {
        let mut distances = [0.0; WIDTH];
        for ((min, max), query) in self.min.iter().zip(&self.max).zip(query) {
            for ((distance, min), max) in distances.iter_mut().zip(min).zip(max) {
                let (below, above) = (min - query, query - max);
                let gap = if below > above { below } else { above };
                let gap = if gap > 0.0 { gap } else { 0.0 };
                *distance += gap * gap;
            }
        }
        distances
    }
}

impl Leaf {
    /// Takes the nearest of its points if it comes before the best so far.
    #[inline(always)]
    fn nearest(&self, query: &[f32; 3], best: &mut Nearest) {
        let mut distances = [0.0; LEAF_WIDTH];
        for (slot, distance) in distances.iter_mut().enumerate() {
            let (x, y, z) = (
                query[0] - self.point[0][slot],
                query[1] - self.point[1][slot],
                query[2] - self.point[2][slot],
            );
            *distance = x * x + y * y + z * z;
        }
        let mut near = 0;
        for (slot, distance) in distances.iter().enumerate() {
            near |= u32::from(*distance <= best.distance_squared) << slot;
        }
        while near != 0 {
            let slot = near.trailing_zeros() as usize;
            near &= near - 1;
            let found = Nearest {
                distance_squared: distances[slot],
                element: self.element[slot],
            };
            let before = found.distance_squared < best.distance_squared
                || (found.distance_squared == best.distance_squared
                    && found.element < best.element);
            if before {
                *best = found;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(state: &mut u64) -> f32 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (*state >> 40) as f32 / 16_777_216.0
    }

    /// On a coarse grid, where ties are the rule.
    #[test]
    fn answers_are_those_of_a_search_of_all_points_whatever_the_hint() {
        let mut state = 5;
        for count in [1, 2, 7, 8, 9, 16, 17, 63, 64, 65, 200, 1000, 4100] {
            for cells in [6.0, 1e6] {
                let mut point =
                    || Point3::from([(); 3].map(|()| (number(&mut state) * cells).floor() / cells));
                let points: Vec<Point3<f32>> = (0..count).map(|_| point()).collect();
                let queries: Vec<Point3<f32>> = (0..50).map(|_| point() * 1.5).collect();
                let tree = WideTree::new(points.clone());
                for query in &queries {
                    let all = (0_u32..).zip(&points).map(|(element, p)| Nearest {
                        distance_squared: distance_squared(
                            &[query.x, query.y, query.z],
                            [p.x, p.y, p.z],
                        ),
                        element,
                    });
                    let expected = all.reduce(|a, b| {
                        if b.distance_squared < a.distance_squared {
                            b
                        } else {
                            a
                        }
                    });
                    for hint in [0, count - 1, count / 2, u32::MAX] {
                        assert_eq!(tree.nearest(query, hint), expected, "{count} {hint}");
                    }
                }
            }
        }
    }

    #[test]
    fn nothing_is_found_without_points_or_for_a_query_that_is_not_finite() {
        assert_eq!(
            WideTree::new(Vec::new()).nearest(&Point3::origin(), 0),
            None
        );
        let tree = WideTree::new(vec![Point3::origin()]);
        for x in [f32::NAN, f32::INFINITY, f32::MAX] {
            assert_eq!(tree.nearest(&Point3::new(x, 0.0, 0.0), 0), None, "{x}");
        }
    }
}
