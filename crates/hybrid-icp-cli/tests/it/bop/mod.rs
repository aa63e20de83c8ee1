//! Tests of `hybrid-icp bop`.

mod chain;
mod compare;
mod eval;
mod generate;
mod malformed;
mod masks;
mod refine;
mod scale;
mod sequence;
mod show;
mod track;
mod warnings;
