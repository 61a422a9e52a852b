//! A traced structure → nodes of one rooted tree.
//!
//! **Input** [`Traced`], with any number of roots, edges without length, radii of 0. **Output** nodes with one root.
//! **Steps** 1. Several roots by policy: the tree of the greatest length is kept, the others dropped or joined to its
//! nearest node. 2. Edges without length collapse. 3. Radii of 0, which tracing programs write for "not measured",
//! become the mean of the nearest measured ones above and below, by policy.
//! **Guarantees** nodes keep their order but for those dropped or merged; every change is in the ledger.
//! **Cost** O(N), and O(roots · N) to join.

use espalier_model::swc::Traced;
use espalier_model::{Ledger, LedgerEntry, LedgerKind, Node};

use crate::Error;
use crate::merge::{merge_near, parents_first};
use crate::params::{MissingRadii, Params, Roots};

/// The nodes of one tree, and how many roots there were.
///
/// # Errors
/// [`Error::EmptyTrace`]; [`Error::Roots`] if there are several and the policy is to refuse them.
pub(crate) fn single_tree(
    traced: &Traced,
    params: &Params,
    ledger: &mut Ledger,
) -> Result<(Vec<Node>, usize), Error> {
    if traced.nodes.is_empty() {
        return Err(Error::EmptyTrace);
    }
    let nodes: Vec<Node> = traced
        .nodes
        .iter()
        .map(|n| Node { position_mm: n.position_mm, radius_mm: n.radius_mm, parent: n.parent, kind: n.kind })
        .collect();
    let roots: Vec<usize> = (0..nodes.len()).filter(|&node| nodes[node].parent.is_none()).collect();
    let nodes = match (roots.as_slice(), params.roots) {
        ([_] | [], _) => nodes,
        (&[first, second, ..], Roots::Refuse) => {
            return Err(Error::Roots {
                n_roots: roots.len(),
                first_id: traced.nodes[first].id,
                first_line: traced.nodes[first].line,
                second_id: traced.nodes[second].id,
                second_line: traced.nodes[second].line,
            });
        }
        (_, policy) => resolve_roots(traced, &nodes, policy, ledger),
    };
    let mut nodes = merge_near(&nodes, ledger);
    if params.missing_radii == MissingRadii::Neighbours {
        repair_radii(&mut nodes, ledger);
    }
    Ok((nodes, roots.len()))
}

/// Drops or joins all trees but the longest (of equals, the first in the file).
fn resolve_roots(traced: &Traced, nodes: &[Node], policy: Roots, ledger: &mut Ledger) -> Vec<Node> {
    let order = parents_first(nodes);
    let mut root_of = vec![usize::MAX; nodes.len()];
    let mut length_mm = vec![0.0; nodes.len()];
    for &node in &order {
        root_of[node] = nodes[node].parent.map_or(node, |parent| root_of[parent]);
        if let Some(parent) = nodes[node].parent {
            length_mm[root_of[node]] += nodes[node].position_mm.distance(nodes[parent].position_mm);
        }
    }
    let roots: Vec<usize> = (0..nodes.len()).filter(|&node| nodes[node].parent.is_none()).collect();
    let kept = roots
        .iter()
        .copied()
        .fold(roots[0], |best, root| if length_mm[root] > length_mm[best] { root } else { best });

    let mut joined = nodes.to_vec();
    for &root in roots.iter().filter(|&&root| root != kept) {
        let name = format!("root {} on line {}", traced.nodes[root].id, traced.nodes[root].line);
        let (length, reason) = if policy == Roots::Join {
            let distance = |node: usize| nodes[node].position_mm.distance(nodes[root].position_mm);
            let nearest = (0..nodes.len())
                .filter(|&node| root_of[node] == kept)
                .min_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)))
                .unwrap_or(kept);
            joined[root].parent = Some(nearest);
            let gap_mm = distance(nearest);
            let target = traced.nodes[nearest].id;
            (gap_mm, format!("{name}: joined to node {target} over a gap of {gap_mm:.4} mm"))
        } else {
            let dropped_mm = length_mm[root];
            let kept_mm = length_mm[kept];
            (
                dropped_mm,
                format!("{name}: dropped with {dropped_mm:.4} mm; the tree kept has {kept_mm:.4} mm"),
            )
        };
        ledger.0.push(LedgerEntry {
            kind: LedgerKind::RootResolved,
            position_mm: nodes[root].position_mm,
            radius_mm: nodes[root].radius_mm,
            length_mm: length,
            reason,
        });
    }
    if policy == Roots::Join {
        return joined;
    }

    let mut new_index = vec![usize::MAX; nodes.len()];
    let kept_nodes: Vec<usize> = (0..nodes.len()).filter(|&node| root_of[node] == kept).collect();
    for (new, &old) in kept_nodes.iter().enumerate() {
        new_index[old] = new;
    }
    let renumbered = |old: usize| Node { parent: nodes[old].parent.map(|p| new_index[p]), ..nodes[old] };
    kept_nodes.into_iter().map(renumbered).collect()
}

/// Gives nodes of radius 0 the mean of the nearest measured radii above and below them.
fn repair_radii(nodes: &mut [Node], ledger: &mut Ledger) {
    let order = parents_first(nodes);
    // The nearest measured radius towards the root, and the mean of the nearest ones of the children.
    let mut above: Vec<f64> = nodes.iter().map(|node| node.radius_mm).collect();
    for &node in &order {
        if let (true, Some(parent)) = (above[node] <= 0.0, nodes[node].parent) {
            above[node] = above[parent];
        }
    }
    let mut below: Vec<f64> = nodes.iter().map(|node| node.radius_mm).collect();
    let mut children_sum = vec![(0.0, 0_u32); nodes.len()];
    for &node in order.iter().rev() {
        let (sum, count) = children_sum[node];
        if below[node] <= 0.0 && count > 0 {
            below[node] = sum / f64::from(count);
        }
        if let (Some(parent), true) = (nodes[node].parent, below[node] > 0.0) {
            children_sum[parent].0 += below[node];
            children_sum[parent].1 += 1;
        }
    }
    for node in 0..nodes.len() {
        if nodes[node].radius_mm > 0.0 {
            continue;
        }
        let measured: Vec<f64> = [above[node], below[node]].into_iter().filter(|&r| r > 0.0).collect();
        if measured.is_empty() {
            continue;
        }
        let radius_mm = measured.iter().sum::<f64>() / measured.len() as f64;
        nodes[node].radius_mm = radius_mm;
        ledger.0.push(LedgerEntry {
            kind: LedgerKind::RadiusRepaired,
            position_mm: nodes[node].position_mm,
            radius_mm,
            length_mm: 0.0,
            reason: format!(
                "radius 0 replaced; nearest measured: {:.4} mm above, {:.4} mm below",
                above[node], below[node]
            ),
        });
    }
}
