//! The one energy by which every layout is scored, made by ratios or not.
//!
//! **Input** positions of all nodes, the number of their crossings. **Output** `Energy` by parts, r_l and r_a.
//! **Notation** l target length, l_e embedded length, h heading, H heading in the global view, p cost of a node's
//! placement. **Steps** 1. r_l = l_e / l − 1 and r_a by the inverse of equation 3. 2. Σ over segments of
//! w_l · mean r_l² + w_a · mean r_a² (Eq. 4, equal to the printed one where a segment has one ratio).
//! Beside it w_s · mean of how far a turn is on the other side of its target. 3. Placement: Σ p wrap(h + φ − H)², φ
//! the rotation for which Σ p cos(h + φ − H) is largest.
//! **Guarantees** a deviation that rounding to the quantum explains counts as none, so that a layout that meets
//! all targets has energy 0 after rounding too. No loss for the angles of the root's children.
//! **Source** [Hu2022] Eq. 4. **Differs from the source** the side and placement terms are ours.
//! **Cost** O(N).

use std::f64::consts::{FRAC_PI_2, PI};

use espalier_geom::angle::wrap;
use espalier_geom::math;
use espalier_model::Energy;
use glam::DVec2;

use crate::place;
use crate::problem::Problem;
use crate::ratio;

/// A layout's energy and the ratios behind it.
pub(crate) struct Scored {
    pub(crate) energy: Energy,
    pub(crate) length_ratio: Vec<f64>,
    pub(crate) angle_ratio: Vec<f64>,
}

/// Scores a layout whose coordinates are rounded to `quantum_mm`.
pub(crate) fn score(problem: &Problem, positions: &[DVec2], quantum_mm: f64, crossings: usize) -> Scored {
    let n_nodes = problem.n_nodes();
    let heading_rad = place::headings(problem, positions);
    let turn_rad = place::turns(problem, &heading_rad);
    // Both ends of an edge move by at most 0.71 quantum each.
    let slack_mm = 2.0 * quantum_mm;

    let (mut length_ratio, mut angle_ratio) = (vec![0.0; n_nodes], vec![0.0; n_nodes]);
    let mut energy = Energy { crossing: problem.crossing_weight * crossings as f64, ..Energy::default() };
    for node in 1..n_nodes {
        let parent = problem.parent[node] as usize;
        let target_mm = problem.targets.length_mm[node];
        let embedded_mm = positions[node].distance(positions[parent]);
        if (embedded_mm - target_mm).abs() > slack_mm {
            length_ratio[node] = embedded_mm / target_mm - 1.0;
        }
        energy.length += problem.length_cost[node] * length_ratio[node] * length_ratio[node];

        if parent != 0 {
            let target_turn = problem.side[node] * problem.bend[node];
            let slack_rad = slack_mm / embedded_mm + slack_mm / problem.targets.length_mm[parent];
            // `slack_rad` is infinite for an edge without length, whose angle is anyone's: straight on, as above.
            let is_explained = wrap(turn_rad[node] - target_turn).abs() <= slack_rad && embedded_mm > 0.0;
            if !is_explained {
                angle_ratio[node] = ratio::angle_ratio(problem.targets.angle_rad[node], turn_rad[node]);
            }
            energy.angle += problem.angle_cost[node] * angle_ratio[node] * angle_ratio[node];
            if !is_explained {
                energy.side += problem.side_cost[node] * switched(target_turn, turn_rad[node]);
            }
        }
    }
    energy.placement = placement(problem, &heading_rad);
    Scored { energy, length_ratio, angle_ratio }
}

/// How far a turn is on the other side of its target: 2/π · min(a, π − a, b, π − b) of the two bends a and b; 0 on
/// the same side, and for turns that are straight or folded back, which have no side.
fn switched(target_turn_rad: f64, turn_rad: f64) -> f64 {
    if target_turn_rad * turn_rad >= 0.0 {
        return 0.0;
    }
    let off = |turn: f64| turn.abs().min(PI - turn.abs());
    off(target_turn_rad).min(off(turn_rad)).max(0.0) / FRAC_PI_2
}

fn placement(problem: &Problem, heading_rad: &[f64]) -> f64 {
    let (mut cos_sum, mut sin_sum) = (0.0, 0.0);
    for (node, &heading_rad) in heading_rad.iter().enumerate().skip(1) {
        let (sin, cos) = math::sin_cos(heading_rad);
        cos_sum += problem.placement_cos[node] * cos + problem.placement_sin[node] * sin;
        sin_sum += problem.placement_sin[node] * cos - problem.placement_cos[node] * sin;
    }
    let rotation = math::atan2(sin_sum, cos_sum);
    (1..heading_rad.len())
        .map(|node| {
            let off = wrap(heading_rad[node] + rotation - problem.targets.heading_rad[node]);
            problem.placement_cost[node] * (off * off)
        })
        .sum()
}
