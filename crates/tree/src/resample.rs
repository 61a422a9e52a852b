//! How densely nodes stand on a branch.
//!
//! **Input** [`Tree`] with as many nodes as one likes. **Output** nodes of the same tree: root, forks and tips as they
//! were, and between them as many as `resample` asks for.
//! **Shape** Douglas–Peucker over position and radius: starting from the two ends of a branch, the sample that errs
//! most is kept while it errs more than `tolerance` × its radius; the error is the larger of the distance from the
//! straight edge and the deviation from the radius interpolated along it.
//! **Step** edges of equal length, as near to `step_mm` as the branch's length allows.
//! **Folds** A traced branch may come back on itself. Of one that ends where it began, the sample farthest from there is
//! kept if the others would leave nothing of it; nodes that come to lie at one place are merged, and the ledger says so.
//! **Source** [Douglas1973]. **Differs from the source** the tolerance follows the local radius, the radius is a
//! coordinate of its own, and long branches are first split every `MAX_STRETCH` samples, since the textbook method
//! takes quadratic time in the worst case.
//! **Cost** O(N · `MAX_STRETCH`) in the worst case, O(N log N) as a rule.

use espalier_geom::space::nearest_parameter;
use espalier_model::{Ledger, Node, Tree};
use glam::DVec3;

use crate::curve::{between, evenly_spaced};
use crate::graph::{Sample, polyline_length_mm};
use crate::merge::{merge_near, tolerance_mm};
use crate::params::{Params, Resample};

/// The longest stretch that is simplified in one go, in samples.
const MAX_STRETCH: usize = 4096;
/// Errors below this share of an edge's length are rounding.
const ROUNDING: f64 = 1e-9;
/// About the most edges a tree gets by `step_mm`, so that a tiny step cannot eat the memory.
const MAX_STEPS: f64 = 1e6;

/// The nodes of the resampled tree, parents first, with no edge so short that it has no direction.
pub(crate) fn resample(tree: &Tree, kind: Resample, params: &Params, ledger: &mut Ledger) -> Vec<Node> {
    if matches!(kind, Resample::None | Resample::Auto) {
        return tree.nodes().to_vec();
    }
    let least_mm = tolerance_mm(tree.nodes());
    let step_mm = params.step_mm.max(tree.length_mm() / MAX_STEPS);
    let mut nodes = vec![tree.nodes()[0]];
    let mut new_index = vec![0; tree.n_nodes()];
    for branch in tree.branches().list() {
        let old: Vec<Node> = branch.polyline().map(|node| tree.nodes()[node]).collect();
        let samples: Vec<Sample> =
            old.iter().map(|n| Sample { position_mm: n.position_mm, radius_mm: n.radius_mm }).collect();
        let kept: Vec<(Sample, i32)> = match kind {
            Resample::Step => {
                let end_kind = old[old.len() - 1].kind;
                step(&samples, step_mm).into_iter().map(|sample| (sample, end_kind)).collect()
            }
            _ => shape(&samples, params.tolerance).into_iter().map(|i| (samples[i], old[i].kind)).collect(),
        };
        let kept = unfolded(kept, &old, least_mm);
        let mut parent = new_index[branch.hub];
        for &(sample, kind) in &kept[1..] {
            nodes.push(Node {
                position_mm: sample.position_mm,
                radius_mm: sample.radius_mm,
                parent: Some(parent),
                kind,
            });
            parent = nodes.len() - 1;
        }
        new_index[branch.end()] = parent;
    }
    merge_near(&nodes, ledger)
}

fn step(samples: &[Sample], step_mm: f64) -> Vec<Sample> {
    let n_edges = (polyline_length_mm(samples) / step_mm).round().max(1.0) as usize;
    evenly_spaced(samples, n_edges)
}

/// What is kept of a branch or, if all of that lies where the branch begins, its ends and the place farthest from them.
fn unfolded(kept: Vec<(Sample, i32)>, old: &[Node], least_mm: f64) -> Vec<(Sample, i32)> {
    let (begin, end) = (kept[0], kept[kept.len() - 1]);
    let distance_mm = |position_mm: DVec3| position_mm.distance(begin.0.position_mm);
    if kept.iter().any(|(sample, _)| distance_mm(sample.position_mm) > least_mm) {
        return kept;
    }
    let farthest = old.iter().fold(old[0], |farthest, &node| {
        if distance_mm(node.position_mm) > distance_mm(farthest.position_mm) { node } else { farthest }
    });
    let turn = Sample { position_mm: farthest.position_mm, radius_mm: farthest.radius_mm };
    vec![begin, (turn, farthest.kind), end]
}

/// The indices of the samples that the shape needs, ascending, both ends among them.
fn shape(samples: &[Sample], tolerance: f64) -> Vec<usize> {
    let last = samples.len() - 1;
    let mut is_kept = vec![false; samples.len()];
    let mut stack = Vec::new();
    for first in (0..last).step_by(MAX_STRETCH) {
        let end = (first + MAX_STRETCH).min(last);
        is_kept[first] = true;
        is_kept[end] = true;
        stack.push((first, end));
    }
    while let Some((first, end)) = stack.pop() {
        // Errors as multiples of what is tolerated there; the first of equals.
        let mut worst = (1.0, None);
        for i in first + 1..end {
            let error = relative_error(samples[i], samples[first], samples[end], tolerance);
            if error > worst.0 {
                worst = (error, Some(i));
            }
        }
        if let Some(i) = worst.1 {
            is_kept[i] = true;
            stack.push((i, end));
            stack.push((first, i));
        }
    }
    (0..=last).filter(|&i| is_kept[i]).collect()
}

/// How far a sample is from the edge `a → b` in position and radius, over what is tolerated.
fn relative_error(sample: Sample, a: Sample, b: Sample, tolerance: f64) -> f64 {
    let on_edge = between(a, b, nearest_parameter(sample.position_mm, a.position_mm, b.position_mm));
    let off_mm = sample.position_mm.distance(on_edge.position_mm);
    let radius_off_mm = (sample.radius_mm - on_edge.radius_mm).abs();
    // Where there is no radius, rounding must not count as shape.
    let tolerated_mm = (tolerance * sample.radius_mm).max(ROUNDING * a.position_mm.distance(b.position_mm));
    off_mm.max(radius_off_mm) / tolerated_mm
}
