//! The depth of covered pixels.

use hicp_core::internal::{VectorLoop, Work, vectorized};
use hicp_core::{PixelRegion, RenderedView};

use crate::edge::{Coverage, Edge};
use crate::inverse_depth::InverseDepth;

/// The buffers of the view to fill.
#[derive(Debug)]
pub(crate) struct Target<'a> {
    pub(crate) region: PixelRegion,
    depth: &'a mut [f32],
    triangles: &'a mut [u32],
    width: usize,
    /// Zero, which the compiler does not know; see [`keep_nearer`].
    zero: i32,
}

impl<'a> Target<'a> {
    pub(crate) fn new(view: &'a mut RenderedView) -> Self {
        let region = view.region();
        let (depth, triangles) = view.buffers_mut();
        Self {
            region,
            depth,
            triangles,
            width: region.width(),
            zero: std::hint::black_box(0),
        }
    }

    /// Writes the pixels of a triangle that are nearer than the depth in the view.
    #[inline(always)]
    pub(crate) fn fill(&mut self, coverage: &Coverage, plane: &InverseDepth, triangle: u32) {
        // Rows that fit a few vectors are tested as a whole.
        match coverage.columns {
            ..5 => self.fill_narrow::<4>(coverage, plane, triangle),
            5..9 => self.fill_narrow::<8>(coverage, plane, triangle),
            9..17 => self.fill_narrow::<16>(coverage, plane, triangle),
            _ => self.fill_wide(coverage, plane, triangle),
        }
    }

    /// Tests `N` columns of each row at once, at least those of the bounding box.
    #[inline(always)]
    fn fill_narrow<const N: usize>(
        &mut self,
        coverage: &Coverage,
        plane: &InverseDepth,
        triangle: u32,
    ) {
        let mut start = self.index(coverage.u, coverage.v);
        let end = start + index(coverage.rows - 1) * self.width + N;
        let Some(mut edges) = LaneEdges::<N>::new(coverage).filter(|_| end <= self.depth.len())
        else {
            return self.fill_wide(coverage, plane, triangle);
        };
        let (first_u, mut v) = (to_f64(coverage.u), to_f64(coverage.v));
        let us = columns_from::<N>(first_u);
        Work::PixelsTested.count(N * index(coverage.rows));
        for _ in 0..coverage.rows {
            let outside = edges.outside();
            let candidates = plane.depths(plane.at_row(v), &us);
            let row = start..start + N;
            let (Some(depths), Some(ids)) = (
                self.depth[row.clone()].first_chunk_mut::<N>(),
                self.triangles[row].first_chunk_mut::<N>(),
            ) else {
                unreachable!("the row has N pixels")
            };
            keep_nearer(depths, ids, &candidates, &outside, triangle, self.zero);
            edges.next_row();
            start += self.width;
            v += 1.0;
        }
    }

    /// Fills long rows, whose ends it computes.
    fn fill_wide(&mut self, coverage: &Coverage, plane: &InverseDepth, triangle: u32) {
        vectorized(FillWide {
            target: self,
            coverage,
            plane,
            triangle,
        });
    }

    #[inline(always)]
    fn index(&self, u: i64, v: i64) -> usize {
        index(v - i64::from(self.region.v_min)) * self.width
            + index(u - i64::from(self.region.u_min))
    }
}

/// Pixels of a long row that are written at once.
const LANES: usize = 8;

struct FillWide<'a, 'view> {
    target: &'a mut Target<'view>,
    coverage: &'a Coverage,
    plane: &'a InverseDepth,
    triangle: u32,
}

impl VectorLoop for FillWide<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (coverage, plane) = (self.coverage, self.plane);
        let (triangle, zero) = (self.triangle, self.target.zero);
        let mut edges = coverage.edges;
        let mut start = self.target.index(coverage.u, coverage.v);
        let (first_u, mut v) = (to_f64(coverage.u), to_f64(coverage.v));
        for _ in 0..coverage.rows {
            let (first, end) = inside_columns(&edges, coverage.columns);
            if first < end {
                let row = plane.at_row(v);
                let mut u = first_u + to_f64(first);
                let (mut at, last) = (start + index(first), start + index(end));
                Work::PixelsTested.count(last - at);
                while at < last {
                    let (Some(depths), Some(ids)) = (
                        self.target.depth[at..].first_chunk_mut::<LANES>(),
                        self.target.triangles[at..].first_chunk_mut::<LANES>(),
                    ) else {
                        break;
                    };
                    let candidates = plane.depths(row, &columns_from::<LANES>(u));
                    let outside = beyond(last - at);
                    keep_nearer(depths, ids, &candidates, &outside, triangle, zero);
                    u += LANES as f64;
                    at += LANES;
                }
                // At the end of the view.
                for at in at..last {
                    let depth = std::array::from_mut(&mut self.target.depth[at]);
                    let id = std::array::from_mut(&mut self.target.triangles[at]);
                    keep_nearer(depth, id, &[plane.depth(row, u)], &[0], triangle, zero);
                    u += 1.0;
                }
            }
            for edge in &mut edges {
                edge.value += edge.per_v;
            }
            start += self.target.width;
            v += 1.0;
        }
    }
}

/// Returns numbers that are negative for lanes from `columns` on.
#[inline(always)]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "at most 32768"
)]
fn beyond<const N: usize>(columns: usize) -> [i32; N] {
    let mut left = columns as i32 - 1;
    let mut beyond = [0; N];
    for lane in &mut beyond {
        *lane = left;
        left -= 1;
    }
    beyond
}

/// The largest edge function in 32 bits.
const MOST: u64 = i32::MAX.unsigned_abs() as u64;

/// Returns consecutive columns from the first one on.
#[inline(always)]
fn columns_from<const N: usize>(first: f64) -> [f64; N] {
    let mut columns = [0.0; N];
    for (lane, column) in columns.iter_mut().enumerate() {
        *column = first + lane as f64;
    }
    columns
}

/// The three edge functions at `N` adjacent pixels, in 32 bits.
struct LaneEdges<const N: usize> {
    values: [[i32; N]; 3],
    per_v: [i32; 3],
    /// Negative beyond the columns of the bounding box, which may be clipped at the border of the
    /// view.
    beyond: [i32; N],
}

impl<const N: usize> LaneEdges<N> {
    /// Returns `None` if a required value is out of range.
    #[inline(always)]
    fn new(coverage: &Coverage) -> Option<Self> {
        let mut lanes = Self {
            values: [[0; N]; 3],
            per_v: [0; 3],
            beyond: beyond(index(coverage.columns)),
        };
        for (index, edge) in coverage.edges.iter().enumerate() {
            // The largest magnitude at any of the tested pixels.
            let reach = edge.value.unsigned_abs()
                + edge.per_u.unsigned_abs() * N as u64
                + edge.per_v.unsigned_abs() * coverage.rows.unsigned_abs();
            let (Ok(value), true) = (i32::try_from(edge.value), reach <= MOST) else {
                return None;
            };
            #[allow(clippy::cast_possible_truncation, reason = "within reach")]
            let (per_u, per_v) = (edge.per_u as i32, edge.per_v as i32);
            for (lane, u) in lanes.values[index].iter_mut().zip(0..) {
                *lane = value + per_u * u;
            }
            lanes.per_v[index] = per_v;
        }
        Some(lanes)
    }

    /// Returns numbers that are negative for pixels outside.
    #[inline(always)]
    fn outside(&self) -> [i32; N] {
        let mut outside = self.beyond;
        for values in &self.values {
            for (outside, value) in outside.iter_mut().zip(values) {
                *outside |= value;
            }
        }
        outside
    }

    #[inline(always)]
    fn next_row(&mut self) {
        for (values, per_v) in self.values.iter_mut().zip(self.per_v) {
            for value in values {
                // The row after the last may be out of range.
                *value = value.wrapping_add(per_v);
            }
        }
    }
}

/// Returns the columns of a row, first and one past the last, in which no edge is negative.
fn inside_columns(edges: &[Edge; 3], columns: i64) -> (i64, i64) {
    let (mut first, mut end) = (0, columns);
    for edge in edges {
        let (value, step) = (edge.value, edge.per_u);
        if step > 0 {
            if value < 0 {
                // The first column k with value + k·step ≥ 0.
                first = first.max((step - 1 - value) / step);
            }
        } else if value < 0 {
            return (0, 0);
        } else if step < 0 && value + (columns - 1) * step < 0 {
            // The last such column.
            end = end.min(value / -step + 1);
        }
    }
    (first, end)
}

/// Stores candidates that are nearer; of equal depths, the first is kept.
///
/// A depth of 0 is missing. Pixels outside (negative) do not change.
#[inline(always)]
fn keep_nearer<const N: usize>(
    depths: &mut [f32; N],
    ids: &mut [u32; N],
    candidates: &[f32; N],
    outside: &[i32; N],
    triangle: u32,
    zero: i32,
) {
    // Positive numbers are ordered like their bits; less one, a missing depth is the farthest.
    // Signs become masks, all-ones or zero in each lane. If the compiler knew that (`zero`), it
    // would make masked stores of them, which some processors run slowly.
    let mut taken = [0_i32; N];
    for lane in 0..N {
        let old = depths[lane].to_bits().wrapping_sub(1) & (u32::MAX >> 1);
        let candidate = candidates[lane].to_bits().wrapping_sub(1);
        let nearer = candidate.wrapping_sub(old).cast_signed();
        taken[lane] = (nearer & !outside[lane]) >> 31 | zero;
    }
    for lane in 0..N {
        let taken = taken[lane].cast_unsigned();
        let (old, candidate) = (depths[lane].to_bits(), candidates[lane].to_bits());
        depths[lane] = f32::from_bits((candidate & taken) | (old & !taken));
    }
    for lane in 0..N {
        let taken = taken[lane].cast_unsigned();
        ids[lane] = (triangle & taken) | (ids[lane] & !taken);
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "offsets within a region, not negative and below 2^15"
)]
#[inline(always)]
fn index(offset: i64) -> usize {
    offset as usize
}

/// Converts a pixel index, which is below 2¹⁵ and exact.
#[inline(always)]
fn to_f64(pixel: i64) -> f64 {
    pixel as f64
}
