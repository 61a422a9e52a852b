//! The tree in space beside its map, in the colours chosen there.
//!
//! **Input** tree and global view, the colourings. **Output** inline SVG: branches from far to near, each with its number,
//! so that the script lights it here when the pointer rests on it there, and the other way round.
//! **Guarantees** colours follow the map's menu without a script.

use espalier_model::Branches;
use glam::DVec2;
use maud::{Markup, PreEscaped, html};

use crate::facts::{Coloring, Facts};
use crate::layout::{Frame, bounds};
use crate::map::write_tube;
use crate::strokes::{self, Budget, Subject};

const BUDGET: Budget = Budget { pieces: 6_000, points: 40_000 };
/// Room around the tree.
const MARGIN: f64 = 0.03;

pub(crate) fn body(
    facts: &Facts<'_>,
    (branches, is_own): (&Branches, &[bool]),
    colorings: &[Coloring],
) -> Markup {
    let (tree, view) = (facts.tree, &facts.views.global);
    let seen = |node: usize| view.project(tree.position_mm(node) - view.center_mm);
    let positions_mm: Vec<DVec2> = (0..tree.n_nodes()).map(seen).collect();
    let discs = positions_mm.iter().zip(tree.nodes()).map(|(point, node)| (*point, node.radius_mm));
    let frame = Frame::with_margin(bounds(discs), MARGIN);
    let bins: Vec<&[u8]> = colorings.iter().map(|coloring| coloring.bins.as_slice()).collect();
    let subject =
        Subject { tree, branches, positions_mm: &positions_mm, frame: &frame, bins: &bins, has_widths: true };
    let mut pieces = strokes::pieces(&subject, BUDGET);
    pieces.retain(|piece| is_own[piece.branch]);
    let depth = |branch: usize| {
        let list = &branches.list()[branch];
        let at = |node: usize| tree.position_mm(node).dot(view.towards_camera);
        0.5 * (at(list.hub) + at(list.end()))
    };
    pieces.sort_by(|a, b| depth(a.branch).total_cmp(&depth(b.branch)).then(a.branch.cmp(&b.branch)));
    let mut out = String::new();
    pieces.iter().for_each(|piece| write_tube(&mut out, piece));
    html! {
        div.canvas.space {
            svg #space-svg viewBox=(frame.view_box()) role="img" aria-label="the tree in space, from its global view" {
                use.rim href="#space-tubes" {}
                g #space-tubes.tubes { (PreEscaped(out)) }
            }
        }
        p.note { "Above: the same tree in space, from its global view, in the same colours." }
    }
}
