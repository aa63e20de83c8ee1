//! Names of components for traces.

/// Returns the name of a type without path and type parameters: a component's default name.
///
/// ```
/// struct MyAssociation<T>(T);
/// assert_eq!(hicp_core::internal::type_label::<MyAssociation<Vec<u8>>>(), "MyAssociation");
/// ```
#[must_use]
pub fn type_label<T: ?Sized>() -> &'static str {
    let full = std::any::type_name::<T>();
    let bare = full.split('<').next().unwrap_or(full);
    bare.rsplit("::").next().unwrap_or(bare)
}
