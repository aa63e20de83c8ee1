//! The choice by color among poses that depth cannot tell apart.

pub(crate) mod choice;
pub(crate) mod tried;
