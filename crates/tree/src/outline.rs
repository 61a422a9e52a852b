//! The pruned tree as lines between forks and tips, seen from the root.
//!
//! **Input** the tree of pieces and its root. **Output** [`Outline`]: hubs that are root, forks or tips, and lines
//! between them, a line after the line it hangs from.
//! **Order** depth first, lines of one fork in the order of their pieces, hence of the voxels.

use crate::graph::{Hub, Sample};
use crate::living::Living;

/// A line from one hub to another, away from the root.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    /// The hub nearer to the root.
    pub(crate) from: usize,
    /// The hub further out.
    pub(crate) to: usize,
    /// All samples, with those at both hubs.
    pub(crate) samples: Vec<Sample>,
}

/// Hubs and lines; hub 0 is the root.
#[derive(Clone, Debug)]
pub(crate) struct Outline {
    /// Root, forks and tips.
    pub(crate) hubs: Vec<Hub>,
    /// The lines; each hub but the root ends exactly one.
    pub(crate) lines: Vec<Line>,
}

impl Outline {
    /// The lines at each hub: the one that ends there first, then those that start there.
    pub(crate) fn incidence(&self) -> Vec<Vec<usize>> {
        let mut incident = vec![Vec::new(); self.hubs.len()];
        for (line_idx, line) in self.lines.iter().enumerate() {
            incident[line.to].push(line_idx);
        }
        for (line_idx, line) in self.lines.iter().enumerate() {
            incident[line.from].push(line_idx);
        }
        incident
    }
}

/// Walks the tree from its root.
pub(crate) fn trace(living: &Living<'_>, root: usize) -> Outline {
    let mut outline = Outline { hubs: vec![living.graph.hubs[root]], lines: Vec::new() };
    let mut stack: Vec<(usize, usize, usize)> = Vec::new();
    let push_all =
        |stack: &mut Vec<(usize, usize, usize)>, hub: usize, new_hub: usize, from: Option<usize>| {
            let mut pieces: Vec<usize> = living.pieces_at(hub).filter(|&piece| Some(piece) != from).collect();
            pieces.reverse();
            stack.extend(pieces.into_iter().map(|piece| (hub, new_hub, piece)));
        };
    push_all(&mut stack, root, 0, None);
    while let Some((hub, from, piece)) = stack.pop() {
        let (samples, end, last_piece) = living.branch_from(hub, piece);
        let to = outline.hubs.len();
        outline.hubs.push(living.graph.hubs[end]);
        outline.lines.push(Line { from, to, samples });
        push_all(&mut stack, end, to, Some(last_piece));
    }
    outline
}
