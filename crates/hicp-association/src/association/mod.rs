//! Associations: the observed point for each model point.

pub(crate) mod closest_point_on_mesh;
pub(crate) mod contour;
pub(crate) mod data_association;
pub(crate) mod from_observation;
pub(crate) mod k_nearest;
pub(crate) mod nearest_neighbor;
pub(crate) mod normal_compatible;
pub(crate) mod normal_shooting;
pub(crate) mod observation_to_model;
pub(crate) mod pixel_projection;
pub(crate) mod projective;
pub(crate) mod projective_interpolated;
pub(crate) mod projective_search;
pub(crate) mod reciprocal;
pub(crate) mod rendered_surface;

pub use closest_point_on_mesh::ClosestPointOnMesh;
pub use contour::Contour;
pub use data_association::DataAssociation;
pub use k_nearest::KNearest;
pub use nearest_neighbor::{NearestNeighbor, SearchIndex};
pub use normal_compatible::NormalCompatible;
pub use normal_shooting::NormalShooting;
pub use observation_to_model::ObservationToModel;
pub use projective::Projective;
pub use projective_interpolated::ProjectiveInterpolated;
pub use projective_search::ProjectiveSearch;
pub use reciprocal::Reciprocal;
pub use rendered_surface::RenderedSurface;
