//! Names of components.

use hicp_core::Derived;
use hicp_core::internal::type_label;

mod inner {
    pub(super) struct Part<T>(#[allow(dead_code)] T);
}

#[test]
fn a_label_is_the_bare_name_of_the_type() {
    assert_eq!(type_label::<Derived>(), "Derived");
    assert_eq!(type_label::<inner::Part<u8>>(), "Part");
    assert_eq!(
        type_label::<inner::Part<Vec<inner::Part<Derived>>>>(),
        "Part"
    );
    assert_eq!(type_label::<f32>(), "f32");
    assert_eq!(type_label::<str>(), "str");
}
