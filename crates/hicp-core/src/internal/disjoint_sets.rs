//! Union-find.

use crate::internal::index;

/// Disjoint sets of the numbers below the length of a buffer.
///
/// The buffer is a list, or an array where nothing may be allocated.
#[derive(Debug)]
pub struct DisjointSets<T>(T);

impl<T: AsMut<[u32]>> DisjointSets<T> {
    /// Creates a set for each number. The content of the buffer is overwritten.
    pub fn new(mut buffer: T) -> Self {
        for (parent, number) in buffer.as_mut().iter_mut().zip(0..) {
            *parent = number;
        }
        Self(buffer)
    }

    /// Returns the smallest number of the set that contains a number.
    pub fn find(&mut self, mut number: usize) -> usize {
        let parents = self.0.as_mut();
        while parents[number] as usize != number {
            parents[number] = parents[parents[number] as usize];
            number = parents[number] as usize;
        }
        number
    }

    /// Joins the sets of two numbers.
    pub fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        self.0.as_mut()[a.max(b)] = index(a.min(b));
    }
}

impl DisjointSets<Vec<u32>> {
    /// Connects the corners of each triangle, of `count` vertices.
    pub fn of<'a>(count: usize, triangles: impl IntoIterator<Item = &'a [u32; 3]>) -> Self {
        let mut sets = Self::new(vec![0; count]);
        for corners in triangles {
            let [a, b, c] = corners.map(|corner| corner as usize);
            sets.join(a, b);
            sets.join(b, c);
        }
        sets
    }
}
