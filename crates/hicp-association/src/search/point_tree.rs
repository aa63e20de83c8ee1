//! Exact nearest points.

use hicp_core::Point3;
use hicp_core::internal::stored;

use crate::search::box_tree::{BoxTree, Stack};
use crate::search::nearest::Nearest;
use crate::search::neighborhood::{Found, distances};
use crate::search::point_index::PointIndex;

/// Points per leaf. Comparing two vectors of points costs less than visiting another node.
const LEAF_SIZE: usize = 16;

/// A [`BoxTree`] over points.
///
/// Results are exact and depend only on the points: of equally near points, the first is found.
#[derive(Clone, Debug, Default)]
pub(crate) struct PointTree {
    tree: BoxTree<LEAF_SIZE>,
    /// The points of each leaf: `leaf[axis][lane]`. Missing points lie at infinity.
    leaves: Vec<[[f32; LEAF_SIZE]; 3]>,
}

impl PointIndex for PointTree {
    fn new(points: &[Point3<f32>]) -> Self {
        let mut tree = Self::default();
        tree.rebuild(points);
        tree
    }

    #[inline(always)]
    fn points_near(&self, query: &Point3<f32>, within: f32, stack: &mut Stack) -> Found {
        let mut found = Found::only(Nearest::NONE);
        self.visit(query, within, stack, |point| {
            found.insert(point).min(within)
        });
        found
    }
}

impl PointTree {
    /// Replaces the tree by one over `points`, which must be finite, and reuses its memory.
    pub(crate) fn rebuild(&mut self, points: &[Point3<f32>]) {
        self.tree.rebuild(points);
        self.leaves.clear();
        self.leaves.reserve(points.len().div_ceil(LEAF_SIZE));
        for elements in self.tree.order().chunks(LEAF_SIZE) {
            let mut leaf = [[f32::INFINITY; LEAF_SIZE]; 3];
            for (lane, element) in elements.iter().enumerate() {
                for (axis, coordinates) in leaf.iter_mut().enumerate() {
                    coordinates[lane] = points[*element as usize][axis];
                }
            }
            self.leaves.push(leaf);
        }
    }

    /// Returns the indices of the points such that near ones follow each other.
    pub(crate) fn order(&self) -> &[u32] {
        self.tree.order()
    }

    /// Returns the nearest point.
    #[inline(always)]
    pub(crate) fn nearest(&self, query: &Point3<f32>, stack: &mut Stack) -> Option<Nearest> {
        self.nearest_where(query, stack, |_| true)
    }

    /// Returns the nearest of the points whose index `accept` accepts.
    #[inline(always)]
    pub(crate) fn nearest_where(
        &self,
        query: &Point3<f32>,
        stack: &mut Stack,
        accept: impl Fn(u32) -> bool,
    ) -> Option<Nearest> {
        let mut best = Nearest::NONE;
        self.visit(query, best.distance_squared, stack, |found| {
            if found.precedes(&best) && accept(found.element) {
                best = found;
            }
            best.distance_squared
        });
        (best.element != Nearest::NONE.element).then_some(best)
    }

    /// Replaces the content of `found` by the `count` nearest points, nearest first.
    #[inline(always)]
    pub(crate) fn nearest_n(
        &self,
        query: &Point3<f32>,
        count: usize,
        stack: &mut Stack,
        found: &mut Vec<Nearest>,
    ) {
        self.gather(query, count, [-1.0, f32::MAX], stack, found);
        found.sort_unstable_by_key(Nearest::key);
    }

    /// Replaces the content of `found` by the `count` nearest points in any order, but only by
    /// those within the squared distance `within[1]`, which must be finite.
    ///
    /// It ends early if there are `count` points within the squared distance `within[0]`. Then they
    /// are any such points. This matters if many points lie in one place.
    #[inline(always)]
    pub(crate) fn gather(
        &self,
        query: &Point3<f32>,
        count: usize,
        within: [f32; 2],
        stack: &mut Stack,
        found: &mut Vec<Nearest>,
    ) {
        found.clear();
        if count == 0 {
            return;
        }
        let [enough, mut bound] = within;
        // Selecting now and then costs less than keeping the points in order.
        let full = count.saturating_mul(3);
        let select = |found: &mut Vec<Nearest>| {
            let (_, last, _) = found.select_nth_unstable_by_key(count - 1, Nearest::key);
            let last = last.distance_squared;
            found.truncate(count);
            last
        };
        self.visit(query, bound, stack, |next| {
            found.push(next);
            if found.len() >= full {
                bound = select(found);
                if bound <= enough {
                    bound = -1.0;
                }
            }
            bound
        });
        if found.len() > count {
            select(found);
        }
    }

    /// Passes points to `take` until no other point is within the squared distance that `take`
    /// returned last.
    #[inline(always)]
    fn visit(
        &self,
        query: &Point3<f32>,
        mut bound: f32,
        stack: &mut Stack,
        mut take: impl FnMut(Nearest) -> f32,
    ) {
        let order = self.tree.order();
        let mut leaves = self.tree.leaves_near(query, stack);
        while let Some(slots) = leaves.next(bound) {
            let distances = stored(distances(&self.leaves[slots.start / LEAF_SIZE], query));
            let mut near = 0;
            for (lane, distance) in distances.iter().enumerate() {
                near |= u32::from(*distance <= bound) << lane;
            }
            while near != 0 {
                let lane = near.trailing_zeros() as usize;
                near &= near - 1;
                bound = take(Nearest {
                    distance_squared: distances[lane],
                    element: order[slots.start + lane],
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use hicp_core::Vector3;

    use super::*;
    use crate::search::nearest::distance_squared;
    use crate::search::neighborhood::Neighborhood;

    fn number(state: &mut u64) -> f32 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (*state >> 40) as f32 / 16_777_216.0
    }

    /// Uses a coarse grid, where ties are common.
    #[test]
    fn results_equal_those_of_brute_force_for_every_start() {
        let (mut state, stack) = (5, &mut Stack::default());
        for count in [1, 2, 7, 8, 9, 16, 17, 63, 64, 65, 200, 1000, 4100] {
            for cells in [6.0, 1e6] {
                let mut point =
                    || Point3::from([(); 3].map(|()| (number(&mut state) * cells).floor() / cells));
                let points: Vec<Point3<f32>> = (0..count).map(|_| point()).collect();
                let queries: Vec<Point3<f32>> = (0..50).map(|_| point() * 1.5).collect();
                let tree = PointTree::new(&points);
                for query in &queries {
                    let at = |element: u32| Nearest {
                        distance_squared: distance_squared(query, &points[element as usize]),
                        element,
                    };
                    let mut all: Vec<Nearest> = (0..count).map(at).collect();
                    all.sort_by(|a, b| a.distance_squared.total_cmp(&b.distance_squared));
                    assert_eq!(tree.nearest(query, stack), Some(all[0]));
                    let odd = all.iter().find(|found| found.element % 2 == 1);
                    assert_eq!(
                        tree.nearest_where(query, stack, |i| i % 2 == 1),
                        odd.copied()
                    );
                    let mut found = Vec::new();
                    for n in [0, 1, 3, 20] {
                        tree.nearest_n(query, n, stack, &mut found);
                        assert_eq!(found, all[..n.min(all.len())]);
                        let within = all[n.min(all.len() - 1)].distance_squared;
                        for bound in [within, f32::MAX] {
                            tree.gather(query, n, [-1.0, bound], stack, &mut found);
                            found.sort_unstable_by_key(Nearest::key);
                            assert_eq!(found, all[..n.min(all.len())]);
                        }
                    }
                }
            }
        }
    }

    /// Moves a query by long and short steps, on a coarse grid too, where ties are common.
    #[test]
    fn the_nearest_of_a_moving_query_is_that_of_brute_force() {
        let (mut state, stack) = (7, &mut Stack::default());
        let (mut searches, mut queries) = (0, 0);
        for count in [1, 2, 4, 5, 40, 1000] {
            for cells in [6.0, 1e6] {
                let mut vector = |scale: f32| {
                    Vector3::from([(); 3].map(|()| (number(&mut state) * cells).floor() / cells))
                        * scale
                };
                let points: Vec<_> = (0..count).map(|_| Point3::from(vector(1.0))).collect();
                let tree = PointTree::new(&points);
                let mut near = Neighborhood::UNKNOWN;
                let mut query = Point3::from(vector(1.0));
                for step in 0..400 {
                    let scale = [0.5, 0.01, 0.001][step / 3 % 3];
                    query += vector(2.0 * scale) - Vector3::repeat(scale);
                    let key = |element: u32| {
                        let point = &points[element as usize];
                        Nearest::new(distance_squared(&query, point), element).key()
                    };
                    queries += 1;
                    searches += u32::from(near.nearest(&query).is_err());
                    let point = |element| points[element as usize];
                    let found = tree.nearest_to_moved(&query, &mut near, stack, point);
                    assert_eq!(found, (0..count).min_by_key(|element| key(*element)));
                }
            }
        }
        assert!(
            (queries / 20..queries / 2).contains(&searches),
            "{searches} of {queries}"
        );
    }

    #[test]
    fn empty_trees_and_queries_that_are_not_finite_find_nothing() {
        let stack = &mut Stack::default();
        assert_eq!(PointTree::new(&[]).nearest(&Point3::origin(), stack), None);
        let tree = PointTree::new(&[Point3::origin()]);
        for x in [f32::NAN, f32::INFINITY, f32::MAX] {
            let query = Point3::new(x, 0.0, 0.0);
            let mut near = Neighborhood::UNKNOWN;
            let found = tree.nearest_to_moved(&query, &mut near, stack, |_| Point3::origin());
            assert_eq!(found, None, "{x}");
            assert_eq!(tree.nearest(&query, stack), None, "{x}");
        }
    }
}
