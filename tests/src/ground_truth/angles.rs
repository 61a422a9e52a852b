//! Angles between the arms of a fork.

use espalier_geom::math;
use espalier_model::Tree;
use glam::DVec3;

use super::{Score, matched};

/// The length of the chord that gives an arm's direction, in its radii.
const CHORD: f64 = 4.0;

/// The polyline of an arm, from the fork outwards.
type Arm = Vec<DVec3>;

pub(crate) fn compare(truth: &Tree, found: &Tree, tolerance_mm: f64, score: &mut Score) {
    let (true_forks, found_forks) = (forks(truth), forks(found));
    let pairs = matched((truth, &true_forks), (found, &found_forks), tolerance_mm);
    score.n_forks = [true_forks.len(), pairs.len()];
    let mut errors: Vec<f64> = pairs.iter().flat_map(|&(t, f)| errors_deg((truth, t), (found, f))).collect();
    errors.sort_by(f64::total_cmp);
    if !errors.is_empty() {
        score.angle_error_mean_deg = errors.iter().sum::<f64>() / errors.len() as f64;
        score.angle_error_p95_deg = errors[(errors.len() - 1) * 95 / 100];
    }
}

fn forks(tree: &Tree) -> Vec<usize> {
    (1..tree.n_nodes()).filter(|&node| tree.children(node).len() > 1).collect()
}

/// The errors of the angles between every two arms.
fn errors_deg((truth, true_fork): (&Tree, usize), (found, found_fork): (&Tree, usize)) -> Vec<f64> {
    let near_mm = truth.nodes()[true_fork].radius_mm;
    let mut free = arms(found, found_fork);
    let mut directions: Vec<(DVec3, DVec3)> = Vec::new();
    for (arm, radius_mm) in arms(truth, true_fork) {
        let range_mm = [near_mm, near_mm + CHORD * radius_mm];
        let true_direction = direction(&arm, range_mm);
        let dot = |arm: &Arm| direction(arm, range_mm).dot(true_direction);
        let best = (0..free.len()).max_by(|&a, &b| dot(&free[a].0).total_cmp(&dot(&free[b].0)));
        if let Some(best) = best {
            directions.push((true_direction, direction(&free.swap_remove(best).0, range_mm)));
        }
    }
    let angle_deg = |a: DVec3, b: DVec3| math::acos(a.dot(b).clamp(-1.0, 1.0)).to_degrees();
    let mut errors = Vec::new();
    for (i, a) in directions.iter().enumerate() {
        for b in &directions[..i] {
            errors.push((angle_deg(a.0, b.0) - angle_deg(a.1, b.1)).abs());
        }
    }
    errors
}

/// The branches at a fork with their mean radius, outwards.
fn arms(tree: &Tree, fork: usize) -> Vec<(Arm, f64)> {
    let branches = tree.branches();
    let mut arms = Vec::new();
    for branch in branches.list() {
        let nodes: Vec<usize> = branch.polyline().collect();
        let mut arm: Arm = nodes.iter().map(|&node| tree.position_mm(node)).collect();
        if branch.end() == fork {
            arm.reverse();
        } else if branch.hub != fork {
            continue;
        }
        let radius_mm =
            nodes.iter().map(|&node| tree.nodes()[node].radius_mm).sum::<f64>() / nodes.len() as f64;
        arms.push((arm, radius_mm));
    }
    arms
}

/// The chord of an arm between two arc lengths; of a shorter arm, from its first third to its end.
fn direction(arm: &Arm, [from_mm, to_mm]: [f64; 2]) -> DVec3 {
    let length_mm: f64 = arm.windows(2).map(|edge| edge[0].distance(edge[1])).sum();
    let to_mm = to_mm.min(length_mm);
    (point_at(arm, to_mm) - point_at(arm, from_mm.min(length_mm / 3.0))).normalize_or_zero()
}

fn point_at(arm: &Arm, mut left_mm: f64) -> DVec3 {
    for edge in arm.windows(2) {
        let length_mm = edge[0].distance(edge[1]);
        if left_mm <= length_mm {
            return edge[0].lerp(edge[1], left_mm / length_mm.max(f64::MIN_POSITIVE));
        }
        left_mm -= length_mm;
    }
    arm[arm.len() - 1]
}
