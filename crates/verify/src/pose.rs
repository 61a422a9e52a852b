//! How the picture lies, and how the search for it went.
//!
//! **Input** the embedding. **Output** checks of its pose and of its convergence curve.
//! **Notation** h drawn headings, H those of the global view, w = confidence × length; A = Σ w e^{i(H − h)}, and A' the
//! same for the mirror image, whose headings are π − h: |A| tells how well the picture agrees with the view at its
//! best rotation.
//! **Steps** 1. The root lies at the origin. 2. The picture has the handedness that agrees better, by more than 1e-9 of
//! all weights where it was reflected. 3. It lies as the view has it (A has no imaginary part and is positive), or
//! hangs from its root (the centroid of its length is straight below). 4. The curve's iterations rise, its
//! evaluations do not fall and its energies do not rise.

use espalier_geom::math;
use espalier_model::{Embedding, TracePoint, Tree, WidthMode};
use glam::DVec2;

use crate::check::Check;

/// A share of the weights, of the length: what rounding can do.
const ROUNDING: f64 = 1e-9;
/// Radians by which the rounding of coordinates may have turned the whole.
const TURNED_RAD: f64 = 1e-6;

/// Checks the pose.
pub(crate) fn check_pose(tree: &Tree, embedding: &Embedding) -> Vec<Check> {
    let positions = &embedding.positions_mm;
    let at_origin = (positions[0] != DVec2::ZERO).then(|| format!("the root lies at {}", positions[0]));
    let turned = format!("{:.3}°", embedding.pose.rotation_rad.to_degrees());
    let turned = Check::untested("pose: rotation", turned, "the layout before it is not in the files");
    let stated = if embedding.pose.is_reflected { "reflected" } else { "not reflected" };
    let root = Check::unless("pose: root", "at the origin", at_origin);
    // What was edited lies as the layout lay of which it was made.
    if !embedding.edits.is_empty() || embedding.widths.mode != WidthMode::Report {
        return vec![root, turned, Check::untested("pose", stated, "taken over from the layout before")];
    }
    let seen = Seen::new(tree, embedding);
    let hangs = hangs(tree, positions);
    let lies = seen.lies_as_seen() || hangs;
    vec![
        root,
        turned,
        Check::unless("pose: side", stated, seen.wrong_side(embedding.pose.is_reflected)),
        Check::unless("pose", "upright", (!lies).then(|| "neither as the view nor from its root".to_owned())),
    ]
}

/// Checks the convergence curve.
pub(crate) fn check_trace(embedding: &Embedding) -> Check {
    Check::unless("trace", format!("{} points", embedding.trace.len()), fault_of_trace(&embedding.trace))
}

/// What is wrong with a convergence curve: iterations and work go up, the energy never does.
pub(crate) fn fault_of_trace(trace: &[TracePoint]) -> Option<String> {
    let worse = |pair: &[TracePoint]| {
        let (a, b) = (pair[0], pair[1]);
        let rises = b.energy > a.energy + ROUNDING * a.energy.abs();
        b.iteration <= a.iteration || b.evaluations < a.evaluations || rises
    };
    let broken = trace.windows(2).position(worse);
    broken.map(|idx| format!("points {idx} and {} are in no order", idx + 1))
}

/// A and A', and all weights.
struct Seen {
    drawn: DVec2,
    mirrored: DVec2,
    weight: f64,
}

impl Seen {
    fn new(tree: &Tree, embedding: &Embedding) -> Self {
        let targets = &embedding.targets;
        let mut seen = Self { drawn: DVec2::ZERO, mirrored: DVec2::ZERO, weight: 0.0 };
        for (node, parent) in tree.edges() {
            let edge = embedding.positions_mm[node] - embedding.positions_mm[parent];
            let Some(direction) = edge.try_normalize() else { continue };
            let weight = targets.confidence[node] * targets.length_mm[node];
            let (sin, cos) = math::sin_cos(targets.heading_rad[node]);
            let target = DVec2::new(cos, sin);
            // e^{i(H − h)} is the target turned back by the direction.
            let turned_back = |d: DVec2| DVec2::new(d.x, -d.y).rotate(target);
            seen.drawn += weight * turned_back(direction);
            seen.mirrored += weight * turned_back(DVec2::new(-direction.x, direction.y));
            seen.weight += weight;
        }
        seen
    }

    fn wrong_side(&self, is_reflected: bool) -> Option<String> {
        let (own, other) = (self.drawn.length(), self.mirrored.length());
        // Twice what the rule allows: the rounding of coordinates comes on top.
        let is_wrong = if is_reflected { other > own } else { other > own + 2.0 * ROUNDING * self.weight };
        is_wrong.then(|| format!("its mirror image agrees with the view by {other:.9}, it by {own:.9}"))
    }

    fn lies_as_seen(&self) -> bool {
        let has_direction = self.drawn.length() > 2.0 * ROUNDING * self.weight;
        !has_direction || (self.drawn.x > 0.0 && self.drawn.y.abs() <= TURNED_RAD * self.drawn.length())
    }
}

/// Whether the centroid of the length lies straight below the root.
fn hangs(tree: &Tree, positions: &[DVec2]) -> bool {
    let (mut moment, mut total) = (DVec2::ZERO, 0.0);
    for (node, parent) in tree.edges() {
        let length = positions[node].distance(positions[parent]);
        moment += 0.5 * length * (positions[node] + positions[parent]);
        total += length;
    }
    let has_direction = moment.length() > 2.0 * ROUNDING * total * total;
    has_direction && moment.y < 0.0 && moment.x.abs() <= TURNED_RAD * moment.length()
}
