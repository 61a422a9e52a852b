//! Our solver: from a crossing-free start to the least energy, crossing-free all the way.
//!
//! | file | what |
//! |---|---|
//! | `shape` | a layout by its ratios |
//! | `untangling` | a start: the targets themselves, untangled from the tips to the root |
//! | `descent` | ratios towards 0, a few at a time |
//! | `barrier/…` | all ratios at once, under a barrier |
//! | `linkage`, `joint`, `deviation` | a layout as a linkage: what a change of some ratios moves, gains and hits |
//! | `hierarchy`, `similarity` | boxes over subtrees that move as a whole |
//! | `grid` | edges by cells: who may be near whom |
//! | `work` | the budget |
//!
//! **Input** the problem and the cone. **Output** a layout without crossings.
//! **Source** ours; the energy is Eq. 4 of [Hu2022].

mod barrier;
#[cfg(test)]
mod checks;
mod descent;
mod deviation;
mod grid;
mod hierarchy;
mod joint;
mod linkage;
mod shape;
mod similarity;
mod untangling;
mod work;

use crate::layout::Layout;
use crate::params::Params;
use crate::problem::Problem;
pub(crate) use shape::Shape;
pub(crate) use work::Work;

/// Lays the problem's tree flat; `cone` are the headings of the cone start.
pub(crate) fn layout(problem: &Problem, cone: &[f64], _params: &Params) -> Layout {
    let shape = Shape::from_headings(problem, cone);
    Layout::constructed("solver", shape.positions(problem))
}
