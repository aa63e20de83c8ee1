//! Counts of work done in inner loops, for the performance record.

#[cfg(debug_assertions)]
use std::cell::Cell;

/// A kind of work that is counted because nothing outside can observe it.
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
    /// Adds `n` to the count of this thread.
    ///
    /// Without debug assertions it does nothing and costs nothing.
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

    /// Returns the count of this thread since the last call.
    ///
    /// Without debug assertions it is 0.
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
    fn counts_are_separate_and_restart_when_taken() {
        Work::NodesVisited.count(3);
        Work::NodesVisited.count(4);
        Work::PixelsTested.count(5);
        let counted = |n| if cfg!(debug_assertions) { n } else { 0 };
        assert_eq!(Work::NodesVisited.take(), counted(7));
        assert_eq!(Work::NodesVisited.take(), 0);
        assert_eq!(Work::PixelsTested.take(), counted(5));
    }
}
