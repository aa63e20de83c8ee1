//! A projective point-to-plane step, fused by hand into one AVX2 loop.
//!
//! It shows the speed that the hardware allows; the traits are measured against it.
//!
//! It does the work of `Projective` and `PointToPlane` for the points of one selection and one
//! observation, eight at a time. Sums are `f32` and are added to `f64` totals every few hundred
//! points. There are no traits, weights, filters or lists of pairs: only the arithmetic and one
//! load per observed pixel, neither of which can be avoided.

use hybrid_icp::core::{Isometry3, Matrix6, Observation, Point3, Surfel, Vector3, Vector6, se3};

/// Columns of a row: six unknowns and the residual.
const COLUMNS: usize = 7;
/// Number of entries of the upper triangle of [`COLUMNS`]²: JᵀJ, Jᵀr and rᵀr.
const SUMS: usize = COLUMNS * (COLUMNS + 1) / 2;

/// The points and observed surfels of a registration, in the memory layout of the loop.
#[derive(Debug)]
pub struct Fused {
    /// x, y and z of the source points in the object frame, padded with NaN to whole vectors of
    /// eight.
    source: [Vec<f32>; 3],
    /// Point, normal and two zeros per pixel of the observation's region. All zeros without a
    /// surfel.
    targets: Vec<Target>,
    width: usize,
    height: usize,
    corner: [f32; 2],
    /// fx, fy, cx, cy.
    camera: [f32; 4],
}

#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
struct Target([f32; 8]);

/// Rotation (row-major), translation and pivot of a step.
#[derive(Clone, Copy, Debug)]
struct Motion {
    rotation: [f32; 9],
    translation: [f32; 3],
    pivot: [f32; 3],
}

impl Fused {
    /// Arranges a selection and an observation for the loop.
    ///
    /// Returns `None` on a processor without AVX2 and FMA.
    #[must_use]
    pub fn new(observation: &Observation, source: &[Surfel]) -> Option<Self> {
        if !available() || observation.region().is_empty() {
            return None;
        }
        let padded = source.len().next_multiple_of(8);
        let coordinates = |axis: usize| {
            let mut values: Vec<f32> = source.iter().map(|s| s.point[axis]).collect();
            values.resize(padded, f32::NAN);
            values
        };
        let region = observation.region();
        let area = u32::try_from(region.area()).ok()?;
        let target = |index| {
            observation
                .surfel(index)
                .map_or_else(Target::default, |surfel| {
                    let (p, n) = (surfel.point, surfel.normal);
                    Target([p.x, p.y, p.z, n.x, n.y, n.z, 0.0, 0.0])
                })
        };
        let camera = observation.camera();
        Some(Self {
            source: [0, 1, 2].map(coordinates),
            targets: (0..area).map(target).collect(),
            width: region.width(),
            height: region.height(),
            corner: [region.u_min as f32, region.v_min as f32],
            camera: [camera.fx(), camera.fy(), camera.cx(), camera.cy()].map(|x| x as f32),
        })
    }

    /// Returns the Gauss–Newton increment at a pose, or `None` if the pairs do not determine it.
    ///
    /// Rotations are summed around `pivot`, a point in the camera frame anywhere near the object.
    ///
    #[must_use]
    pub fn step(
        &self,
        camera_from_object: &Isometry3<f64>,
        pivot: &Point3<f64>,
    ) -> Option<Isometry3<f64>> {
        let rotation = camera_from_object.rotation.to_rotation_matrix();
        let translation = camera_from_object.translation.vector;
        let motion = Motion {
            rotation: std::array::from_fn(|i| rotation[(i / 3, i % 3)] as f32),
            translation: std::array::from_fn(|i| translation[i] as f32),
            pivot: std::array::from_fn(|i| pivot[i] as f32),
        };
        let sums = self.sums(&motion);
        let mut hessian = Matrix6::zeros();
        let mut gradient = Vector6::zeros();
        let mut entries = sums.into_iter();
        for i in 0..6 {
            for j in i..COLUMNS {
                let entry = entries.next().unwrap_or(0.0);
                if j == 6 {
                    gradient[i] = entry;
                } else {
                    hessian[(i, j)] = entry;
                    hessian[(j, i)] = entry;
                }
            }
        }
        let twist = -hessian.cholesky()?.solve(&gradient);
        let turn = Vector3::new(twist[3], twist[4], twist[5]);
        let shift = Vector3::new(twist[0], twist[1], twist[2]) + pivot.coords.cross(&turn);
        let increment = se3::exp(&Vector6::new(
            shift.x, shift.y, shift.z, turn.x, turn.y, turn.z,
        ));
        se3::is_finite(&increment).then_some(increment)
    }

    #[cfg(target_arch = "x86_64")]
    fn sums(&self, motion: &Motion) -> [f64; SUMS] {
        avx2::sums(self, motion)
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn sums(&self, _motion: &Motion) -> [f64; SUMS] {
        [0.0; SUMS]
    }
}

#[cfg(target_arch = "x86_64")]
fn available() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
}

#[cfg(not(target_arch = "x86_64"))]
fn available() -> bool {
    false
}

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)] // Intrinsics: see the SAFETY comments.
mod avx2 {
    use std::arch::x86_64::*;

    use super::{COLUMNS, Fused, Motion, SUMS, Target};

    /// Vectors per block. Its rows stay in the first-level cache until they are summed.
    const BLOCK: usize = 64;

    type Rows = [[__m256; BLOCK]; COLUMNS];

    pub(super) fn sums(fused: &Fused, motion: &Motion) -> [f64; SUMS] {
        // SAFETY: a `Fused` is only created if AVX2 and FMA are available.
        unsafe { vectorized(fused, motion) }
    }

    #[target_feature(enable = "avx2,fma")]
    fn vectorized(fused: &Fused, motion: &Motion) -> [f64; SUMS] {
        let mut total = [0.0; SUMS];
        let mut rows: Rows = [[_mm256_setzero_ps(); BLOCK]; COLUMNS];
        let [xs, ys, zs] = &fused.source;
        let points = BLOCK * 8;
        for ((xs, ys), zs) in xs
            .chunks(points)
            .zip(ys.chunks(points))
            .zip(zs.chunks(points))
        {
            let vectors = fill(fused, motion, [xs, ys, zs], &mut rows);
            accumulate::<0>(&rows, vectors, &mut total[0..]);
            accumulate::<1>(&rows, vectors, &mut total[7..]);
            accumulate::<2>(&rows, vectors, &mut total[13..]);
            accumulate::<3>(&rows, vectors, &mut total[18..]);
            accumulate::<4>(&rows, vectors, &mut total[22..]);
            accumulate::<5>(&rows, vectors, &mut total[25..]);
            accumulate::<6>(&rows, vectors, &mut total[27..]);
        }
        total
    }

    /// Moves, projects, pairs and linearizes the points of a block.
    ///
    /// A point without a pair leaves a row of zeros. Returns the number of vectors.
    #[target_feature(enable = "avx2,fma")]
    fn fill(fused: &Fused, motion: &Motion, source: [&[f32]; 3], rows: &mut Rows) -> usize {
        let r = motion.rotation.map(|x| _mm256_set1_ps(x));
        let t = motion.translation.map(|x| _mm256_set1_ps(x));
        let pivot = motion.pivot.map(|x| _mm256_set1_ps(x));
        let [fx, fy, cx, cy] = fused.camera.map(|x| _mm256_set1_ps(x));
        let [left, top] = fused.corner.map(|x| _mm256_set1_ps(x));
        let half = _mm256_set1_ps(0.5);
        let zero = _mm256_setzero_ps();
        let columns = _mm256_set1_ps(fused.width as f32);
        let lines = _mm256_set1_ps(fused.height as f32);
        let width = _mm256_set1_epi32(i32::try_from(fused.width).unwrap_or(i32::MAX));
        let vectors = source[0].len() / 8;
        for vector in 0..vectors {
            let of = |values: &[f32]| load(&values[vector * 8..vector * 8 + 8]);
            let (x, y, z) = (of(source[0]), of(source[1]), of(source[2]));
            let row = |i: usize| {
                let two = _mm256_add_ps(_mm256_mul_ps(r[i], x), _mm256_mul_ps(r[i + 1], y));
                _mm256_add_ps(two, _mm256_mul_ps(r[i + 2], z))
            };
            let px = _mm256_add_ps(row(0), t[0]);
            let py = _mm256_add_ps(row(3), t[1]);
            let pz = _mm256_add_ps(row(6), t[2]);
            let u = _mm256_add_ps(_mm256_div_ps(_mm256_mul_ps(fx, px), pz), cx);
            let v = _mm256_add_ps(_mm256_div_ps(_mm256_mul_ps(fy, py), pz), cy);
            let u = _mm256_add_ps(_mm256_sub_ps(u, left), half);
            let v = _mm256_add_ps(_mm256_sub_ps(v, top), half);
            let inside = |value, limit| {
                _mm256_and_ps(
                    _mm256_cmp_ps::<_CMP_GE_OQ>(value, zero),
                    _mm256_cmp_ps::<_CMP_LT_OQ>(value, limit),
                )
            };
            let ahead = _mm256_cmp_ps::<_CMP_GT_OQ>(pz, zero);
            let valid = _mm256_and_ps(_mm256_and_ps(inside(u, columns), inside(v, lines)), ahead);
            let pixel = _mm256_add_epi32(
                _mm256_mullo_epi32(_mm256_cvttps_epi32(v), width),
                _mm256_cvttps_epi32(u),
            );
            // Points outside the image use pixel 0; the mask clears their rows.
            let pixel = _mm256_and_si256(pixel, _mm256_castps_si256(valid));
            let [tx, ty, tz, nx, ny, nz] = gather(&fused.targets, pixel);
            let valid = _mm256_and_ps(valid, _mm256_cmp_ps::<_CMP_GT_OQ>(tz, zero));

            let (dx, dy, dz) = (
                _mm256_sub_ps(px, tx),
                _mm256_sub_ps(py, ty),
                _mm256_sub_ps(pz, tz),
            );
            let residual = _mm256_fmadd_ps(nz, dz, _mm256_fmadd_ps(ny, dy, _mm256_mul_ps(nx, dx)));
            let (lx, ly, lz) = (
                _mm256_sub_ps(px, pivot[0]),
                _mm256_sub_ps(py, pivot[1]),
                _mm256_sub_ps(pz, pivot[2]),
            );
            let columns = [
                nx,
                ny,
                nz,
                _mm256_fmsub_ps(ly, nz, _mm256_mul_ps(lz, ny)),
                _mm256_fmsub_ps(lz, nx, _mm256_mul_ps(lx, nz)),
                _mm256_fmsub_ps(lx, ny, _mm256_mul_ps(ly, nx)),
                residual,
            ];
            for (rows, column) in rows.iter_mut().zip(columns) {
                rows[vector] = _mm256_and_ps(column, valid);
            }
        }
        vectors
    }

    /// Adds the products of column `I` with columns `I` and higher to the totals.
    #[target_feature(enable = "avx2,fma")]
    fn accumulate<const I: usize>(rows: &Rows, vectors: usize, total: &mut [f64]) {
        let mut sums = [_mm256_setzero_ps(); COLUMNS];
        #[allow(clippy::needless_range_loop)] // Several columns at one index.
        for vector in 0..vectors.min(BLOCK) {
            let factor = rows[I][vector];
            for j in I..COLUMNS {
                sums[j] = _mm256_fmadd_ps(factor, rows[j][vector], sums[j]);
            }
        }
        for (total, sum) in total.iter_mut().zip(&sums[I..]) {
            *total += horizontal(*sum);
        }
    }

    #[target_feature(enable = "avx2,fma")]
    fn horizontal(vector: __m256) -> f64 {
        let low = _mm256_cvtps_pd(_mm256_castps256_ps128(vector));
        let high = _mm256_cvtps_pd(_mm256_extractf128_ps::<1>(vector));
        let four = _mm256_add_pd(low, high);
        let two = _mm_add_pd(
            _mm256_castpd256_pd128(four),
            _mm256_extractf128_pd::<1>(four),
        );
        _mm_cvtsd_f64(_mm_add_sd(two, _mm_unpackhi_pd(two, two)))
    }

    #[target_feature(enable = "avx2,fma")]
    fn load(values: &[f32]) -> __m256 {
        assert_eq!(values.len(), 8);
        // SAFETY: there are eight values, and the load needs no alignment.
        unsafe { _mm256_loadu_ps(values.as_ptr()) }
    }

    /// Loads eight targets, one cache line each, and transposes them into columns.
    ///
    /// The columns are x, y, z of the point and then of the normal.
    #[target_feature(enable = "avx2,fma")]
    fn gather(targets: &[Target], pixels: __m256i) -> [__m256; 6] {
        let mut indices = [0_u32; 8];
        // SAFETY: the store writes eight 32-bit integers and needs no alignment.
        unsafe { _mm256_storeu_si256(indices.as_mut_ptr().cast(), pixels) };
        let line = |i: usize| load(&targets[indices[i] as usize].0);
        let (a, b, c, d) = (line(0), line(1), line(2), line(3));
        let (e, f, g, h) = (line(4), line(5), line(6), line(7));
        // Transposes four lanes at a time: 2×2 blocks, then 4×4 blocks, then the halves.
        let quarter = |a, b, c, d| {
            let (ab, cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
            let (ab_high, cd_high) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
            [
                _mm256_shuffle_ps::<0x44>(ab, cd),
                _mm256_shuffle_ps::<0xEE>(ab, cd),
                _mm256_shuffle_ps::<0x44>(ab_high, cd_high),
                _mm256_shuffle_ps::<0xEE>(ab_high, cd_high),
            ]
        };
        let [a0, a1, a2, a3] = quarter(a, b, c, d);
        let [e0, e1, e2, e3] = quarter(e, f, g, h);
        [
            _mm256_permute2f128_ps::<0x20>(a0, e0),
            _mm256_permute2f128_ps::<0x20>(a1, e1),
            _mm256_permute2f128_ps::<0x20>(a2, e2),
            _mm256_permute2f128_ps::<0x20>(a3, e3),
            _mm256_permute2f128_ps::<0x31>(a0, e0),
            _mm256_permute2f128_ps::<0x31>(a1, e1),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{OBJECTS, case, selected};
    use hybrid_icp::association::{DataAssociation, Projective, Stride, VisibleSurface};
    use hybrid_icp::core::{Correspondences, Problem};
    use hybrid_icp::metric::{ErrorMetric, PointToPlane};

    /// The steps of the loop and of the traits differ by at most 10⁻⁴ of the motion.
    #[test]
    fn the_traits_compute_the_same_step() {
        if !available() {
            eprintln!("skipped: no AVX2 with FMA");
            return;
        }
        for object in OBJECTS {
            let case = case(object);
            let problem = Problem::new(&case.scene.model, &case.scene.observation);
            let mut every_pixel = VisibleSurface::with_stride(Stride::Pixels(1));
            let (source, mut workspace) = selected(&case.scene, &case.init, &mut every_pixel);
            let mut context = workspace.context(&problem);
            let mut pairs = Correspondences::new();
            pairs.begin(&case.init, source.len());
            Projective.associate(&mut context, &source, &case.init, &mut pairs);
            assert!(pairs.len() > 1000, "{}", pairs.len());
            let expected = PointToPlane.step(&pairs).unwrap().increment;

            let fused = Fused::new(&case.scene.observation, &source).unwrap();
            let pivot = case.init * case.scene.model.center();
            let found = fused.step(&case.init, &pivot).unwrap();

            let (mut difference, mut motion) = (0.0_f64, 0.0_f64);
            for sample in case.scene.model.samples() {
                let point = case.init * sample.point.cast::<f64>();
                difference = difference.max((found * point - expected * point).norm());
                motion = motion.max((expected * point - point).norm());
            }
            assert!(motion > 1e-4, "{motion}");
            assert!(
                difference < 1e-4 * motion,
                "{}: {difference} of {motion}",
                case.name
            );
        }
    }
}
