//! Connected parts of a grid.

/// Connected parts of some cells (union-find), fewer than 2¹⁶.
pub(crate) struct Parts<T>(T);

impl<T: AsMut<[u16]>> Parts<T> {
    /// Creates a part for each cell. The numbers are overwritten.
    pub(crate) fn new(mut cells: T) -> Self {
        for (cell, index) in cells.as_mut().iter_mut().zip(0..) {
            *cell = index;
        }
        Self(cells)
    }

    /// Returns the first cell of the part that contains a cell.
    pub(crate) fn find(&mut self, mut index: usize) -> usize {
        let cells = self.0.as_mut();
        while usize::from(cells[index]) != index {
            cells[index] = cells[usize::from(cells[index])];
            index = usize::from(cells[index]);
        }
        index
    }

    /// Joins the parts of two cells.
    pub(crate) fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        #[allow(clippy::cast_possible_truncation)] // Fewer than 2¹⁶ cells.
        let low = a.min(b) as u16;
        self.0.as_mut()[a.max(b)] = low;
    }
}
