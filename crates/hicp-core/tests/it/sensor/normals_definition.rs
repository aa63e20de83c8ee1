//! Tests of normals against their definition, pixel by pixel, without sliding sums.

use crate::support::Numbers;
use hicp_core::{DepthImage, Mask, Matrix3, NormalWindow, Observation, PinholeCamera, Vector3};

/// The depths and edges that [`Observation`] fits to, by definition. Pixels are relative to the
/// corner of the region.
struct Definition<'a> {
    camera: &'a PinholeCamera,
    corner: (f64, f64),
    width: usize,
    height: usize,
    /// In meters; 0 if the pixel is not masked.
    depth: Vec<f64>,
    /// Half sides of the windows away from edges and near them, pixels.
    radius: usize,
    edge_radius: usize,
    /// A step between neighbors beyond this share of the nearer depth is an edge.
    edge_step: f64,
    /// Pixels on either side of an edge.
    beside: Vec<(usize, usize)>,
}

/// Pixels nearer than this, in meters, are not fitted.
const MIN_DEPTH: f64 = 1e-4;

impl<'a> Definition<'a> {
    fn new(observation: &'a Observation) -> Self {
        let region = observation.region();
        let masked = |(u, v)| observation.mask().get(u, v) == Some(true);
        let depth = region
            .pixels()
            .map(|(u, v)| {
                let z = observation.depth().get(u, v).unwrap();
                if masked((u, v)) { f64::from(z) } else { 0.0 }
            })
            .collect();
        let camera = observation.camera();
        let mut definition = Self {
            camera,
            corner: (region.u_min.into(), region.v_min.into()),
            width: region.width(),
            height: region.height(),
            depth,
            radius: 0,
            edge_radius: 3,
            edge_step: 0.0,
            beside: Vec::new(),
        };
        let (focal, noise) = (camera.fx().min(camera.fy()), definition.noise());
        // The smallest window in which noise changes the slope by a deviation of at most 0.1.
        let suffices = |r: &usize| {
            let n = (2 * r + 1) as f64;
            let squares: f64 = (1..=*r).map(|u| 2.0 * n * (u * u) as f64).sum();
            focal * noise / squares.sqrt() <= 0.1
        };
        definition.radius = (2..=10).find(suffices).unwrap_or(10);
        if let NormalWindow::HalfSide(radius) = observation.normal_window() {
            definition.radius = radius.into();
            definition.edge_radius = definition.radius.min(3);
        }
        let surface = 85_f64.to_radians().tan() / focal;
        definition.edge_step = surface.max(5.0 * 2_f64.sqrt() * noise);
        definition.beside = definition
            .pixels()
            .filter(|p| definition.torn(*p))
            .collect();
        definition
    }

    fn pixels(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let width = self.width;
        (0..self.height).flat_map(move |v| (0..width).map(move |u| (u, v)))
    }

    fn at(&self, (u, v): (usize, usize)) -> f64 {
        self.depth[v * self.width + u]
    }

    /// The deviation of white noise that has the measured median second difference along rows, over
    /// depth.
    fn noise(&self) -> f64 {
        let mut differences: Vec<f64> = self
            .depth
            .chunks(self.width)
            .flat_map(|row| row.windows(3))
            .filter(|z| z.iter().all(|z| *z > 0.0))
            .map(|z| ((z[0] - 2.0 * z[1] + z[2]) / z[1]).abs())
            .collect();
        if differences.is_empty() {
            return 0.0;
        }
        crate::support::median(&mut differences) / (0.6745 * 6_f64.sqrt())
    }

    fn neighbors(&self, (u, v): (usize, usize)) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (width, height) = (self.width, self.height);
        [
            (u.wrapping_sub(1), v),
            (u + 1, v),
            (u, v.wrapping_sub(1)),
            (u, v + 1),
        ]
        .into_iter()
        .filter(move |(u, v)| *u < width && *v < height)
    }

    /// The step between two neighbors over the nearer depth; `None` if one has no depth.
    fn step(&self, a: (usize, usize), b: (usize, usize)) -> Option<f64> {
        let (a, b) = (self.at(a), self.at(b));
        (a > 0.0 && b > 0.0).then(|| (a - b).abs() / a.min(b))
    }

    fn torn(&self, pixel: (usize, usize)) -> bool {
        self.neighbors(pixel)
            .any(|other| self.step(pixel, other).is_some_and(|s| s > self.edge_step))
    }

    /// Returns whether a pixel on either side of an edge is within `radius` rows and columns.
    fn is_near_an_edge(&self, pixel: (usize, usize)) -> bool {
        self.beside
            .iter()
            .any(|b| distance(*b, pixel) <= self.radius)
    }

    fn window(&self, pixel: (usize, usize), radius: usize) -> Vec<(usize, usize)> {
        let (columns, rows) = (
            pixel.0.saturating_sub(radius)..(pixel.0 + radius + 1).min(self.width),
            pixel.1.saturating_sub(radius)..(pixel.1 + radius + 1).min(self.height),
        );
        rows.flat_map(|v| columns.clone().map(move |u| (u, v)))
            .collect()
    }

    /// The pixels that a plane is fitted to.
    ///
    /// Away from edges they are the window's. Near an edge they are those of a window of at most
    /// 7 × 7 pixels that are connected inside it by steps that are not edges. Their depth must
    /// differ by at most half a step plus half a step per pixel.
    fn support(&self, pixel: (usize, usize)) -> Vec<(usize, usize)> {
        if !self.is_near_an_edge(pixel) {
            return self.window(pixel, self.radius);
        }
        let window = self.window(pixel, self.edge_radius);
        let mut joined = vec![pixel];
        let mut next = 0;
        while let Some(&here) = joined.get(next) {
            for other in self.neighbors(here) {
                let leads = self.step(here, other).is_some_and(|s| s <= self.edge_step);
                if leads && window.contains(&other) && !joined.contains(&other) {
                    joined.push(other);
                }
            }
            next += 1;
        }
        joined.retain(|other| {
            let reach = distance(*other, pixel).max(1) as f64;
            let gate = 0.5 * self.edge_step * (1.0 + reach);
            (self.at(*other) - self.at(pixel)).abs() <= gate * self.at(pixel)
        });
        joined
    }

    /// Returns the normal of the plane m · X = 1 that fits the support best.
    ///
    /// It minimizes the squares of m · (x, y, 1) − 1/z over the rays (x, y, 1) of the support.
    fn normal(&self, pixel: (usize, usize)) -> Option<Vector3<f64>> {
        if self.at(pixel) < MIN_DEPTH {
            return None;
        }
        let mut support = self.support(pixel);
        support.retain(|p| self.at(*p) >= MIN_DEPTH);
        if support.len() < 6 || on_one_line(&support) {
            return None;
        }
        // Rays are relative to the pixel's own, in pixels, which saves digits of the sums.
        let (mut squares, mut products) = (Matrix3::zeros(), Vector3::zeros());
        for p in support {
            let ray = Vector3::new(
                p.0 as f64 - pixel.0 as f64,
                p.1 as f64 - pixel.1 as f64,
                1.0,
            );
            squares += ray * ray.transpose();
            products += ray / self.at(p);
        }
        let m = squares.lu().solve(&products)?;
        let (fx, fy) = (self.camera.fx(), self.camera.fy());
        let ray = self.camera.unproject(
            self.corner.0 + pixel.0 as f64,
            self.corner.1 + pixel.1 as f64,
            1.0,
        );
        let m_z = m.z - m.x * fx * ray.x - m.y * fy * ray.y;
        let plane = Vector3::new(m.x * fx, m.y * fy, m_z);
        // The plane must be in front of the camera. The camera is on the side that m points away
        // from.
        (m.z > 0.0).then(|| -plane.normalize())
    }
}

/// The distance in the maximum norm of rows and columns.
fn distance(a: (usize, usize), b: (usize, usize)) -> usize {
    a.0.abs_diff(b.0).max(a.1.abs_diff(b.1))
}

fn on_one_line(pixels: &[(usize, usize)]) -> bool {
    // Small integers: every product is exact.
    let from_first = |p: &(usize, usize)| {
        let first = pixels[0];
        (p.0 as f64 - first.0 as f64, p.1 as f64 - first.1 as f64)
    };
    let other = from_first(&pixels[1]);
    pixels
        .iter()
        .map(from_first)
        .all(|p| p.0 * other.1 - p.1 * other.0 == 0.0)
}

/// The parameters of the images of [`scene`].
#[derive(Clone, Copy, Debug)]
struct Recipe {
    size: (u32, u32),
    focal: f64,
    /// Side of the patches of surface in pixels, their steepest slope, and the jumps between them
    /// in edge steps.
    patch: usize,
    slope: f64,
    jump: f64,
    /// Relative noise of depth, either everywhere or only in the right half.
    noise: f64,
    right_half: bool,
    /// Shares of pixels that are not masked, and that have no depth.
    unmasked: f64,
    holes: f64,
    window: NormalWindow,
}

const PLAIN: Recipe = Recipe {
    size: (86, 27),
    focal: 600.0,
    patch: 9,
    slope: 0.3,
    jump: 0.0,
    noise: 0.0,
    right_half: false,
    unmasked: 0.0,
    holes: 0.0,
    window: NormalWindow::Automatic,
};

/// Creates patches of surface with different slopes and offsets; a border of the image is not
/// masked.
fn scene(recipe: &Recipe, seed: u64) -> Observation {
    let mut numbers = Numbers(seed);
    let (width, height) = recipe.size;
    let (f, center) = (recipe.focal, numbers.between(0.0, f64::from(width)));
    let camera = PinholeCamera::new(f * 1.1, f, center, 17.3, width + 9, height + 6).unwrap();
    let step = 85_f64.to_radians().tan() / f;
    let n_patches = (width as usize / recipe.patch + 2) * (height as usize / recipe.patch + 2);
    let mut slope = || step * recipe.slope * numbers.between(-1.0, 1.0);
    let slopes: Vec<(f64, f64)> = (0..n_patches).map(|_| (slope(), slope())).collect();
    let jumps = step.max(5.0 * 2_f64.sqrt() * recipe.noise) * recipe.jump;
    let offsets: Vec<f64> = (0..n_patches).map(|_| jumps * numbers.unit()).collect();
    let (mut depth, mut mask) = (Vec::new(), Vec::new());
    for (u, v) in camera.region().pixels() {
        let (column, row) = (u as usize / recipe.patch, v as usize / recipe.patch);
        let patch = (column + row * (width as usize / recipe.patch + 1)) % n_patches;
        let (a, b) = slopes[patch];
        let (x, y) = (u as usize % recipe.patch, v as usize % recipe.patch);
        let noisy = !recipe.right_half || u > width / 2 + 5;
        let noise = if noisy {
            recipe.noise * numbers.normal()
        } else {
            0.0
        };
        let z = 0.6 * (offsets[patch] + a * x as f64 + b * y as f64 + noise).exp();
        let hole = numbers.unit() < recipe.holes;
        depth.push(if hole { 0.0 } else { z as f32 });
        let inside = (5..width + 5).contains(&u) && (2..height + 2).contains(&v);
        mask.push(inside && numbers.unit() >= recipe.unmasked);
    }
    let (width, height) = (camera.width(), camera.height());
    let depth = DepthImage::from_meters(width, height, depth).unwrap();
    let mask = Mask::new(width, height, mask).unwrap();
    Observation::with_normal_window(depth, mask, camera, recipe.window).unwrap()
}

/// Cases that the images must contain, so that the comparison means something.
#[derive(Default)]
struct Seen {
    normals: usize,
    beside_edges: usize,
    without: usize,
    radii: Vec<usize>,
}

/// Compares the observation with the definition at every pixel.
fn compare(recipe: &Recipe, seed: u64, seen: &mut Seen) {
    let observation = scene(recipe, seed);
    let definition = Definition::new(&observation);
    let region = observation.region();
    seen.radii.push(definition.radius);
    for (u, v) in definition.pixels() {
        let expected = definition.normal((u, v));
        let surfel = observation.surfel_at(region.u_min + u as u32, region.v_min + v as u32);
        let found = surfel.map(|s| s.normal.into_inner().cast::<f64>());
        // Components are rounded to f32, by up to 6e-8 each.
        let agree = match (found, expected) {
            (Some(found), Some(expected)) => (found - expected).norm() < 3e-7,
            (found, expected) => found.is_none() && expected.is_none(),
        };
        assert!(
            agree,
            "{recipe:?} {seed}, ({u}, {v}): {found:?}, expected {expected:?}"
        );
        let beside = expected.is_some() && definition.is_near_an_edge((u, v));
        seen.normals += usize::from(expected.is_some());
        seen.beside_edges += usize::from(beside);
        seen.without += usize::from(expected.is_none() && definition.at((u, v)) > 0.0);
    }
}

#[test]
fn normals_near_edges_equal_the_definition() {
    let mut seen = Seen::default();
    let jumps = Recipe { jump: 3.0, ..PLAIN };
    let steep = Recipe {
        slope: 1.1,
        jump: 2.0,
        patch: 11,
        ..PLAIN
    };
    let short = Recipe {
        focal: 90.0,
        slope: 0.9,
        jump: 2.5,
        ..PLAIN
    };
    let ragged = Recipe {
        unmasked: 0.2,
        holes: 0.1,
        ..steep
    };
    for (seed, recipe) in (100..).zip([jumps, steep, short, ragged, ragged, ragged]) {
        compare(&recipe, seed, &mut seen);
    }
    assert!(seen.beside_edges > 6000, "{}", seen.beside_edges);
    assert!(seen.without > 100, "{}", seen.without);
}

#[test]
fn normals_in_noise_equal_the_definition() {
    let mut seen = Seen::default();
    for (seed, noise) in (200..).zip([0.0003, 0.001, 0.002, 0.004, 0.007, 0.012, 0.025]) {
        compare(
            &Recipe {
                noise,
                jump: 1.5,
                patch: 19,
                ..PLAIN
            },
            seed,
            &mut seen,
        );
    }
    seen.radii.dedup();
    assert!(
        seen.radii.is_sorted() && seen.radii.len() >= 6,
        "{:?}",
        seen.radii
    );
    assert!(seen.normals > 10_000 && seen.beside_edges > 1000);
}

/// Second differences across holes, or from one row to the next, are not noise. Those of every
/// column count.
#[test]
fn noise_is_measured_within_rows_and_not_across_holes() {
    let mut seen = Seen::default();
    let noise = 0.004;
    for recipe in [
        Recipe {
            holes: 0.3,
            noise,
            jump: 1.5,
            ..PLAIN
        },
        Recipe {
            right_half: true,
            noise,
            ..PLAIN
        },
        Recipe {
            size: (4, 300),
            slope: 1.0,
            patch: 40,
            ..PLAIN
        },
        Recipe {
            size: (300, 6),
            noise,
            patch: 40,
            ..PLAIN
        },
    ] {
        compare(&recipe, 300, &mut seen);
    }
    assert!(seen.normals > 4000, "{}", seen.normals);
}

#[test]
fn fixed_windows_equal_the_definition_whatever_the_noise() {
    for half_side in [1, 2, 4, 10] {
        let mut seen = Seen::default();
        for (seed, noise) in [(400, 0.0), (401, 0.01)] {
            let recipe = Recipe {
                noise,
                jump: 2.0,
                patch: 15,
                holes: 0.05,
                window: NormalWindow::HalfSide(half_side),
                ..PLAIN
            };
            compare(&recipe, seed, &mut seen);
        }
        assert_eq!(seen.radii, [usize::from(half_side); 2]);
        assert!(seen.normals > 3000 && seen.beside_edges > 300);
    }
}
