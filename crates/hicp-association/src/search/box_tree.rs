//! A tree of axis-aligned boxes for exact nearest-element queries.

use hicp_core::Point3;
use hicp_core::internal::Work;

/// Elements per leaf: small enough to prune, large enough that a leaf is a short scan.
const LEAF_SIZE: usize = 8;
/// A tree that halves its elements at every level is at most this deep; so is the stack of a query.
const MAX_DEPTH: usize = 64;
/// Rounding may put the computed distance of a box a few units in the last place beyond that of an element inside it.
const PRUNING_SLACK: f32 = 1.0 - 1.0e-6;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub(crate) min: Point3<f32>,
    pub(crate) max: Point3<f32>,
}

impl Bounds {
    fn join(&self, other: &Self) -> Self {
        Self {
            min: self.min.inf(&other.min),
            max: self.max.sup(&other.max),
        }
    }

    fn center(&self) -> Point3<f32> {
        Point3::from((self.min.coords + self.max.coords) * 0.5)
    }

    fn distance_squared(&self, point: &Point3<f32>) -> f32 {
        let gap = |axis: usize| {
            (self.min[axis] - point[axis])
                .max(point[axis] - self.max[axis])
                .max(0.0)
        };
        let (x, y, z) = (gap(0), gap(1), gap(2));
        x * x + y * y + z * z
    }
}

/// Returns |a − b|², the same bits for (b, a).
#[inline]
pub(crate) fn distance_squared(a: &Point3<f32>, b: &Point3<f32>) -> f32 {
    let (x, y, z) = (a.x - b.x, a.y - b.y, a.z - b.z);
    x * x + y * y + z * z
}

/// An element that a query found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    /// Squared distance, m², finite.
    pub(crate) distance_squared: f32,
    /// Which element, by the order in which they were given to the tree.
    pub(crate) element: u32,
    /// Where the element lies in the tree's own order, see [`BoxTree::order`].
    pub(crate) slot: usize,
}

impl Found {
    /// Nearer first; of equally near elements the one given first.
    fn precedes(&self, other: &Self) -> bool {
        self.distance_squared < other.distance_squared
            || (self.distance_squared == other.distance_squared && self.element < other.element)
    }
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Bounds,
    /// A leaf's first slot; an inner node's second child (its first child is the next node).
    first: u32,
    /// A leaf's number of slots; 0 for an inner node.
    count: u32,
}

/// A balanced tree of boxes over elements of any shape; whoever asks says how far an element is.
///
/// Answers are exact and depend on the elements alone: ties go to the element given first. Building splits at the median of
/// the longest extent, O(n log n), and reuses the memory of the tree before; queries allocate nothing.
#[derive(Clone, Debug, Default)]
pub(crate) struct BoxTree {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

impl BoxTree {
    /// Builds the tree over elements 0..count anew. All bounds must be finite.
    pub(crate) fn rebuild(&mut self, count: usize, bounds: impl Fn(u32) -> Bounds) {
        self.nodes.clear();
        self.order.clear();
        self.order.extend((0_u32..).take(count));
        if count > 0 {
            self.split(0, count, &bounds);
        }
    }

    fn split(&mut self, from: usize, to: usize, bounds_of: &impl Fn(u32) -> Bounds) {
        let order = &mut self.order[from..to];
        let first = bounds_of(order[0]);
        let (mut bounds, center) = (first, first.center());
        let mut centers = Bounds {
            min: center,
            max: center,
        };
        for element in &order[1..] {
            let other = bounds_of(*element);
            let center = other.center();
            bounds = bounds.join(&other);
            centers = centers.join(&Bounds {
                min: center,
                max: center,
            });
        }
        let node = self.nodes.len();
        let count = to - from;
        // Slots and nodes are fewer than 2³²: elements are counted in u32.
        #[allow(clippy::cast_possible_truncation)]
        self.nodes.push(Node {
            bounds,
            first: from as u32,
            count: if count <= LEAF_SIZE { count as u32 } else { 0 },
        });
        if count <= LEAF_SIZE {
            return;
        }
        let axis = (centers.max - centers.min).imax();
        let key = |element: u32| bounds_of(element).center()[axis];
        // The index makes the order total, so the tree does not depend on how the selection works.
        order.select_nth_unstable_by(count / 2, |a, b| {
            key(*a).total_cmp(&key(*b)).then_with(|| a.cmp(b))
        });
        let middle = from + count / 2;
        self.split(from, middle, bounds_of);
        #[allow(clippy::cast_possible_truncation)]
        let second = self.nodes.len() as u32;
        self.nodes[node].first = second;
        self.split(middle, to, bounds_of);
    }

    /// The elements in the order of the leaves; an owner that keeps their data in this order scans leaves without jumps.
    pub(crate) fn order(&self) -> &[u32] {
        &self.order
    }

    /// Returns the nearest element; `None` without one, and for a query that is not finite.
    ///
    /// `distance_squared(slot)` is the squared distance of the element at a slot, `None` for one that must not be found.
    #[inline]
    pub(crate) fn nearest(
        &self,
        query: &Point3<f32>,
        distance_squared: impl Fn(usize) -> Option<f32>,
    ) -> Option<Found> {
        let mut best: Option<Found> = None;
        self.visit(
            query,
            |found| {
                if best.is_none_or(|best| found.precedes(&best)) {
                    best = Some(found);
                }
                best.map_or(f32::INFINITY, |best| best.distance_squared)
            },
            distance_squared,
        );
        best
    }

    /// Replaces the content of `found` by the `count` nearest elements, nearest first.
    pub(crate) fn nearest_n(
        &self,
        query: &Point3<f32>,
        count: usize,
        found: &mut Vec<Found>,
        distance_squared: impl Fn(usize) -> Option<f32>,
    ) {
        found.clear();
        if count == 0 {
            return;
        }
        self.visit(
            query,
            |next| {
                if found.len() < count || found.last().is_some_and(|last| next.precedes(last)) {
                    if found.len() == count {
                        found.pop();
                    }
                    let position = found.partition_point(|other| other.precedes(&next));
                    found.insert(position, next);
                }
                match found.last() {
                    Some(last) if found.len() == count => last.distance_squared,
                    _ => f32::INFINITY,
                }
            },
            distance_squared,
        );
    }

    /// Shows the elements to `take`, near boxes first, until none can be nearer than the bound that `take` returned last.
    #[inline]
    fn visit(
        &self,
        query: &Point3<f32>,
        mut take: impl FnMut(Found) -> f32,
        distance_squared: impl Fn(usize) -> Option<f32>,
    ) {
        if self.nodes.is_empty() || !query.iter().all(|x| x.is_finite()) {
            return;
        }
        let mut bound = f32::INFINITY;
        let mut stack = [(0_u32, 0.0_f32); MAX_DEPTH];
        let mut depth = 1;
        let mut visited = 0;
        while depth > 0 {
            depth -= 1;
            let (index, distance) = stack[depth];
            if distance * PRUNING_SLACK > bound {
                continue;
            }
            visited += 1;
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                let from = node.first as usize;
                for slot in from..from + node.count as usize {
                    let Some(distance_squared) = distance_squared(slot) else {
                        continue;
                    };
                    if distance_squared <= bound && distance_squared.is_finite() {
                        bound = take(Found {
                            distance_squared,
                            element: self.order[slot],
                            slot,
                        });
                    }
                }
                continue;
            }
            let children = [index + 1, node.first].map(|child| {
                let bounds = &self.nodes[child as usize].bounds;
                (child, bounds.distance_squared(query))
            });
            let (near, far) = if children[0].1 <= children[1].1 {
                (children[0], children[1])
            } else {
                (children[1], children[0])
            };
            // Invariant: every level leaves at most one node behind, so the stack never holds more than the depth plus one.
            stack[depth] = far;
            stack[depth + 1] = near;
            depth += 2;
        }
        Work::NodesVisited.count(visited);
    }
}
