//! Points with normals that no image belongs to.

use nalgebra::{Point3, UnitVector3, Vector3};

use crate::derived::Derived;
use crate::id::Id;
use crate::internal::centroid;
use crate::object::diameter::diameter;
use crate::object::mesh::MAX_COORDINATE_METERS;
use crate::surfel::Surfel;

/// A point cloud with normals, organized or not: the source or the target of a registration.
///
/// It is immutable, in meters, in any frame. Scanners and depth cameras put the origin of that
/// frame at the sensor; nothing here requires it. Share a cloud between threads and runs, because
/// search trees are built once per cloud, see [`Cloud::derived`].
///
/// ```
/// use hicp_core::{Cloud, Point3, Surfel, Vector3};
/// let surfel = |x| Surfel { point: Point3::new(x, 0.0, 1.0), normal: -Vector3::z_axis() };
/// let cloud = Cloud::new([0.0, 0.5, f32::NAN].map(surfel));
/// assert_eq!((cloud.surfels().len(), cloud.n_skipped()), (2, 1));
/// assert_eq!(cloud.diameter(), 0.5);
/// ```
#[derive(Clone, Debug)]
pub struct Cloud {
    id: Id,
    surfels: Vec<Surfel>,
    n_skipped: usize,
    center: Point3<f64>,
    neighbors: Option<usize>,
    derived: Derived,
}

impl Cloud {
    /// Creates a cloud from surfels in any order.
    ///
    /// Skips surfels that are not finite, or beyond [`MAX_COORDINATE_METERS`]. A cloud without
    /// points is valid: a registration with it ends with "no pairs".
    pub fn new(surfels: impl IntoIterator<Item = Surfel>) -> Self {
        Self::of(surfels, |surfel| {
            surfel.normal.iter().all(|x| x.is_finite())
        })
    }

    /// Creates a cloud without normals, for metrics that do not use them.
    ///
    /// Point-to-point uses no normals, and point-to-plane only those of the target. The normals of
    /// the cloud are NaN, so other metrics and filters on normals give no step or no pairs. Skips
    /// points as [`Cloud::new`] does.
    pub fn without_normals(points: impl IntoIterator<Item = Point3<f32>>) -> Self {
        let normal = UnitVector3::new_unchecked(Vector3::repeat(f32::NAN));
        let surfels = points.into_iter().map(|point| Surfel { point, normal });
        Self::with_some_normals(surfels).with_normals_from(0)
    }

    /// Creates a cloud from surfels of which some may have a normal of NaN.
    ///
    /// [`Cloud::new`] skips points without a normal. Use this for metrics without normals, which
    /// can use such points. Skips points that are not finite, or beyond [`MAX_COORDINATE_METERS`].
    pub fn with_some_normals(surfels: impl IntoIterator<Item = Surfel>) -> Self {
        Self::of(surfels, |_| true)
    }

    fn of(surfels: impl IntoIterator<Item = Surfel>, has_normal: impl Fn(&Surfel) -> bool) -> Self {
        let within = |x: &f32| x.abs() <= MAX_COORDINATE_METERS;
        let mut n_given = 0;
        let surfels: Vec<Surfel> = surfels
            .into_iter()
            .inspect(|_| n_given += 1)
            .filter(|surfel| surfel.point.iter().all(within) && has_normal(surfel))
            .collect();
        Self {
            id: Id::next(),
            n_skipped: n_given - surfels.len(),
            center: centroid(&surfels).unwrap_or_default(),
            surfels,
            neighbors: None,
            derived: Derived::default(),
        }
    }

    /// Records that the normals were estimated from this many neighbors, for warnings.
    #[must_use]
    pub fn with_normals_from(self, neighbors: usize) -> Self {
        Self {
            neighbors: Some(neighbors),
            ..self
        }
    }

    /// The identity of this cloud, for caches.
    #[must_use]
    pub fn id(&self) -> Id {
        self.id
    }

    /// The points with their normals, in the order given.
    #[must_use]
    pub fn surfels(&self) -> &[Surfel] {
        &self.surfels
    }

    /// Number of surfels that were skipped because they are not finite or too far away.
    #[must_use]
    pub fn n_skipped(&self) -> usize {
        self.n_skipped
    }

    /// Number of neighbors from which the normals were estimated; `None` if they were given, and 0
    /// if there are none.
    #[must_use]
    pub fn normals_from(&self) -> Option<usize> {
        self.neighbors
    }

    /// Mean of the points, meters; the origin without points.
    #[must_use]
    pub fn center(&self) -> Point3<f64> {
        self.center
    }

    /// Largest distance between two points, meters; 0 without points.
    ///
    /// It is computed on first use. Cost: about O(n log n).
    #[must_use]
    pub fn diameter(&self) -> f64 {
        /// Private, so that no value of another crate has its key.
        struct Diameter(f64);
        let of_all = || {
            let points: Vec<_> = self.surfels.iter().map(|surfel| surfel.point).collect();
            Diameter(diameter(&points))
        };
        self.derived.get_or_build(0, of_all).0
    }

    /// Values derived from this cloud, such as search trees: built once, shared by all threads.
    #[must_use]
    pub fn derived(&self) -> &Derived {
        &self.derived
    }
}
