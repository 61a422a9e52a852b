//! What a run folder claims, computed again by other means.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `sweep`, with `order` and `exact` | which edges meet where they should not: a plane sweep with exact predicates |
//!
//! **Architecture Invariant:** shares no algorithm with the crate that made the results, nor a line of its code: what
//! is found here is found from the written numbers, and from the formulas of the paper and of the documentation.

mod exact;
mod order;
mod sweep;

pub use sweep::{Meetings, meetings};
