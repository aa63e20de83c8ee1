//! A tree of axis-aligned boxes for exact nearest-element queries.

use std::ops::Range;

use hicp_core::Point3;
use hicp_core::internal::{Work, stored};

/// Children of a node.
const WIDTH: usize = 8;
/// Upper bound of the number of levels, for 2³² elements and nodes that are at least half full.
const MAX_DEPTH: usize = 16;
/// Number of nodes and leaves that a search may still have to visit.
const STACK_SIZE: usize = MAX_DEPTH * WIDTH;
/// The entry of a stack that starts a search.
const ROOT: (u32, f32) = (0, 0.0);
/// Marks a child that is a leaf.
const LEAF: u32 = 1 << 31;
/// Rounding may put the computed distance of a box slightly above that of an element inside it.
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
}

/// An element that a [`BoxTree`] can hold. All coordinates must be finite.
pub(crate) trait Element {
    /// Returns the smallest box around the element.
    fn bounds(&self) -> Bounds;

    /// Returns the point that decides into which box the element goes.
    fn center(&self) -> Point3<f32>;
}

impl Element for Point3<f32> {
    fn bounds(&self) -> Bounds {
        Bounds {
            min: *self,
            max: *self,
        }
    }

    fn center(&self) -> Point3<f32> {
        *self
    }
}

/// Eight boxes: `min[axis][child]`.
#[derive(Clone, Copy, Debug)]
struct Node {
    min: [[f32; WIDTH]; 3],
    max: [[f32; WIDTH]; 3],
    /// Index of a node, or of a leaf with [`LEAF`] set. Missing children are boxes at infinity.
    child: [u32; WIDTH],
}

/// A tree of boxes with eight children per node, so that a node takes a few vector operations.
///
/// It divides elements of any shape; their owner computes distances. The owner keeps a copy of the
/// elements in the tree's order ([`BoxTree::order`]), in which the elements of a leaf are
/// consecutive. A position in that order is called a slot. Every leaf but the last has exactly
/// `LEAF_SIZE` slots.
#[derive(Clone, Debug, Default)]
pub(crate) struct BoxTree<const LEAF_SIZE: usize> {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

impl<const LEAF_SIZE: usize> BoxTree<LEAF_SIZE> {
    /// Replaces the tree by one over `elements` and reuses its memory. Cost: O(n log n).
    pub(crate) fn rebuild(&mut self, elements: &[impl Element]) {
        self.nodes.clear();
        let mut order = std::mem::take(&mut self.order);
        order.clear();
        order.extend((0_u32..).take(elements.len()));
        if !order.is_empty() {
            self.build(elements, &mut order, 0);
        }
        self.order = order;
    }

    /// Returns the indices of the elements, slot by slot.
    pub(crate) fn order(&self) -> &[u32] {
        &self.order
    }

    /// Builds the node over the slots from `first` on, which hold `order`, and returns its index.
    fn build(&mut self, elements: &[impl Element], order: &mut [u32], mut first: usize) -> u32 {
        // There are fewer nodes and leaves than elements, which are counted in `u32`.
        #[allow(clippy::cast_possible_truncation)]
        let index = self.nodes.len() as u32;
        self.nodes.push(Node {
            min: [[f32::INFINITY; WIDTH]; 3],
            max: [[f32::INFINITY; WIDTH]; 3],
            child: [LEAF; WIDTH],
        });
        let halve = |order| halve::<LEAF_SIZE>(elements, order);
        let (a, b) = halve(order);
        let ((a, b), (c, d)) = (halve(a), halve(b));
        let quarters = [a, b, c, d];
        let parts = quarters.map(halve);
        for (slot, part) in parts.into_iter().flat_map(|(a, b)| [a, b]).enumerate() {
            if part.is_empty() {
                continue;
            }
            let Bounds { min, max } = bounds(elements, part);
            let length = part.len();
            #[allow(clippy::cast_possible_truncation)]
            let child = if length <= LEAF_SIZE {
                (first / LEAF_SIZE) as u32 | LEAF
            } else {
                self.build(elements, part, first)
            };
            first += length;
            let node = &mut self.nodes[index as usize];
            node.child[slot] = child;
            for axis in 0..3 {
                node.min[axis][slot] = min[axis];
                node.max[axis][slot] = max[axis];
            }
        }
        index
    }

    /// Starts a search for the elements nearest to a point.
    ///
    /// If the query is not finite, nothing is found. `stack` may have any content.
    #[inline(always)]
    pub(crate) fn leaves_near<'a>(
        &'a self,
        query: &Point3<f32>,
        stack: &'a mut Stack,
    ) -> LeavesNear<'a, LEAF_SIZE> {
        let finite = query.iter().all(|x| x.is_finite());
        stack.0[0] = ROOT;
        LeavesNear {
            tree: self,
            query: [query.x, query.y, query.z],
            stack: &mut stack.0,
            depth: usize::from(finite && !self.nodes.is_empty()),
        }
    }
}

/// Returns the smallest box around some elements, of which there must be at least one.
fn bounds(elements: &[impl Element], order: &[u32]) -> Bounds {
    let boxes = order.iter().map(|i| elements[*i as usize].bounds());
    boxes
        .reduce(|a, b| a.join(&b))
        .unwrap_or_else(|| unreachable!("a part without elements has no box"))
}

/// Splits at the median of the longest extent of the centers.
///
/// The first half has whole leaves. A single leaf is not split.
fn halve<'a, const LEAF_SIZE: usize>(
    elements: &[impl Element],
    order: &'a mut [u32],
) -> (&'a mut [u32], &'a mut [u32]) {
    if order.len() <= LEAF_SIZE {
        return (order, &mut []);
    }
    let center = |element: u32| elements[element as usize].center();
    let first = center(order[0]);
    let (min, max) = order.iter().fold((first, first), |(min, max), element| {
        let center = center(*element);
        (min.inf(&center), max.sup(&center))
    });
    let axis = (max - min).imax();
    let middle = (order.len() / 2)
        .next_multiple_of(LEAF_SIZE)
        .min(order.len() - 1);
    // The index makes the order total, so the tree does not depend on the selection algorithm.
    order.select_nth_unstable_by(middle, |a, b| {
        (center(*a)[axis].total_cmp(&center(*b)[axis])).then_with(|| a.cmp(b))
    });
    order.split_at_mut(middle)
}

/// Memory of a search.
///
/// Clearing it takes longer than a search that starts near its result, so a loop of searches shares
/// one.
#[derive(Debug)]
pub(crate) struct Stack([(u32, f32); STACK_SIZE]);

impl Default for Stack {
    fn default() -> Self {
        Self([ROOT; STACK_SIZE])
    }
}

/// A search of a [`BoxTree`] that yields leaves, near ones first.
#[derive(Debug)]
pub(crate) struct LeavesNear<'a, const LEAF_SIZE: usize> {
    tree: &'a BoxTree<LEAF_SIZE>,
    query: [f32; 3],
    /// Nodes and leaves to visit, with their squared distances.
    stack: &'a mut [(u32, f32); STACK_SIZE],
    depth: usize,
}

impl<const LEAF_SIZE: usize> LeavesNear<'_, LEAF_SIZE> {
    /// Returns the slots of the next leaf that may hold an element within a squared distance.
    ///
    /// `bound` must be finite, and may shrink from call to call.
    #[inline(always)]
    pub(crate) fn next(&mut self, bound: f32) -> Option<Range<usize>> {
        while self.depth > 0 {
            self.depth -= 1;
            let (index, distance) = self.stack[self.depth];
            if distance * PRUNING_SLACK > bound {
                continue;
            }
            Work::NodesVisited.count(1);
            if index & LEAF != 0 {
                let first = (index & !LEAF) as usize * LEAF_SIZE;
                return Some(first..self.tree.order.len().min(first + LEAF_SIZE));
            }
            let tree = self.tree;
            self.push_children(&tree.nodes[index as usize], bound);
        }
        None
    }

    /// Pushes the children that may be near enough, in any order except that the nearest one is on
    /// top.
    #[inline(always)]
    fn push_children(&mut self, node: &Node, bound: f32) {
        let distances = stored(node.distances(&self.query));
        // The limit is finite, so that missing children are excluded.
        let limit = (bound / PRUNING_SLACK).min(f32::MAX);
        let mut near = 0;
        for (slot, distance) in distances.iter().enumerate() {
            near |= u32::from(*distance <= limit) << slot;
        }
        let mut nearest = (0, f32::INFINITY);
        while near != 0 {
            let slot = near.trailing_zeros() as usize;
            near &= near - 1;
            let mut found = (node.child[slot], distances[slot]);
            if found.1 < nearest.1 {
                std::mem::swap(&mut nearest, &mut found);
            }
            if found.1 < f32::INFINITY {
                self.push(found);
            }
        }
        if nearest.1 < f32::INFINITY {
            self.push(nearest);
        }
    }

    #[inline(always)]
    fn push(&mut self, child: (u32, f32)) {
        self.stack[self.depth] = child;
        self.depth += 1;
    }
}

impl Node {
    /// Returns the squared distances of the boxes from a point.
    #[inline(always)]
    fn distances(&self, query: &[f32; 3]) -> [f32; WIDTH] {
        let mut distances = [0.0; WIDTH];
        for ((query, min), max) in query.iter().zip(&self.min).zip(&self.max) {
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
