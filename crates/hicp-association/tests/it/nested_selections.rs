//! Tests of nested selections against their definitions.

// References are written like the definitions. Their cost does not matter, since tests are small.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use crate::common::{Fixed, Scene, ball_scene, blind_scene, scene_of};
use crate::support::{Numbers, cuboid};
use hicp_association::{
    AllSamples, Length, NormalSpace, ObservedSurface, PointSelection, RandomSample, StableSampling,
    Stride, UniformCount, VisibleSurface, VoxelGrid, WithoutBoundary,
};
use hicp_core::{
    Context, Isometry3, Matrix6, Point3, RenderCache, Surfel, UnitQuaternion, UnitVector3, Vector3,
    Vector6,
};
use proptest::prelude::*;

/// Returns the positions of `chosen` in `all`, and panics unless it is a subset in order.
fn positions(all: &[Surfel], chosen: &[Surfel]) -> Vec<usize> {
    let mut rest = all.iter().enumerate();
    chosen
        .iter()
        .map(|c| rest.find(|(_, s)| *s == c).expect("a subset in order").0)
        .collect()
}

fn select_fixed(selection: &mut impl PointSelection) -> Vec<Surfel> {
    static SCENE: OnceLock<Scene> = OnceLock::new();
    SCENE
        .get_or_init(ball_scene)
        .select(selection, &Isometry3::identity())
}

#[test]
fn a_used_voxel_grid_equals_a_new_one() {
    let scene = ball_scene();
    let mut used = VoxelGrid::new(AllSamples, Length::Meters(0.02));
    scene.select(&mut used, &scene.truth);
    assert_eq!(used.clone(), used);
    assert_eq!(used, VoxelGrid::new(AllSamples, Length::Meters(0.02)));
    assert_ne!(used, VoxelGrid::new(AllSamples, Length::Meters(0.03)));
    assert!(format!("{used:?}").contains("Meters(0.02)"));
}

#[test]
fn impossible_poses_select_nothing_and_counts_may_be_zero() {
    for scene in [ball_scene(), blind_scene()] {
        for translation in [[f64::NAN, 0.0, 0.5], [0.0, f64::INFINITY, 0.5]] {
            let pose = Isometry3::from_parts(translation.into(), UnitQuaternion::identity());
            let found = scene.select(&mut ObservedSurface::default(), &pose);
            assert!(found.is_empty());
        }
    }
    for points in [0, 1, 2] {
        let fixed = Fixed(Numbers(1).surfels(points, 0.1));
        for count in [0, 1, 5] {
            let expected = points.min(count);
            let selection = fixed.clone();
            assert_eq!(
                select_fixed(&mut UniformCount { selection, count }).len(),
                expected
            );
            let selection = fixed.clone();
            let mut random = RandomSample {
                selection,
                count,
                seed: 9,
            };
            assert_eq!(select_fixed(&mut random).len(), expected);
            let mut normals = NormalSpace::new(fixed.clone(), count, 0);
            assert_eq!(select_fixed(&mut normals).len(), expected);
            let mut stable = StableSampling::new(fixed.clone(), count);
            assert_eq!(select_fixed(&mut stable).len(), expected);
        }
    }
}

#[test]
fn points_that_are_not_finite_do_not_panic() {
    let mut surfels = Numbers(2).surfels(40, 0.1);
    surfels[3].point.x = f32::NAN;
    surfels[7].point.z = f32::INFINITY;
    surfels[9].normal = UnitVector3::new_unchecked(Vector3::repeat(f32::NAN));
    let stable = select_fixed(&mut StableSampling::new(Fixed(surfels.clone()), 20));
    assert_eq!(stable.len(), 20);
    assert!(stable.iter().all(|s| s.point.iter().all(|x| x.is_finite())));
    assert_eq!(
        select_fixed(&mut NormalSpace::new(Fixed(surfels.clone()), 20, 4)).len(),
        20
    );
    let cell = Length::Meters(0.05);
    assert!(!select_fixed(&mut VoxelGrid::new(Fixed(surfels), cell)).is_empty());
}

#[test]
fn uniform_count_is_evenly_spaced() {
    let fixed = Fixed(Numbers(3).surfels(10, 0.1));
    let mut selection = UniformCount {
        selection: fixed.clone(),
        count: 4,
    };
    let chosen = select_fixed(&mut selection);
    // ⌊(i + ½)·10/4⌋
    assert_eq!(positions(&fixed.0, &chosen), [1, 3, 6, 8]);
    for count in [10, 11, usize::MAX] {
        selection.count = count;
        assert_eq!(select_fixed(&mut selection), fixed.0);
    }
}

#[test]
fn random_samples_are_fair_and_follow_the_seed() {
    let fixed = Fixed(Numbers(4).surfels(12, 0.1));
    let mut drawn = [0_u32; 12];
    let mut pairs_drawn = 0;
    for seed in 0..2000 {
        let mut selection = RandomSample {
            selection: fixed.clone(),
            count: 3,
            seed,
        };
        let chosen = select_fixed(&mut selection);
        assert_eq!(chosen, select_fixed(&mut selection.clone()));
        let chosen = positions(&fixed.0, &chosen);
        assert_eq!(chosen.len(), 3);
        for position in &chosen {
            drawn[*position] += 1;
        }
        pairs_drawn += u32::from(chosen.contains(&2) && chosen.contains(&11));
    }
    // Expected are 500 draws each, with a deviation of √(2000·¼·¾) = 19. For a given pair they are
    // 2000·3·2/(12·11) = 91, with a deviation of 9.3.
    assert!(drawn.iter().all(|n| n.abs_diff(500) < 85), "{drawn:?}");
    assert!(u32::abs_diff(pairs_drawn, 91) < 42, "{pairs_drawn}");
}

/// Returns the most central point of each cell, the first of equals.
fn voxel_reference(surfels: &[Surfel], cell: f32) -> Vec<usize> {
    let mut cells: BTreeMap<[i64; 3], (f32, usize)> = BTreeMap::new();
    for (position, surfel) in surfels.iter().enumerate() {
        let scaled = surfel.point / cell;
        let key = [scaled.x, scaled.y, scaled.z].map(|x| x.floor() as i64);
        let center = Point3::from(scaled.coords.map(|x| x.floor() + 0.5));
        let entry = ((scaled - center).norm_squared(), position);
        let best = cells.entry(key).or_insert(entry);
        if entry.0 < best.0 {
            *best = entry;
        }
    }
    let mut kept: Vec<usize> = cells.values().map(|(_, position)| *position).collect();
    kept.sort_unstable();
    kept
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn voxel_grid_keeps_the_central_point_of_every_cell(seed: u64, cell in 0.005_f32..0.3) {
        let mut random = Numbers(seed);
        let mut surfels = random.surfels(120, 0.1);
        let grid = |surfels: &[Surfel]| {
            select_fixed(&mut VoxelGrid::new(Fixed(surfels.to_vec()), Length::Meters(f64::from(cell))))
        };
        let chosen = grid(&surfels);
        // Squared distances in units of cells may tie up to rounding, so compare kept points by
        // cell.
        let expected = voxel_reference(&surfels, cell);
        prop_assert_eq!(positions(&surfels, &chosen), expected);
        // The order of the points does not change which are kept.
        random.shuffle(&mut surfels);
        let mut shuffled = grid(&surfels);
        prop_assert_eq!(shuffled.len(), chosen.len());
        shuffled.retain(|s| !chosen.contains(s));
        prop_assert!(shuffled.is_empty());
    }

    #[test]
    fn normal_space_selects_equally_from_every_direction(seed: u64, count in 1_usize..150) {
        let mut random = Numbers(seed);
        // Six directions of very different frequency, so that the buckets are known.
        let axes = [Vector3::x_axis(), -Vector3::x_axis(), Vector3::y_axis(), -Vector3::y_axis(),
            Vector3::z_axis(), -Vector3::z_axis()];
        let shares = [1, 3, 9, 27, 81, 0];
        let mut surfels: Vec<Surfel> = axes.iter().zip(shares).flat_map(|(normal, share)| {
            vec![*normal; share]
        }).map(|normal| Surfel { point: random.point(0.1), normal }).collect();
        random.shuffle(&mut surfels);
        let resolution = 1 + random.below(3) * 2;
        let chosen = select_fixed(&mut NormalSpace::new(Fixed(surfels.clone()), count, resolution));
        positions(&surfels, &chosen);
        prop_assert_eq!(chosen.len(), count.min(121));
        let taken = axes.map(|axis| chosen.iter().filter(|s| s.normal == axis).count());
        let most = taken.iter().max().unwrap();
        for (taken, share) in taken.iter().zip(shares) {
            prop_assert!(*taken == share || taken + 1 >= *most, "{taken} of {share}, others {most}");
        }
    }

    #[test]
    fn stable_sampling_equals_its_definition(seed: u64, count in 1_usize..60) {
        let surfels = Numbers(seed).surfels(60, 0.1);
        let chosen = select_fixed(&mut StableSampling::new(Fixed(surfels.clone()), count));
        prop_assert_eq!(positions(&surfels, &chosen), stable_reference(&surfels, count));
    }
}

/// Returns the rows [p × n; n] relative to the mean, in units of the mean distance from it.
fn constraints(surfels: &[Surfel]) -> Vec<Vector6<f64>> {
    let n = surfels.len() as f64;
    let points: Vec<Vector3<f64>> = surfels.iter().map(|s| s.point.coords.cast()).collect();
    let mean = points.iter().sum::<Vector3<f64>>() / n;
    let size = points.iter().map(|p| (p - mean).norm()).sum::<f64>() / n;
    (points.iter().zip(surfels))
        .map(|(p, s)| {
            let normal: Vector3<f64> = s.normal.into_inner().cast();
            let turn = ((p - mean) / size).cross(&normal);
            Vector6::new(turn.x, turn.y, turn.z, normal.x, normal.y, normal.z)
        })
        .collect()
}

fn covariance(rows: &[Vector6<f64>]) -> Matrix6<f64> {
    rows.iter().map(|v| v * v.transpose()).sum()
}

fn stable_reference(surfels: &[Surfel], count: usize) -> Vec<usize> {
    let rows = constraints(surfels);
    let motions = covariance(&rows).symmetric_eigen().eigenvectors;
    let mut sums = [0.0; 6];
    let mut taken = Vec::new();
    while taken.len() < count {
        let k = (0..6)
            .min_by(|a, b| f64::total_cmp(&sums[*a], &sums[*b]))
            .unwrap();
        let along = |i: usize, k: usize| motions.column(k).dot(&rows[i]).powi(2);
        let best = (0..rows.len())
            .filter(|i| !taken.contains(i))
            .max_by(|a, b| along(*a, k).total_cmp(&along(*b, k)))
            .unwrap();
        for (k, sum) in sums.iter_mut().enumerate() {
            *sum += along(best, k);
        }
        taken.push(best);
    }
    taken.sort_unstable();
    taken
}

#[test]
fn stable_sampling_finds_the_groove_of_a_plate() {
    // Only forty slanted points of a thousand keep this plate from sliding along x and y.
    let mut random = Numbers(6);
    let mut surfels: Vec<Surfel> = (0..1000)
        .map(|_| Surfel {
            point: Point3::new(random.within(0.1), random.within(0.1), 0.0),
            normal: Vector3::z_axis(),
        })
        .collect();
    for i in 0..40 {
        let side = if i % 2 == 0 { 1.0 } else { -1.0 };
        let along = if i % 4 < 2 {
            Vector3::x()
        } else {
            Vector3::y()
        };
        surfels[25 * i].normal = UnitVector3::new_normalize(Vector3::z() + along * side);
    }
    random.shuffle(&mut surfels);
    let condition = |chosen: &[Surfel]| {
        let values = covariance(&constraints(chosen))
            .symmetric_eigen()
            .eigenvalues;
        values.max() / values.min()
    };
    let stable = select_fixed(&mut StableSampling::new(Fixed(surfels.clone()), 100));
    let uniform = select_fixed(&mut UniformCount {
        selection: Fixed(surfels),
        count: 100,
    });
    let (stable, uniform) = (condition(&stable), condition(&uniform));
    assert!(5.0 * stable < uniform, "{stable} against {uniform}");
}

#[test]
fn observed_surface_lies_at_the_observed_points() {
    let scene = ball_scene();
    let pose = scene.nearby(2);
    let stride = Stride::Pixels(2);
    let source = scene.select(&mut ObservedSurface { stride }, &pose);
    let targets = scene.targets(2);
    assert_eq!(source.len(), targets.len());
    for (surfel, (_, target)) in source.iter().zip(&targets) {
        let seen = pose * surfel.point.cast::<f64>();
        assert!((seen - target.point.cast::<f64>()).norm() < 1e-6);
        let normal = pose.rotation * surfel.normal.into_inner().cast::<f64>();
        assert!((normal - target.normal.into_inner().cast::<f64>()).norm() < 1e-6);
    }
}

#[test]
fn without_boundary_equals_its_definition() {
    for scene in [ball_scene(), scene_of(cuboid(0.06, 0.18, 0.1), 0.0, 8)] {
        let pose = scene.nearby(3);
        let stride = Stride::Pixels(1);
        let all = scene.select(&mut VisibleSurface::with_stride(stride), &pose);
        let camera = scene.observation.camera();
        let focal = camera.fx().min(camera.fy());
        for (width, max_tilt_degrees) in [(0, 60.0), (1, 60.0), (2, 45.0), (1, 85.0), (3, f64::NAN)]
        {
            let slope = f64::to_radians(max_tilt_degrees).tan();
            let max_step = (slope / focal) as f32;
            let mut selection = WithoutBoundary {
                selection: VisibleSurface::with_stride(stride),
                width,
                max_tilt_degrees,
            };
            let kept = scene.select(&mut selection, &pose);
            assert_eq!(
                kept,
                boundary_reference(&scene, &pose, &all, width, max_step)
            );
            assert_eq!(kept.len() == all.len(), width == 0);
            assert_eq!(kept.is_empty(), max_step.is_nan());
        }
    }
}

fn boundary_reference(
    scene: &Scene,
    pose: &Isometry3<f64>,
    all: &[Surfel],
    width: u32,
    max_step: f32,
) -> Vec<Surfel> {
    let mut renders = RenderCache::new(crate::support::RayCaster);
    let mut context = Context::new(scene.problem(), &mut renders);
    let view = context.view(pose).unwrap();
    let depth = |u: i64, v: i64| view.depth_at(u as u32, v as u32);
    let width = i64::from(width);
    let keep = |surfel: &&Surfel| {
        let p = pose * surfel.point.cast::<f64>();
        let pixel = scene.observation.camera().project(&p).unwrap();
        let (u, v) = (pixel.x.round() as i64, pixel.y.round() as i64);
        let center = depth(u, v);
        (-width..=width).all(|dv| {
            (-width..=width).all(|du| {
                let (x, y) = (u + du, v + dv);
                if !(0..64).contains(&x) || !(0..48).contains(&y) || (du, dv) == (0, 0) {
                    return true;
                }
                let reach = du.abs().max(dv.abs()) as f32;
                let z = depth(x, y);
                z > 0.0 && (z - center).abs() <= max_step * reach * z.min(center)
            })
        })
    };
    all.iter().filter(keep).copied().collect()
}
