//! Traits of tuples.

/// Calls a macro with the members of every tuple that a trait is implemented for: one to eight.
#[doc(hidden)]
#[macro_export]
macro_rules! for_tuples {
    ($implement:ident) => {
        $implement!(A);
        $implement!(A, B);
        $implement!(A, B, C);
        $implement!(A, B, C, D);
        $implement!(A, B, C, D, E);
        $implement!(A, B, C, D, E, F);
        $implement!(A, B, C, D, E, F, G);
        $implement!(A, B, C, D, E, F, G, H);
    };
}
