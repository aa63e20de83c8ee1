//! Counts of work done in inner loops, for the performance record.

#[cfg(debug_assertions)]
use std::cell::Cell;

/// What is counted where nothing outside can see it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// Nodes and leaves of search trees that a search visited.
    NodesVisited,
    /// Pixels that the rasterizer tried against a triangle.
    PixelsTested,
}

#[cfg(debug_assertions)]
thread_local! {
    static COUNTS: [Cell<u64>; 2] = const { [Cell::new(0), Cell::new(0)] };
}

impl Work {
    /// Counts `n` more on this thread. Does nothing, and costs nothing, in a build without debug assertions.
    #[inline(always)]
    pub fn count(self, n: usize) {
        #[cfg(debug_assertions)]
        COUNTS.with(|counts| {
            let count = &counts[self as usize];
            count.set(count.get() + n as u64);
        });
        #[cfg(not(debug_assertions))]
        let _ = n;
    }

    /// Returns what this thread has counted since the last call; 0 in a build without debug assertions.
    #[must_use]
    pub fn take(self) -> u64 {
        #[cfg(debug_assertions)]
        let count = COUNTS.with(|counts| counts[self as usize].take());
        #[cfg(not(debug_assertions))]
        let count = 0;
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_add_up_apart_and_start_anew_when_taken() {
        Work::NodesVisited.count(3);
        Work::NodesVisited.count(4);
        Work::PixelsTested.count(5);
        let counted = |n| if cfg!(debug_assertions) { n } else { 0 };
        assert_eq!(Work::NodesVisited.take(), counted(7));
        assert_eq!(Work::NodesVisited.take(), 0);
        assert_eq!(Work::PixelsTested.take(), counted(5));
    }
}
