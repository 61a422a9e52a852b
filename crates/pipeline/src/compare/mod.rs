//! Methods, or runs, side by side.

pub(crate) mod figure;
