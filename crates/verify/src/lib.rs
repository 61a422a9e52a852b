//! What a run folder claims, computed again by other means.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `sweep`, with `order` and `exact` | which edges meet where they should not: a plane sweep with exact predicates |
//! | 2 | `targets` | whether targets are those of the tree and its views |
//! | 3 | `flat`, `ratios` | lengths and angles in the plane; the ratios they are of the targets |
//! | 4 | `weights`, `energy` | the energy by parts |
//! | 5 | `losses`, `form`, `clearance`, `distances`, `overlaps` | the losses; `boxes` finds what is near, `kinship` where two edges part |
//! | | `widths`, `pose` | what is said of the tubes, of how the picture lies and of the search |
//! | 6 | `layout` | every claim of an embedding beside what was found |
//! | 7 | `comparison` | the same for the layouts of all methods |
//! | 8 | `tables` | whether the tables say the same |
//!
//! **Architecture Invariant:** shares no algorithm with the crate that made the results, nor a line of its code: what
//! is found here is found from the written numbers, and from the formulas of the paper and of the documentation.

mod boxes;
mod check;
mod clearance;
mod comparison;
mod distances;
mod energy;
mod exact;
mod flat;
mod form;
mod kinship;
mod layout;
mod losses;
mod order;
mod overlaps;
mod pose;
mod ratios;
mod sweep;
mod tables;
mod targets;
mod weights;
mod widths;

pub use check::{Check, Outcome, Value};
pub use comparison::check_comparison;
pub use layout::{Claim, check_embedding};
pub use sweep::{Meetings, meetings};
pub use tables::{check_compare_table, check_header, check_nodes_table};
pub use weights::{Rule, Weights};
